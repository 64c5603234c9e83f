//! Fault injection into a virtual machine and its connection.

use crate::fault::{Fault, Sensor, WrongPosition, WrongPressure};
use crate::lockstep::Disturbance;
use crate::machine::Incoming;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::{AxisMeasurement, AxisSignals};
use hydroboom_description::Description;
use hydroboom_math::Real;
use hydroboom_plant::PlantError;
use hydroboom_virtual_crane::VirtualCrane;
use std::collections::VecDeque;

/// Fault or payload change of a virtual machine during a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tampering {
    /// A fault begins; it replaces the present one.
    Fault(Fault),
    /// All faults end.
    Mend,
    /// The payload changes to this mass \[kg\]; active faults stay.
    Payload(f64),
}

impl Tampering {
    /// As words for another process.
    pub(crate) fn to_words(self) -> [u64; 2] {
        match self {
            Self::Mend => [0, 0],
            Self::Payload(mass) => [1, mass.to_bits()],
            Self::Fault(fault) => {
                let place = Fault::all().iter().position(|f| *f == fault);
                [2, place.map_or(u64::MAX, |k| k as u64)]
            }
        }
    }

    /// From words of another process; none if they are invalid.
    pub(crate) fn from_words([kind, value]: [u64; 2]) -> Option<Self> {
        match kind {
            0 => Some(Self::Mend),
            1 => Some(f64::from_bits(value)).filter(|m| m.is_finite()).map(Self::Payload),
            2 => Fault::all().get(usize::try_from(value).ok()?).copied().map(Self::Fault),
            _ => None,
        }
    }
}

/// Active fault.
#[derive(Clone, Copy)]
struct Active {
    fault: Fault,
    /// Periods since its start.
    since: u32,
    /// First measurement during the fault.
    first: Option<AxisSignals<f64>>,
}

/// Active faults of a virtual machine and its connection: none, one, or two.
#[derive(Clone)]
pub struct Trouble {
    active: [Option<Active>; 2],
    before: VecDeque<AxisSignals<f64>>,
    /// Change still to be applied to the machine.
    due: Option<Tampering>,
    sound: Description,
    burst: Description,
    /// Control period \[s\].
    period: f64,
}

/// Delay of a delayed sensor \[measurements\].
const LATE: usize = 50;
/// Leakage coefficient of a burst line \[m³/s/Pa\]: a hole of 3 mm, 50 L/min at 70 bar.
const BURST: f64 = 3e-7;
/// Speed of a drive that turns at zero command \[rev/s\].
const UNCOMMANDED: f64 = 5.0;
/// Noise amplitude of a wrong pressure signal \[Pa\].
const NOISE: f64 = 5e3;

impl Trouble {
    /// State without a fault, for a machine as described.
    pub fn new(machine: &Description) -> Self {
        let mut burst = machine.clone();
        burst.numbers.case_leakage_a = BURST;
        Self {
            active: [None; 2],
            before: VecDeque::with_capacity(LATE + 1),
            due: None,
            sound: machine.clone(),
            burst,
            period: machine.numbers.control_period,
        }
    }

    /// Applies a fault or payload change from the next control period on. A fault replaces the active ones.
    pub fn tamper(&mut self, what: Tampering) {
        match what {
            Tampering::Fault(fault) => {
                self.active = [Some(Active { fault, since: 0, first: None }), None];
                self.due = Some(what);
            }
            Tampering::Mend => {
                self.active = [None; 2];
                self.due = Some(what);
            }
            Tampering::Payload(mass) => {
                (self.sound.numbers.payload, self.burst.numbers.payload) = (mass, mass);
                self.due = Some(what);
            }
        }
    }

    /// Adds a second fault, which acts beside the first. It replaces an earlier second one.
    pub fn add(&mut self, fault: Fault) {
        self.active[1] = Some(Active { fault, since: 0, first: None });
    }

    /// Counts a control period; faults that grow or end with time depend on it.
    pub fn pass(&mut self) {
        for active in self.active.iter_mut().flatten() {
            active.since = active.since.saturating_add(1);
        }
    }

    fn faults(&self) -> impl Iterator<Item = (Fault, u32)> + '_ {
        self.active.iter().flatten().map(|active| (active.fault, active.since))
    }

    fn has(&self, fault: Fault) -> bool {
        self.faults().any(|(active, _)| active == fault)
    }

    fn spoil(&self, sensor: usize, kind: Sensor, active: &Active, reading: &mut AxisSignals<f64>) {
        let mut values = reading.to_array();
        let first = active.first.unwrap_or(*reading);
        // a tenth of the range: position, pressures, motor speed
        let tenth = match sensor {
            0 => 0.05,
            6 => 10.0,
            _ => 25e5,
        };
        let scatter = scatter(active.since);
        let is_high = (active.since / 100).is_multiple_of(2);
        values[sensor] = match kind {
            Sensor::Stuck => first.to_array()[sensor],
            Sensor::Jumping => values[sensor] + tenth * f64::from(u8::from(is_high)),
            Sensor::Noisy => values[sensor] + 0.2 * tenth * scatter,
            Sensor::NotANumber => f64::NAN,
            Sensor::Delayed => match self.before.front() {
                Some(old) => old.to_array()[sensor],
                None => values[sensor],
            },
        };
        *reading = AxisSignals::from_array(values);
    }
}

/// Pseudo-random number in -1 to 1, reproducible.
fn scatter(number: u32) -> f64 {
    let scatter = (f64::from(number) * 12.9898).sin() * 43_758.547;
    2.0 * (scatter - scatter.floor()) - 1.0
}

/// Sets the wrong pressure signals.
fn mistake(wrong: WrongPressure, since: u32, r: &mut AxisSignals<f64>) {
    let noise = NOISE * scatter(since);
    match wrong {
        WrongPressure::LoadZero => r.pressure_a = noise,
        WrongPressure::Load20Bar => r.pressure_a = 20e5 + noise,
        WrongPressure::LoadCopiesPump => r.pressure_a = r.pressure_pump_a + noise,
        WrongPressure::Exchanged => std::mem::swap(&mut r.pressure_a, &mut r.pressure_b),
        WrongPressure::PumpCopiesLoad => r.pressure_pump_a = r.pressure_a + noise,
        WrongPressure::PumpHigh => r.pressure_pump_a += 66e5,
    }
}

/// Whether the machine's process is silent; `since` is the time since the fault began \[periods\].
fn is_silent(fault: Fault, since: u32) -> bool {
    match fault {
        Fault::MachineKilled => true,
        Fault::MachinePaused => since < 100,
        _ => false,
    }
}

impl Disturbance for Trouble {
    fn reading(&mut self, mut incoming: Incoming) -> Option<Incoming> {
        self.before.push_back(incoming.measurement.axes[0].signals);
        if self.before.len() > LATE {
            self.before.pop_front();
        }
        for k in 0..self.active.len() {
            let Some(active) = &mut self.active[k] else { continue };
            let first = *active.first.get_or_insert(incoming.measurement.axes[0].signals);
            let (active, reading) = (*active, &mut incoming.measurement.axes[0].signals);
            let time = f64::from(active.since) * self.period;
            match active.fault {
                fault if is_silent(fault, active.since) => return None,
                Fault::Sensor(sensor, kind) => self.spoil(sensor, kind, &active, reading),
                Fault::Pressure(wrong) => mistake(wrong, active.since, reading),
                Fault::Position(WrongPosition::Drift2) => reading.stroke += 2e-3 * time,
                Fault::Position(WrongPosition::Drift20) => reading.stroke += 20e-3 * time,
                Fault::Position(WrongPosition::Gain) => {
                    reading.stroke += 0.2 * (reading.stroke - first.stroke);
                }
                Fault::Position(WrongPosition::Gain5) => {
                    reading.stroke += 0.05 * (reading.stroke - first.stroke);
                }
                Fault::MachineRestarted => {
                    incoming.measurement.number = u64::from(active.since) + 1
                }
                _ => {}
            }
        }
        incoming.measurement.axes =
            incoming.measurement.axes.map(|axis| AxisMeasurement::new(axis.signals));
        Some(incoming)
    }

    fn command(&mut self, command: AxisCommand<f64>) -> Option<AxisCommand<f64>> {
        let is_lost = self.faults().any(|(fault, since)| {
            // a restarting machine ignores commands for 500 periods
            is_silent(fault, since) || (fault == Fault::MachineRestarted && since < 500)
        });
        (!is_lost).then_some(command)
    }

    fn drive(&mut self, mut command: AxisCommand<f64>) -> AxisCommand<f64> {
        for (fault, _) in self.faults() {
            let stands = command.motor_speed == 0.0;
            match fault {
                Fault::DriveSaturated => {
                    command.motor_speed = Real::clamp(command.motor_speed, -5.0, 5.0);
                }
                Fault::DriveReversed => command.motor_speed = -command.motor_speed,
                Fault::DriveDead => command.motor_speed = 0.0,
                Fault::DriveLifts if stands => command.motor_speed = UNCOMMANDED,
                Fault::DriveLowers if stands => command.motor_speed = -UNCOMMANDED,
                Fault::ValveStuckShut => command.holding_valve = 0.0,
                Fault::ValveStuckOpen => command.holding_valve = 1.0,
                _ => {}
            }
        }
        command
    }

    fn steps(&mut self, due: u32) -> u32 {
        if self.has(Fault::SimulationKilled) {
            0
        } else if self.has(Fault::SimulationSlowed) {
            due / 2
        } else {
            due
        }
    }

    fn attended(&mut self) -> bool {
        !self.has(Fault::OperatorGone)
    }

    fn clock_jumped(&mut self) -> bool {
        self.faults().any(|active| active == (Fault::ClockJump, 0))
    }

    fn control_is_held_up(&mut self) -> bool {
        self.faults().any(|(fault, since)| match fault {
            Fault::ControlStopped(time) => f64::from(since) * self.period < f64::from(time) * 1e-3,
            Fault::ControlStarved => !since.is_multiple_of(13),
            _ => false,
        })
    }

    fn machine(&mut self, machine: &mut VirtualCrane) -> Result<(), PlantError> {
        match self.due.take() {
            Some(Tampering::Fault(Fault::PayloadDropped)) => machine.set_payload(0.0),
            Some(Tampering::Fault(Fault::LineBurst)) => machine.set_description(&self.burst),
            Some(Tampering::Mend) => machine.set_description(&self.sound),
            Some(Tampering::Payload(mass)) => machine.set_payload(mass),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn injected_faults_are_transferred_unchanged_to_the_machine() {
        let mut all: Vec<Tampering> = Fault::all().into_iter().map(Tampering::Fault).collect();
        all.extend([Tampering::Mend, Tampering::Payload(123.5)]);
        for what in all {
            assert_eq!(Tampering::from_words(what.to_words()), Some(what));
        }
        assert_eq!(Tampering::from_words([7, 0]), None);
        assert_eq!(Tampering::from_words([2, 99]), None);
        assert_eq!(Tampering::from_words([1, f64::NAN.to_bits()]), None);
    }
}
