//! The fault campaign: everything that can go wrong, at several moments, under every strategy.

use crate::lockstep::{Disturbance, Lockstep};
use crate::machine::Incoming;
use crate::operator::Operator;
use hydroboom_control::{Cause, Command, Motion, Reading, State, Strategy};
use hydroboom_description::Description;
use hydroboom_model::SimulationError;
use hydroboom_plant::PlantError;
use hydroboom_virtual_crane::VirtualCrane;
use std::collections::VecDeque;

/// What a sensor can do wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    /// It shows what it showed last.
    Stuck,
    /// It jumps by a tenth of its range.
    Jumping,
    /// It scatters.
    Noisy,
    /// It shows no number.
    NotANumber,
    /// It is 50 ms late.
    Delayed,
}

/// What can go wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// A sensor, by its place in a reading.
    Sensor(usize, Sensor),
    /// The machine's process is gone.
    MachineKilled,
    /// It stands still for 100 ms.
    MachinePaused,
    /// It begins anew: its readings are counted from one again.
    MachineRestarted,
    /// The simulation gets half of its steps done.
    SimulationSlowed,
    /// The simulation stands still.
    SimulationKilled,
    /// The control task misses deadlines.
    ControlLate,
    /// The drive gives a tenth of its speed at most.
    DriveSaturated,
    /// The drive turns the other way.
    DriveReversed,
    /// The drive does not turn.
    DriveDead,
    /// The valve does not open, or falls shut.
    ValveStuckShut,
    /// The valve does not shut any more.
    ValveStuckOpen,
    /// The load falls off.
    PayloadDropped,
    /// A line on pump side A bursts.
    LineBurst,
    /// Nobody attends any more.
    OperatorGone,
    /// The clock jumps.
    ClockJump,
    /// Somebody presses the button.
    EmergencyStop,
}

/// Names of the sensors, in the order of a reading.
const SENSORS: [&str; 7] = ["position", "p_PA", "p_A", "p_B", "p_PB", "p_acc", "motor speed"];

impl Fault {
    /// All of them.
    pub fn all() -> Vec<Self> {
        use Sensor::{Delayed, Jumping, Noisy, NotANumber, Stuck};
        let mut all = Vec::new();
        for sensor in 0..SENSORS.len() {
            let kinds = [Stuck, Jumping, Noisy, NotANumber, Delayed];
            all.extend(kinds.map(|kind| Self::Sensor(sensor, kind)));
        }
        all.extend([
            Self::MachineKilled,
            Self::MachinePaused,
            Self::MachineRestarted,
            Self::SimulationSlowed,
            Self::SimulationKilled,
            Self::ControlLate,
            Self::DriveSaturated,
            Self::DriveReversed,
            Self::DriveDead,
            Self::ValveStuckShut,
            Self::ValveStuckOpen,
            Self::PayloadDropped,
            Self::LineBurst,
            Self::OperatorGone,
            Self::ClockJump,
            Self::EmergencyStop,
        ]);
        all
    }

    /// Name in tables.
    pub fn name(self) -> String {
        match self {
            Self::Sensor(sensor, kind) => {
                let how = match kind {
                    Sensor::Stuck => "stuck",
                    Sensor::Jumping => "jumping",
                    Sensor::Noisy => "noisy",
                    Sensor::NotANumber => "not a number",
                    Sensor::Delayed => "50 ms late",
                };
                format!("{} {how}", SENSORS[sensor])
            }
            Self::MachineKilled => "machine killed".into(),
            Self::MachinePaused => "machine paused for 100 ms".into(),
            Self::MachineRestarted => "machine restarted".into(),
            Self::SimulationSlowed => "simulation slowed".into(),
            Self::SimulationKilled => "simulation killed".into(),
            Self::ControlLate => "control task late".into(),
            Self::DriveSaturated => "drive saturated".into(),
            Self::DriveReversed => "drive reversed".into(),
            Self::DriveDead => "drive dead".into(),
            Self::ValveStuckShut => "valve stuck shut".into(),
            Self::ValveStuckOpen => "valve stuck open".into(),
            Self::PayloadDropped => "payload dropped".into(),
            Self::LineBurst => "line burst".into(),
            Self::OperatorGone => "operator gone".into(),
            Self::ClockJump => "clock jump".into(),
            Self::EmergencyStop => "emergency stop".into(),
        }
    }
}

/// When it goes wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Name in tables.
    pub name: &'static str,
    /// Time of the course \[s\].
    pub time: f64,
}

/// In the first ramp, in the cruise, and at rest at the far end.
pub fn moments(motion: &Motion<f64>) -> [Moment; 3] {
    let travel = motion.travel_time();
    [
        Moment { name: "ramp", time: motion.rest + 0.5 * motion.ramp },
        Moment { name: "cruise", time: motion.rest + 0.5 * travel },
        Moment { name: "rest", time: motion.rest + travel + 0.5 * motion.dwell },
    ]
}

/// What came of a fault.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// What went wrong.
    pub fault: Fault,
    /// Under which strategy.
    pub strategy: Strategy,
    /// When.
    pub moment: &'static str,
    /// What the supervisor found; none where the course was finished all the same.
    pub cause: Option<Cause>,
    /// Time from the fault to the safe state: motor at zero, valve de-energised \[s\]. For a
    /// finished course none.
    pub safe_after: Option<f64>,
    /// Whether the benchmark took over from the simulation.
    pub fallback: bool,
    /// How far the tracking error, truly, went from where it was at the fault, until the safe state or
    /// the end of the course \[m\].
    pub strayed: f64,
    /// How far the piston moved after the safe state, within two seconds \[m\].
    pub moved_after: f64,
    /// Why the machine broke, where it did.
    pub broke: Option<SimulationError>,
}

/// A fault at work from its moment on.
struct Injected {
    fault: Fault,
    /// Periods since the moment; none before.
    since: Option<u32>,
    before: VecDeque<Reading<f64>>,
    stuck: Option<Reading<f64>>,
    done: bool,
    burst: Description,
}

/// How many readings a delayed sensor is late.
const LATE: usize = 50;

impl Injected {
    fn is_on(&self) -> bool {
        self.since.is_some()
    }

    fn spoil(&mut self, sensor: usize, kind: Sensor, reading: &mut Reading<f64>) {
        let mut values = reading.to_array();
        let stuck = *self.stuck.get_or_insert(*reading);
        let k = f64::from(self.since.unwrap_or(0));
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

impl Disturbance for Injected {
    fn reading(&mut self, mut incoming: Incoming) -> Option<Incoming> {
        self.before.push_back(incoming.reading);
        if self.before.len() > LATE {
            self.before.pop_front();
        }
        let Some(since) = self.since else { return Some(incoming) };
        match self.fault {
            Fault::Sensor(sensor, kind) => self.spoil(sensor, kind, &mut incoming.reading),
            Fault::MachineKilled => return None,
            Fault::MachinePaused if since < 100 => return None,
            Fault::MachineRestarted => incoming.sequence = u64::from(since) + 1,
            _ => {}
        }
        Some(incoming)
    }

    fn command(&mut self, mut command: Command<f64>) -> Option<Command<f64>> {
        let Some(since) = self.since else { return Some(command) };
        match self.fault {
            Fault::MachineKilled => return None,
            Fault::MachinePaused if since < 100 => return None,
            // it comes up with its load held, and does not take commands at once
            Fault::MachineRestarted if since < 500 => return None,
            Fault::DriveSaturated => command.motor_speed = command.motor_speed.clamp(-5.0, 5.0),
            Fault::DriveReversed => command.motor_speed = -command.motor_speed,
            Fault::DriveDead => command.motor_speed = 0.0,
            Fault::ValveStuckShut => command.holding_valve = 0.0,
            Fault::ValveStuckOpen => command.holding_valve = 1.0,
            _ => {}
        }
        Some(command)
    }

    fn steps(&mut self, due: u32) -> u32 {
        match self.fault {
            Fault::SimulationSlowed if self.is_on() => due / 2,
            Fault::SimulationKilled if self.is_on() => 0,
            _ => due,
        }
    }

    fn attended(&mut self) -> bool {
        !(self.fault == Fault::OperatorGone && self.is_on())
    }

    fn clock_jumped(&mut self) -> bool {
        self.fault == Fault::ClockJump && self.since == Some(0)
    }

    fn overruns(&mut self) -> u32 {
        match self.fault {
            Fault::ControlLate => self.since.map_or(0, |since| since + 1),
            _ => 0,
        }
    }

    fn machine(&mut self, machine: &mut VirtualCrane) -> Result<(), PlantError> {
        if !self.is_on() || std::mem::replace(&mut self.done, true) {
            return Ok(());
        }
        match self.fault {
            Fault::PayloadDropped => machine.set_payload(0.0),
            Fault::LineBurst => machine.set_description(&self.burst),
            _ => Ok(()),
        }
    }
}

/// A case takes no longer than its course and this \[s\]: pre-loading, stopping, and two seconds more.
const LONGEST: f64 = 12.0;

/// One fault, under one strategy, at one moment, in simulated time.
///
/// # Errors
///
/// [`PlantError`] when the cranes cannot be built.
pub fn inject(
    model: &Description,
    machine: &Description,
    motion: Motion<f64>,
    strategy: Strategy,
    fault: Fault,
    moment: &Moment,
) -> Result<Outcome, PlantError> {
    let mut run = Lockstep::new(model, machine, motion, strategy)?;
    let mut operator = Operator::new(true);
    // oil runs out as through a hole of 3 mm: 50 L/min at 70 bar
    let mut burst = machine.clone();
    burst.numbers.case_leakage_a = 3e-7;
    let mut injected =
        Injected { fault, since: None, before: VecDeque::new(), stuck: None, done: false, burst };
    let mut outcome = Outcome {
        fault,
        strategy,
        moment: moment.name,
        cause: None,
        safe_after: None,
        fallback: false,
        strayed: 0.0,
        moved_after: 0.0,
        broke: None,
    };
    let period = model.numbers.control_period;
    let (mut error_before, mut safe_at, mut course_time) = (None, None, None);
    let mut after_safe = 0;
    let longest = motion.duration() + LONGEST;
    for _ in 0..(longest / period) as u32 {
        if after_safe >= (2.0 / period) as u32 {
            break;
        }
        let is_due = course_time.is_some_and(|time| time >= moment.time);
        if injected.since.is_some() || is_due {
            injected.since = Some(injected.since.map_or(0, |since| since + 1));
            operator.emergency |= fault == Fault::EmergencyStop && injected.since == Some(0);
        }
        let record = match run.disturbed_period(&mut operator, strategy, &mut injected) {
            Ok(record) => record,
            Err(error) => {
                outcome.broke = Some(error);
                return Ok(outcome);
            }
        };
        course_time = record.course_time.or(course_time);
        let stroke = run.truth().outputs.stroke;
        let Some(since) = injected.since else { continue };
        outcome.fallback |= record.fallback;
        let reference = motion.reference(course_time.unwrap_or(0.0)).position;
        let error = stroke - reference;
        let before = *error_before.get_or_insert(error);
        let command = &record.decision.command;
        let at_rest = command.motor_speed == 0.0 && command.holding_valve == 0.0;
        match (record.decision.state, safe_at) {
            (State::Fault, None) if at_rest => {
                outcome.cause = record.decision.cause;
                outcome.safe_after = Some(f64::from(since) * period);
                safe_at = Some(stroke);
            }
            (State::Holding, None) if operator.is_done() && at_rest => safe_at = Some(stroke),
            (_, Some(at)) => outcome.moved_after = outcome.moved_after.max((stroke - at).abs()),
            (_, None) => outcome.strayed = outcome.strayed.max((error - before).abs()),
        }
        after_safe += u32::from(safe_at.is_some());
    }
    Ok(outcome)
}
