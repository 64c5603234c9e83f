//! The supervisor: what the machine may do, and what brings it to rest.
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

use super::deadline_monitor::DeadlineMonitor;
use super::drive_monitor::DriveMonitorState;
use super::fault::{Cause, Reaction};
use super::flow_monitor::{FlowMonitorState, FlowReading};
use super::limits::{Limits, MachineStatus, Observation, ValveState};
use super::oscillation_detector::{OscillationDetector, OscillationState};
use super::plausibility::{Plausibility, RUNAWAY};
use super::release::{Refusal, ReleaseInput, ReleaseState, phase};
use super::waiting::Waiting;
use crate::command::AxisCommand;
use crate::measurement::AxisSignals;

/// What the machine is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Nothing has been asked for; nothing acts.
    Idle,
    /// Readings are plausible; nothing acts.
    Ready,
    /// The load hangs on its valves; before a motion the pump takes it over.
    Holding,
    /// The valves are open, the controller moves the load.
    Moving,
    /// The load is brought to rest, then held.
    Stopping,
    /// Something was wrong; the load is held until a person resets.
    Fault,
}

impl State {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Idle, Self::Ready, Self::Holding, Self::Moving, Self::Stopping, Self::Fault];

    /// Name in logs and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Idle => "Idle",
            Self::Ready => "Ready",
            Self::Holding => "Holding",
            Self::Moving => "Moving",
            Self::Stopping => "Stopping",
            Self::Fault => "Fault",
        }
    }

    /// The state of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.name() == name)
    }
}

/// What a person, or the program for him, asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Request {
    /// Nothing.
    #[default]
    None,
    /// Watch the machine.
    Enable,
    /// Switch the drive on, load held.
    Hold,
    /// Release the load and move.
    Start,
    /// Come to rest and hold.
    Stop,
    /// Hold at once.
    EmergencyStop,
    /// After a fault: watch the machine again.
    Reset,
}

/// What is to be sent, and what the machine is doing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision {
    /// What to send.
    pub command: AxisCommand<f64>,
    /// What the machine is doing.
    pub state: State,
    /// Why it is in [`State::Fault`].
    pub cause: Option<Cause>,
    /// Whether the controller has the load: then its course runs.
    pub controls: bool,
    /// Whether a release is under way: the pump proves that it carries the load.
    pub releasing: bool,
    /// What the state waits for.
    pub waiting: Waiting,
    /// For how long it has waited for that \[s\].
    pub waited: f64,
    /// Amplitude \[m\] and frequency \[Hz\] of a sustained oscillation that was found while the controller has had
    /// the load.
    pub oscillation: Option<[f64; 2]>,
}

impl Decision {
    /// Of a machine that nothing has been asked of: valve shut, motor at zero.
    pub const IDLE: Self = Self {
        command: HELD,
        state: State::Idle,
        cause: None,
        controls: false,
        releasing: false,
        waiting: Waiting::Enable,
        waited: 0.0,
        oscillation: None,
    };

    /// Whether motor and valve are commanded to rest.
    pub fn is_at_rest(&self) -> bool {
        self.command == HELD
    }

    /// Whether the machine's drives are to follow: from Holding on, and until a stop has ended.
    pub fn is_enabled(&self) -> bool {
        let acts = matches!(self.state, State::Holding | State::Moving | State::Stopping);
        acts || !self.is_at_rest()
    }
}

/// Motor at zero, load held.
const HELD: AxisCommand<f64> = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };

/// Time constant in which the peak velocity of a swinging load is forgotten, in periods of the load
/// mode: what counts is the last swing.
const SWING_MEMORY: f64 = 1.5;
/// Share of a controlled stop in which the motor is ramped to zero; the rest is the load's to come to rest.
pub const CONTROLLED_RAMP: f64 = 0.75;

/// A stop under way.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stop {
    reaction: Reaction,
    /// Motor speed as read when it began \[rev/s\].
    from: f64,
    /// Time since then \[s\].
    since: f64,
}

/// The supervisor at work.
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

    /// Allows for another largest speed of the piston \[m/s\].
    pub fn set_speed(&mut self, speed: f64) {
        self.limits.speed = speed;
    }

    /// What the machine is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// What is allowed.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Time within which every fault reaches the safe state: motor at zero, valve de-energised \[s\].
    pub fn bound(&self) -> f64 {
        let brake = self.limits.motor_speed / self.limits.motor_slew;
        self.limits.stop_time.max(brake) + 2.0 * self.limits.period
    }

    /// One control period.
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

    /// Goes to [`State::Fault`] with the reaction that suits the cause and what the machine does now.
    fn fail(&mut self, cause: Cause, seen: &Observation) {
        // a controlled stop needs a machine that still obeys: its valve is open, as read or, where it
        // cannot be read, as pump side and cylinder show that agree; and its watchdog has not stopped it
        let is_open = match seen.valve {
            Some(valve) => valve == ValveState::Open,
            None => self.has_opened() && self.disagreeing == 0.0,
        };
        let obeys =
            self.command.holding_valve > 0.0 && is_open && seen.elapsed <= self.limits.watchdog;
        let reaction = match cause.reaction() {
            Reaction::ControlledStop if obeys => Reaction::ControlledStop,
            _ => Reaction::ImmediateStop,
        };
        let is_trusted = seen.age <= self.limits.stale && seen.elapsed <= self.limits.watchdog;
        let is_stopping = matches!(self.state, State::Fault | State::Stopping);
        let goes_on = is_stopping && self.stop.reaction == reaction;
        if !goes_on {
            self.begin_stop(reaction, &seen.reading, is_trusted);
        }
        self.enter(State::Fault);
        self.cause = Some(cause);
        self.continue_stop();
    }

    /// Begins a stop from the motor's speed as read; a reading that is not trusted counts as a motor
    /// at rest, which the drive's own slew limit brakes.
    fn begin_stop(&mut self, reaction: Reaction, reading: &AxisSignals<f64>, is_trusted: bool) {
        let most = self.limits.motor_speed;
        let from = match is_trusted && reading.motor_speed.is_finite() {
            // no faster than the drive can be after what it was commanded
            true => self.drive.plausible(reading.motor_speed).max(-most).min(most),
            false => 0.0,
        };
        self.stop = Stop { reaction, from, since: 0.0 };
    }

    /// Goes on with a stop; true once motor and valve are commanded to rest.
    fn continue_stop(&mut self) -> bool {
        let Stop { reaction, from, since } = self.stop;
        match reaction {
            Reaction::ControlledStop => {
                let left = (1.0 - since / (CONTROLLED_RAMP * self.limits.stop_time)).max(0.0);
                self.command.motor_speed = from * left;
                if since >= self.limits.stop_time {
                    self.switch(0.0);
                }
            }
            Reaction::ImmediateStop => {
                self.switch(0.0);
                let braked = self.limits.motor_slew * since;
                self.command.motor_speed = from.signum() * (from.abs() - braked).max(0.0);
            }
        }
        if self.command.motor_speed == 0.0 {
            // a negative zero is a zero
            self.command.motor_speed = 0.0;
        }
        self.command == HELD
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

    /// The most severe of all that is wrong, if anything. Monitors of measurements, drive, valve and deadlines
    /// take in every period in every state; position against flow, and pump side against cylinder, while the
    /// valve is open; course and end stops while the controller moves the load.
    fn judge(&mut self, seen: &Observation, elapsed: f64, has_passed: bool) -> Option<Cause> {
        let l = self.limits;
        let r = &seen.reading;
        let mut wrong: Option<Cause> = None;
        let mut found = |cause: Cause| wrong = Some(wrong.map_or(cause, |w| w.worse(cause)));

        if seen.clock_jumped || !has_passed {
            found(Cause::ClockJumped);
        }
        // first, because readings step over such an interval
        let is_active = self.is_active();
        if is_active && (elapsed > l.watchdog || seen.commands_lost) {
            found(Cause::WatchdogExpired);
        }
        match seen.machine {
            Some(MachineStatus::Fault { .. }) => found(Cause::MachineFault),
            Some(MachineStatus::Absent | MachineStatus::Starting) => found(Cause::MachineNotReady),
            Some(MachineStatus::Ready) if is_active => found(Cause::MachineNotReady),
            Some(MachineStatus::Ready | MachineStatus::Enabled) | None => {}
        }
        // pressures that were shut in step when the valve opens or shuts
        let is_switching = self.valve_since < l.valve_time + l.stale;
        if let Some(cause) = self.plausibility.judge(seen, &l, is_switching) {
            found(cause);
        }
        self.plausibility.remember(seen, &l, SWING_MEMORY * l.still.1);
        if self.deadlines.executed(seen.missed) > l.missed {
            found(Cause::Overruns);
        }
        if seen.new_readings > 0 && self.losses.executed(seen.lost_readings) > l.missed {
            found(Cause::MeasurementsLost);
        }
        if self.state != State::Fault && is_active && !seen.attended {
            found(Cause::OperatorLost);
        }
        if r.motor_speed.is_finite() && self.state != State::Idle {
            let commanded = self.command.motor_speed;
            let load = r.pressure_pump_a - r.pressure_pump_b;
            let verdict = l.drive.judge(&mut self.drive, commanded, r.motor_speed, load, elapsed);
            if verdict.uncommanded {
                found(Cause::DriveUncommanded);
            } else if verdict.deviates && is_active {
                found(Cause::DriveNotFollowing);
            }
        }
        let commanded = match self.command.holding_valve > 0.0 {
            true => ValveState::Open,
            false => ValveState::Shut,
        };
        let has_switched = self.valve_since > l.valve_time + l.stale;
        if self.state != State::Idle && has_switched && seen.valve.is_some_and(|v| v != commanded) {
            found(Cause::ValveNotFollowing);
        }
        // faster than the pump can drive it: the piston moves by itself
        let fastest = l.motor_speed * l.speed_per_motor_speed;
        if self.plausibility.velocity().abs() > RUNAWAY * fastest.max(l.speed) {
            found(Cause::Runaway);
        }
        match self.state {
            State::Ready | State::Holding | State::Fault => {
                // a release lifts the load, and never lowers it
                let moved = self.held_at.map_or(0.0, |at| r.stroke - at);
                let against = -l.release.direction * moved;
                let releasing = self.release.is_some();
                if (if releasing { against } else { moved.abs() }) > l.creep {
                    found(Cause::LoadNotHeld);
                }
            }
            State::Moving if !self.controls() => {
                let sank = self.held_at.map_or(0.0, |at| l.release.direction * (at - r.stroke));
                if sank > l.creep {
                    found(Cause::LoadSank);
                }
            }
            State::Moving => {
                if !seen.wanted.is_finite() {
                    found(Cause::ControllerInvalid);
                }
                // a reference that is not a number is no reference
                let is_near = (r.stroke - seen.reference).abs() <= seen.tracking;
                if !is_near {
                    found(Cause::TrackingError);
                }
                // slower than this a piston may touch its stop
                let touches = l.creep / l.still.1;
                let velocity = self.plausibility.velocity();
                let margin = l.end_margin(velocity);
                let is_low = r.stroke < margin && velocity < -touches;
                let is_high = r.stroke > l.stroke - margin && velocity > touches;
                if is_low || is_high {
                    found(Cause::EndOfStroke);
                }
            }
            _ => {}
        }
        if self.has_opened() {
            let [pump, load, other_pump, _] = self.sides(r);
            let (most, time) = l.pressure_agreement;
            let apart = (pump - load).abs() > most;
            self.disagreeing = if apart { self.disagreeing + elapsed } else { 0.0 };
            if self.disagreeing > time {
                found(Cause::PressureDisagrees);
            }
            let reading = FlowReading {
                stroke: r.stroke,
                motor_speed: r.motor_speed,
                pressures: [pump, load, other_pump, r.pressure_accumulator],
            };
            // where readings were missed, the pump has delivered all the same
            self.unread += elapsed;
            if seen.new_readings > 0 {
                let unread = core::mem::take(&mut self.unread);
                if l.flow.advance(&mut self.flow, &reading, unread) > 0.0 {
                    found(Cause::PositionFlowDisagree);
                }
            }
        }
        wrong
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
