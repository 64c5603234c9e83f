//! Controllers designed from a crane's description, before anything moves.
//!
//! ```text
//! Description -> linear (the crane linearised, its modes and responses), frequency_response (by its Hessenberg form)
//!             -> linearised_plant (as it is once the pump lifts)
//!             -> hydraulic_spring_fit (a mass on a hydraulic spring, fitted to that)
//!             -> operating_points (over the stroke)
//!             -> reduced_model_fit (over stroke and payload) -> scheduled_lqr (estimator and law)
//!             -> unstable_poles (Nyquist criterion), margins (stability margins)
//!             -> benchmark_design (gains of the benchmark), design_report (both loops), stability (over the stroke)
//!             -> supervision (limits, monitors and the release of the load)
//!             -> tip (estimator of the tip's position), tip_survey (its numbers, fitted to a survey)
//! ```

// code of the control cycle cannot panic
#![deny(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::panic,
    clippy::todo,
    clippy::unimplemented,
    clippy::unreachable
)]

pub mod benchmark_design;
mod design_report;
mod error;
mod frequency_response;
mod hydraulic_spring_fit;
pub mod linear;
mod linearised_plant;
mod margins;
pub mod observability;
pub mod operating_points;
pub mod reduced_model_fit;
pub mod scheduled_lqr;
pub mod small_signal_controller;
pub mod stability;
mod supervision;
pub mod tip;
pub mod tip_survey;
pub mod unknown_flow;
mod unstable_poles;

pub use design_report::{
    DesignReport, benchmark_loop, design_report, scheduled_lqr_loop, scheduled_lqr_loop_at,
};
pub use error::DesignError;
pub use hydraulic_spring_fit::{ElasticLoad, HydraulicSpring, hydraulic_spring};
pub use linearised_plant::{LinearisedPlant, Responses};
pub use margins::{Actuation, Loop, Margins, margins};
pub use supervision::{
    LoadPressure, framed_benchmark, framed_scheduled_lqr, framed_simulation_feedforward, limits,
    load_pressure,
};
