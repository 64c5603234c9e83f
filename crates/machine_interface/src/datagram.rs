//! Datagrams: header, body, check sum. Little-endian, SI units, at most [`LONGEST`] bytes.
//!
//! | offset | bytes | header |
//! |---|---|---|
//! | 0 | 4 | `HYDM` |
//! | 4 | 2 | version |
//! | 6 | 1 | kind |
//! | 7 | 1 | number of axes |
//! | 8 | 2 | length of the datagram, check sum included |
//! | 10 | 6 | zero |
//! | 16 | 8 | session |
//! | 24 | 8 | sequence number, one more with each datagram |
//! | 32 | 8 | last sequence number that was accepted of the peer |
//! | 40 | 8 | sender's clock \[ns\] |
//!
//! The body begins at 48; the last four bytes are CRC-32 (ISO-HDLC, as of zlib and Ethernet) of all before.

use crate::signal::{COMMANDED, MEASURED, MachineState, Validity, ValveState};
use thiserror::Error;

/// First four bytes of every datagram.
pub const MAGIC: [u8; 4] = *b"HYDM";
/// Version of the interface, in every header.
pub const VERSION: u16 = 1;
/// Longest datagram: what an Ethernet frame carries over IPv4 and UDP \[byte\].
pub const LONGEST: usize = 1472;
/// Bytes of the header.
const HEADER: usize = 48;
/// Bytes of the check sum.
const CHECK_SUM: usize = 4;
/// Largest number of axes: eight fit into a datagram.
pub const MOST_AXES: usize = 8;
/// Bytes of a measurement before its axes: sampling time, state, zero, fault code, zero.
const MEASUREMENT_HEAD: usize = 16;
/// Bytes of an axis in a measurement: signals, validities, state of the valve.
const MEASURED_AXIS: usize = 8 * MEASURED.len() + MEASURED.len() + 1;
/// Bytes of a command before its axes: flags, zero.
const COMMAND_HEAD: usize = 8;
/// Bytes of an axis in a command.
const COMMANDED_AXIS: usize = 8 * COMMANDED.len();
/// Bytes of a hello before its axes: period, versions, peer, zero.
const HELLO_HEAD: usize = 16;
/// Bytes of an axis in a hello: lowest and highest of each measured signal.
const HELLO_AXIS: usize = 16 * MEASURED.len();

/// Header of a datagram.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// Session number: 64 random bits chosen by the controller; 0 before a session.
    pub session: u64,
    /// Sequence number, which increases by one with each datagram of a sender; 0 in a hello.
    pub sequence: u64,
    /// Last accepted sequence number of the peer; 0 before the first.
    pub received: u64,
    /// Time of the sender's clock \[ns\].
    pub clock: u64,
}

/// Kind of the sender of a hello.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Peer {
    /// A controller.
    Controller = 0,
    /// A simulated machine.
    SimulatedMachine = 1,
    /// A real machine.
    RealMachine = 2,
}

impl Peer {
    /// Name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Controller => "controller",
            Self::SimulatedMachine => "simulated machine",
            Self::RealMachine => "real machine",
        }
    }

    fn of(number: u8) -> Option<Self> {
        [Self::Controller, Self::SimulatedMachine, Self::RealMachine]
            .into_iter()
            .find(|peer| *peer as u8 == number)
    }
}

/// Hello: a machine asks for a session with a hello of session 0; the controller starts it with a hello of its
/// session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hello {
    /// Kind of the sender.
    pub peer: Peer,
    /// Control period \[ns\]; it must be the same on both sides.
    pub period: u32,
    /// Newest version of the interface that the sender supports.
    pub newest_version: u16,
    /// Number of axes, 1 to [`MOST_AXES`].
    pub axes: usize,
    /// Number that the machine's maker changes with its firmware; 0 if it is not stated.
    pub firmware: u64,
    /// Lowest and highest value of each measured signal of each axis, in SI units, speeds in rev/s; not finite where
    /// unknown.
    pub ranges: [[[f64; 2]; MEASURED.len()]; MOST_AXES],
}

/// Measurement of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeasuredAxis {
    /// The signals, in the order of [`MEASURED`], in SI units, speeds in rev/s.
    pub signals: [f64; MEASURED.len()],
    /// Validity of each signal.
    pub validity: [Validity; MEASURED.len()],
    /// State of the load-holding valve.
    pub valve: ValveState,
}

/// Command for one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CommandedAxis {
    /// Commanded motor speed \[rev/s\], finite.
    pub motor_speed: f64,
    /// Load-holding valve: 1 energised (load released), 0 not (load held).
    pub holding_valve: f64,
}

/// A measurement of all axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurement {
    /// Sampling time by the machine's clock \[ns\].
    pub sampled: u64,
    /// State of the machine.
    pub state: MachineState,
    /// Code of the machine's fault; 0 without a fault.
    pub fault: u16,
    /// Number of valid entries in [`axes`](Self::axes), 1 to [`MOST_AXES`].
    pub count: usize,
    /// Measurement of each axis.
    pub axes: [MeasuredAxis; MOST_AXES],
}

/// Command for all axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Whether the drives are enabled; else they are without torque.
    pub is_enabled: bool,
    /// Number of valid entries in [`axes`](Self::axes), 1 to [`MOST_AXES`].
    pub count: usize,
    /// Command for each axis.
    pub axes: [CommandedAxis; MOST_AXES],
}

/// Body of a datagram, by its kind.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "no allocation in the control period")]
pub enum Body {
    /// Hello, which starts a session.
    Hello(Hello),
    /// Measurement, from a machine.
    Measurement(Measurement),
    /// Command, from a controller.
    Command(Command),
}

/// Reason why a datagram is dropped.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum Dropped {
    /// It does not start with [`MAGIC`].
    #[error("no datagram of this interface")]
    Magic,
    /// Its version, in the variant, is not supported.
    #[error("version {0}; {VERSION} is spoken here")]
    Version(u16),
    /// Its length differs from the stated one, or from that of its kind.
    #[error("its length is not that of its kind")]
    Length,
    /// Its check sum differs.
    #[error("its check sum differs")]
    CheckSum,
    /// It has an undefined kind, state or validity.
    #[error("a number in it is not defined")]
    Undefined,
    /// A valid signal, or a command, is not finite.
    #[error("a signal in it is not finite")]
    NotFinite,
}

/// Kinds of body.
const HELLO: u8 = 1;
const MEASUREMENT: u8 = 2;
const COMMAND: u8 = 3;

/// Bytes being written. Bytes that do not fit are omitted, which an invalid length shows.
struct Writer<'a> {
    bytes: &'a mut [u8; LONGEST],
    length: usize,
}

impl Writer<'_> {
    fn put(&mut self, more: &[u8]) {
        if let Some(room) = self.bytes.get_mut(self.length..self.length + more.len()) {
            room.copy_from_slice(more);
            self.length += more.len();
        }
    }
}

/// Encodes a datagram into a buffer and returns its length \[byte\]. Nothing is allocated.
///
/// The number of axes must be 1 to [`MOST_AXES`], and numbers finite: the receiver drops any other datagram.
pub fn encode(header: &Header, body: &Body, into: &mut [u8; LONGEST]) -> usize {
    let (kind, axes, body_length) = match body {
        Body::Hello(hello) => (HELLO, hello.axes, HELLO_HEAD + HELLO_AXIS * hello.axes),
        Body::Measurement(m) => (MEASUREMENT, m.count, MEASUREMENT_HEAD + MEASURED_AXIS * m.count),
        Body::Command(c) => (COMMAND, c.count, COMMAND_HEAD + COMMANDED_AXIS * c.count),
    };
    let length = (HEADER + body_length + CHECK_SUM) as u16;
    let mut to = Writer { bytes: into, length: 0 };
    to.put(&MAGIC);
    to.put(&VERSION.to_le_bytes());
    to.put(&[kind, axes as u8]);
    to.put(&length.to_le_bytes());
    to.put(&[0; 6]);
    for number in [header.session, header.sequence, header.received, header.clock] {
        to.put(&number.to_le_bytes());
    }
    match body {
        Body::Hello(hello) => {
            to.put(&hello.period.to_le_bytes());
            to.put(&hello.newest_version.to_le_bytes());
            to.put(&[hello.peer as u8, 0]);
            to.put(&hello.firmware.to_le_bytes());
            for number in hello.ranges.iter().take(hello.axes).flatten().flatten() {
                to.put(&number.to_le_bytes());
            }
        }
        Body::Measurement(measurement) => {
            to.put(&measurement.sampled.to_le_bytes());
            to.put(&[measurement.state as u8, 0]);
            to.put(&measurement.fault.to_le_bytes());
            to.put(&[0; 4]);
            for axis in measurement.axes.iter().take(measurement.count) {
                axis.signals.iter().for_each(|signal| to.put(&signal.to_le_bytes()));
                axis.validity.iter().for_each(|validity| to.put(&[*validity as u8]));
                to.put(&[axis.valve as u8]);
            }
        }
        Body::Command(command) => {
            to.put(&[u8::from(command.is_enabled)]);
            to.put(&[0; 7]);
            for axis in command.axes.iter().take(command.count) {
                to.put(&axis.motor_speed.to_le_bytes());
                to.put(&axis.holding_valve.to_le_bytes());
            }
        }
    }
    let sum = crc32fast::hash(&to.bytes[..to.length]);
    to.put(&sum.to_le_bytes());
    to.length
}

/// Bytes being read; beyond the end there are zeros, which a checked length rules out.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        match self.0.split_first_chunk::<N>() {
            Some((taken, rest)) => {
                self.0 = rest;
                *taken
            }
            None => [0; N],
        }
    }

    fn u8(&mut self) -> u8 {
        self.take::<1>()[0]
    }

    fn u16(&mut self) -> u16 {
        u16::from_le_bytes(self.take())
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.take())
    }

    fn f64(&mut self) -> f64 {
        f64::from_le_bytes(self.take())
    }
}

/// Decodes a datagram. Nothing is allocated.
///
/// # Errors
///
/// The first reason that applies, in this order:
/// - [`Dropped::Magic`], [`Dropped::Version`];
/// - [`Dropped::Undefined`] for an undefined kind;
/// - [`Dropped::Length`], also for a number of axes that is not 1 to [`MOST_AXES`];
/// - [`Dropped::CheckSum`];
/// - [`Dropped::Undefined`] for an undefined state or validity, or [`Dropped::NotFinite`], in the order of the axes.
pub fn decode(bytes: &[u8]) -> Result<(Header, Body), Dropped> {
    if bytes.get(..4) != Some(&MAGIC) {
        return Err(Dropped::Magic);
    }
    let mut from = Reader(&bytes[4..]);
    let version = from.u16();
    if version != VERSION {
        return Err(Dropped::Version(version));
    }
    let [kind, axes] = from.take();
    let axes = usize::from(axes);
    let length = usize::from(from.u16());
    let expected = match kind {
        HELLO => HELLO_HEAD + HELLO_AXIS * axes,
        MEASUREMENT => MEASUREMENT_HEAD + MEASURED_AXIS * axes,
        COMMAND => COMMAND_HEAD + COMMANDED_AXIS * axes,
        _ => return Err(Dropped::Undefined),
    };
    let fits = (1..=MOST_AXES).contains(&axes)
        && length == HEADER + expected + CHECK_SUM
        && length == bytes.len();
    if !fits {
        return Err(Dropped::Length);
    }
    let (checked, sum) = bytes.split_at(length - CHECK_SUM);
    if crc32fast::hash(checked).to_le_bytes() != *sum {
        return Err(Dropped::CheckSum);
    }
    let _zero: [u8; 6] = from.take();
    let header = Header {
        session: from.u64(),
        sequence: from.u64(),
        received: from.u64(),
        clock: from.u64(),
    };
    let body = match kind {
        HELLO => Body::Hello(hello(&mut from, axes)?),
        MEASUREMENT => Body::Measurement(measurement(&mut from, axes)?),
        _ => Body::Command(command(&mut from, axes)?),
    };
    Ok((header, body))
}

fn hello(from: &mut Reader<'_>, axes: usize) -> Result<Hello, Dropped> {
    let (period, newest_version) = (from.u32(), from.u16());
    let peer = Peer::of(from.u8()).ok_or(Dropped::Undefined)?;
    from.u8();
    let firmware = from.u64();
    let mut ranges = [[[f64::NAN; 2]; MEASURED.len()]; MOST_AXES];
    for number in ranges.iter_mut().take(axes).flatten().flatten() {
        *number = from.f64();
    }
    Ok(Hello { peer, period, newest_version, axes, firmware, ranges })
}

fn measurement(from: &mut Reader<'_>, count: usize) -> Result<Measurement, Dropped> {
    let sampled = from.u64();
    let state = MachineState::of(from.u8()).ok_or(Dropped::Undefined)?;
    from.u8();
    let fault = from.u16();
    from.u32();
    let mut axes = [MeasuredAxis::default(); MOST_AXES];
    for axis in axes.iter_mut().take(count) {
        axis.signals.iter_mut().for_each(|signal| *signal = from.f64());
        for validity in &mut axis.validity {
            *validity = Validity::of(from.u8()).ok_or(Dropped::Undefined)?;
        }
        axis.valve = ValveState::of(from.u8()).ok_or(Dropped::Undefined)?;
        let mut signals = axis.signals.iter().zip(&axis.validity);
        if signals.any(|(signal, is)| *is == Validity::Good && !signal.is_finite()) {
            return Err(Dropped::NotFinite);
        }
    }
    Ok(Measurement { sampled, state, fault, count, axes })
}

fn command(from: &mut Reader<'_>, count: usize) -> Result<Command, Dropped> {
    let is_enabled = match from.u8() {
        0 => false,
        1 => true,
        _ => return Err(Dropped::Undefined),
    };
    let _zero: [u8; 7] = from.take();
    let mut axes = [CommandedAxis::default(); MOST_AXES];
    for axis in axes.iter_mut().take(count) {
        *axis = CommandedAxis { motor_speed: from.f64(), holding_valve: from.f64() };
        if !(axis.motor_speed.is_finite() && axis.holding_valve.is_finite()) {
            return Err(Dropped::NotFinite);
        }
    }
    Ok(Command { is_enabled, count, axes })
}
