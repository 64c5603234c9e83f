//! Baselines: what the strategies are held against. The best published alternatives, on the same cranes, each knowing the
//! paper's crane only.
//!
//! They are here to be compared, not to be used on a machine: the strategies that are offered are those of
//! [`Strategy`](hydroboom_control::strategy::Strategy).

mod box_qp;
mod kalman_filter;
mod linear_mpc;
mod linear_plant;
mod lqg;
mod retuned_benchmark;
mod riccati;

pub use linear_mpc::MPC;
pub use lqg::{LQG, Weights};
pub use retuned_benchmark::{Gains, RETUNED};

use crate::LabError;
use hydroboom_control::controller::Controller;
use hydroboom_description::Description;
use linear_mpc::LinearMpc;
use lqg::Lqg;
use retuned_benchmark::RetunedBenchmark;

/// A controller that is only compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Baseline {
    /// The benchmark controller, its four numbers found anew on virtual cranes.
    RetunedBenchmark(Gains),
    /// Linear-quadratic state feedback on an observer's state of the machine.
    Lqg(Weights),
    /// Linear model-predictive control on the same observer; it sees the reference half a second ahead, and the motor's limits.
    LinearMpc(Weights),
}

impl Baseline {
    /// All of them, with the numbers that were found for each.
    pub const ALL: [Self; 3] =
        [Self::RetunedBenchmark(RETUNED), Self::Lqg(LQG), Self::LinearMpc(MPC)];

    /// Name in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::RetunedBenchmark(_) => "reoptimised-benchmark",
            Self::Lqg(_) => "lqg",
            Self::LinearMpc(_) => "linear-mpc",
        }
    }

    /// The controller for a machine of which the model is known.
    ///
    /// # Errors
    ///
    /// [`LabError::NoBaseline`] when it cannot be designed for the model.
    pub(crate) fn controller(self, model: &Description) -> Result<Box<dyn Controller>, LabError> {
        Ok(match self {
            Self::RetunedBenchmark(gains) => Box::new(RetunedBenchmark::new(model, &gains)),
            Self::Lqg(weights) => Box::new(Lqg::new(model, &weights)?),
            Self::LinearMpc(weights) => Box::new(LinearMpc::new(model, &weights)?),
        })
    }
}
