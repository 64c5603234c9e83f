//! The dashboard: one page from inside the program, on which people follow a run and command it.
//!
//! ```text
//! session -records-> Dashboard -samples-> Feed -30 frames a second-> every viewer
//!         <-demands-           <--------- commands, with the token ---
//! desk    <- stop, emergency stop, reset, strategy, attendance -------
//! ```
//!
//! It runs in one ordinary thread of its own: whatever viewers do, the real-time tasks do not wait for it.

mod command;
mod dashboard;
mod feed;
mod operator_role;
mod scene;
mod server;
mod token;

pub use command::Demand;
pub use dashboard::{Dashboard, DashboardError};
pub use scene::Setup;
