//! Hand-over between the bus task and the control task: atomics only, so that neither waits for the other.

use crate::fault::Fault;
use hydroboom_control::command::{AxisCommand, Command};
use hydroboom_control::measurement::{AXES, AxisMeasurement, AxisSignals, Measurement, Validity};
use hydroboom_control::supervision::limits::ValveState;
use hydroboom_realtime::machine::{Incoming, Machine, Outgoing};
use hydroboom_realtime::slot::Slot;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// State of the machine on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MachineState {
    /// Measurements come; drives are without torque.
    Ready,
    /// Drives follow commands.
    Enabled,
    /// A fault: commands are not followed until a person resets it.
    Fault(Fault),
}

/// Signals of an axis.
const SIGNALS: usize = 7;
/// Words of an axis: signals, and their validities in one.
const AXIS_WORDS: usize = SIGNALS + 1;
/// Words of a measurement: number, time, valve, and those of the axes.
const MEASUREMENT_WORDS: usize = 3 + AXES * AXIS_WORDS;
/// Words of a command: sequence number, whether drives are to follow, and two of each axis.
const COMMAND_WORDS: usize = 2 + 2 * AXES;

#[derive(Debug, Default)]
struct Shared {
    measurement: Slot<MEASUREMENT_WORDS>,
    command: Slot<COMMAND_WORDS>,
    /// Whether drives follow commands, and the fault.
    is_enabled: AtomicU64,
    fault: AtomicU64,
    /// Number of resets that persons asked for.
    resets: AtomicU64,
}

/// The control task's side: a [`Machine`].
#[derive(Debug)]
pub struct FieldbusMachine(Arc<Shared>);

/// The bus task's side.
#[derive(Debug)]
pub(crate) struct BusSide {
    shared: Arc<Shared>,
    /// Sequence number of the last command that was taken.
    sequence: Option<u64>,
    /// Resets that were taken up.
    resets: u64,
}

/// Both sides.
pub(crate) fn hand_over() -> (FieldbusMachine, BusSide) {
    let shared = Arc::new(Shared::default());
    (FieldbusMachine(Arc::clone(&shared)), BusSide { shared, sequence: None, resets: 0 })
}

impl FieldbusMachine {
    /// State of the machine.
    pub fn state(&self) -> MachineState {
        match Fault::of_word(self.0.fault.load(Ordering::Acquire)) {
            Some(fault) => MachineState::Fault(fault),
            None if self.0.is_enabled.load(Ordering::Acquire) != 0 => MachineState::Enabled,
            None => MachineState::Ready,
        }
    }

    /// A person has mended the cause of a fault and resets it. Never called by a program on its own.
    pub fn reset_by_a_person(&self) {
        self.0.resets.fetch_add(1, Ordering::AcqRel);
    }
}

impl Machine for FieldbusMachine {
    fn read(&mut self) -> Option<Incoming> {
        let (_, [number, time, valve, axes @ ..]) = self.0.measurement.read()?;
        let mut measurement =
            Measurement { number, time: f64::from_bits(time), ..Measurement::default() };
        for (axis, words) in measurement.axes.iter_mut().zip(axes.chunks_exact(AXIS_WORDS)) {
            let signals = std::array::from_fn(|k| f64::from_bits(words[k]));
            let validity = std::array::from_fn(|k| validity_of(words[SIGNALS] >> (2 * k)));
            *axis = AxisMeasurement {
                signals: AxisSignals::from_array(signals),
                validity: AxisSignals::from_array(validity),
            };
        }
        let valve = match valve {
            1 => Some(ValveState::Shut),
            2 => Some(ValveState::Open),
            _ => None,
        };
        Some(Incoming::new(measurement, valve))
    }

    fn write(&mut self, sequence: u64, outgoing: &Outgoing) {
        let mut words = [0; COMMAND_WORDS];
        words[0] = sequence;
        words[1] = u64::from(outgoing.is_enabled);
        for (words, axis) in words[2..].chunks_exact_mut(2).zip(&outgoing.command.axes) {
            words[0] = axis.motor_speed.to_bits();
            words[1] = axis.holding_valve.to_bits();
        }
        self.0.command.publish(words);
    }
}

fn validity_of(bits: u64) -> Validity {
    match bits & 3 {
        0 => Validity::Good,
        1 => Validity::Absent,
        2 => Validity::OutOfRange,
        _ => Validity::Stale,
    }
}

fn bits_of(validity: Validity) -> u64 {
    match validity {
        Validity::Good => 0,
        Validity::Absent => 1,
        Validity::OutOfRange => 2,
        Validity::Stale => 3,
    }
}

impl BusSide {
    /// Hands a measurement over.
    pub(crate) fn publish(&self, incoming: &Incoming) {
        let measurement = &incoming.measurement;
        let mut words = [0; MEASUREMENT_WORDS];
        words[0] = measurement.number;
        words[1] = measurement.time.to_bits();
        words[2] = match incoming.valve {
            None => 0,
            Some(ValveState::Shut) => 1,
            Some(ValveState::Open) => 2,
        };
        for (words, axis) in words[3..].chunks_exact_mut(AXIS_WORDS).zip(&measurement.axes) {
            for (word, value) in words.iter_mut().zip(axis.signals.to_array()) {
                *word = value.to_bits();
            }
            let validity = axis.validity.to_array().map(bits_of);
            words[SIGNALS] =
                validity.iter().enumerate().fold(0, |all, (k, bits)| all | bits << (2 * k));
        }
        self.shared.measurement.publish(words);
    }

    /// The newest command, if none was taken since it was sent.
    pub(crate) fn take_command(&mut self) -> Option<Outgoing> {
        let (_, [sequence, is_enabled, axes @ ..]) = self.shared.command.read()?;
        if self.sequence.is_some_and(|last| sequence <= last) {
            return None;
        }
        self.sequence = Some(sequence);
        let mut command = Command::default();
        for (axis, words) in command.axes.iter_mut().zip(axes.chunks_exact(2)) {
            *axis = AxisCommand {
                motor_speed: f64::from_bits(words[0]),
                holding_valve: f64::from_bits(words[1]),
            };
        }
        Some(Outgoing { command, is_enabled: is_enabled == 1 })
    }

    /// Whether a person asked for a reset since it was looked at last.
    pub(crate) fn take_reset(&mut self) -> bool {
        let resets = self.shared.resets.load(Ordering::Acquire);
        std::mem::replace(&mut self.resets, resets) != resets
    }

    pub(crate) fn show(&self, is_enabled: bool, fault: Option<Fault>) {
        self.shared.is_enabled.store(u64::from(is_enabled), Ordering::Release);
        self.shared.fault.store(Fault::to_word(fault), Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_handed_over_arrives_as_it_was_and_a_command_is_taken_once() {
        let (mut machine, mut bus) = hand_over();
        assert_eq!((machine.read(), bus.take_command()), (None, None));
        let signals = AxisSignals::from_array([0.3, 1e5, 2e5, -3e5, 4e5, 5e5, -12.5]);
        let mut measurement = Measurement::new(7, 1.5, [signals; AXES]);
        measurement.axes[0].validity.pressure_b = Validity::OutOfRange;
        measurement.axes[0].validity.motor_speed = Validity::Absent;
        measurement.axes[0].validity.stroke = Validity::Stale;
        let incoming = Incoming::new(measurement, Some(ValveState::Open));
        bus.publish(&incoming);
        assert_eq!(machine.read(), Some(incoming));

        let outgoing = Outgoing { command: Command::released([-33.25; AXES]), is_enabled: true };
        machine.write(1, &outgoing);
        assert_eq!(bus.take_command(), Some(outgoing));
        assert_eq!(bus.take_command(), None, "an old command is not taken again");
        machine.write(1, &outgoing);
        assert_eq!(bus.take_command(), None, "nor one with a number that was there");
    }

    #[test]
    fn a_reset_is_taken_up_once_and_the_state_tells_the_fault() {
        let (machine, mut bus) = hand_over();
        assert!(!bus.take_reset());
        machine.reset_by_a_person();
        assert!(bus.take_reset());
        assert!(!bus.take_reset());
        bus.show(true, None);
        assert_eq!(machine.state(), MachineState::Enabled);
        let fault = Fault::Drive { device: 1, code: 0x3220 };
        bus.show(true, Some(fault));
        assert_eq!(machine.state(), MachineState::Fault(fault));
    }
}
