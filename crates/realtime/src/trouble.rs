//! Faults at work on the way to a virtual machine, and in it.

use crate::fault::{Fault, Sensor};
use crate::lockstep::Disturbance;
use crate::machine::Incoming;
use hydroboom_control::{Command, Reading};
use hydroboom_description::Description;
use hydroboom_plant::PlantError;
use hydroboom_virtual_crane::VirtualCrane;
use std::collections::VecDeque;

/// What is done to a virtual machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tampering {
    /// A fault begins; another one ends.
    Fault(Fault),
    /// What was broken is mended.
    Mend,
    /// Another payload \[kg\] hangs on the boom.
    Payload(f64),
}

impl Tampering {
    /// As it crosses to another process.
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

    /// Back again; none where the words mean nothing.
    pub(crate) fn from_words([kind, value]: [u64; 2]) -> Option<Self> {
        match kind {
            0 => Some(Self::Mend),
            1 => Some(f64::from_bits(value)).filter(|m| m.is_finite()).map(Self::Payload),
            2 => Fault::all().get(usize::try_from(value).ok()?).copied().map(Self::Fault),
            _ => None,
        }
    }
}

/// A fault at work, if any.
#[derive(Clone)]
pub struct Trouble {
    fault: Option<Fault>,
    /// Periods since it began.
    since: u32,
    before: VecDeque<Reading<f64>>,
    stuck: Option<Reading<f64>>,
    /// What is still to be done to the machine.
    due: Option<Tampering>,
    sound: Description,
    burst: Description,
}

/// How many readings a delayed sensor is late.
const LATE: usize = 50;
/// Leakage of a burst line \[m³/s/Pa\]: oil runs out as through a hole of 3 mm, 50 L/min at 70 bar.
const BURST: f64 = 3e-7;

impl Trouble {
    /// None yet, for a machine as described.
    pub fn new(machine: &Description) -> Self {
        let mut burst = machine.clone();
        burst.numbers.case_leakage_a = BURST;
        Self {
            fault: None,
            since: 0,
            before: VecDeque::with_capacity(LATE + 1),
            stuck: None,
            due: None,
            sound: machine.clone(),
            burst,
        }
    }

    /// Lets it happen from the next period on.
    pub fn tamper(&mut self, what: Tampering) {
        match what {
            Tampering::Fault(fault) => {
                (self.fault, self.since, self.stuck) = (Some(fault), 0, None);
                self.due = Some(what);
            }
            Tampering::Mend => {
                self.fault = None;
                self.due = Some(what);
            }
            Tampering::Payload(mass) => {
                (self.sound.numbers.payload, self.burst.numbers.payload) = (mass, mass);
                self.due = Some(what);
            }
        }
    }

    /// Counts a period as over.
    pub fn pass(&mut self) {
        self.since = self.since.saturating_add(1);
    }

    fn spoil(&mut self, sensor: usize, kind: Sensor, reading: &mut Reading<f64>) {
        let mut values = reading.to_array();
        let stuck = *self.stuck.get_or_insert(*reading);
        let k = f64::from(self.since);
        // a tenth of a range: position, pressures, motor speed
        let tenth = match sensor {
            0 => 0.05,
            6 => 10.0,
            _ => 25e5,
        };
        // as if at random, the same every time
        let scatter = (k * 12.9898).sin() * 43_758.547;
        let scatter = 2.0 * (scatter - scatter.floor()) - 1.0;
        values[sensor] = match kind {
            Sensor::Stuck => stuck.to_array()[sensor],
            Sensor::Jumping => {
                values[sensor] + tenth * f64::from(u8::from((k as u32 / 100).is_multiple_of(2)))
            }
            Sensor::Noisy => values[sensor] + 0.2 * tenth * scatter,
            Sensor::NotANumber => f64::NAN,
            Sensor::Delayed => match self.before.front() {
                Some(old) => old.to_array()[sensor],
                None => values[sensor],
            },
        };
        *reading = Reading::from_array(values);
    }
}

impl Disturbance for Trouble {
    fn reading(&mut self, mut incoming: Incoming) -> Option<Incoming> {
        self.before.push_back(incoming.reading);
        if self.before.len() > LATE {
            self.before.pop_front();
        }
        match self.fault {
            Some(Fault::Sensor(sensor, kind)) => self.spoil(sensor, kind, &mut incoming.reading),
            Some(Fault::MachineKilled) => return None,
            Some(Fault::MachinePaused) if self.since < 100 => return None,
            Some(Fault::MachineRestarted) => incoming.sequence = u64::from(self.since) + 1,
            _ => {}
        }
        Some(incoming)
    }

    fn command(&mut self, mut command: Command<f64>) -> Option<Command<f64>> {
        match self.fault {
            Some(Fault::MachineKilled) => return None,
            Some(Fault::MachinePaused) if self.since < 100 => return None,
            // it comes up with its load held, and does not take commands at once
            Some(Fault::MachineRestarted) if self.since < 500 => return None,
            Some(Fault::DriveSaturated) => {
                command.motor_speed = command.motor_speed.clamp(-5.0, 5.0);
            }
            Some(Fault::DriveReversed) => command.motor_speed = -command.motor_speed,
            Some(Fault::DriveDead) => command.motor_speed = 0.0,
            Some(Fault::ValveStuckShut) => command.holding_valve = 0.0,
            Some(Fault::ValveStuckOpen) => command.holding_valve = 1.0,
            _ => {}
        }
        Some(command)
    }

    fn steps(&mut self, due: u32) -> u32 {
        match self.fault {
            Some(Fault::SimulationSlowed) => due / 2,
            Some(Fault::SimulationKilled) => 0,
            _ => due,
        }
    }

    fn attended(&mut self) -> bool {
        self.fault != Some(Fault::OperatorGone)
    }

    fn clock_jumped(&mut self) -> bool {
        self.fault == Some(Fault::ClockJump) && self.since == 0
    }

    fn overruns(&mut self) -> u32 {
        match self.fault {
            Some(Fault::ControlLate) => self.since + 1,
            _ => 0,
        }
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
    fn what_is_done_to_a_machine_crosses_to_its_process() {
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
