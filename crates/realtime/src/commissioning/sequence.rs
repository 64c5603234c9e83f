//! Sequence of the steps: one call a control period.
//!
//! While the load-holding valve is shut, the sequence commands by itself and checks each measurement that arrives: it
//! is valid and in its range, the load is at rest, the machine has no fault. From the release on the supervisor
//! commands, with all its monitors, and the sequence adds narrower bounds. A step that fails ends the sequence with
//! motor zero, valve shut.
//!
//! The operator starts each motion: a confirmed reset starts none (ISO 13850, ISO 14118).

use super::finding::{Finding, Outcome, Reason};
use super::settings::Settings;
use super::step::{Prompt, Step};
use super::window::Window;
use crate::machine::{Incoming, Outgoing};
use hydroboom_control::command::{AxisCommand, Command};
use hydroboom_control::measurement::AXES;
use hydroboom_control::supervision::limits::{Limits, MachineStatus, Observation};
use hydroboom_control::supervision::supervisor::{Decision, Request, Supervisor};

mod checks;
mod held;
mod released;

/// Signals of an axis, and their places.
const SIGNALS: usize = 7;
const STROKE: usize = 0;
const MOTOR: usize = 6;
/// Time constant of smoothed signals \[s\].
const SMOOTHING: f64 = 0.02;
/// Time for which a motor brakes with torque after a failed step \[s\].
const BRAKING: f64 = 0.5;
/// Longest time of a supervised stop before the drives are switched off \[s\].
const STOPPING: f64 = 3.0;
/// Shortest time in which a prompt is read \[s\]: a line that comes before is a second Enter of the prompt before it.
const READING: f64 = 1.0;

/// Inputs of a period.
#[derive(Clone, Copy, Debug)]
pub struct Now {
    /// Time since the last executed period, by the machine's clock \[s\].
    pub elapsed: f64,
    /// Newest data of the machine; none before the first.
    pub incoming: Option<Incoming>,
    /// Periods missed since the last executed one.
    pub missed: u32,
    /// Whether the operator has confirmed the prompt.
    pub is_confirmed: bool,
    /// Whether the operator wants to end.
    pub is_ended: bool,
}

/// Output of a period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// A command to send.
    Send(Outgoing),
    /// Nothing is sent, so that the machine's own watchdog expires.
    Withhold,
    /// The operator has confirmed that the machine may be reset; with the command to send.
    Reset(Outgoing),
}

/// Measured quantities; NaN where one was not measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantities {
    /// Mean of each signal at rest, in the order of a measurement: stroke \[m\], pressures \[Pa\], motor speed
    /// \[rev/s\].
    pub rest: [f64; SIGNALS],
    /// Standard deviation of each signal at rest about its least-squares line, in the same order and units.
    pub noise: [f64; SIGNALS],
    /// The machine's code while the stop circuit was open; 0 where it reported no fault.
    pub stop_circuit_code: f64,
    /// Time from the last command until the speed signal was below the tolerance of the slow speed \[s\]; NaN where no
    /// measurement came meanwhile.
    pub watchdog: f64,
    /// Measured motor speed over the commanded one \[1\].
    pub motor_ratio: f64,
    /// Delay from commanded to measured motor speed, at half of the slow speed \[cycles\].
    pub motor_reaction: f64,
    /// Rise of the pump side's pressure in the slow turn \[Pa\].
    pub polarity_rise: f64,
    /// Revolutions of the motor until that rise \[rev\].
    pub polarity_revolutions: f64,
    /// Lift by the release \[m\].
    pub release_lift: f64,
    /// Duration of the release \[s\].
    pub release_time: f64,
    /// Travel by position against the load and back \[m\].
    pub travel: [f64; 2],
    /// Travel by position over travel by the pump's volume \[1\].
    pub scale: f64,
    /// Delay from sampling to actuation, as the machine's connection measures it \[cycles\].
    pub delay: f64,
    /// Stopping distance of the piston after the immediate stop \[m\].
    pub stop_distance: f64,
    /// Largest distance of the piston from its position at the begin, by the position signal \[m\].
    pub largest_movement: f64,
}

impl Default for Quantities {
    fn default() -> Self {
        let n = f64::NAN;
        Self {
            rest: [n; SIGNALS],
            noise: [n; SIGNALS],
            stop_circuit_code: n,
            watchdog: n,
            motor_ratio: n,
            motor_reaction: n,
            polarity_rise: n,
            polarity_revolutions: n,
            release_lift: n,
            release_time: n,
            travel: [n; 2],
            scale: n,
            delay: n,
            stop_distance: n,
            largest_movement: 0.0,
        }
    }
}

/// Result of one period of a step.
enum Next {
    /// The step goes on, with this action.
    Go(Action),
    /// The step has passed.
    Passed,
    /// The step cannot be done.
    Skipped(Reason),
}

/// How a failed sequence comes to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ending {
    /// The motor brakes with torque, the valve is shut; time left \[s\].
    Braking(f64),
    /// The supervisor stops the load; time left \[s\].
    Supervised(f64),
    /// Drives are without torque.
    Over,
}

/// State of a sequence.
#[derive(Clone, Debug)]
pub struct Sequence {
    limits: Limits,
    settings: Settings,
    step: Step,
    /// Part of the step, and time in it \[s\].
    phase: u8,
    time: f64,
    outcomes: [Option<Outcome>; Step::ALL.len()],
    quantities: Quantities,
    ending: Option<Ending>,
    prompt: Option<Prompt>,
    /// Newest data of the machine, its age \[s\], and whether it came in this period.
    seen: Option<Incoming>,
    age: f64,
    new_readings: u32,
    lost: u64,
    /// Signals, smoothed.
    smooth: [f64; SIGNALS],
    /// Whether measurements may be missing, and whether the machine may have a fault.
    may_be_silent: bool,
    may_have_fault: bool,
    /// Whether the operator has started the motion of this step.
    is_started: bool,
    /// Time since the last command \[s\], where no measurement has shown yet that the watchdog stopped the motor.
    unmeasured: Option<f64>,
    /// Position of the held load \[m\].
    origin: Option<f64>,
    /// Motor speed commanded with the valve shut \[rev/s\].
    motor: f64,
    windows: [Window; SIGNALS],
    /// Signals at the begin of a turn.
    before: [f64; SIGNALS],
    revolutions: f64,
    /// Times since the begin of a turn at which command and motor had half of the slow speed \[s\].
    half: [f64; 2],
    supervisor: Supervisor,
    decision: Decision,
    /// Position that the travel began at, its set point \[m\], and volume that the pump delivered since \[m³\].
    base: f64,
    reference: f64,
    volume: f64,
    /// Mean position \[m\] and volume \[m³\] at the rests of the travel.
    rests: [[f64; 2]; 3],
    position: Window,
    delivered: Window,
}

impl Sequence {
    /// A sequence within a crane's limits. `is_identified` states whether the machine has reported its identity.
    pub fn new(limits: Limits, settings: Settings, is_identified: bool) -> Self {
        let mut limits = limits;
        limits.speed = settings.travel_speed;
        let mut sequence = Self {
            limits,
            settings,
            step: Step::Identity,
            phase: 0,
            time: 0.0,
            outcomes: [None; Step::ALL.len()],
            quantities: Quantities::default(),
            ending: None,
            prompt: None,
            seen: None,
            age: 0.0,
            new_readings: 0,
            lost: 0,
            smooth: [f64::NAN; SIGNALS],
            may_be_silent: false,
            may_have_fault: false,
            is_started: false,
            unmeasured: None,
            origin: None,
            motor: 0.0,
            windows: [Window::default(); SIGNALS],
            before: [f64::NAN; SIGNALS],
            revolutions: 0.0,
            half: [f64::NAN; 2],
            supervisor: Supervisor::new(limits),
            decision: Decision::IDLE,
            base: 0.0,
            reference: 0.0,
            volume: 0.0,
            rests: [[f64::NAN; 2]; 3],
            position: Window::default(),
            delivered: Window::default(),
        };
        match is_identified {
            true => sequence.pass(Outcome::Passed),
            false => sequence.fail(Finding::Identity),
        }
        sequence
    }

    /// The present step, or the one that ended the sequence.
    pub fn step(&self) -> Step {
        self.step
    }

    /// What the operator is asked to do now; none while no action is needed.
    pub fn prompt(&self) -> Option<Prompt> {
        self.prompt
    }

    /// Code of the fault that the machine reports; none where it reports no fault.
    pub fn machine_code(&self) -> Option<u16> {
        match self.status() {
            Some(MachineStatus::Fault { code }) => Some(code),
            _ => None,
        }
    }

    /// Result of each step, in their order; none for one that was not reached.
    pub fn outcomes(&self) -> &[Option<Outcome>; Step::ALL.len()] {
        &self.outcomes
    }

    /// Quantities that were measured so far; NaN where one was not.
    pub fn quantities(&self) -> &Quantities {
        &self.quantities
    }

    /// Whether every step passed or was skipped.
    pub fn has_passed(&self) -> bool {
        let is_well = |outcome: &Option<Outcome>| {
            matches!(outcome, Some(Outcome::Passed | Outcome::Skipped(_)))
        };
        self.outcomes.iter().all(is_well)
    }

    /// Whether it is over, with drives without torque.
    pub fn is_over(&self) -> bool {
        self.ending == Some(Ending::Over)
    }

    /// Executes one control period: checks the measurement, advances the step, and returns what to send. An elapsed
    /// time that is not finite or not positive counts as one control period. Once the sequence is over, it sends the
    /// safe command.
    pub fn period(&mut self, now: &Now) -> Action {
        let is_sane = now.elapsed.is_finite() && now.elapsed > 0.0;
        let elapsed = if is_sane { now.elapsed } else { self.limits.period };
        self.take(now, elapsed);
        if let Some(ending) = self.ending {
            return self.end(ending, now, elapsed);
        }
        self.time += elapsed;
        let next = match now.is_ended {
            true => Err(Finding::Ended),
            false => self.judge().and_then(|()| self.advance(now, elapsed)),
        };
        match next {
            Ok(Next::Go(action)) => action,
            Ok(Next::Passed) => {
                self.pass(Outcome::Passed);
                self.held_on()
            }
            Ok(Next::Skipped(reason)) => {
                self.pass(Outcome::Skipped(reason));
                self.held_on()
            }
            Err(finding) => {
                self.fail(finding);
                match self.ending {
                    Some(ending) => self.end(ending, now, elapsed),
                    None => Action::Send(Outgoing::SAFE),
                }
            }
        }
    }

    /// Between two steps: the last decision of the supervisor, or the load held.
    fn held_on(&self) -> Action {
        let is_released = self.step.place() > Step::Release.place();
        Action::Send(match is_released && self.ending.is_none() {
            true => Outgoing::of(&self.decision),
            false => Outgoing::SAFE,
        })
    }

    /// Ends the step well, and begins the next one.
    fn pass(&mut self, outcome: Outcome) {
        self.outcomes[self.step.place()] = Some(outcome);
        self.begin_phase(0);
        self.prompt = None;
        (self.may_be_silent, self.may_have_fault) = (false, false);
        (self.is_started, self.unmeasured) = (false, None);
        match self.step.next() {
            Some(next) => self.step = next,
            None => self.ending = Some(Ending::Over),
        }
    }

    /// Ends the sequence with a step that failed.
    fn fail(&mut self, finding: Finding) {
        self.outcomes[self.step.place()] = Some(Outcome::Failed(finding));
        self.prompt = None;
        self.ending = Some(match self.step {
            Step::Identity => Ending::Over,
            Step::Listening | Step::StopCircuit | Step::Watchdog | Step::Polarity => {
                Ending::Braking(BRAKING)
            }
            Step::Release if !self.is_started => Ending::Braking(BRAKING),
            Step::Release | Step::Travel | Step::Delay | Step::StopDistance => {
                Ending::Supervised(STOPPING)
            }
        });
    }

    fn end(&mut self, ending: Ending, now: &Now, elapsed: f64) -> Action {
        let (outgoing, next) = match ending {
            // an enabled drive brakes with its torque; one that is not enabled any more stays so
            Ending::Braking(left) if left > 0.0 && self.motor != 0.0 && self.may_brake() => {
                (self.held(true), Ending::Braking(left - elapsed))
            }
            Ending::Supervised(left) if left > 0.0 => {
                let decision = self.supervise(now, Request::EmergencyStop, 0.0);
                let next = match decision.is_at_rest() {
                    true => Ending::Over,
                    false => Ending::Supervised(left - elapsed),
                };
                (Outgoing::of(&decision), next)
            }
            _ => (Outgoing::SAFE, Ending::Over),
        };
        self.ending = Some(next);
        Action::Send(outgoing)
    }

    /// Whether the drives may be commanded to brake: they are enabled, or the machine reports no state.
    fn may_brake(&self) -> bool {
        matches!(self.status(), None | Some(MachineStatus::Enabled))
    }

    /// Whether the operator has started the motion of this step. The operator is asked for it until then, and the
    /// drives have no torque.
    fn has_started(&mut self, now: &Now, prompt: Prompt) -> Result<bool, Finding> {
        if self.is_started {
            return Ok(true);
        }
        if self.prompt != Some(prompt) {
            self.prompt = Some(prompt);
            self.time = 0.0;
        }
        if now.is_confirmed && self.time >= READING {
            self.prompt = None;
            self.is_started = true;
            self.time = 0.0;
            return Ok(true);
        }
        match self.time > self.settings.starting {
            true => Err(Finding::NotStarted(self.settings.starting)),
            false => Ok(false),
        }
    }

    /// Whether the load is held by its valve, and the supervisor does not command yet.
    fn is_held(&self) -> bool {
        match self.step {
            Step::Release => !self.is_started,
            step => step.place() < Step::Release.place(),
        }
    }

    fn begin_phase(&mut self, phase: u8) {
        (self.phase, self.time) = (phase, 0.0);
    }

    /// Measurements that were lost until now are none of the supervisor's.
    fn forget_losses(&mut self) {
        let link = self.seen.and_then(|seen| seen.link);
        self.lost = link.map_or(self.lost, |link| link.lost);
    }

    /// Takes the machine's data in.
    fn take(&mut self, now: &Now, elapsed: f64) {
        let before = self.seen.map_or(0, |seen| seen.measurement.number);
        let newest = now.incoming.filter(|incoming| incoming.measurement.number != before);
        self.age += elapsed;
        self.new_readings = newest.map_or(0, |incoming| {
            let more = incoming.measurement.number.checked_sub(before).unwrap_or(1);
            u32::try_from(more).unwrap_or(1)
        });
        if let Some(incoming) = now.incoming {
            // state and link are updated without a new measurement, too
            self.seen = Some(incoming);
        }
        let Some(incoming) = newest else { return };
        let values = incoming.measurement.axes[0].signals.to_array();
        // the value before a long silence is of no use
        let share = (self.age / SMOOTHING).min(1.0);
        self.age = 0.0;
        for (smooth, value) in self.smooth.iter_mut().zip(values) {
            *smooth = if smooth.is_finite() { *smooth + share * (value - *smooth) } else { value };
        }
        if let Some(origin) = self.origin {
            let moved = (self.smooth[STROKE] - origin).abs();
            self.quantities.largest_movement = self.quantities.largest_movement.max(moved);
        }
        self.revolutions += values[MOTOR] * elapsed;
        let gain = 0.5 * (self.limits.flow.gain.low + self.limits.flow.gain.high);
        self.volume += values[MOTOR] * elapsed * gain * self.limits.flow.displacement;
    }

    fn advance(&mut self, now: &Now, elapsed: f64) -> Result<Next, Finding> {
        match self.step {
            Step::Identity => Ok(Next::Passed),
            Step::Listening => self.listen(),
            Step::StopCircuit => self.see_stop_circuit(now),
            Step::Watchdog => self.try_watchdog(now, elapsed),
            Step::Polarity => self.find_polarity(now, elapsed),
            Step::Release => self.release(now),
            Step::Travel => self.travel(now),
            Step::Delay => self.judge_delay(now),
            Step::StopDistance => self.stop(now),
        }
    }

    /// State that the machine reports.
    fn status(&self) -> Option<MachineStatus> {
        self.seen.and_then(|seen| seen.status)
    }

    /// The load held by its valve, the motor at the sequence's own command.
    fn held(&mut self, is_enabled: bool) -> Outgoing {
        if self.ending.is_some() {
            self.motor = self.ramped(0.0);
        }
        let axis = AxisCommand { motor_speed: self.motor, holding_valve: 0.0 };
        Outgoing { command: Command { axes: [axis; AXES] }, is_enabled }
    }

    /// The motor's command, moved towards a speed by one period of its slew rate \[rev/s\].
    fn ramped(&self, wanted: f64) -> f64 {
        let reach = self.limits.motor_slew * self.limits.period;
        wanted.max(self.motor - reach).min(self.motor + reach)
    }

    /// Of an axis's signals, the pressures of the pump side and of the cylinder chamber that carry the load, then of
    /// the others.
    fn sides(&self, signals: &[f64; SIGNALS]) -> [f64; 4] {
        let [_, pump_a, a, b, pump_b, ..] = *signals;
        match self.limits.release.direction > 0.0 {
            true => [pump_a, a, pump_b, b],
            false => [pump_b, b, pump_a, a],
        }
    }

    /// One period of the supervisor.
    fn supervise(&mut self, now: &Now, request: Request, wanted: f64) -> Decision {
        let Some(seen) = self.seen else { return Decision::IDLE };
        let lost = seen.link.map_or(self.lost, |link| link.lost);
        let observation = Observation {
            elapsed: now.elapsed,
            reading: seen.measurement.axes[0].signals,
            valve: seen.valve,
            machine: seen.status,
            age: self.age,
            new_readings: self.new_readings,
            lost_readings: u32::try_from(lost.saturating_sub(self.lost)).unwrap_or(u32::MAX),
            commands_lost: seen.link.is_some_and(|link| link.commands_lost),
            reference: self.reference,
            tracking: self.settings.travel_deviation,
            wanted,
            course_over: false,
            missed: now.missed,
            attended: true,
            clock_jumped: false,
        };
        self.lost = lost;
        self.decision = self.supervisor.advance(&observation, request);
        self.decision
    }
}
