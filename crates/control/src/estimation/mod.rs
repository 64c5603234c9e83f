//! State and parameter estimation.

pub mod drive_identification;
pub mod error_covariance;
pub mod extended_kalman_filter;
pub mod innovation_test;
pub mod noise_estimation;
pub mod reduced_model;
pub mod retained_parameters;
pub mod state_estimator;
pub mod tip;
