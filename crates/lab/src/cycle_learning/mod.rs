//! Identification of a machine from one closed-loop cycle or a log, and the tracking errors of feedforward
//! and iterative learning control with the identified model.
//!
//! ```text
//! cycle in closed loop -> record ->  identification (crate `identify`) -> surrogate (virtual crane, equipment off)
//! log                  ---------/                                          |-> off-line feedforward
//!                                                                          \-> iterative learning control (norm-optimal)
//! ```

mod closed_loop_cycle;
mod drive_delay;
pub mod experiment;
mod identification;
pub mod identified_payload;
mod iterative_learning_control;
mod linearised_response;
pub mod log_learning;
mod margins;
mod offline_feedforward;
mod record;
mod replay;
mod saturation;
mod stages;
mod usability;
