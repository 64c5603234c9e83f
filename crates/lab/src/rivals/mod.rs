//! What model following is held against: the best published alternatives, on the same cranes, each knowing the paper's crane only.
//!
//! They are here to be compared, not to be used on a machine: the strategies that are offered are those of
//! [`Strategy`].

mod box_program;
mod following_lqg;
mod linear_crane;
mod lqg;
mod mpc;
mod observer;
mod reoptimised;
mod riccati;

pub use following_lqg::FOLLOWING_LQG;
pub use lqg::{LQG, Weights};
pub use mpc::MPC;
pub use reoptimised::{Gains, REOPTIMISED};

use crate::LabError;
use hydroboom_control::{Measured, Reading, Reference, Strategy};
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
    /// Model following, with LQG in the place of PI and pressure feedback on what the machine differs from the simulation.
    FollowingLqg(Weights),
}

impl Rival {
    /// All of them, with the numbers that were found for each.
    pub const ALL: [Self; 4] = [
        Self::ReoptimisedBenchmark(REOPTIMISED),
        Self::Lqg(LQG),
        Self::Mpc(MPC),
        Self::FollowingLqg(FOLLOWING_LQG),
    ];

    /// Name in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::ReoptimisedBenchmark(_) => "reoptimised-benchmark",
            Self::Lqg(_) => "lqg",
            Self::Mpc(_) => "linear-mpc",
            Self::FollowingLqg(_) => "model-following-lqg",
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
    pub reference: Reference<f64>,
    /// Where it should be so long after now \[s\].
    pub ahead: &'a dyn Fn(f64) -> Reference<f64>,
    /// What is read of the machine.
    pub reading: Reading<f64>,
    /// Position and load pressure of that.
    pub measured: Measured<f64>,
}

/// A rival at work.
pub(crate) trait Steers {
    /// Motor speed \[rev/s\] for the coming period.
    ///
    /// # Errors
    ///
    /// [`LabError`] when what it simulates leaves what the model holds for.
    fn speed(&mut self, shown: &Shown<'_>) -> Result<f64, LabError>;
}

/// A rival at rest beside a machine, of which the model and what it measures are known.
pub(crate) fn rival(
    which: Rival,
    model: &Description,
    (reading, measured): (&Reading<f64>, &Measured<f64>),
    start: f64,
) -> Result<Box<dyn Steers>, LabError> {
    Ok(match which {
        Rival::ReoptimisedBenchmark(gains) => {
            Box::new(reoptimised::Reoptimised::new(model, &gains, measured))
        }
        Rival::Lqg(weights) => Box::new(lqg::Lqg::new(model, &weights, measured)?),
        Rival::Mpc(weights) => Box::new(mpc::Mpc::new(model, &weights, measured)?),
        Rival::FollowingLqg(weights) => {
            Box::new(following_lqg::FollowingLqg::new(model, &weights, (reading, measured), start)?)
        }
    })
}
