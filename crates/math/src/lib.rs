//! Number types for evaluating the model.
//!
//! Model and controllers are written once, generic over the scalar trait [`Real`]. The scalar type determines the
//! result of a run:
//!
//! | scalar | result |
//! |---|---|
//! | `f64`, `f32` | one simulation |
//! | [`Lanes`] | several simulations side by side, one per SIMD lane |
//! | [`Dual`] | a simulation and its exact derivatives |
//!
//! `exp`, `tanh`, `ln` and `sin_cos` are our own, written with additions, multiplications and one division
//! ([`elementary`] states their error bounds). Every lane of a batch, and the same operations in generated code of
//! another language, therefore give the same bits as `f64` here.
//!
//! ```
//! use hydroboom_math::{Dual, Real};
//!
//! fn area<T: Real>(diameter: T) -> T {
//!     T::lit(std::f64::consts::FRAC_PI_4) * diameter.square()
//! }
//!
//! let piston = area(Dual::<f64, 1>::variable(0.065, 0));
//! assert!((piston.slope[0] - std::f64::consts::FRAC_PI_2 * 0.065).abs() < 1e-15);
//! ```
#![cfg_attr(not(feature = "std"), no_std)]
// code of the control cycle must not panic
#![deny(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::panic,
    clippy::todo,
    clippy::unimplemented,
    clippy::unreachable
)]

mod dual;
pub mod elementary;
mod float;
mod lanes;
mod linear;
mod real;
mod record;
pub mod simd;

pub use dual::Dual;
pub use lanes::{LaneMask, Lanes};
pub use linear::{Factored, solve_pivoted};
pub use real::Real;
