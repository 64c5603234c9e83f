//! A machine on EtherCAT: main device, table of devices and signals, drives by CiA 402, faults; in real and in
//! simulated time.
//!
//! ```text
//! control task  <-measurement-  Slot  <-  Bus::measure  <-  exchange of frames  <->  Link  <->  devices
//!               -command->      Slot  ->  Bus::act      ->
//! ```
//!
//! [`Table::parse`](table::Table::parse) reads the table of devices and signals; [`Bus::start`](bus::Bus::start)
//! brings the devices to SAFEOP or OP; a bus task, or a loop in simulated time, calls [`Bus::measure`](bus::Bus::measure) and
//! [`Bus::act`](bus::Bus::act). The control task has a [`FieldbusMachine`](machine::FieldbusMachine). Frames go over
//! a [`Link`](link::Link); [`time`] is the system's monotonic clock, or simulated. [`diagnosis`] finds out why a bus
//! does not run.

// code of the bus task must not panic: the cyclic frames would stop
#![deny(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::panic,
    clippy::todo,
    clippy::unimplemented,
    clippy::unreachable
)]

mod al_status_code;
pub mod bus;
pub mod bus_task;
pub mod check;
pub mod cia402;
pub mod cycle_record;
mod device_configuration;
pub mod diagnosis;
mod drive;
pub mod fault;
pub mod frame_ring;
mod input_decoding;
pub mod interface;
pub mod link;
pub mod machine;
mod pace;
pub mod raw_socket;
mod sii;
pub mod start_up;
pub mod statistics;
pub mod table;
pub mod time;
mod wire;
