//! Time integration schemes.
//!
//! | scheme | order | cost | for |
//! |---|---|---|---|
//! | [`published`] | 1 | one derivative | comparison with the paper; 50 us and below |
//! | [`Implicit`] | 2 | six derivatives with Jacobian | everything else; 0.5 ms, to 2 ms |
//! | [`Underlying`] | 2 | the implicit one, and two derivatives with slopes | its exact slopes |
//! | [`runge_kutta_4`] | 4 | four derivatives | converged references at small steps |

mod implicit;
mod limit;
mod published;
mod runge_kutta;
mod with_slopes;

pub use implicit::{Implicit, MOST_PARTS, has_settled};
pub use limit::{StepBound, StepLimit};
pub use published::published;
pub use runge_kutta::runge_kutta_4;
pub use with_slopes::Underlying;
