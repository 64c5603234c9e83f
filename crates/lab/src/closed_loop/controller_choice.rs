//! Which controller closes the loop: a strategy that is offered, or a baseline.

use crate::baselines::Baseline;
use hydroboom_control::strategy::Strategy;
use serde::{Serialize, Serializer};

/// A controller, by its name and its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ControllerChoice {
    /// A strategy that is offered.
    Strategy(Strategy),
    /// A baseline, that is only compared with.
    Baseline(Baseline),
}

impl ControllerChoice {
    /// All strategies, in their order.
    pub fn strategies() -> Vec<Self> {
        Strategy::ALL.map(Self::Strategy).to_vec()
    }

    /// All strategies, then all baselines.
    pub fn all() -> Vec<Self> {
        let mut all = Self::strategies();
        all.extend(Baseline::ALL.map(Self::Baseline));
        all
    }

    /// Name in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Strategy(strategy) => strategy.name(),
            Self::Baseline(baseline) => baseline.name(),
        }
    }
}

impl From<Strategy> for ControllerChoice {
    fn from(strategy: Strategy) -> Self {
        Self::Strategy(strategy)
    }
}

impl Serialize for ControllerChoice {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.name())
    }
}
