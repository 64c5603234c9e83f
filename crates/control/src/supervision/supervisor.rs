//! The supervisor: what the machine may do, and what brings it to rest.
//!
//! A pure state machine, called once a control period; it allocates nothing and knows no clock but
//! the one it is given.
//!
//! ```text
//! Idle -enable-> Ready -hold-> Holding -start, pre-loaded-> Moving -stop, course over-> Stopping -> Holding
//!   any fault -> Fault -reset, all well-> Ready
//! ```
//!
//! It is no safety function in the sense of ISO 13849: it runs on an ordinary computer, by an
//! ordinary program. A hardware emergency stop that cuts drive and valve stays where it is.

use super::fault::Cause;
use super::limits::{Limits, Observation};
use super::plausibility::{Plausibility, RUNAWAY};
use crate::signals::Command;

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
    pub command: Command<f64>,
    /// What the machine is doing.
    pub state: State,
    /// Why it is in [`State::Fault`].
    pub cause: Option<Cause>,
    /// Whether the controller has the load: then its course runs.
    pub controls: bool,
}

/// The supervisor at work.
#[derive(Clone, Debug)]
pub struct Supervisor {
    limits: Limits,
    state: State,
    cause: Option<Cause>,
    command: Command<f64>,
    /// Time in this state \[s\].
    since: f64,
    /// Whether the load has been asked to move.
    starting: bool,
    /// Time that the pump has been pre-loaded \[s\].
    preloaded: f64,
    /// Motor speed that the pump's leakage takes \[rev/s\].
    leakage: f64,
    /// Motor speed when stopping began \[rev/s\].
    stopping_from: f64,
    /// Position at which the load is held \[m\].
    held_at: Option<f64>,
    /// Time that the drive has not followed \[s\].
    deviating: f64,
    plausibility: Plausibility,
}

/// Motor speed per pressure that the pump side lacks while it is pre-loaded \[rev/s per Pa\].
const PRELOAD_GAIN: f64 = 0.5e-5;
/// Time in which the speed that the leakage takes is found \[s\].
const PRELOAD_RESET: f64 = 0.5;
/// Largest motor speed while pre-loading \[rev/s\].
const PRELOAD_SPEED: f64 = 8.0;
/// The pump side must stay pre-loaded for so long before the load is released \[s\].
const PRELOADED: f64 = 0.1;
/// A load is still once its piston has been slower than this \[m/s\] for so long \[s\], a swing.
const STILL_SPEED: f64 = 0.015;
const STILL_TIME: f64 = 0.35;
/// A load is brought to rest within this time \[s\], if the cause allows for it.
pub const SOFT_STOP: f64 = 0.4;

impl Supervisor {
    /// A supervisor in [`State::Idle`].
    pub fn new(limits: Limits) -> Self {
        Self {
            limits,
            state: State::Idle,
            cause: None,
            command: Command { motor_speed: 0.0, holding_valve: 0.0 },
            since: 0.0,
            starting: false,
            preloaded: 0.0,
            leakage: 0.0,
            stopping_from: 0.0,
            held_at: None,
            deviating: 0.0,
            plausibility: Plausibility::default(),
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

    /// Time within which every fault reaches the safe state: motor at zero, valve de-energised \[s\].
    pub fn bound(&self) -> f64 {
        let ramp = self.limits.motor_speed / self.limits.motor_slew;
        SOFT_STOP.max(ramp) + 2.0 * self.limits.period
    }

    /// One control period.
    pub fn advance(&mut self, seen: &Observation, request: Request) -> Decision {
        self.since += self.limits.period;
        let begins = match self.state {
            State::Idle => request == Request::Enable,
            State::Fault => request == Request::Reset && self.is_at_rest(),
            _ => false,
        };
        if begins {
            // what was wrong before is judged by new readings only
            self.plausibility = Plausibility::default();
            self.deviating = 0.0;
        }
        let wrong = self.what_is_wrong(seen, request);
        self.plausibility.remember(seen, &self.limits);
        match (self.state, wrong) {
            (State::Fault | State::Idle, None) if begins => {
                self.cause = None;
                self.enter(State::Ready);
            }
            // a machine that is not watched yet has no faults
            (State::Fault | State::Idle, _) => {}
            (_, Some(cause)) => {
                self.cause = Some(cause);
                self.stopping_from = self.command.motor_speed;
                self.enter(State::Fault);
            }
            (_, None) => {}
        }
        match self.state {
            State::Idle => {}
            State::Ready => self.ready(seen, request),
            State::Holding => self.holding(seen, request),
            State::Moving => self.moving(seen, request),
            State::Stopping => self.stopping(),
            State::Fault => self.faulty(),
        }
        Decision {
            command: self.command,
            state: self.state,
            cause: self.cause,
            controls: self.controls(),
        }
    }

    /// Whether the controller has the load: the valve has had its time to open.
    fn controls(&self) -> bool {
        self.state == State::Moving && self.since >= self.limits.valve_time
    }

    fn is_at_rest(&self) -> bool {
        self.command.motor_speed == 0.0 && self.command.holding_valve == 0.0
    }

    fn enter(&mut self, state: State) {
        self.state = state;
        self.since = 0.0;
        self.starting = false;
        self.preloaded = 0.0;
        self.leakage = 0.0;
        self.held_at = None;
    }

    fn ramp(&mut self, wanted: f64) {
        let reach = self.limits.motor_slew * self.limits.period;
        let now = self.command.motor_speed;
        let most = self.limits.motor_speed;
        self.command.motor_speed = wanted.clamp(-most, most).clamp(now - reach, now + reach);
    }

    fn ready(&mut self, seen: &Observation, request: Request) {
        self.command.holding_valve = 0.0;
        self.ramp(0.0);
        // a load that still swings on its locked cylinder, after an emergency stop, would seem to creep
        let is_still = self.since >= STILL_TIME && self.plausibility.swing() < STILL_SPEED;
        if request == Request::Hold && seen.attended && is_still {
            self.enter(State::Holding);
        }
    }

    /// The load hangs on its valves. Asked to start, the pump side is brought to the load's pressure
    /// first: released onto an empty one, the load would fall by centimetres.
    fn holding(&mut self, seen: &Observation, request: Request) {
        self.command.holding_valve = 0.0;
        match request {
            Request::Start if !self.starting => {
                self.starting = true;
                self.since = 0.0;
            }
            Request::Stop => self.starting = false,
            _ => {}
        }
        self.held_at.get_or_insert(seen.reading.stroke);
        if !self.starting {
            self.ramp(0.0);
            // nothing moves, nobody is there: that is no fault, but the drive goes off
            if !seen.attended && self.is_at_rest() {
                self.enter(State::Ready);
            }
            return;
        }
        let lacking = seen.reading.pressure_a - seen.reading.pressure_pump_a;
        // quickly up, slowly at the end: the line's air gives way first, and then no more
        if lacking.abs() < 2.0 * self.limits.preload {
            // what leaks is found out near the end only
            self.leakage += PRELOAD_GAIN * lacking * self.limits.period / PRELOAD_RESET;
        }
        let speed = PRELOAD_GAIN * lacking + self.leakage;
        self.ramp(speed.clamp(-PRELOAD_SPEED, PRELOAD_SPEED));
        self.preloaded = match lacking.abs() < 0.5 * self.limits.preload {
            true => self.preloaded + self.limits.period,
            false => 0.0,
        };
        if self.preloaded >= PRELOADED {
            let speed = self.command.motor_speed;
            self.enter(State::Moving);
            self.command = Command { motor_speed: speed, holding_valve: 1.0 };
        }
    }

    fn moving(&mut self, seen: &Observation, request: Request) {
        self.command.holding_valve = 1.0;
        if self.controls() {
            self.ramp(seen.wanted);
        }
        if request == Request::Stop || (self.controls() && seen.course_over) {
            self.stopping_from = self.command.motor_speed;
            self.enter(State::Stopping);
        }
    }

    fn stopping(&mut self) {
        if self.slow_down(SOFT_STOP) {
            self.enter(State::Holding);
        }
    }

    fn faulty(&mut self) {
        match self.cause.is_some_and(Cause::stops_softly) && self.command.holding_valve > 0.0 {
            true => {
                self.slow_down(SOFT_STOP);
            }
            false => {
                self.command.holding_valve = 0.0;
                self.ramp(0.0);
            }
        }
    }

    /// Takes the motor to zero within a time \[s\], then the valve; true once both are.
    fn slow_down(&mut self, within: f64) -> bool {
        let left = (1.0 - self.since / (0.75 * within)).max(0.0);
        self.ramp(self.stopping_from * left);
        if self.since >= within {
            self.command.holding_valve = 0.0;
            self.ramp(0.0);
        }
        self.is_at_rest()
    }

    /// The first thing that is wrong, if any.
    fn what_is_wrong(&mut self, seen: &Observation, request: Request) -> Option<Cause> {
        if request == Request::EmergencyStop {
            return Some(Cause::EmergencyStop);
        }
        if let Some(cause) = self.plausibility.judge(seen, &self.limits) {
            return Some(cause);
        }
        let l = &self.limits;
        let reading = &seen.reading;
        if matches!(self.state, State::Holding | State::Moving | State::Stopping) {
            let is_resting = self.state == State::Holding && !self.starting && self.is_at_rest();
            if !seen.attended && !is_resting {
                return Some(Cause::OperatorLost);
            }
            let deviation = (reading.motor_speed - self.command.motor_speed).abs();
            self.deviating = match deviation > l.drive_deviation.0 {
                true => self.deviating + l.period,
                false => 0.0,
            };
            if self.deviating > l.drive_deviation.1 {
                return Some(Cause::DriveNotFollowing);
            }
        }
        if self.plausibility.velocity().abs() > RUNAWAY * l.speed {
            return Some(Cause::Runaway);
        }
        match self.state {
            State::Holding => {
                let moved = self.held_at.map_or(0.0, |at| (reading.stroke - at).abs());
                if moved > l.creep {
                    return Some(Cause::LoadNotHeld);
                }
                if self.starting && self.since > l.preload_time {
                    return Some(Cause::NoPreload);
                }
            }
            State::Moving if self.controls() => {
                if !seen.wanted.is_finite() {
                    return Some(Cause::ControllerInvalid);
                }
                if (reading.stroke - seen.reference).abs() > seen.tracking {
                    return Some(Cause::TrackingError);
                }
                let towards_end = (reading.stroke < l.margin && self.command.motor_speed < 0.0)
                    || (reading.stroke > l.stroke - l.margin && self.command.motor_speed > 0.0);
                if towards_end {
                    return Some(Cause::EndOfStroke);
                }
            }
            _ => {}
        }
        None
    }
}
