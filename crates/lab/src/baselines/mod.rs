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
mod scheduled;

pub use linear_mpc::MPC;
pub use lqg::{LQG, Weights};
pub use retuned_benchmark::{Gains, RETUNED};

use crate::LabError;
use hydroboom_control::feedback::benchmark::BenchmarkInput;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_description::Description;

/// A controller that is only compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Baseline {
    /// The benchmark controller, its four numbers found anew on virtual cranes.
    RetunedBenchmark(Gains),
    /// Linear-quadratic state feedback on an observer's state of the machine.
    Lqg(Weights),
    /// Linear model-predictive control on the same observer; it sees the reference half a second ahead, and the motor's limits.
    LinearMpc(Weights),
    /// Scheduled LQR.
    ScheduledLqr,
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
            Self::ScheduledLqr => "scheduled-lqr",
        }
    }
}

/// What a baseline is shown in a period.
pub(crate) struct Shown<'a> {
    /// Where the piston should be.
    pub reference: SetPoint<f64>,
    /// Where it should be so long after now \[s\].
    pub ahead: &'a dyn Fn(f64) -> SetPoint<f64>,
    /// Its largest speed \[m/s\].
    pub speed: f64,
    /// What is read of the machine.
    pub reading: AxisSignals<f64>,
    /// Position and load pressure of that.
    pub measured: BenchmarkInput<f64>,
}

/// A baseline at work.
pub(crate) trait Steers {
    /// Motor speed \[rev/s\] for the coming period.
    fn speed(&mut self, shown: &Shown<'_>) -> f64;
}

/// A baseline at rest beside a machine, of which the model and what it measures are known.
pub(crate) fn baseline(
    which: Baseline,
    model: &Description,
    measured: &BenchmarkInput<f64>,
) -> Result<Box<dyn Steers>, LabError> {
    Ok(match which {
        Baseline::RetunedBenchmark(gains) => {
            Box::new(retuned_benchmark::RetunedBenchmark::new(model, &gains, measured))
        }
        Baseline::Lqg(weights) => Box::new(lqg::Lqg::new(model, &weights, measured)?),
        Baseline::ScheduledLqr => Box::new(scheduled::Scheduled::new(model)?),
        Baseline::LinearMpc(weights) => {
            Box::new(linear_mpc::LinearMpc::new(model, &weights, measured)?)
        }
    })
}
