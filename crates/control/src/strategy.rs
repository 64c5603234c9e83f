//! The compared ways to find the motor's speed.

/// How the motor's speed is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategy {
    /// u_FF alone, without any feedback (test 1).
    VelocityFeedforward,
    /// The speed that the benchmark controller gives the simulated crane (tests 1 and 2).
    SimulationFeedforwardOpenLoop,
    /// The benchmark controller (tests 2 and 3).
    BenchmarkClosedLoop,
    /// The benchmark controller with the simulation's speed in the place of u_FF (test 3).
    SimulationFeedforwardClosedLoop,
}

impl Strategy {
    /// All strategies, in the paper's order.
    pub const ALL: [Self; 4] = [
        Self::VelocityFeedforward,
        Self::SimulationFeedforwardOpenLoop,
        Self::BenchmarkClosedLoop,
        Self::SimulationFeedforwardClosedLoop,
    ];

    /// Name in commands, tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::VelocityFeedforward => "velocity-feedforward",
            Self::SimulationFeedforwardOpenLoop => "simulation-feedforward-open-loop",
            Self::BenchmarkClosedLoop => "benchmark-closed-loop",
            Self::SimulationFeedforwardClosedLoop => "simulation-feedforward-closed-loop",
        }
    }

    /// The strategy of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|strategy| strategy.name() == name)
    }

    /// Whether a simulation runs beside the machine.
    pub fn simulates(self) -> bool {
        matches!(self, Self::SimulationFeedforwardOpenLoop | Self::SimulationFeedforwardClosedLoop)
    }

    /// Whether it looks at the machine.
    pub fn measures(self) -> bool {
        matches!(self, Self::BenchmarkClosedLoop | Self::SimulationFeedforwardClosedLoop)
    }
}
