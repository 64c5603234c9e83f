//! Planned commands of a predictive controller over its horizon, and the command in a control period
//! without a solution.
//!
//! Without a solution the last plan is shifted by one period, as in a warm start. A plan that was feasible
//! one period ago is still feasible except for the newest measurement. Before the first plan the command is
//! zero.
//!
//! Source: J. B. Rawlings, D. Q. Mayne, M. M. Diehl, *Model Predictive Control: Theory, Computation, and
//! Design*, second edition, 2017, section 2.7 (suboptimal model-predictive control).

use super::horizon::{BLOCKS, advanced};

/// Last plan, and the number of periods without a solution.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct CommandPlan {
    /// Commands of the blocks \[rev/s\]; none before the first plan.
    commands: Option<[f64; BLOCKS]>,
    without_solution: u64,
}

impl CommandPlan {
    /// Last plan shifted by one period; none before the first plan.
    pub(super) fn next(&self) -> Option<[f64; BLOCKS]> {
        self.commands.as_ref().map(advanced)
    }

    /// Command of a period \[rev/s\]: the first of the new plan, else that of the shifted last plan, else
    /// zero.
    pub(super) fn command(&mut self, found: Option<[f64; BLOCKS]>) -> f64 {
        self.without_solution += u64::from(found.is_none());
        self.commands = found.or_else(|| self.next());
        self.commands.map_or(0.0, |commands| commands[0])
    }

    /// Number of periods without a solution since the start.
    pub(super) fn without_solution(&self) -> u64 {
        self.without_solution
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With single-period blocks at the start of the horizon, the shifted plan yields the commands planned
    /// for the next periods.
    #[test]
    fn a_period_without_a_plan_uses_the_next_command_of_the_last_plan() {
        let mut plan = CommandPlan::default();
        assert_eq!((plan.command(None), plan.without_solution()), (0.0, 1));
        let commands = std::array::from_fn(|k| 10.0 + k as f64);
        assert_eq!(plan.command(Some(commands)), 10.0);
        assert_eq!([plan.command(None), plan.command(None)], [11.0, 12.0]);
        assert_eq!(plan.without_solution(), 3);
        assert_eq!(plan.command(Some([5.0; BLOCKS])), 5.0);
        assert_eq!(plan.without_solution(), 3);
    }
}
