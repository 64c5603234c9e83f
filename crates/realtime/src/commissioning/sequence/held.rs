//! Steps with the load-holding valve shut: the load must not move.

use super::{Action, MOTOR, Next, Now, SIGNALS, STROKE, Sequence};
use crate::commissioning::finding::{Finding, Reason};
use crate::commissioning::step::Prompt;
use crate::commissioning::window::Window;
use crate::machine::Outgoing;
use hydroboom_control::supervision::limits::MachineStatus;

/// Standard deviations of the noise that a rise exceeds.
const SIGNIFICANT: f64 = 6.0;
/// Time for a machine that reports no state to enable its drives \[s\].
const UNREPORTED: f64 = 0.2;
/// Time at slow speed before measurements are judged \[s\].
const STEADY: f64 = 0.1;
/// Time after a confirmed reset, after which a remaining fault is prompted again \[s\].
const AGAIN: f64 = 1.0;

impl Sequence {
    /// Whether the drives are enabled, as far as the machine reports it.
    fn enabled(&self) -> Result<bool, Finding> {
        match self.status() {
            Some(MachineStatus::Enabled) => Ok(true),
            None => Ok(self.time >= UNREPORTED),
            Some(_) if self.time > self.settings.ready => Err(Finding::NotEnabled),
            Some(_) => Ok(false),
        }
    }

    /// Drives that were enabled stay so.
    fn stays_enabled(&self) -> Result<(), Finding> {
        match self.status() {
            None | Some(MachineStatus::Enabled) => Ok(()),
            Some(_) => Err(Finding::NotEnabled),
        }
    }

    /// Measurements at rest, drives without torque.
    pub(super) fn listen(&mut self) -> Result<Next, Finding> {
        let go = Ok(Next::Go(Action::Send(Outgoing::SAFE)));
        if self.phase == 0 {
            let is_late = self.time > self.settings.ready;
            let is_ready = match self.status() {
                None => self.seen.is_some(),
                Some(MachineStatus::Ready) => true,
                Some(MachineStatus::Enabled) if is_late => return Err(Finding::EnabledByItself),
                Some(_) if is_late => return Err(Finding::NotReady),
                Some(_) => false,
            };
            if is_ready {
                self.windows = [Window::default(); SIGNALS];
                self.begin_phase(1);
            }
            return go;
        }
        if self.status().is_some_and(|status| status != MachineStatus::Ready) {
            return Err(Finding::NotReady);
        }
        if let Some(seen) = self.seen.filter(|_| self.new_readings > 0) {
            let values = seen.measurement.axes[0].signals.to_array();
            self.windows.iter_mut().zip(values).for_each(|(window, value)| window.add(value));
        }
        if self.time < self.settings.listening {
            return go;
        }
        self.judge_rest()?;
        Ok(Next::Passed)
    }

    /// Checks whether the measurements at rest are plausible.
    fn judge_rest(&mut self) -> Result<(), Finding> {
        let l = &self.limits;
        let (rest, noise) =
            (self.windows.map(|w| w.mean()), self.windows.map(|w| w.residual_deviation()));
        (self.quantities.rest, self.quantities.noise) = (rest, noise);
        for (signal, (window, scatter)) in self.windows.iter().zip(noise).enumerate() {
            let allowed = if signal == STROKE { l.scatter.0 } else { l.scatter.1 };
            if signal == MOTOR {
                continue;
            }
            if l.stuck > 0.0 && window.deviation() == 0.0 {
                return Err(Finding::Stuck(signal));
            }
            if scatter.is_nan() || scatter > allowed {
                return Err(Finding::Noisy(signal, [scatter, allowed]));
            }
        }
        let drift = self.windows[STROKE].drift().abs();
        // the limit holds for the observation time of a release
        let allowed = l.release.rest_drift * (self.settings.listening / l.still.1).max(1.0);
        if drift.is_nan() || drift > allowed {
            return Err(Finding::Drifts([drift, allowed]));
        }
        if rest[MOTOR].is_nan() || rest[MOTOR].abs() > l.drive.uncommanded {
            return Err(Finding::Turns(rest[MOTOR]));
        }
        let r = &l.release;
        let [pump, load, _, other] = self.sides(&rest);
        let height = if r.direction > 0.0 { rest[STROKE] } else { r.stroke - rest[STROKE] };
        // the load chamber carries the pressure shut in on the other side, too
        let held_back = other.max(0.0) * r.other_area / r.area;
        let least = if height > r.end_zone { r.least_pressure + held_back } else { 0.0 };
        let low = least - r.pressure_tolerance;
        let high = r.most_pressure + held_back + r.pressure_tolerance;
        if !(low..=high).contains(&load) {
            return Err(Finding::LoadPressure([load, low, high]));
        }
        if pump > load + r.pressure_tolerance {
            return Err(Finding::PumpAboveLoad([pump, load]));
        }
        let s = &self.settings;
        let needed = s.release_movement + s.travel + s.travel_deviation;
        let margin = l.margin.max(s.travel_deviation);
        let (low, high) = match r.direction > 0.0 {
            true => (margin, l.stroke - margin - needed),
            false => (margin + needed, l.stroke - margin),
        };
        if !(low..=high).contains(&rest[STROKE]) {
            return Err(Finding::NoStroke([rest[STROKE], low, high]));
        }
        self.origin = Some(rest[STROKE]);
        Ok(())
    }

    /// The operator opens the stop circuit, and the machine has to report that its drives are off. Whether the stop
    /// circuit was the cause, the operator confirms: a machine's codes are its own.
    pub(super) fn see_stop_circuit(&mut self, now: &Now) -> Result<Next, Finding> {
        if self.phase < 2 && self.smooth[MOTOR].abs() > self.limits.drive.uncommanded {
            return Err(Finding::Turns(self.smooth[MOTOR]));
        }
        match self.phase {
            0 => {
                if self.status().is_none() {
                    return Ok(Next::Skipped(Reason::NoState));
                }
                if self.enabled()? {
                    self.begin_phase(1);
                    self.prompt = Some(Prompt::OpenStopCircuit);
                    self.may_have_fault = true;
                }
                Ok(Next::Go(Action::Send(self.held(true))))
            }
            1 => {
                if self.status() != Some(MachineStatus::Enabled) {
                    self.begin_phase(2);
                } else if self.time > self.settings.opening {
                    return Err(Finding::StopCircuitNotSeen(self.settings.opening));
                }
                Ok(Next::Go(Action::Send(self.held(true))))
            }
            2 => {
                // a machine that goes into a fault reports its code within a few periods
                if self.time < STEADY {
                    return Ok(Next::Go(Action::Send(self.held(true))));
                }
                let code = match self.status() {
                    Some(MachineStatus::Fault { code }) => f64::from(code),
                    Some(MachineStatus::Ready) => 0.0,
                    Some(MachineStatus::Enabled) => {
                        // it was enabled again by itself: the stop circuit was not open
                        self.begin_phase(1);
                        return Ok(Next::Go(Action::Send(self.held(true))));
                    }
                    None | Some(MachineStatus::Absent | MachineStatus::Starting) => {
                        return Err(Finding::NotEnabled);
                    }
                };
                self.quantities.stop_circuit_code = code;
                self.begin_phase(3);
                self.prompt = Some(Prompt::CloseStopCircuit);
                Ok(Next::Go(Action::Send(Outgoing::SAFE)))
            }
            _ => self.wait_for_reset(now),
        }
    }

    /// Drives without torque until the operator has confirmed and the machine is ready.
    fn wait_for_reset(&mut self, now: &Now) -> Result<Next, Finding> {
        // no measurements arrive while a bus restarts
        self.may_be_silent = true;
        if now.is_confirmed {
            (self.prompt, self.time) = (None, 0.0);
            return Ok(Next::Go(Action::Reset(Outgoing::SAFE)));
        }
        let has_fault = matches!(self.status(), Some(MachineStatus::Fault { .. }));
        if self.prompt.is_none() && has_fault && self.time > AGAIN {
            // a second fault behind the one that was reset needs the operator, too
            self.prompt = Some(Prompt::ResetAgain);
        }
        let is_ready = matches!(self.status(), None | Some(MachineStatus::Ready));
        let is_there = self.age <= self.limits.stale;
        if self.prompt.is_none() && is_ready && is_there && self.unmeasured.is_none() {
            return Ok(Next::Passed);
        }
        match self.time > self.settings.resetting {
            true => Err(Finding::NotReset(self.settings.resetting)),
            false => Ok(Next::Go(Action::Send(Outgoing::SAFE))),
        }
    }

    /// The slow speed of the motor, in the direction that lifts \[rev/s\].
    fn slow(&self) -> f64 {
        self.limits.release.direction * self.limits.release.slow
    }

    fn begin_turn(&mut self) {
        self.before = self.smooth;
        self.revolutions = 0.0;
        self.half = [f64::NAN; 2];
    }

    /// Whether the motor is faster than the tolerance of its slow speed, and than the noise of its signal at rest: a
    /// wrong factor of the command is found within a few periods.
    fn is_too_fast(&self, slow: f64) -> bool {
        let noise = SIGNIFICANT * self.quantities.noise[MOTOR];
        let allowed = (1.0 + self.settings.speed_tolerance) * slow.abs() + noise;
        self.read_motor().abs() > allowed
    }

    /// Ramps the motor to its slow speed; returns whether the smoothed speed signal has reached it.
    fn turn(&mut self) -> Result<bool, Finding> {
        self.stays_enabled()?;
        let slow = self.slow();
        self.motor = self.ramped(slow);
        let read = self.smooth[MOTOR];
        let speeds = [self.motor, self.read_motor()];
        for (half, speed) in self.half.iter_mut().zip(speeds) {
            if half.is_nan() && speed / slow >= 0.5 {
                *half = self.time;
            }
        }
        if self.is_too_fast(slow) {
            return Err(Finding::MotorDoesNotFollow([self.read_motor(), self.motor]));
        }
        let is_near = (read / slow - 1.0).abs() <= self.settings.speed_tolerance;
        if is_near && self.motor == slow {
            return Ok(true);
        }
        if read / slow < -self.settings.speed_tolerance {
            return Err(Finding::MotorReversed([read, self.motor]));
        }
        match self.time > self.settings.turning {
            true => Err(Finding::MotorDoesNotFollow([read, self.motor])),
            false => Ok(false),
        }
    }

    /// The motor turns slowly, and commands are withheld: the machine's watchdog has to stop it.
    pub(super) fn try_watchdog(&mut self, now: &Now, elapsed: f64) -> Result<Next, Finding> {
        let slow = self.slow();
        let braking = slow.abs() / self.limits.motor_slew + self.limits.drive.response;
        let longest = self.limits.watchdog + braking + self.settings.watchdog_margin;
        let threshold = self.settings.speed_tolerance * slow.abs();
        self.measure_stop(threshold, elapsed)?;
        match self.phase {
            0 => {
                if !self.has_started(now, Prompt::StartWatchdog)? {
                    return Ok(Next::Go(Action::Send(Outgoing::SAFE)));
                }
                if self.enabled()? {
                    self.begin_phase(1);
                    self.begin_turn();
                }
                Ok(Next::Go(Action::Send(self.held(true))))
            }
            1 => {
                if self.turn()? && self.time >= self.half[0] + STEADY + braking {
                    self.quantities.motor_ratio = self.smooth[MOTOR] / slow;
                    self.quantities.motor_reaction =
                        (self.half[1] - self.half[0]) / self.limits.period;
                    self.begin_phase(2);
                    (self.may_be_silent, self.may_have_fault) = (true, true);
                    return Ok(Next::Go(Action::Withhold));
                }
                Ok(Next::Go(Action::Send(self.held(true))))
            }
            2 => {
                if self.new_readings > 0
                    && self.quantities.watchdog.is_nan()
                    && self.read_motor().abs() <= threshold
                {
                    self.quantities.watchdog = self.time;
                }
                if self.time <= longest {
                    return Ok(Next::Go(Action::Withhold));
                }
                // where measurements came meanwhile, they have to show the motor at rest; if not, the next one has to.
                // On a bus whose devices have kept OP it was sampled before this command can have acted
                let came = self.age <= self.limits.stale;
                if came && self.read_motor().abs() > threshold {
                    return Err(Finding::NoWatchdog([self.read_motor(), self.time]));
                }
                self.unmeasured = if came { None } else { Some(self.time) };
                self.motor = 0.0;
                self.begin_phase(if came { 4 } else { 3 });
                Ok(Next::Go(Action::Send(Outgoing::SAFE)))
            }
            3 => {
                if self.unmeasured.is_none() {
                    self.begin_phase(4);
                } else if self.time > 2.0 * STEADY
                    && matches!(self.status(), Some(MachineStatus::Fault { .. }))
                {
                    // devices that left OP by their watchdogs take no outputs: working counters are wrong, and the bus
                    // publishes no measurement until it restarts. The first one after it has to show the motor at rest.
                    // A device without a watchdog stays in OP, and is judged by its measurement
                    self.begin_phase(5);
                    self.prompt = Some(Prompt::ResetAfterWatchdog);
                } else if self.time > self.settings.ready {
                    return Err(Finding::Silent(self.age));
                }
                Ok(Next::Go(Action::Send(Outgoing::SAFE)))
            }
            4 => {
                // a machine that goes into a fault does so within a few periods
                if self.time < STEADY + elapsed {
                    return Ok(Next::Go(Action::Send(Outgoing::SAFE)));
                }
                self.begin_phase(5);
                if let Some(MachineStatus::Fault { .. }) = self.status() {
                    self.prompt = Some(Prompt::ResetAfterWatchdog);
                }
                Ok(Next::Go(Action::Send(Outgoing::SAFE)))
            }
            _ => self.wait_for_reset(now),
        }
    }

    /// After commands were withheld without a measurement, the first one has to show the motor at rest: its speed
    /// within a threshold \[rev/s\].
    fn measure_stop(&mut self, threshold: f64, elapsed: f64) -> Result<(), Finding> {
        let Some(time) = self.unmeasured.map(|time| time + elapsed) else { return Ok(()) };
        self.unmeasured = Some(time);
        if self.new_readings > 0 {
            let speed = self.read_motor();
            if speed.is_nan() || speed.abs() > threshold {
                return Err(Finding::NoWatchdog([speed, time]));
            }
            self.unmeasured = None;
        }
        Ok(())
    }

    /// Newest measured motor speed \[rev/s\].
    fn read_motor(&self) -> f64 {
        self.seen.map_or(f64::NAN, |seen| seen.measurement.axes[0].signals.motor_speed)
    }

    /// A slow turn has to raise the pressure of the pump side that carries the load, and no other.
    pub(super) fn find_polarity(&mut self, now: &Now, elapsed: f64) -> Result<Next, Finding> {
        let [noise, ..] = self.sides(&self.quantities.noise);
        let rise = self.settings.pressure_rise.max(SIGNIFICANT * noise);
        let [pump, load, other, _] = self.sides(&self.smooth);
        let needed = rise + self.settings.pressure_margin;
        match self.phase {
            // the pump side drains first
            0 => {
                let has_margin = load - pump > needed;
                if self.prompt.is_none() && !has_margin {
                    return match self.time > self.settings.draining {
                        true => Ok(Next::Skipped(Reason::PressureMarginTooSmall([pump, needed]))),
                        false => Ok(Next::Go(Action::Send(Outgoing::SAFE))),
                    };
                }
                if self.has_started(now, Prompt::StartPolarity)? {
                    self.begin_phase(1);
                }
                Ok(Next::Go(Action::Send(Outgoing::SAFE)))
            }
            1 => {
                if self.enabled()? {
                    self.begin_phase(2);
                    self.begin_turn();
                }
                Ok(Next::Go(Action::Send(self.held(true))))
            }
            2 => {
                let [pump_before, load_before, other_before, _] = self.sides(&self.before);
                let is_turning = self.turn()?;
                let rises = [pump - pump_before, load - load_before, other - other_before];
                if rises[0] >= rise && is_turning {
                    self.quantities.polarity_rise = rises[0];
                    self.quantities.polarity_revolutions = self.revolutions.abs();
                    self.begin_phase(3);
                } else if rises[1].abs() >= rise {
                    return Err(Finding::LoadRose([rises[0], rises[1]]));
                } else if rises[2] >= rise {
                    return Err(Finding::OtherSideRose([rises[0], rises[2]]));
                } else if load - pump < self.settings.pressure_margin {
                    return Err(Finding::LoadRose([rises[0], rises[1]]));
                }
                let volume = self.revolutions.abs() * self.limits.release.delivery;
                if self.time > self.settings.polarity || volume > self.limits.release.largest_volume
                {
                    return Err(Finding::NoRise([rises[0], rise]));
                }
                Ok(Next::Go(Action::Send(self.held(true))))
            }
            _ => {
                self.motor = self.ramped(0.0);
                let is_over = self.motor == 0.0 && self.time > STEADY + elapsed;
                match is_over {
                    true => Ok(Next::Passed),
                    false => Ok(Next::Go(Action::Send(self.held(true)))),
                }
            }
        }
    }
}
