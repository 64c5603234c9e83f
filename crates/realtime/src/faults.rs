//! Fault-injection campaign: every fault at several moments, under every strategy, alone and with a second
//! fault, judged by the true state of the simulated machine.

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

/// Moment of a course at which a fault is injected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// From the first period on, before the start.
    BeforeStart,
    /// While the pump pre-loads its side, before the valve opens.
    PreLoad,
    /// In the middle of the first ramp, at half of the course's speed.
    Ramp,
    /// At constant speed, in the middle of the first travel.
    Cruise,
    /// At rest at the far end, with the load released.
    Rest,
}

impl Moment {
    /// All moments, in the order of the course.
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

    /// Time of the course \[s\]; none before the load is released.
    fn course_time(self, motion: &OutAndBack<f64>) -> Option<f64> {
        let travel = motion.travel_time();
        match self {
            Self::BeforeStart | Self::PreLoad => None,
            Self::Ramp => Some(motion.rest + 0.5 * motion.ramp),
            Self::Cruise => Some(motion.rest + 0.5 * travel),
            Self::Rest => Some(motion.rest + travel + 0.5 * motion.dwell),
        }
    }

    /// Speed of the piston at that moment as a share of the course's speed.
    fn share_of_speed(self) -> f64 {
        match self {
            Self::BeforeStart | Self::PreLoad | Self::Rest => 0.0,
            Self::Ramp => 0.5,
            Self::Cruise => 1.0,
        }
    }
}

/// Outcome of an injected fault, judged by the true state of the machine.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Injected fault.
    pub fault: Fault,
    /// Second fault, injected 20 ms later; none for a single fault.
    pub second: Option<Fault>,
    /// Active control strategy at the injection.
    pub strategy: Strategy,
    /// Moment of the injection.
    pub moment: Moment,
    /// Fault that the supervisor found last; none if the course was finished.
    pub cause: Option<Cause>,
    /// Time from the fault to the safe state, pilots without pressure and motor at rest \[s\]; none if it
    /// was not reached.
    pub safe_after: Option<f64>,
    /// Whether the benchmark controller took over from the requested strategy.
    pub fallback: bool,
    /// Largest movement of the piston after the fault \[m\]: deviation from the reference until the stop began, then
    /// distance from the position at that time.
    pub moved: f64,
    /// Largest drop of the piston below its held position, for faults before the release \[m\].
    pub dropped: f64,
    /// Largest force on an end stop \[N\].
    pub stop_force: f64,
    /// Largest pressure in any chamber \[Pa\], gauge.
    pub peak_pressure: f64,
    /// Upper bound of the pressure \[Pa\]: the supervised limit, and the rise when the valve shuts at speed.
    pub pressure_bound: f64,
    /// Whether the supervisor must detect the fault at this moment of the course.
    pub must_be_found: bool,
    /// Upper bound of the movement, computed from the limits \[m\].
    pub movement_bound: f64,
    /// Upper bound of the time to the safe state \[s\]; none for faults that are not detected, or that
    /// disable drive or valve.
    pub time_bound: Option<f64>,
    /// Error of the machine's simulation; none if it ran to the end.
    pub broke: Option<SimulationError>,
}

impl Outcome {
    /// Whether the fault was detected where required, and movement, time, pressure and end-stop force keep
    /// to their bounds, without an error of the simulation.
    ///
    /// The piston may touch an end stop only where the load has no support: with a valve stuck open, a burst line or
    /// a dropped payload. A NaN exceeds its bound.
    pub fn is_within_bounds(&self) -> bool {
        let in_time = match (self.cause, self.time_bound) {
            (Some(_), Some(bound)) => self.safe_after.is_some_and(|time| time <= bound),
            _ => true,
        };
        // a load without support may reach its end stop
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

/// Largest duration of a case in excess of its course \[s\]: a release, a stop and two seconds.
const LONGEST: f64 = 45.0;
/// Time from the first to the second fault \[s\].
const SECOND_AFTER: f64 = 0.02;
/// Observation time after the safe state is reached \[s\].
const WATCHED: f64 = 2.0;
/// Pilot position, and motor speed \[rev/s\], below which the machine is safe.
const SAFE: (f64, f64) = (0.05, 0.2);

/// Course simulated up to the moment of injection, from which every fault starts; it is simulated once for all faults.
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
    /// Remaining number of periods.
    left: u32,
    course_time: Option<f64>,
    /// Cause that stopped the course before the injection, if any.
    stopped: Option<Cause>,
    /// Simulation error before the injection, if any.
    broke: Option<SimulationError>,
}

impl Underway {
    /// Simulates the course up to the moment of injection.
    ///
    /// # Errors
    ///
    /// [`SetupError`] if a crane cannot be built or the model has no supervision limits.
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

    /// Whether the moment of injection has come. `turning`: periods in which the pump has pre-loaded its
    /// side.
    fn has_come(&self, turning: u32) -> bool {
        match self.moment.course_time(&self.motion) {
            Some(time) => self.course_time.is_some_and(|now| now >= time),
            None => self.moment == Moment::BeforeStart || f64::from(turning) * self.period > 0.5,
        }
    }

    /// Fault that stopped the course before the injection; none if it went on.
    pub fn stopped(&self) -> Option<Cause> {
        self.stopped
    }

    /// Injects a fault, and a second one 20 ms later if given. Simulates to the end of the course or two seconds of
    /// the safe state.
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
            // a machine that cannot reach the safe state, with its valve stuck for instance, is observed as
            // long
            watched += u32::from(done && record.decision.is_at_rest());
        }
        if outcome.cause.is_none() {
            outcome.safe_after = None;
        }
        outcome
    }

    /// Bounds of movement and time. They follow from the detection time, the piston's speed meanwhile, and
    /// the stopping time.
    fn bounds(&self, fault: Fault, second: Option<Fault>) -> Bounds {
        let (l, n) = (&self.limits, &self.machine.numbers);
        let speed = self.motion.speed * self.moment.share_of_speed();
        let tracking = match self.strategy.measures() {
            true => n.supervision_tracking,
            false => n.supervision_tracking_open_loop,
        };
        let until_found = detection_time(fault, l);
        let swing = speed * l.still.1 / std::f64::consts::TAU;
        // closing time of the valve, or the motor's ramp to zero
        let stop = l.valve_time.max(l.motor_speed / l.motor_slew) + l.stop_time;
        // until detection the piston deviates by at most the tracking limit, or the course continues
        let strays = match until_found {
            Some(time) => (self.motion.speed * (time + l.valve_time)).min(tracking + l.creep),
            None => tracking + l.creep,
        };
        // the lift in the proof of the release, and the boom's spring-back when the load falls off or oil
        // is lost
        let lift = l.release.largest_motion + l.creep;
        let spring = match fault {
            Fault::PayloadDropped | Fault::LineBurst => self.spring_back(),
            _ => 0.0,
        };
        let uncommanded = match fault {
            // behind a shut valve only the drive's own power stop ends the motion of an uncommanded drive
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
        // a suspended control task detects the fault and stops later
        let held_up = match (fault, second) {
            (Fault::ControlStopped(time), _) => f64::from(time) * 1e-3,
            (Fault::ControlStarved, _) | (_, Some(Fault::ControlStarved)) => 26.0 * l.period,
            _ => 0.0,
        };
        let second_after = if second.is_some() { SECOND_AFTER } else { 0.0 };
        // a machine that is not enabled yet waits for plausible measurements before the supervisor reports
        // a fault
        let waits = if self.moment == Moment::BeforeStart { l.wait_time } else { 0.0 };
        let time = until_found
            .filter(|_| !takes_away)
            .map(|found| found + second_after + stop + held_up + waits + 0.1);
        Bounds { movement, time }
    }

    /// Whether the second fault masks the first. Without an operator a machine that was not started stays
    /// idle, and a control task starved twice is never executed.
    fn is_unseen(&self, fault: Fault, second: Option<Fault>) -> bool {
        let is_idle = self.moment == Moment::BeforeStart && second == Some(Fault::OperatorGone);
        is_idle || second == Some(fault)
    }

    /// Upper bound of the pressure \[Pa\]: the limit, and the rise when trapped oil stops the load at speed
    /// v. The stiff chamber is compressed by the oscillation's amplitude v/ω.
    fn pressure_bound(&self) -> f64 {
        let (l, n) = (&self.limits, &self.machine.numbers);
        let way = self.motion.speed * l.still.1 / std::f64::consts::TAU;
        let area = self.machine.cylinder().piston_area;
        l.pressure + n.bulk_modulus_max * area * way / n.dead_volume_a
    }

    /// Spring-back of the piston when the load falls off \[m\]. The oil of both volumes expands to the
    /// pressure of the empty boom; the overshoot doubles the distance.
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

/// Bounds of movement \[m\] and time \[s\].
struct Bounds {
    movement: f64,
    time: Option<f64>,
}

/// Upper bound of the detection time while the load moves \[s\]; none if detection depends on the piston's
/// deviation, or is not required.
fn detection_time(fault: Fault, l: &Limits) -> Option<f64> {
    let periods = 3.0 * l.period;
    match fault {
        Fault::Sensor(_, Sensor::NotANumber) => Some(periods),
        Fault::MachineKilled | Fault::MachinePaused => Some(l.stale + periods),
        // the valve was shut for a moment, which the pressures of pump side and cylinder reveal
        Fault::MachineRestarted => Some(l.stale + l.valve_time + l.pressure_agreement.1 + periods),
        Fault::OperatorGone | Fault::EmergencyStop | Fault::ClockJump => Some(periods),
        Fault::ControlStopped(time) => Some(f64::from(time) * 1e-3 + periods),
        Fault::ControlStarved => Some(f64::from(l.missed + 26) * l.period),
        _ => None,
    }
}

/// Whether the supervisor must detect a fault that begins at a moment.
///
/// Detection is not required for delayed signals and noise of the motor speed. Nor is it required for
/// faults that do not show while the machine does not use the part, nor for interruptions without effect.
fn must_be_found(fault: Fault, moment: Moment) -> bool {
    let acts = moment != Moment::BeforeStart;
    match fault {
        Fault::Sensor(_, Sensor::Delayed) | Fault::Sensor(MOTOR_SPEED, Sensor::Noisy) => false,
        Fault::Sensor(..) => true,
        Fault::Pressure(wrong) => {
            !matches!(wrong, WrongPressure::LoadCopiesPump | WrongPressure::PumpCopiesLoad)
        }
        Fault::Position(wrong) => wrong != WrongPosition::Gain5,
        // before the start an empty hook is a valid load
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

/// Index of the motor speed in a measurement.
const MOTOR_SPEED: usize = 6;

/// Whether the machine is in the safe state: pilots without pressure, motor at rest.
fn is_safe(truth: &Truth) -> bool {
    truth.pilot < SAFE.0 && truth.motor_speed.abs() < SAFE.1
}
