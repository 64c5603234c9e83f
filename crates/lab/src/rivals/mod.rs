//! What model following is held against: the best published alternatives, on the same cranes, each knowing the paper's crane only.
//!
//! They are here to be compared, not to be used on a machine: the strategies that are offered are those of
//! [`Strategy`].

mod box_program;
mod linear_crane;
mod lqg;
mod mpc;
mod observer;
mod reoptimised;
mod riccati;

pub use lqg::{LQG, Weights};
pub use mpc::MPC;
pub use reoptimised::{Gains, REOPTIMISED};

use crate::LabError;
use hydroboom_control::feedback::benchmark::Measured;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::signals::Reading;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use serde::{Serialize, Serializer};

/// A controller that is only compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rival {
    /// The benchmark controller, its four numbers found anew on virtual cranes.
    ReoptimisedBenchmark(Gains),
    /// Linear-quadratic state feedback on an observer's state of the machine.
    Lqg(Weights),
    /// Linear model-predictive control on the same observer; it sees the reference half a second ahead, and the motor's limits.
    Mpc(Weights),
}

impl Rival {
    /// All of them, with the numbers that were found for each.
    pub const ALL: [Self; 3] =
        [Self::ReoptimisedBenchmark(REOPTIMISED), Self::Lqg(LQG), Self::Mpc(MPC)];

    /// Name in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::ReoptimisedBenchmark(_) => "reoptimised-benchmark",
            Self::Lqg(_) => "lqg",
            Self::Mpc(_) => "linear-mpc",
        }
    }
}

/// Who steers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Contender {
    /// A strategy that is offered.
    Strategy(Strategy),
    /// One that is only compared with.
    Rival(Rival),
}

impl Contender {
    /// All strategies, in their order.
    pub fn strategies() -> Vec<Self> {
        Strategy::ALL.map(Self::Strategy).to_vec()
    }

    /// All strategies, then all rivals.
    pub fn all() -> Vec<Self> {
        let mut all = Self::strategies();
        all.extend(Rival::ALL.map(Self::Rival));
        all
    }

    /// Name in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Strategy(strategy) => strategy.name(),
            Self::Rival(rival) => rival.name(),
        }
    }
}

impl From<Strategy> for Contender {
    fn from(strategy: Strategy) -> Self {
        Self::Strategy(strategy)
    }
}

impl Serialize for Contender {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.name())
    }
}

/// What a rival is shown in a period.
pub(crate) struct Shown<'a> {
    /// Where the piston should be.
    pub reference: SetPoint<f64>,
    /// Where it should be so long after now \[s\].
    pub ahead: &'a dyn Fn(f64) -> SetPoint<f64>,
    /// Its largest speed \[m/s\].
    pub speed: f64,
    /// What is read of the machine.
    pub reading: Reading<f64>,
    /// Position and load pressure of that.
    pub measured: Measured<f64>,
}

/// A rival at work.
pub(crate) trait Steers {
    /// Motor speed \[rev/s\] for the coming period.
    fn speed(&mut self, shown: &Shown<'_>) -> f64;
}

/// A rival at rest beside a machine, of which the model and what it measures are known.
pub(crate) fn rival(
    which: Rival,
    model: &Description,
    measured: &Measured<f64>,
) -> Result<Box<dyn Steers>, LabError> {
    Ok(match which {
        Rival::ReoptimisedBenchmark(gains) => {
            Box::new(reoptimised::Reoptimised::new(model, &gains, measured))
        }
        Rival::Lqg(weights) => Box::new(lqg::Lqg::new(model, &weights, measured)?),
        Rival::Mpc(weights) => Box::new(mpc::Mpc::new(model, &weights, measured)?),
    })
}
