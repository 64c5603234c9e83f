//! What one closed-loop cycle tells of a machine, and what feedforward is worth with it.
//!
//! ```text
//! cycle in closed loop -> record (commands, readings) -> identification (crate `identify`) -> surrogate
//!                              |                                                                |-> off-line feedforward
//!                              \-> iterative learning control (norm-optimal, on the identified model)
//! ```

mod delayed_drive;
mod drive_fit;
pub mod experiment;
mod identification;
mod iterative_learning_control;
mod offline_feedforward;
mod record;
mod surrogate;
