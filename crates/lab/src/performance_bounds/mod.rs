//! Performance bounds: the least true tracking error of a crane along a course, whoever controls, and what each limit costs.
//!
//! Two parts, which add in squares. The motion that is expected, given what can be known beforehand, is no better than the best motion of a motor with limits
//! of speed and slew. What is not known in time, by delay, noise, or an unknown payload, leaves the
//! prediction error of the piston. For linear plants both are bounds, for any linear causal controller:
//!
//! ```text
//! E e_k² = (E e_k)² + Var e_k,   Σ (E e_k)² ≥ the best motion's,   Var e_k ≥ Var(x_k | what could be acted on)
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
