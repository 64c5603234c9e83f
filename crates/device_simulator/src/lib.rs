//! Simulated devices for EtherCAT: a segment takes a frame and a time, and gives the frame back as devices would.
//!
//! No clock and no socket: [`Segment::process`] is a function of frames and times, so that a main device can be tested
//! in one thread in simulated time. A device has the registers, sync managers, FMMUs, states, mailbox and distributed
//! clock that main devices touch; behind them is an [`Application`], a drive by CiA 402 for example. No conformance is
//! claimed.

#![forbid(unsafe_code)]

pub mod al_status_code;
pub mod application;
pub mod applications;
pub mod controller;
pub mod device;
pub mod frame;
pub mod mailbox;
pub mod object_dictionary;
pub mod segment;

pub use application::Application;
pub use device::Device;
pub use segment::Segment;
