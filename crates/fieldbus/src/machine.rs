//! Hand-over between the bus task and the control task: atomics only, so that neither waits for the other.

use crate::fault::Fault;
use crate::table::BusSettings;
use hydroboom_control::command::{AxisCommand, Command};
use hydroboom_control::measurement::{AXES, AxisMeasurement, AxisSignals, Measurement, Validity};
use hydroboom_control::supervision::limits::{MachineStatus, ValveState};
use hydroboom_realtime::machine::{Delay, Incoming, Link, Machine, Outgoing};
use hydroboom_realtime::slot::Slot;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

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
/// Words of the bus's statistics: lost and dropped frames, whether delays are known, and two delays.
const LINK_WORDS: usize = 5;
/// Words of a measurement: number, SYNC0 at which it was sampled, valve, statistics of the bus, axes.
const MEASUREMENT_WORDS: usize = 3 + LINK_WORDS + AXES * AXIS_WORDS;
/// Words of a command: sequence number, SYNC0 of the measurement that it answers, whether drives are to follow, and
/// two of each axis.
const COMMAND_WORDS: usize = 3 + 2 * AXES;

#[derive(Debug, Default)]
struct Shared {
    measurement: Slot<MEASUREMENT_WORDS>,
    command: Slot<COMMAND_WORDS>,
    /// Whether drives follow commands, and the encoded fault.
    is_enabled: AtomicU64,
    fault: AtomicU64,
    /// Number of resets that were requested.
    resets: AtomicU64,
    /// A SYNC0 by this computer's clock \[ns\]; 0 where none is known.
    sync0: AtomicU64,
    /// Whether the control task's side was dropped.
    is_left: AtomicBool,
    /// Whether no frames are to be sent, so that the devices' watchdogs expire.
    is_withheld: AtomicBool,
}

/// The control task's side: a [`Machine`].
#[derive(Debug)]
pub struct FieldbusMachine {
    shared: Arc<Shared>,
    /// Control period, and when in it control begins, after SYNC0 \[ns\].
    period: u64,
    begin: u64,
    /// SYNC0 at which the measurement that was read last was sampled, by the devices' clock \[ns\].
    sampled: u64,
}

/// The bus task's side.
#[derive(Debug)]
pub(crate) struct BusSide {
    shared: Arc<Shared>,
    /// Sequence number of the last command that was taken.
    sequence: Option<u64>,
    /// Number of resets that were carried out.
    resets: u64,
}

/// A command as the bus task takes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Taken {
    pub(crate) outgoing: Outgoing,
    /// SYNC0 at which the measurement that it answers was sampled, by the devices' clock \[ns\]; 0: none.
    pub(crate) answers: u64,
}

/// Creates the control task's side and the bus task's side.
pub(crate) fn hand_over(bus: &BusSettings) -> (FieldbusMachine, BusSide) {
    let shared = Arc::new(Shared::default());
    let machine = FieldbusMachine {
        shared: Arc::clone(&shared),
        period: bus.period,
        begin: bus.control(),
        sampled: 0,
    };
    (machine, BusSide { shared, sequence: None, resets: 0 })
}

impl FieldbusMachine {
    /// State of the machine.
    pub fn state(&self) -> MachineState {
        match Fault::of_word(self.shared.fault.load(Ordering::Acquire)) {
            Some(fault) => MachineState::Fault(fault),
            None if self.shared.is_enabled.load(Ordering::Acquire) != 0 => MachineState::Enabled,
            None => MachineState::Ready,
        }
    }

    /// Resets a fault whose cause a person has removed. It is called on a person's request only, never automatically.
    /// The bus task executes it in its next cycle.
    pub fn reset_by_a_person(&self) {
        self.shared.resets.fetch_add(1, Ordering::AcqRel);
    }
}

impl Machine for FieldbusMachine {
    fn read(&mut self) -> Option<Incoming> {
        let (_, words) = self.shared.measurement.read()?;
        let [number, sampled, valve, lost, dropped, has_delay, sent_after, total, axes @ ..] =
            words;
        self.sampled = sampled;
        let mut measurement =
            Measurement { number, time: sampled as f64 * 1e-9, ..Measurement::default() };
        for (axis, words) in measurement.axes.iter_mut().zip(axes.chunks_exact(AXIS_WORDS)) {
            let signals = std::array::from_fn(|k| f64::from_bits(words[k]));
            let validity = std::array::from_fn(|k| validity_of(words[SIGNALS] >> (2 * k)));
            *axis = AxisMeasurement::reported(
                AxisSignals::from_array(signals),
                AxisSignals::from_array(validity),
            );
        }
        let valve = match valve {
            1 => Some(ValveState::Shut),
            2 => Some(ValveState::Open),
            _ => None,
        };
        let status = match self.state() {
            MachineState::Ready => MachineStatus::Ready,
            MachineState::Enabled => MachineStatus::Enabled,
            MachineState::Fault(fault) => MachineStatus::Fault { code: fault.code() },
        };
        let delay = Delay { measurement: f64::from_bits(sent_after), total: f64::from_bits(total) };
        let link = Link {
            lost,
            dropped,
            delay: (has_delay == 1).then_some(delay),
            // without new commands the bus has the fault `commands-stopped`
            commands_lost: false,
        };
        Some(Incoming { measurement, valve, status: Some(status), link: Some(link) })
    }

    fn write(&mut self, sequence: u64, outgoing: &Outgoing) {
        let mut words = [0; COMMAND_WORDS];
        words[0] = sequence;
        words[1] = self.sampled;
        self.shared.is_withheld.store(false, Ordering::Release);
        words[2] = u64::from(outgoing.is_enabled);
        for (words, axis) in words[3..].chunks_exact_mut(2).zip(&outgoing.command.axes) {
            words[0] = axis.motor_speed.to_bits();
            words[1] = axis.holding_valve.to_bits();
        }
        self.shared.command.publish(words);
    }

    fn withhold(&mut self) {
        self.shared.is_withheld.store(true, Ordering::Release);
    }

    fn reset_by_a_person(&mut self) {
        FieldbusMachine::reset_by_a_person(self);
    }

    fn release(&self, due: u64) -> u64 {
        match self.shared.sync0.load(Ordering::Acquire) {
            0 => due,
            sync0 => {
                // the nearest begin of a control period
                let off = due.wrapping_sub(sync0 + self.begin) as i64;
                let (period, half) = (self.period as i64, self.period as i64 / 2);
                due.wrapping_add_signed(half - (off + half).rem_euclid(period))
            }
        }
    }
}

impl Drop for FieldbusMachine {
    fn drop(&mut self) {
        self.shared.is_left.store(true, Ordering::Release);
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
    /// Publishes a measurement that was sampled at a SYNC0, by the devices' clock \[ns\].
    pub(crate) fn publish(&self, incoming: &Incoming, sampled: u64) {
        let measurement = &incoming.measurement;
        let mut words = [0; MEASUREMENT_WORDS];
        words[0] = measurement.number;
        words[1] = sampled;
        words[2] = match incoming.valve {
            None => 0,
            Some(ValveState::Shut) => 1,
            Some(ValveState::Open) => 2,
        };
        if let Some(link) = incoming.link {
            let delay = link.delay.unwrap_or_default();
            words[3..3 + LINK_WORDS].copy_from_slice(&[
                link.lost,
                link.dropped,
                u64::from(link.delay.is_some()),
                delay.measurement.to_bits(),
                delay.total.to_bits(),
            ]);
        }
        let axes = words[3 + LINK_WORDS..].chunks_exact_mut(AXIS_WORDS);
        for (words, axis) in axes.zip(&measurement.axes) {
            for (word, value) in words.iter_mut().zip(axis.signals.to_array()) {
                *word = value.to_bits();
            }
            let validity = axis.validity.to_array().map(bits_of);
            words[SIGNALS] =
                validity.iter().enumerate().fold(0, |all, (k, bits)| all | bits << (2 * k));
        }
        self.shared.measurement.publish(words);
    }

    /// The newest command; none where it was taken before.
    pub(crate) fn take_command(&mut self) -> Option<Taken> {
        let (_, [sequence, answers, is_enabled, axes @ ..]) = self.shared.command.read()?;
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
        Some(Taken { outgoing: Outgoing { command, is_enabled: is_enabled == 1 }, answers })
    }

    /// Whether the control task's side was dropped.
    pub(crate) fn is_left(&self) -> bool {
        self.shared.is_left.load(Ordering::Acquire)
    }

    /// Whether no frames are to be sent.
    pub(crate) fn is_withheld(&self) -> bool {
        self.shared.is_withheld.load(Ordering::Acquire)
    }

    /// Publishes a SYNC0 by this computer's clock \[ns\].
    pub(crate) fn show_sync0(&self, sync0: u64) {
        self.shared.sync0.store(sync0, Ordering::Release);
    }

    /// Whether a person has requested a reset since the last call.
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

    const BUS: BusSettings = BusSettings::OF_TESTS;

    #[test]
    fn measurements_arrive_unchanged_and_a_command_is_taken_once() {
        let (mut machine, mut bus) = hand_over(&BUS);
        assert_eq!((machine.read(), bus.take_command()), (None, None));
        let signals = AxisSignals::from_array([0.3, 1e5, 2e5, -3e5, 4e5, 5e5, -12.5]);
        let sampled = 1_500_000_000;
        let mut measurement = Measurement::new(7, 1.5, [signals; AXES]);
        measurement.axes[0].validity.pressure_b = Validity::OutOfRange;
        measurement.axes[0].validity.motor_speed = Validity::Absent;
        measurement.axes[0].validity.stroke = Validity::Stale;
        let delay = Some(Delay { measurement: 0.125, total: 1.5 });
        let link = Some(Link { lost: 3, dropped: 4, delay, commands_lost: false });
        let status = Some(MachineStatus::Ready);
        let incoming = Incoming { measurement, valve: Some(ValveState::Open), status, link };
        bus.publish(&incoming, sampled);
        let mut read = machine.read().unwrap();
        let [axis] = &mut read.measurement.axes;
        // an absent value, or one out of range, is NaN
        for (value, sent) in [
            (&mut axis.signals.pressure_b, signals.pressure_b),
            (&mut axis.signals.motor_speed, signals.motor_speed),
        ] {
            assert!(std::mem::replace(value, sent).is_nan());
        }
        assert_eq!(read, incoming);

        let outgoing = Outgoing { command: Command::released([-33.25; AXES]), is_enabled: true };
        machine.write(1, &outgoing);
        let taken = Taken { outgoing, answers: sampled };
        assert_eq!(bus.take_command(), Some(taken));
        assert_eq!(bus.take_command(), None, "an old command is not taken again");
        machine.write(1, &outgoing);
        assert_eq!(bus.take_command(), None, "nor one with a number that was sent before");
    }

    #[test]
    fn a_reset_is_taken_once_and_the_state_reports_the_fault() {
        let (machine, mut bus) = hand_over(&BUS);
        assert!(!bus.take_reset());
        machine.reset_by_a_person();
        assert!(bus.take_reset());
        assert!(!bus.take_reset());
        bus.show(true, None);
        assert_eq!(machine.state(), MachineState::Enabled);
        let fault = Fault::Drive { device: 1, code: 0x3220 };
        bus.show(true, Some(fault));
        assert_eq!(machine.state(), MachineState::Fault(fault));
        assert!(!bus.is_left());
        drop(machine);
        assert!(bus.is_left());
    }

    #[test]
    fn control_is_released_in_phase_with_sync0_within_half_a_period() {
        let (machine, bus) = hand_over(&BUS);
        assert_eq!(machine.release(123_456_789), 123_456_789, "nothing is known of SYNC0");
        let sync0 = 77_000_250_000;
        bus.show_sync0(sync0);
        for due in (sync0 - 3_000_000..sync0 + 3_000_000).step_by(77_777) {
            let release = machine.release(due);
            assert!(release.abs_diff(due) <= BUS.period / 2, "{release} for {due}");
            let phase = (release as i64 - sync0 as i64).rem_euclid(BUS.period as i64);
            assert_eq!(phase, BUS.control() as i64);
        }
    }
}
