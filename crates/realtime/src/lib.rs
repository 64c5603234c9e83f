//! The executive: the simulation runs beside the machine, 50 us a step, and the controller uses it
//! every millisecond.
//!
//! ```text
//! machine  -reading->  control task (1 ms)  -pump speed->  simulation task (50 us)
//!          <-command-  supervisor, strategy <-simulated-
//! ```
//!
//! The tasks know no clock and no thread. [`executive`] runs them in real time, each on a core of its
//! own; [`lockstep`] in simulated time, every time the same.

// what runs in the control cycle cannot panic
#![deny(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::panic,
    clippy::todo,
    clippy::unimplemented,
    clippy::unreachable
)]

pub mod bus_task;
pub mod campaign_cranes;
pub mod conditions;
pub mod control_task;
pub mod course;
pub mod desk;
pub mod doctor;
pub mod endpoint;
pub mod executive;
pub mod failure;
pub mod fault;
pub mod faults;
pub mod flow_baseline;
pub mod healthy;
pub mod host;
pub mod local_lockstep;
pub mod local_machine;
pub mod lockstep;
pub mod log;
pub mod machine;
pub mod operator;
pub mod parameter_file;
pub mod posix;
pub mod reactions;
pub mod readiness;
pub mod replay;
pub mod session;
pub mod setup;
pub mod shared;
pub mod simulation_task;
pub mod slot;
pub mod timing;
pub mod trouble;
