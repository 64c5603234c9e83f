//! Baselines for comparison with the strategies: published methods implemented here and run on the same
//! cranes. Each uses the controller's crane file only.
//!
//! They are not meant for a machine. The strategies for a machine are those of
//! [`Strategy`](hydroboom_control::strategy::Strategy).

mod command_plan;
mod condensed;
mod estimated_machine;
mod horizon;
mod kalman_filter;
mod linear_mpc;
mod linear_plant;
mod lqg;
mod nonlinear_mpc;
#[cfg(test)]
mod nonlinear_mpc_oracle;
mod optimal_control_problem;
mod quadratic_program;
mod receding_horizon;
mod reference_ahead;
mod retuned_benchmark;
mod riccati;

pub use lqg::{LQG, Weights};

use crate::LabError;
use hydroboom_control::controller::Controller;
use hydroboom_description::Description;
use hydroboom_design::benchmark_design::{Gains, benchmark_design, payload_range};
use linear_mpc::LinearMpc;
use lqg::Lqg;
use nonlinear_mpc::NonlinearMpc;
use retuned_benchmark::RetunedBenchmark;

/// Controller for comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Baseline {
    /// Benchmark controller with gains designed for the payload range of the crane file.
    RetunedBenchmark(Gains),
    /// The same with an input shaper (ZVD) for the boom's lowest mode.
    ShapedBenchmark(Gains),
    /// Linear-quadratic state feedback on a Kalman filter's estimate, a fixed design at one operating
    /// point.
    Lqg(Weights),
    /// Linear model-predictive control with estimator, gain schedule and weights of the scheduled LQR, and
    /// the motor's limits.
    LinearMpc,
    /// Nonlinear model-predictive control with the same, and limits of the pressure.
    NonlinearMpc,
}

impl Baseline {
    /// Names of all baselines in their order.
    pub const NAMES: [&'static str; 5] =
        ["retuned-benchmark", "shaped-benchmark", "lqg", "linear-mpc", "nonlinear-mpc"];

    /// All baselines, designed for a model.
    ///
    /// # Errors
    ///
    /// [`LabError::Design`] if no gains keep the benchmark's margins over the payload range.
    pub fn all(model: &Description) -> Result<[Self; 5], LabError> {
        let gains = benchmark_design(model, payload_range(model))?.gains;
        Ok([
            Self::RetunedBenchmark(gains),
            Self::ShapedBenchmark(gains),
            Self::Lqg(LQG),
            Self::LinearMpc,
            Self::NonlinearMpc,
        ])
    }

    /// Name in tables and JSON.
    pub fn name(self) -> &'static str {
        Self::NAMES[match self {
            Self::RetunedBenchmark(_) => 0,
            Self::ShapedBenchmark(_) => 1,
            Self::Lqg(_) => 2,
            Self::LinearMpc => 3,
            Self::NonlinearMpc => 4,
        }]
    }

    /// Controller for a machine described by the model.
    ///
    /// # Errors
    ///
    /// [`LabError::NoBaseline`] if a Riccati equation of the LQG has no solution; [`LabError::Design`] if the model
    /// has no reduced or linear plant. [`LabError::NoOscillation`] or [`LabError::Plant`] if the shaped benchmark
    /// finds no oscillatory mode or no state of rest at the middle of the motion.
    pub(crate) fn controller(self, model: &Description) -> Result<Box<dyn Controller>, LabError> {
        Ok(match self {
            Self::RetunedBenchmark(gains) => Box::new(RetunedBenchmark::new(model, &gains)),
            Self::ShapedBenchmark(gains) => Box::new(RetunedBenchmark::shaped(model, &gains)?),
            Self::Lqg(weights) => Box::new(Lqg::new(model, &weights)?),
            Self::LinearMpc => Box::new(LinearMpc::controller(model)?),
            Self::NonlinearMpc => Box::new(NonlinearMpc::controller(model)?),
        })
    }
}
