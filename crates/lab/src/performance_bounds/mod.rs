//! Performance bounds: smallest true tracking error of a crane along a course for any controller, and the
//! cost of each limit.
//!
//! The bound has two parts, whose squares add. The expected motion, given the prior information, is no
//! better than the best motion of a motor with limits of speed and slew rate. Missing information, due to
//! delay, noise or an unknown payload, leaves the prediction error of the piston position. For linear
//! plants both are bounds for any linear causal controller:
//!
//! ```text
//! E e_k² = (E e_k)² + Var e_k,   Σ (E e_k)² ≥ that of the best motion,   Var e_k ≥ Var(x_k | usable
//! measurements)
//! ```

mod assessment;
mod conditions;
mod crane_along_course;
mod delay;
mod disturbances;
mod motor_limits;
mod optimal_control;
mod prediction_error;
mod sensor_noise;
mod strategies;
mod unknown_payload;

pub use assessment::{
    BOUND_PARTS, LONGEST_COURSE, Limit, LimitCost, PerformanceBounds, performance_bounds,
};
pub use conditions::Condition;
pub use strategies::{StrategyError, strategy_errors};
