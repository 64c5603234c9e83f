//! What parameters may have an effect on.

use hydroboom_control::strategy::Strategy;

/// What parameters may have an effect on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// RMS tracking error of a strategy.
    Tracking(Strategy),
    /// Swing of p_A under a strategy: its RMS about its own mean.
    Pressure(Strategy),
    /// Frequency at which the boom rings with the load held.
    Eigenfrequency,
}

impl Output {
    /// Those of the published strategies and the eigenfrequency: all that can be differentiated.
    pub const ALL: [Self; 9] = [
        Self::Tracking(Strategy::ALL[0]),
        Self::Tracking(Strategy::ALL[1]),
        Self::Tracking(Strategy::ALL[2]),
        Self::Tracking(Strategy::ALL[3]),
        Self::Pressure(Strategy::ALL[0]),
        Self::Pressure(Strategy::ALL[1]),
        Self::Pressure(Strategy::ALL[2]),
        Self::Pressure(Strategy::ALL[3]),
        Self::Eigenfrequency,
    ];

    /// Name in commands, tables and JSON.
    pub fn name(self) -> String {
        match self {
            Self::Tracking(strategy) => format!("tracking-{}", strategy.name()),
            Self::Pressure(strategy) => format!("pressure-{}", strategy.name()),
            Self::Eigenfrequency => "eigenfrequency".into(),
        }
    }

    /// Those of the scheduled LQR, whose estimator is not written over dual numbers: the machine can be re-run, and has no slopes.
    pub const OF_SCHEDULED_LQR: [Self; 2] =
        [Self::Tracking(Strategy::ScheduledLqr), Self::Pressure(Strategy::ScheduledLqr)];

    /// Whether it can be differentiated.
    pub fn has_slopes(self) -> bool {
        Self::ALL.contains(&self)
    }

    /// The output of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().chain(Self::OF_SCHEDULED_LQR).find(|output| output.name() == name)
    }

    /// What it is, for people.
    pub fn title(self) -> String {
        match self {
            Self::Tracking(strategy) => format!("RMS true tracking error, {}", strategy.name()),
            Self::Pressure(strategy) => format!("swing of p_A (RMS), {}", strategy.name()),
            Self::Eigenfrequency => "eigenfrequency with the load held".into(),
        }
    }

    /// The unit it is shown in, and its size in SI units.
    pub fn unit(self) -> (&'static str, f64) {
        match self {
            Self::Tracking(_) => ("mm", 1e-3),
            Self::Pressure(_) => ("bar", 1e5),
            Self::Eigenfrequency => ("Hz", 1.0),
        }
    }
}
