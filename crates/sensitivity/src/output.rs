//! Outputs of a sensitivity study.

use hydroboom_control::strategy::Strategy;

/// Scalar result of a simulated motion or oscillation, differentiable by the parameters except for the scheduled LQR.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// RMS tracking error under a strategy \[m\].
    Tracking(Strategy),
    /// Standard deviation of p_A under a strategy \[Pa\].
    Pressure(Strategy),
    /// Eigenfrequency of boom and oil with the cylinder locked at mid-stroke \[Hz\].
    Eigenfrequency,
}

impl Output {
    /// Outputs with derivatives: tracking error and pressure under the four published strategies, and the
    /// eigenfrequency.
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

    /// Name in commands, tables and JSON, as `tracking-benchmark` or `eigenfrequency`.
    pub fn name(self) -> String {
        match self {
            Self::Tracking(strategy) => format!("tracking-{}", strategy.name()),
            Self::Pressure(strategy) => format!("pressure-{}", strategy.name()),
            Self::Eigenfrequency => "eigenfrequency".into(),
        }
    }

    /// Outputs of the scheduled LQR, whose estimator does not support dual numbers: re-runs only, no derivatives.
    pub const OF_SCHEDULED_LQR: [Self; 2] =
        [Self::Tracking(Strategy::ScheduledLqr), Self::Pressure(Strategy::ScheduledLqr)];

    /// Whether the output has derivatives: all but those of the scheduled LQR.
    pub fn has_slopes(self) -> bool {
        Self::ALL.contains(&self)
    }

    /// Output of a name as written by [`name`](Self::name); none if there is no such output.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().chain(Self::OF_SCHEDULED_LQR).find(|output| output.name() == name)
    }

    /// Heading in tables and figures, without the unit.
    pub fn title(self) -> String {
        match self {
            Self::Tracking(strategy) => format!("RMS true tracking error, {}", strategy.name()),
            Self::Pressure(strategy) => format!("swing of p_A (RMS), {}", strategy.name()),
            Self::Eigenfrequency => "eigenfrequency with the load held at mid-stroke".into(),
        }
    }

    /// Display unit, and its size in SI units: mm and 1e-3, bar and 1e5, Hz and 1.
    pub fn unit(self) -> (&'static str, f64) {
        match self {
            Self::Tracking(_) => ("mm", 1e-3),
            Self::Pressure(_) => ("bar", 1e5),
            Self::Eigenfrequency => ("Hz", 1.0),
        }
    }
}
