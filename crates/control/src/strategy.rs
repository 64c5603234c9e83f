//! Control strategies that are compared.

use core::error::Error;
use core::fmt;
use core::str::FromStr;

/// Control strategy: how the commanded motor speed is determined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategy {
    /// Velocity feedforward u_FF (1) alone, without feedback (test 1).
    VelocityFeedforward,
    /// Motor speed of the benchmark controller on the simulated crane, without feedback (tests 1 and 2).
    SimulationFeedforwardOpenLoop,
    /// Benchmark controller: velocity feedforward, PI and pressure feedback (tests 2 and 3).
    BenchmarkClosedLoop,
    /// Benchmark controller with the simulated crane's motor speed as feedforward, in place of u_FF (test 3).
    SimulationFeedforwardClosedLoop,
    /// Gain-scheduled linear-quadratic regulator around the inverse dynamics of the reference, on a Kalman filter's
    /// estimates (ours).
    ScheduledLqr,
}

impl Strategy {
    /// All strategies: the published ones in the paper's order, then ours.
    pub const ALL: [Self; 5] = [
        Self::VelocityFeedforward,
        Self::SimulationFeedforwardOpenLoop,
        Self::BenchmarkClosedLoop,
        Self::SimulationFeedforwardClosedLoop,
        Self::ScheduledLqr,
    ];

    /// Name in commands, tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::VelocityFeedforward => "velocity-feedforward",
            Self::SimulationFeedforwardOpenLoop => "simulation-feedforward-open-loop",
            Self::BenchmarkClosedLoop => "benchmark-closed-loop",
            Self::SimulationFeedforwardClosedLoop => "simulation-feedforward-closed-loop",
            Self::ScheduledLqr => "scheduled-lqr",
        }
    }

    /// Whether a crane is simulated in parallel to the machine.
    pub fn simulates(self) -> bool {
        !matches!(self, Self::VelocityFeedforward | Self::BenchmarkClosedLoop | Self::ScheduledLqr)
    }

    /// Whether the command depends on measurements: closed loop.
    pub fn measures(self) -> bool {
        !matches!(self, Self::VelocityFeedforward | Self::SimulationFeedforwardOpenLoop)
    }

    /// Whether it is the scheduled LQR, which uses state estimates.
    pub fn estimates(self) -> bool {
        self == Self::ScheduledLqr
    }
}

/// Reason why a name is not that of a strategy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoStrategy {
    /// Unknown name.
    Unknown,
    /// Former name `model-following`, of an earlier version.
    Replaced,
}

impl fmt::Display for NoStrategy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Replaced => f.write_str("model-following was replaced by scheduled-lqr"),
            Self::Unknown => {
                f.write_str("no such strategy; there are")?;
                let mut names = Strategy::ALL.into_iter().map(Strategy::name);
                names.try_for_each(|name| write!(f, " {name}"))
            }
        }
    }
}

impl Error for NoStrategy {}

impl FromStr for Strategy {
    type Err = NoStrategy;

    /// Strategy with this [`name`](Strategy::name), in exactly this spelling.
    ///
    /// # Errors
    /// [`NoStrategy::Replaced`] for the former name `model-following`, [`NoStrategy::Unknown`] for any other.
    fn from_str(name: &str) -> Result<Self, NoStrategy> {
        let found = Self::ALL.into_iter().find(|strategy| strategy.name() == name);
        found.ok_or(match name {
            "model-following" => NoStrategy::Replaced,
            _ => NoStrategy::Unknown,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strategy_names_are_parsed_and_replaced_ones_are_refused() {
        for strategy in Strategy::ALL {
            assert_eq!(strategy.name().parse(), Ok(strategy));
        }
        assert_eq!("model-following".parse::<Strategy>(), Err(NoStrategy::Replaced));
        assert_eq!("lqr".parse::<Strategy>(), Err(NoStrategy::Unknown));
    }
}
