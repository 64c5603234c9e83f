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
    /// State feedback makes the simulated crane follow the reference, an observer and feedback of what differs the machine the
    /// simulated crane (ours).
    ModelFollowing,
    /// Gain-scheduled linear-quadratic regulator around the inverse dynamics of the reference, on a Kalman filter's estimates (ours).
    ScheduledLqr,
}

impl Strategy {
    /// All strategies: the published ones in the paper's order, then ours.
    pub const ALL: [Self; 6] = [
        Self::VelocityFeedforward,
        Self::SimulationFeedforwardOpenLoop,
        Self::BenchmarkClosedLoop,
        Self::SimulationFeedforwardClosedLoop,
        Self::ModelFollowing,
        Self::ScheduledLqr,
    ];

    /// Name in commands, tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::VelocityFeedforward => "velocity-feedforward",
            Self::SimulationFeedforwardOpenLoop => "simulation-feedforward-open-loop",
            Self::BenchmarkClosedLoop => "benchmark-closed-loop",
            Self::SimulationFeedforwardClosedLoop => "simulation-feedforward-closed-loop",
            Self::ModelFollowing => "model-following",
            Self::ScheduledLqr => "scheduled-lqr",
        }
    }

    /// The strategy of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|strategy| strategy.name() == name)
    }

    /// Whether a simulation runs beside the machine.
    pub fn simulates(self) -> bool {
        !matches!(self, Self::VelocityFeedforward | Self::BenchmarkClosedLoop | Self::ScheduledLqr)
    }

    /// Whether it looks at the machine.
    pub fn measures(self) -> bool {
        !matches!(self, Self::VelocityFeedforward | Self::SimulationFeedforwardOpenLoop)
    }

    /// Whether it is the scheduled LQR, on estimates of its own.
    pub fn estimates(self) -> bool {
        self == Self::ScheduledLqr
    }

    /// Whether feedback sees the machine's difference from the simulation, and not from the reference.
    pub fn follows(self) -> bool {
        self == Self::ModelFollowing
    }
}
