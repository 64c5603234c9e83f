//! The dashboard: one page from inside the program, on which people follow a run and command it.
//!
//! ```text
//! session -records-> Dashboard -samples-> Feed -30 frames a second-> every viewer
//!         <-demands-           <--------- commands, with the token ---
//! desk    <- stop, emergency stop, reset, strategy, attendance -------
//! ```
//!
//! It runs in one ordinary thread of its own: whatever viewers do, the real-time tasks do not wait for it.

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
