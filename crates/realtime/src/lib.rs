//! Executive: runs the simulation beside the machine in steps of 50 us, and the controller once every
//! millisecond.
//!
//! ```text
//! machine  --measurement-->  control task (1 ms)   --pump speed-->  simulation task (50 us)
//!          <---command-----  supervisor, strategy  <--state-------
//! ```
//!
//! The tasks contain no clock and no thread. [`executive`] runs them in real time, each on a core of its
//! own. [`lockstep`] runs them in simulated time with bit-identical repetition.

// code of the control cycle must not panic
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
pub mod command_delay;
pub mod commissioning;
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
pub mod real_time_thread;
pub mod replay;
pub mod session;
pub mod setup;
pub mod shared;
pub mod simulation_task;
pub mod slot;
pub mod timing;
pub mod trouble;
