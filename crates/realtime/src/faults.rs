//! The fault campaign: everything that can go wrong, at several moments, under every strategy, alone
//! and with a second fault on top, judged on the simulated machine.

use crate::fault::{Fault, Sensor, WrongPosition, WrongPressure};
use crate::lockstep::Lockstep;
use crate::operator::Operator;
use crate::setup::SetupError;
use crate::trouble::{Tampering, Trouble};
use hydroboom_control::reference::profile::OutAndBack;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::limits::Limits;
use hydroboom_control::supervision::supervisor::State;
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_model::SimulationError;
use hydroboom_virtual_crane::Truth;

/// When it goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// Before the start: from the first period on.
    BeforeStart,
    /// While the pump fills its side.
    PreLoad,
    /// In the first ramp.
    Ramp,
    /// In the cruise.
    Cruise,
    /// At rest at the far end, the load released.
    Rest,
}

impl Moment {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::BeforeStart, Self::PreLoad, Self::Ramp, Self::Cruise, Self::Rest];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::BeforeStart => "before the start",
            Self::PreLoad => "pre-load",
            Self::Ramp => "ramp",
            Self::Cruise => "cruise",
            Self::Rest => "rest",
        }
    }

    /// Time of the course \[s\]; none where the load is not released yet.
    fn course_time(self, motion: &OutAndBack<f64>) -> Option<f64> {
        let travel = motion.travel_time();
        match self {
            Self::BeforeStart | Self::PreLoad => None,
            Self::Ramp => Some(motion.rest + 0.5 * motion.ramp),
            Self::Cruise => Some(motion.rest + 0.5 * travel),
            Self::Rest => Some(motion.rest + travel + 0.5 * motion.dwell),
        }
    }

    /// Speed of the piston then, of the course's.
    fn share_of_speed(self) -> f64 {
        match self {
            Self::BeforeStart | Self::PreLoad | Self::Rest => 0.0,
            Self::Ramp => 0.5,
            Self::Cruise => 1.0,
        }
    }
}

/// What came of a fault, as the machine shows it.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// What went wrong.
    pub fault: Fault,
    /// What came on top 20 ms later, if anything.
    pub second: Option<Fault>,
    /// Under which strategy.
    pub strategy: Strategy,
    /// When.
    pub moment: Moment,
    /// What the supervisor found last; none where the course was finished all the same.
    pub cause: Option<Cause>,
    /// Time from the fault until the machine is safe, its pilots without pressure and its motor at
    /// rest \[s\]; none where it never was.
    pub safe_after: Option<f64>,
    /// Whether the benchmark took over from the simulation.
    pub fallback: bool,
    /// Largest movement of the piston after the fault \[m\]: off its course until the stop began, and
    /// from there.
    pub moved: f64,
    /// How far the piston sank below where it was held, for faults before the load was released \[m\].
    pub dropped: f64,
    /// Largest force on an end stop \[N\].
    pub stop_force: f64,
    /// Largest pressure of any chamber \[Pa\].
    pub peak_pressure: f64,
    /// Largest pressure that is to be expected: the limit, and what shutting the valve at speed adds \[Pa\].
    pub pressure_bound: f64,
    /// Whether the supervisor must find it.
    pub must_be_found: bool,
    /// Largest movement that is to be expected, computed from the limits \[m\].
    pub movement_bound: f64,
    /// Longest time until the machine is safe that is to be expected \[s\]; none for faults that are
    /// not found, or take drive or valve away.
    pub time_bound: Option<f64>,
    /// Why the machine broke, where it did.
    pub broke: Option<SimulationError>,
}

impl Outcome {
    /// Whether it was found where it must be, and movement, time, pressure and end stops keep to their bounds.
    pub fn is_within_bounds(&self) -> bool {
        let in_time = match (self.cause, self.time_bound) {
            (Some(_), Some(bound)) => self.safe_after.is_some_and(|time| time <= bound),
            _ => true,
        };
        // a load that nothing holds may come to its end stop
        let may_touch =
            matches!(self.fault, Fault::ValveStuckOpen | Fault::PayloadDropped | Fault::LineBurst);
        self.broke.is_none()
            && (self.cause.is_some() || !self.must_be_found)
            && self.moved <= self.movement_bound
            && in_time
            && self.peak_pressure <= self.pressure_bound
            && (self.stop_force == 0.0 || may_touch)
    }
}

/// A case takes no longer than its course and this \[s\]: a release, a stop, and two seconds more.
const LONGEST: f64 = 45.0;
/// A second fault comes so long after the first one \[s\].
const SECOND_AFTER: f64 = 0.02;
/// A safe machine is watched for so long \[s\].
const WATCHED: f64 = 2.0;
/// Position of the pilots, and motor speed \[rev/s\], below which the machine is safe.
const SAFE: (f64, f64) = (0.05, 0.2);

/// A course on its way, in simulated time, up to the moment at which something is to go wrong: what
/// is the same for every fault, and is run once.
pub struct Underway {
    run: Lockstep,
    operator: Operator,
    trouble: Trouble,
    limits: Limits,
    machine: Description,
    motion: OutAndBack<f64>,
    strategy: Strategy,
    moment: Moment,
    /// Control period \[s\].
    period: f64,
    /// Periods that are left at most.
    left: u32,
    course_time: Option<f64>,
    /// What stopped the course before anything went wrong, if it did.
    stopped: Option<Cause>,
    /// Why the machine broke before anything went wrong, if it did.
    broke: Option<SimulationError>,
}

impl Underway {
    /// Runs the course up to the moment.
    ///
    /// # Errors
    ///
    /// [`SetupError`] when the cranes cannot be built, or there are no limits for the model.
    pub fn until(
        model: &Description,
        machine: &Description,
        motion: OutAndBack<f64>,
        strategy: Strategy,
        moment: Moment,
    ) -> Result<Self, SetupError> {
        let period = model.numbers.control_period;
        let mut way = Self {
            run: Lockstep::new(model, machine, motion, strategy)?,
            operator: Operator::automatic(period),
            trouble: Trouble::new(machine),
            limits: limits(model, motion.speed)?,
            machine: machine.clone(),
            motion,
            strategy,
            moment,
            period,
            left: ((motion.duration() + LONGEST) / period) as u32,
            course_time: None,
            stopped: None,
            broke: None,
        };
        let mut turning = 0;
        while way.left > 0 && way.stopped.is_none() && !way.has_come(turning) {
            way.left -= 1;
            match way.run.disturbed_period(&mut way.operator, strategy, &mut way.trouble) {
                Ok(record) => {
                    way.course_time = record.course_time.or(way.course_time);
                    way.stopped = record.decision.cause;
                    let turns =
                        record.decision.releasing && record.decision.command.motor_speed != 0.0;
                    turning += u32::from(turns);
                }
                Err(error) => {
                    way.broke = Some(error);
                    break;
                }
            }
        }
        Ok(way)
    }

    /// Whether the moment has come, after so many periods in which the pump has filled its side.
    fn has_come(&self, turning: u32) -> bool {
        match self.moment.course_time(&self.motion) {
            Some(time) => self.course_time.is_some_and(|now| now >= time),
            None => self.moment == Moment::BeforeStart || f64::from(turning) * self.period > 0.5,
        }
    }

    /// What stopped the course before anything went wrong, if it did.
    pub fn stopped(&self) -> Option<Cause> {
        self.stopped
    }

    /// What comes of a fault, and of another one on top of it, from here to the end of the course or
    /// two seconds of safety.
    pub fn inject(&self, fault: Fault, second: Option<Fault>) -> Outcome {
        let bounds = self.bounds(fault, second);
        let mut outcome = Outcome {
            fault,
            second,
            strategy: self.strategy,
            moment: self.moment,
            cause: self.stopped,
            safe_after: None,
            fallback: false,
            moved: 0.0,
            dropped: 0.0,
            stop_force: 0.0,
            peak_pressure: 0.0,
            pressure_bound: self.pressure_bound(),
            must_be_found: must_be_found(fault, self.moment) && !self.is_unseen(fault, second),
            movement_bound: bounds.movement,
            time_bound: bounds.time,
            broke: self.broke,
        };
        if outcome.broke.is_some() || outcome.cause.is_some() {
            return outcome;
        }
        let (mut run, mut operator) = (self.run.clone(), self.operator);
        let mut trouble = self.trouble.clone();
        trouble.tamper(Tampering::Fault(fault));
        operator.emergency |= fault == Fault::EmergencyStop;
        let n = &self.machine.numbers;
        let began = run.truth().outputs.stroke;
        let mut course_time = self.course_time;
        let (mut error_before, mut stopped_at, mut watched) = (None, None, 0);
        let second_at = (SECOND_AFTER / self.period) as u32;
        for since in 0..self.left {
            if f64::from(watched) * self.period >= WATCHED {
                break;
            }
            if let Some(second) = second.filter(|_| since == second_at) {
                trouble.add(second);
                operator.emergency |= second == Fault::EmergencyStop;
            }
            let record = match run.disturbed_period(&mut operator, self.strategy, &mut trouble) {
                Ok(record) => record,
                Err(error) => {
                    outcome.broke = Some(error);
                    return outcome;
                }
            };
            trouble.pass();
            course_time = record.course_time.or(course_time);
            let truth = run.truth();
            let o = &truth.outputs;
            outcome.fallback |= record.fallback.is_some();
            let pressures = [o.pressure_a, o.pressure_b, o.pressure_pump_a, o.pressure_pump_b];
            outcome.peak_pressure = pressures.into_iter().fold(outcome.peak_pressure, f64::max);
            let beyond = (o.stroke - n.stroke).max(-o.stroke).max(0.0);
            outcome.stop_force = outcome.stop_force.max(beyond * n.stop_stiffness);
            if self.moment.course_time(&self.motion).is_none() && course_time.is_none() {
                outcome.dropped = outcome.dropped.max(began - o.stroke);
            }
            let is_fault = record.decision.state == State::Fault;
            if is_fault {
                outcome.cause = record.decision.cause;
                stopped_at.get_or_insert(o.stroke);
            }
            match (stopped_at, course_time) {
                (Some(at), _) => outcome.moved = outcome.moved.max((o.stroke - at).abs()),
                (None, Some(time)) => {
                    let error = o.stroke - self.motion.reference(time).position;
                    let before = *error_before.get_or_insert(error);
                    outcome.moved = outcome.moved.max((error - before).abs());
                }
                (None, None) => outcome.moved = outcome.moved.max((o.stroke - began).abs()),
            }
            let done = is_fault || (operator.is_done() && record.decision.is_at_rest());
            if done && is_safe(&truth) {
                outcome.safe_after.get_or_insert(f64::from(since + 1) * self.period);
            }
            // a machine that cannot become safe, its valve stuck say, is watched all the same
            watched += u32::from(done && record.decision.is_at_rest());
        }
        if outcome.cause.is_none() {
            outcome.safe_after = None;
        }
        outcome
    }

    /// Movement and time to be expected: how long the fault may go unfound, how fast the piston is
    /// meanwhile, and what the stop takes.
    fn bounds(&self, fault: Fault, second: Option<Fault>) -> Bounds {
        let (l, n) = (&self.limits, &self.machine.numbers);
        let speed = self.motion.speed * self.moment.share_of_speed();
        let tracking = match self.strategy.measures() {
            true => n.supervision_tracking,
            false => n.supervision_tracking_open_loop,
        };
        let until_found = detection_time(fault, l);
        let swing = speed * l.still.1 / std::f64::consts::TAU;
        // the valve, and the motor's way to zero
        let stop = l.valve_time.max(l.motor_speed / l.motor_slew) + l.stop_time;
        // until it is found, the piston strays as far as tracking allows, or a course goes on
        let strays = match until_found {
            Some(time) => (self.motion.speed * (time + l.valve_time)).min(tracking + l.creep),
            None => tracking + l.creep,
        };
        // a lift for the proof, and the boom that springs up when its load falls off or oil runs out
        let lift = l.release.largest_motion + l.creep;
        let spring = match fault {
            Fault::PayloadDropped | Fault::LineBurst => self.spring_back(),
            _ => 0.0,
        };
        let uncommanded = match fault {
            // behind a shut valve nothing but the drive's own power stop ends what it lifts
            Fault::DriveLifts | Fault::DriveLowers => {
                let turned = 5.0 * l.speed_per_motor_speed;
                turned * (until_found.unwrap_or(0.0) + stop + WATCHED)
            }
            Fault::ValveStuckOpen => 0.5 * self.motion.speed * WATCHED,
            _ => 0.0,
        };
        let movement = strays + self.motion.speed * stop + swing + lift + spring + uncommanded;
        let takes_away = matches!(
            fault,
            Fault::ValveStuckOpen | Fault::DriveLifts | Fault::DriveLowers | Fault::DriveReversed
        );
        // a control task that is held up finds and stops later
        let held_up = match (fault, second) {
            (Fault::ControlStopped(time), _) => f64::from(time) * 1e-3,
            (Fault::ControlStarved, _) | (_, Some(Fault::ControlStarved)) => 26.0 * l.period,
            _ => 0.0,
        };
        let second_after = if second.is_some() { SECOND_AFTER } else { 0.0 };
        // a machine that is not enabled yet waits for plausible readings before it gives up
        let waits = if self.moment == Moment::BeforeStart { l.wait_time } else { 0.0 };
        let time = until_found
            .filter(|_| !takes_away)
            .map(|found| found + second_after + stop + held_up + waits + 0.1);
        Bounds { movement, time }
    }

    /// Whether the second fault keeps the first one from showing: without an operator a machine that has
    /// not been started does nothing, and a control task that is starved twice is never executed.
    fn is_unseen(&self, fault: Fault, second: Option<Fault>) -> bool {
        let is_idle = self.moment == Moment::BeforeStart && second == Some(Fault::OperatorGone);
        is_idle || second == Some(fault)
    }

    /// The limit, and what a load adds that is stopped at speed by trapped oil: it compresses the stiff
    /// chamber by the way v/ω of its swing \[Pa\].
    fn pressure_bound(&self) -> f64 {
        let (l, n) = (&self.limits, &self.machine.numbers);
        let way = self.motion.speed * l.still.1 / std::f64::consts::TAU;
        let area = self.machine.cylinder().piston_area;
        l.pressure + n.bulk_modulus_max * area * way / n.dead_volume_a
    }

    /// How far the piston springs up when its load falls off: the oil of both volumes expands to the
    /// pressure of the empty boom, twice as far while it swings \[m\].
    fn spring_back(&self) -> f64 {
        let n = &self.machine.numbers;
        let cylinder = self.machine.cylinder();
        let volume = n.dead_volume_a + cylinder.piston_area * n.stroke + n.volume_pump_a;
        let oil = hydroboom_model::hydraulics::Oil {
            bulk_modulus_max: n.bulk_modulus_max,
            bulk_modulus_min: n.bulk_modulus_min,
            transition_pressure: n.transition,
            transition_slope: 1.0 / n.transition_width,
            vapour_pressure: n.vapour_pressure,
        };
        let most = self.limits.release.most_pressure;
        let least = self.limits.release.least_pressure;
        2.0 * volume * (oil.compression(most) - oil.compression(least)) / cylinder.piston_area
    }
}

/// Expected movement \[m\] and time \[s\].
struct Bounds {
    movement: f64,
    time: Option<f64>,
}

/// Time after which a fault is found at the latest while the load moves \[s\]; none where that hangs on
/// how far the piston strays, or nothing is to be found.
fn detection_time(fault: Fault, l: &Limits) -> Option<f64> {
    let periods = 3.0 * l.period;
    match fault {
        Fault::Sensor(_, Sensor::NotANumber) => Some(periods),
        Fault::MachineKilled | Fault::MachinePaused => Some(l.stale + periods),
        // its valve was shut for a moment, which pump side and cylinder show
        Fault::MachineRestarted => Some(l.stale + l.valve_time + l.pressure_agreement.1 + periods),
        Fault::OperatorGone | Fault::EmergencyStop | Fault::ClockJump => Some(periods),
        Fault::ControlStopped(time) => Some(f64::from(time) * 1e-3 + periods),
        Fault::ControlStarved => Some(f64::from(l.missed + 26) * l.period),
        _ => None,
    }
}

/// Whether the supervisor must find a fault that begins at a moment.
///
/// Not to be found are signals that are late or, of the motor speed, noisy; what a copy of a pressure or a
/// faulty part does not show while the machine does not need it; and interruptions that nothing has felt.
fn must_be_found(fault: Fault, moment: Moment) -> bool {
    let acts = moment != Moment::BeforeStart;
    match fault {
        Fault::Sensor(_, Sensor::Delayed) | Fault::Sensor(MOTOR_SPEED, Sensor::Noisy) => false,
        Fault::Sensor(..) => true,
        Fault::Pressure(wrong) => {
            !matches!(wrong, WrongPressure::LoadCopiesPump | WrongPressure::PumpCopiesLoad)
        }
        Fault::Position(wrong) => wrong != WrongPosition::Gain5,
        // an empty hook is a load as well
        Fault::PayloadDropped => acts,
        Fault::MachinePaused | Fault::OperatorGone | Fault::ClockJump => acts,
        Fault::ControlStopped(time) => acts && time >= 60,
        Fault::MachineRestarted
        | Fault::SimulationSlowed
        | Fault::SimulationKilled
        | Fault::ValveStuckOpen => false,
        Fault::MachineKilled
        | Fault::ControlStarved
        | Fault::DriveSaturated
        | Fault::DriveReversed
        | Fault::DriveDead
        | Fault::DriveLifts
        | Fault::DriveLowers
        | Fault::ValveStuckShut
        | Fault::LineBurst
        | Fault::EmergencyStop => true,
    }
}

/// Place of the motor speed in a reading.
const MOTOR_SPEED: usize = 6;

/// Whether the machine is safe: its pilots without pressure, its motor at rest.
fn is_safe(truth: &Truth) -> bool {
    truth.pilot < SAFE.0 && truth.motor_speed.abs() < SAFE.1
}
