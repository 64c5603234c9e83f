//! The dashboard: a web page served by the program, on which viewers follow a run and the operator commands it.
//!
//! ```text
//! session -records-> Dashboard -samples-> Feed -30 frames a second-> every viewer
//!         <-demands-           <--------- commands, with the token ---
//! desk    <- stop, emergency stop, reset, strategy, attendance -------
//! ```
//!
//! The server has one thread of normal priority; the real-time tasks never wait for it.

mod choice;
mod command;
mod connections;
mod dashboard;
mod feed;
mod limits;
mod operator_role;
mod scene;
mod server;
mod server_state;
mod token;
mod viewer;
mod viewers;

pub use choice::{Choice, Course};
pub use command::Demand;
pub use dashboard::{Dashboard, DashboardError};
pub use scene::Setup;
