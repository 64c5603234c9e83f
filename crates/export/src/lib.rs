//! Model and controllers as source code of other languages.
//!
//! ```text
//! Description -> model and controllers over Expression -> Graph -> Block -> Plan -> C, ...
//! ```
//!
//! Model and controllers have a single source in Rust. It is executed once with a number type that records the
//! operations. The printers of the languages only know the recording, not the model.

mod block;
pub mod c;
pub mod closed_loop;
mod controller;
mod count;
mod crane;
mod error;
mod expression;
pub mod fmi;
mod given;
mod graph;
mod name;
mod plan;
mod repeated_part;
mod simulating;
mod slopes;
mod statement;
mod step_limit;
pub mod structured_text;
mod writing;

pub use block::{Block, ControlPeriod, Entry, Target, Variable};
pub use controller::{controller, scheduled_lqr_controller, simulation_feedforward_controller};
pub use count::Count;
pub use crane::{blocks, crane_model};
pub use error::ExportError;
pub use expression::{Condition, Expression, record};
pub use graph::{Graph, Node, Op};
pub use plan::Plan;
pub use simulating::simulation_feedforward;
pub use slopes::slopes;
