//! Local interface of a machine: one datagram each way and control period, over UDP on the loopback address.
//!
//! The normative text is `docs/reference/machine-interface.md`. Here are the [datagrams](datagram) and the rules by
//! which a [session] accepts them; sockets, clocks and watchdogs belong to those who use them.
//!
//! ```
//! use hydroboom_machine_interface::datagram::{Body, Command, CommandedAxis, LONGEST, encode};
//! use hydroboom_machine_interface::session::Session;
//!
//! let (mut controller, mut machine) = (Session::new(7), Session::new(7));
//! let mut command = Command { is_enabled: true, count: 1, ..Default::default() };
//! command.axes[0] = CommandedAxis { motor_speed: 12.5, holding_valve: 1.0 };
//! let mut bytes = [0; LONGEST];
//! let length = encode(&controller.next_header(0), &Body::Command(command), &mut bytes);
//! let (header, body) = machine.accept(&bytes[..length]).unwrap();
//! assert_eq!((header.sequence, body), (1, Body::Command(command)));
//! // repeated, it is dropped and counted
//! assert!(machine.accept(&bytes[..length]).is_none());
//! assert_eq!(machine.counters.sequence, 1);
//! ```

#![forbid(unsafe_code)]

pub mod datagram;
pub mod session;
pub mod signal;
