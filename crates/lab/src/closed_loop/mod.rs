//! Closed loops: a controller and virtual cranes along a course, for single runs, robustness trials and
//! families of cranes.

pub mod ablation;
pub mod consistency_statistics;
pub mod controller_choice;
pub mod error_table;
pub mod estimator_consistency;
pub mod family_margins;
pub mod metrics;
pub mod monte_carlo;
mod motor_ripple;
pub mod period_time;
pub mod robustness;
pub mod sample;
pub mod scenario;
pub(crate) mod simulated_crane;
pub mod simulation;
pub mod sustained_oscillation;
pub mod tip_accuracy;
