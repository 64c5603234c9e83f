//! Moving a crane in time.
//!
//! | scheme | order | cost | for |
//! |---|---|---|---|
//! | [`published`] | 1 | one derivative | comparison with the paper; 50 us and below |
//! | [`LinearlyImplicit`] | 2 | two derivatives, one Jacobian | everything else; 0.25 ms, to 0.5 ms |
//! | [`runge_kutta_4`] | 4 | four derivatives | converged references at small steps |

mod limit;
mod linearly_implicit;
mod published;
mod runge_kutta;

pub use limit::StepLimit;
pub use linearly_implicit::LinearlyImplicit;
pub use published::published;
pub use runge_kutta::runge_kutta_4;
