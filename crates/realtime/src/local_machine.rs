//! Machine in another process on the local interface. The control task's side accesses atomics only; a [bus
//! task](crate::bus_task) exchanges the datagrams.

use crate::machine::{Delay, Incoming, Link, Machine, Outgoing};
use crate::shared::{validity_of, valve_state, valve_word};
use crate::slot::Slot;
use hydroboom_control::command::{AxisCommand, Command};
use hydroboom_control::measurement::{AxisMeasurement, AxisSignals, Measurement};
use hydroboom_control::supervision::limits::{MachineStatus, ValveState};
use hydroboom_machine_interface::datagram;
use hydroboom_machine_interface::signal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Number of words of a measurement. They are number, sampling time \[ns\], state, fault code, valve,
/// validities and seven signals. Then follow lost, dropped, whether delays are known, both delays, and
/// whether commands are lost.
const MEASUREMENT: usize = 19;
/// Number of words of a command: number, whether it answers a measurement, that measurement's sampling time
/// \[ns\], enabled, motor speed, valve.
const COMMAND: usize = 6;

/// Data exchanged between control task and bus task.
#[derive(Debug, Default)]
pub(crate) struct Exchange {
    measurement: Slot<MEASUREMENT>,
    command: Slot<COMMAND>,
    /// Whether the bus task holds the load because commands are missing.
    pub(crate) holds: AtomicBool,
    /// Whether nothing is to be sent, so that the machine's own watchdog acts.
    pub(crate) is_withheld: AtomicBool,
}

/// Command as read by the bus task.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Written {
    pub(crate) sequence: u64,
    /// Sampling time of the measurement that it answers \[ns\].
    pub(crate) answers: Option<u64>,
    pub(crate) outgoing: Outgoing,
}

impl Exchange {
    /// For the bus task: publishes an accepted measurement.
    pub(crate) fn publish(&self, number: u64, measurement: &datagram::Measurement, link: &Link) {
        let axis = &measurement.axes[0];
        let validity = axis.validity.iter().rev().fold(0, |word, v| (word << 2) | *v as u64);
        let valve = match axis.valve {
            signal::ValveState::Unknown => None,
            signal::ValveState::Shut => Some(ValveState::Shut),
            signal::ValveState::Open => Some(ValveState::Open),
        };
        let [a, b, c, d, e, f, g] = axis.signals.map(f64::to_bits);
        let delay = link.delay.unwrap_or_default();
        self.measurement.publish([
            number,
            measurement.sampled,
            measurement.state as u64,
            u64::from(measurement.fault),
            valve_word(valve),
            validity,
            a,
            b,
            c,
            d,
            e,
            f,
            g,
            link.lost,
            link.dropped,
            u64::from(link.delay.is_some()),
            delay.measurement.to_bits(),
            delay.total.to_bits(),
            u64::from(link.commands_lost),
        ]);
    }

    /// For the bus task: newest command.
    pub(crate) fn command(&self) -> Option<Written> {
        let (_, [sequence, is_answer, sampled, enabled, speed, valve]) = self.command.read()?;
        let axis = AxisCommand {
            motor_speed: f64::from_bits(speed),
            holding_valve: f64::from_bits(valve),
        };
        let outgoing = Outgoing { command: Command { axes: [axis] }, is_enabled: enabled == 1 };
        let answers = (is_answer == 1).then_some(sampled);
        Some(Written { sequence, answers, outgoing })
    }
}

/// Machine in another process on the local interface, as seen from the control task.
#[derive(Debug)]
pub struct LocalMachine {
    exchange: Arc<Exchange>,
    /// Sampling time of the measurement read last \[ns\].
    sampled: Option<u64>,
}

impl LocalMachine {
    pub(crate) fn new(exchange: Arc<Exchange>) -> Self {
        Self { exchange, sampled: None }
    }
}

/// State of a machine from its number in a datagram, with its fault code.
fn status(state: u64, code: u64) -> MachineStatus {
    match u8::try_from(state).ok().and_then(signal::MachineState::of) {
        Some(signal::MachineState::Starting) => MachineStatus::Starting,
        Some(signal::MachineState::Ready) => MachineStatus::Ready,
        Some(signal::MachineState::Enabled) => MachineStatus::Enabled,
        Some(signal::MachineState::Fault) => MachineStatus::Fault { code: code as u16 },
        Some(signal::MachineState::Absent) | None => MachineStatus::Absent,
    }
}

impl Machine for LocalMachine {
    fn read(&mut self) -> Option<Incoming> {
        let (_, words) = self.exchange.measurement.read()?;
        let [number, sampled, state, code, valve, validities, rest @ ..] = words;
        let [a, b, c, d, e, f, g, lost, dropped, has_delay, measurement, total, commands_lost] =
            rest;
        self.sampled = Some(sampled);
        let signals = AxisSignals::from_array([a, b, c, d, e, f, g].map(f64::from_bits));
        let axis = AxisMeasurement::reported(signals, validity_of(validities));
        let holds = self.exchange.holds.load(Ordering::Acquire);
        let delay =
            Delay { measurement: f64::from_bits(measurement), total: f64::from_bits(total) };
        Some(Incoming {
            measurement: Measurement { number, time: sampled as f64 * 1e-9, axes: [axis] },
            valve: valve_state(valve),
            status: Some(status(state, code)),
            link: Some(Link {
                lost,
                dropped,
                delay: (has_delay == 1).then_some(delay),
                commands_lost: commands_lost == 1 || holds,
            }),
        })
    }

    fn write(&mut self, sequence: u64, outgoing: &Outgoing) {
        let [axis] = outgoing.command.axes;
        let [speed, valve] = axis.to_array().map(f64::to_bits);
        self.exchange.is_withheld.store(false, Ordering::Release);
        self.exchange.command.publish([
            sequence,
            u64::from(self.sampled.is_some()),
            self.sampled.unwrap_or(0),
            u64::from(outgoing.is_enabled),
            speed,
            valve,
        ]);
    }

    fn withhold(&mut self) {
        self.exchange.is_withheld.store(true, Ordering::Release);
    }
}
