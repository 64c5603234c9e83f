//! Commands of a predictive controller over its horizon, and what is commanded where a control period brings no new ones.
//!
//! Then the last plan goes on, moved on by a period, as a warm start would have it: what was feasible a period ago is so still but for what was measured since. Before the first plan
//! the motor stands.
//!
//! Source: J. B. Rawlings, D. Q. Mayne, M. M. Diehl, *Model Predictive Control: Theory, Computation, and Design*, second edition, 2017, section 2.7 (suboptimal model-predictive
//! control).

use super::horizon::{BLOCKS, advanced};

/// The last plan, and how many periods have brought none.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct CommandPlan {
    /// Commands of the blocks \[rev/s\]; none before the first.
    commands: Option<[f64; BLOCKS]>,
    without_solution: u64,
}

impl CommandPlan {
    /// The last plan a period on; none before the first.
    pub(super) fn next(&self) -> Option<[f64; BLOCKS]> {
        self.commands.as_ref().map(advanced)
    }

    /// The command \[rev/s\] of a period with what it brought: the new plan's first one, else that of the last plan moved on, else none at all, zero.
    pub(super) fn command(&mut self, found: Option<[f64; BLOCKS]>) -> f64 {
        self.without_solution += u64::from(found.is_none());
        self.commands = found.or_else(|| self.next());
        self.commands.map_or(0.0, |commands| commands[0])
    }

    /// Periods since the start that brought no plan.
    pub(super) fn without_solution(&self) -> u64 {
        self.without_solution
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Single periods at the horizon's beginning: what was planned for the next ones is commanded in them.
    #[test]
    fn a_period_without_a_plan_takes_the_next_command_of_the_last() {
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
