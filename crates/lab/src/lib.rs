//! Experiments in simulation: closed loops, baselines, performance bounds, calibration, iterative learning control,
//! reports.
//!
//! All experiments take a [`Description`](hydroboom_description::Description). A [`Plant`] abstracts from
//! the number of boom segments.

pub mod baselines;
pub mod benchmark;
pub mod calibrate;
pub mod claims;
pub mod closed_loop;
pub mod crane_file_text;
pub mod cycle_learning;
pub mod dataset;
pub mod double_damping;
pub mod eigenfrequency;
pub mod energy_audit;
mod error;
mod interruptible;
pub mod log;
pub mod log_estimation;
pub mod log_verdict;
pub mod mat_file;
pub mod motion_test;
pub mod numerical_damping;
mod off_model;
pub mod paper;
pub mod performance_bounds;
pub mod report;
pub mod run_log;
pub mod simulate;
pub mod study;
pub mod virtual_estimates;
pub mod virtual_run;
pub mod virtual_survey;
pub mod work_precision;

pub use error::LabError;
pub use hydroboom_design::linear as linearise;
pub use hydroboom_plant::{Plant, plant};
