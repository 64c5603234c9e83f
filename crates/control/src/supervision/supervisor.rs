//! Supervisor: state machine that releases, holds and stops the load.
//!
//! A pure state machine, called once an executed control period; it allocates nothing and knows no
//! clock but the time that each observation says has passed.
//!
//! ```text
//! Idle -enable-> Ready -hold-> Holding -start, proof of balance-> Moving -stop, course over-> Stopping -> Holding
//!   any fault -> Fault -reset by an operator, all well-> Ready
//! ```
//!
//! It is no safety function in the sense of ISO 13849: it runs on an ordinary computer, by an
//! ordinary program. A hardware emergency stop that cuts drive and valve stays where it is.

mod decision;
mod monitors;
mod stop;

pub use decision::{Decision, Request, State};
pub use stop::CONTROLLED_RAMP;

use super::deadline_monitor::DeadlineMonitor;
use super::drive_monitor::DriveMonitorState;
use super::fault::{Cause, Reaction};
use super::flow_monitor::FlowMonitorState;
use super::limits::{Limits, MachineStatus, Observation, ValveState};
use super::oscillation_detector::{OscillationDetector, OscillationState};
use super::plausibility::Plausibility;
use super::release::{Refusal, ReleaseInput, ReleaseState, phase};
use super::waiting::Waiting;
use crate::command::AxisCommand;
use crate::measurement::AxisSignals;
use decision::HELD;
use stop::Stop;

/// Supervisor of one axis: state machine, monitors and limits.
#[derive(Clone, Debug)]
pub struct Supervisor {
    limits: Limits,
    state: State,
    cause: Option<Cause>,
    command: AxisCommand<f64>,
    /// Time in this state \[s\].
    since: f64,
    waiting: Waiting,
    waited: f64,
    /// The release under way.
    release: Option<ReleaseState<f64>>,
    /// The stop under way, in [`State::Stopping`] and [`State::Fault`].
    stop: Stop,
    /// Position at which the load is held, or was when the valve was energised \[m\].
    held_at: Option<f64>,
    /// Time since the valve was last commanded to switch \[s\].
    valve_since: f64,
    /// Time for which everything has been well in [`State::Fault`] \[s\].
    well_for: f64,
    /// Time for which pump side and cylinder have disagreed behind an open valve \[s\].
    disagreeing: f64,
    plausibility: Plausibility,
    deadlines: DeadlineMonitor,
    /// The same of measurements that were lost on their way.
    losses: DeadlineMonitor,
    drive: DriveMonitorState<f64>,
    flow: FlowMonitorState,
    /// Time since the reading that the flow monitor took in last \[s\].
    unread: f64,
    oscillating: OscillationState<f64>,
    oscillation: Option<[f64; 2]>,
    /// Reference of the period before \[m\].
    reference: f64,
}

impl Supervisor {
    /// A supervisor in [`State::Idle`].
    pub fn new(limits: Limits) -> Self {
        Self {
            limits,
            state: State::Idle,
            cause: None,
            command: HELD,
            since: 0.0,
            waiting: Waiting::Enable,
            waited: 0.0,
            release: None,
            stop: Stop { reaction: Reaction::ImmediateStop, from: 0.0, since: 0.0 },
            held_at: None,
            valve_since: f64::INFINITY,
            well_for: 0.0,
            disagreeing: 0.0,
            plausibility: Plausibility::default(),
            deadlines: DeadlineMonitor::default(),
            losses: DeadlineMonitor::default(),
            drive: DriveMonitorState::default(),
            flow: FlowMonitorState::default(),
            unread: 0.0,
            oscillating: OscillationState::default(),
            oscillation: None,
            reference: 0.0,
        }
    }

    /// Sets the largest piston speed of the course, [`Limits::speed`] \[m/s\], zero or more.
    ///
    /// A piston runs away if it exceeds this speed and that at the largest motor speed by the factor
    /// [`RUNAWAY`](super::plausibility::RUNAWAY).
    pub fn set_speed(&mut self, speed: f64) {
        self.limits.speed = speed;
    }

    /// Present state.
    pub fn state(&self) -> State {
        self.state
    }

    /// Limits of the machine and settings of its monitors.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Longest time from any fault to the safe state \[s\]: motor at zero, valve de-energised.
    ///
    /// It is the longer of a controlled stop and of braking from the largest motor speed, plus two control periods.
    pub fn bound(&self) -> f64 {
        let brake = self.limits.motor_speed / self.limits.motor_slew;
        self.limits.stop_time.max(brake) + 2.0 * self.limits.period
    }

    /// One control period: from observation and request to the command.
    ///
    /// An elapsed time that is not positive and finite is a fault, and counts as one control period.
    pub fn advance(&mut self, seen: &Observation, request: Request) -> Decision {
        let has_passed = seen.elapsed.is_finite() && seen.elapsed > 0.0;
        let elapsed = if has_passed { seen.elapsed } else { self.limits.period };
        self.since += elapsed;
        self.stop.since += elapsed;
        self.valve_since += elapsed;
        let wrong = self.judge(seen, elapsed, has_passed);
        let wrong = match request {
            Request::EmergencyStop => Some(Cause::EmergencyStop),
            _ => wrong,
        };
        match self.state {
            State::Idle => self.idle(request, wrong),
            State::Fault => self.fault(seen, request, wrong, elapsed),
            _ => match wrong {
                Some(cause) => self.fail(cause, seen),
                None => match self.state {
                    State::Ready => self.ready(seen, request),
                    State::Holding => self.holding(seen, request, elapsed),
                    State::Moving => self.moving(seen, request, elapsed),
                    State::Stopping => self.stopping(),
                    State::Idle | State::Fault => {}
                },
            },
        }
        self.waits(elapsed);
        Decision {
            command: self.command,
            state: self.state,
            cause: self.cause,
            controls: self.controls(),
            releasing: self.release.is_some(),
            waiting: self.waiting,
            waited: self.waited,
            oscillation: self.oscillation,
        }
    }

    /// Whether the controller has the load: the valve has had its time to open.
    fn controls(&self) -> bool {
        self.state == State::Moving && self.since >= self.limits.valve_time
    }

    /// Whether the valve has been commanded open for as long as it takes.
    fn has_opened(&self) -> bool {
        self.command.holding_valve > 0.0 && self.valve_since >= self.limits.valve_time
    }

    /// Whether the piston has been slow of late.
    fn is_still(&self) -> bool {
        self.plausibility.swing() < self.limits.still.0
    }

    /// Whether anything acts on the load.
    fn is_active(&self) -> bool {
        self.command != HELD || self.release.is_some()
    }

    fn enter(&mut self, state: State) {
        self.state = state;
        self.since = 0.0;
        self.release = None;
        self.held_at = None;
        self.well_for = 0.0;
        self.disagreeing = 0.0;
        self.waiting_for(match state {
            State::Idle => Waiting::Enable,
            State::Ready => Waiting::StillLoad,
            State::Holding => Waiting::Start,
            State::Moving => Waiting::ValveOpening,
            State::Stopping | State::Fault => Waiting::Standstill,
        });
    }

    /// Nothing acts. What is wrong is no fault yet, unless a machine that is to be enabled stays so.
    fn idle(&mut self, request: Request, wrong: Option<Cause>) {
        match (request, wrong) {
            (Request::EmergencyStop, _) => self.latch(Cause::EmergencyStop),
            (Request::Enable, None) => self.enter(State::Ready),
            (Request::Enable, Some(cause)) => {
                self.waiting_for(Waiting::Measurements(cause));
                if self.since >= self.limits.wait_time {
                    self.latch(cause);
                }
            }
            _ => self.since = 0.0,
        }
    }

    /// A fault of a machine on which nothing acts.
    fn latch(&mut self, cause: Cause) {
        self.enter(State::Fault);
        self.cause = Some(cause);
        self.stop = Stop { reaction: Reaction::ImmediateStop, from: 0.0, since: 0.0 };
        self.command = HELD;
    }

    fn ready(&mut self, seen: &Observation, request: Request) {
        self.switch(0.0);
        self.command.motor_speed = 0.0;
        // a load that still swings on its locked cylinder, after an emergency stop, would seem to creep
        let is_still = self.since >= self.limits.still.1 && self.is_still();
        if is_still {
            self.held_at.get_or_insert(seen.reading.stroke);
        }
        self.waiting_for(match (seen.attended, is_still) {
            (false, _) => Waiting::Operator,
            (true, false) => Waiting::StillLoad,
            (true, true) => Waiting::Hold,
        });
        if request != Request::Hold || !seen.attended {
            return;
        }
        if is_still {
            self.enter(State::Holding);
        } else if self.waited >= self.limits.wait_time {
            self.latch(Cause::LoadNotStill);
        }
    }

    /// The load hangs on its valves. Asked to start, the pump proves first that it carries the load:
    /// released onto an empty pump side, the load would fall by centimetres.
    fn holding(&mut self, seen: &Observation, request: Request, elapsed: f64) {
        self.switch(0.0);
        self.held_at.get_or_insert(seen.reading.stroke);
        // a machine that reports nothing is taken at its measurements
        let has_drives = seen.machine.is_none_or(|machine| machine == MachineStatus::Enabled);
        match request {
            Request::Start if seen.attended && self.release.is_none() && has_drives => {
                self.release = Some(self.limits.release.begin());
                self.held_at = Some(seen.reading.stroke);
            }
            Request::Stop => self.release = None,
            _ => {}
        }
        let Some(before) = self.release else {
            self.ramp(0.0);
            self.waiting_for(if has_drives { Waiting::Start } else { Waiting::Drives });
            // nothing moves, nobody is there: that is no fault, but the drive goes off
            if !seen.attended && self.command == HELD {
                self.enter(State::Ready);
            }
            return;
        };
        let [pump, load, other_pump, other] = self.sides(&seen.reading);
        let input = ReleaseInput {
            stroke: seen.reading.stroke,
            pressure_other: other,
            pressure_other_pump: other_pump,
            motor_speed: seen.reading.motor_speed,
            pressure_pump: pump,
            pressure_load: load,
            is_new: f64::from(u8::from(seen.new_readings > 0)),
        };
        let now = self.limits.release.advance(&before, &input, elapsed);
        self.release = Some(now);
        self.command.motor_speed = now.motor_speed;
        self.waiting_for(Waiting::of_release(now.phase));
        if let Some(refusal) = Refusal::from_phase(now.phase) {
            return self.fail(refusal.into(), seen);
        }
        if now.phase >= phase::PROVEN {
            self.enter(State::Moving);
            self.held_at = Some(seen.reading.stroke);
            self.switch(1.0);
            self.flow = FlowMonitorState::default();
            self.unread = 0.0;
            self.oscillating = OscillationState::default();
            self.oscillation = None;
        }
    }

    fn moving(&mut self, seen: &Observation, request: Request, elapsed: f64) {
        self.switch(1.0);
        self.waiting_for(match self.controls() {
            true => Waiting::CourseEnd,
            false => Waiting::ValveOpening,
        });
        if self.controls() {
            self.ramp(seen.wanted);
            self.watch_oscillation(seen, elapsed);
        }
        if request == Request::Stop || (self.controls() && seen.course_over) {
            self.begin_stop(Reaction::ControlledStop, &seen.reading, true);
            self.enter(State::Stopping);
        }
    }

    /// A loop in sustained oscillation is told; it is no fault while the piston keeps to its limits.
    fn watch_oscillation(&mut self, seen: &Observation, elapsed: f64) {
        let rests = seen.reference == self.reference;
        self.reference = seen.reference;
        let detector = OscillationDetector::POSITIONING;
        let error = seen.reference - seen.reading.stroke;
        if detector.update(&mut self.oscillating, error, rests, elapsed) {
            self.oscillation = Some(detector.amplitude_and_frequency(&self.oscillating));
        }
    }

    fn stopping(&mut self) {
        self.waiting_for(Waiting::Standstill);
        if self.continue_stop() {
            self.enter(State::Holding);
        }
    }

    /// The machine is in its safe state or on the way there. A more severe fault takes the place of
    /// the first one, with its harder reaction.
    fn fault(&mut self, seen: &Observation, request: Request, wrong: Option<Cause>, elapsed: f64) {
        if let (Some(before), Some(now)) = (self.cause, wrong)
            && now.severity() > before.severity()
        {
            return self.fail(now, seen);
        }
        if seen.elapsed > self.limits.watchdog {
            // the drive has stopped by itself meanwhile: nothing is left to be braked
            self.begin_stop(Reaction::ImmediateStop, &seen.reading, false);
        }
        let has_stopped = self.continue_stop();
        self.waiting_for(if has_stopped { Waiting::Reset } else { Waiting::Standstill });
        let turns = seen.reading.motor_speed.abs() > self.limits.drive.uncommanded;
        // a valve that cannot be read has had its time to shut, and the load is still behind it
        let is_shut = match seen.valve {
            Some(valve) => valve == ValveState::Shut,
            None => self.valve_since > self.limits.valve_time && self.is_still(),
        };
        let is_well = has_stopped && wrong.is_none() && !turns && is_shut;
        self.well_for = if is_well { self.well_for + elapsed } else { 0.0 };
        // a load that has crept is said to, and watched from where it is by then
        if wrong == Some(Cause::LoadNotHeld) {
            self.held_at = None;
        }
        if has_stopped && self.is_still() {
            self.held_at.get_or_insert(seen.reading.stroke);
        }
        // a signal that is well now and then is not well
        if request == Request::Reset && seen.attended && self.well_for > self.limits.still.1 {
            self.cause = None;
            self.enter(State::Ready);
        }
    }

    /// Commands the valve: 1 energised, 0 not.
    fn switch(&mut self, valve: f64) {
        if self.command.holding_valve != valve {
            self.command.holding_valve = valve;
            self.valve_since = 0.0;
        }
    }

    /// Commands a motor speed \[rev/s\] within speed and slew rate.
    fn ramp(&mut self, wanted: f64) {
        let reach = self.limits.motor_slew * self.limits.period;
        let now = self.command.motor_speed;
        let most = self.limits.motor_speed;
        self.command.motor_speed = wanted.max(-most).min(most).max(now - reach).min(now + reach);
    }

    fn waiting_for(&mut self, what: Waiting) {
        if self.waiting != what {
            self.waiting = what;
            self.waited = 0.0;
        }
    }

    /// Counts the time of waiting; states that say nothing else wait for what follows them.
    fn waits(&mut self, elapsed: f64) {
        match self.state {
            State::Idle if !matches!(self.waiting, Waiting::Measurements(_)) => {
                self.waiting_for(Waiting::Enable);
            }
            State::Fault if self.command != HELD => self.waiting_for(Waiting::Standstill),
            State::Fault => self.waiting_for(Waiting::Reset),
            _ => {}
        }
        self.waited += elapsed;
    }

    /// Pressures of the pump side and the cylinder chamber that carry the load, then of the others.
    fn sides(&self, r: &AxisSignals<f64>) -> [f64; 4] {
        let (a, b) = ([r.pressure_pump_a, r.pressure_a], [r.pressure_pump_b, r.pressure_b]);
        match self.limits.release.direction > 0.0 {
            true => [a[0], a[1], b[0], b[1]],
            false => [b[0], b[1], a[0], a[1]],
        }
    }
}

impl From<Refusal> for Cause {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::PositionNotSteady => Self::PositionNotSteady,
            Refusal::NoLift => Self::NoLift,
            Refusal::PressureDisagrees => Self::PressureDisagrees,
            Refusal::TrappedPressure => Self::TrappedPressure,
            Refusal::LoadTooHeavy => Self::LoadTooHeavy,
        }
    }
}
