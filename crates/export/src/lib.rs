//! Model and controllers as source code of other languages.
//!
//! ```text
//! Description -> model and controllers over Expression -> Graph -> Block -> Plan -> C, ...
//! ```
//!
//! The one source of model and controllers is run once over a number that records what is done to it. Each language is a
//! file that prints what was recorded; none knows the model.

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
