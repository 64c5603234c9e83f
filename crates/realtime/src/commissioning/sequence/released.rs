//! Steps under the supervisor: release, travel, delay, stop.

use super::{Action, Next, Now, STROKE, Sequence};
use crate::commissioning::finding::Finding;
use crate::commissioning::step::Prompt;
use crate::commissioning::window::Window;
use crate::machine::Outgoing;
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::supervisor::{Decision, Request, State};

/// Time for a load to come to rest after the valve has opened, and after a motion \[s\].
const SETTLING: f64 = 1.0;
/// Shortest window of a mean at rest \[s\]; it is a whole number of periods of the load mode.
const WINDOW: f64 = 0.5;
/// Share of the proving motion that is a motion against the pump.
const AGAINST: f64 = 0.5;

impl Sequence {
    /// Smoothed displacement of the piston from the position at which it was held \[m\].
    fn moved(&self) -> f64 {
        self.smooth[STROKE] - self.origin.unwrap_or(f64::NAN)
    }

    /// The pump takes the load over, and the valve opens.
    pub(super) fn release(&mut self, now: &Now) -> Result<Next, Finding> {
        if !self.has_started(now, Prompt::StartRelease)? {
            self.forget_losses();
            return Ok(Next::Go(Action::Send(Outgoing::SAFE)));
        }
        let request = match self.decision.state {
            State::Idle => Request::Enable,
            State::Ready => Request::Hold,
            State::Holding if !self.decision.releasing => Request::Start,
            _ => Request::None,
        };
        self.reference = self.smooth[STROKE];
        let decision = self.supervise(now, request, 0.0);
        if let Some(cause) = decision.cause {
            let (moved, direction) = (self.moved(), self.limits.release.direction);
            let against = direction * moved < -AGAINST * self.limits.release.proving_motion;
            return Err(match cause {
                Cause::PositionNotSteady | Cause::LoadNotHeld if against => {
                    Finding::PositionReversed(moved)
                }
                _ => Finding::Supervisor(cause, moved),
            });
        }
        if decision.controls {
            self.quantities.release_lift = self.limits.release.direction * self.moved();
            self.quantities.release_time = self.time;
            self.base = self.smooth[STROKE];
            (self.reference, self.volume) = (self.base, 0.0);
            return Ok(Next::Passed);
        }
        Ok(Next::Go(Action::Send(Outgoing::of(&decision))))
    }

    /// Motor speed that compensates leakage \[rev/s\].
    fn leakage(&self) -> f64 {
        let r = &self.limits.release;
        let [pump, ..] = self.sides(&self.smooth);
        let share = (pump.max(0.0) / r.nominal_pressure).min(4.0).sqrt();
        r.direction * r.leakage * share
    }

    /// Motor speed for a piston velocity \[m/s\].
    fn feedforward(&self, velocity: f64) -> f64 {
        let flow = &self.limits.flow;
        let gain = 0.5 * (flow.gain.low + flow.gain.high);
        velocity * flow.area / (gain * flow.displacement) + self.leakage()
    }

    /// A whole number of periods of the load mode \[s\].
    fn window(&self) -> f64 {
        (WINDOW / self.limits.still.1).ceil().max(1.0) * self.limits.still.1
    }

    /// Largest velocity of the travel \[m/s\], and the duration of each of its ramps \[s\]: a period of the load mode,
    /// so that the boom does not swing after it.
    fn ramp(&self) -> (f64, f64) {
        let ramp = self.limits.still.1.max(self.limits.period);
        (self.settings.travel_speed.min(self.settings.travel / ramp), ramp)
    }

    /// Distance \[m\] and velocity \[m/s\] of the travel after a time \[s\], and its duration \[s\].
    fn profile(&self, time: f64) -> (f64, f64, f64) {
        let (speed, ramp) = self.ramp();
        let end = self.settings.travel / speed + ramp;
        let rising = |t: f64| match t {
            t if t <= 0.0 => (0.0, 0.0),
            t if t < ramp => (0.5 * speed * t * t / ramp, speed * t / ramp),
            t => (speed * (t - 0.5 * ramp), speed),
        };
        let (up, fast) = rising(time.min(end));
        let (down, slower) = rising(time.min(end) - (end - ramp));
        (up - down, fast - slower, end)
    }

    /// The supervisor with an open-loop velocity; what stops it is a finding.
    fn follow(&mut self, now: &Now, velocity: f64) -> Result<Decision, Finding> {
        let wanted = self.feedforward(velocity);
        let decision = self.supervise(now, Request::None, wanted);
        let deviation = self.settings.travel_deviation;
        let [measured, expected] = [self.smooth[STROKE], self.reference].map(|x| x - self.base);
        match decision.cause {
            Some(Cause::TrackingError) => Err(Finding::LeftTravel([measured, expected, deviation])),
            Some(cause) => Err(Finding::Supervisor(cause, self.moved())),
            None => Ok(decision),
        }
    }

    /// A short travel against the load and back, against the pump's volume.
    pub(super) fn travel(&mut self, now: &Now) -> Result<Next, Finding> {
        let direction = self.limits.release.direction;
        let (is_motion, is_window) = (self.phase % 3 == 2, self.phase % 3 == 1);
        let towards = if self.phase == 2 { direction } else { -direction };
        let (way, velocity, end) = self.profile(self.time);
        let duration = match (is_motion, is_window) {
            (true, _) => end,
            (_, true) => self.window(),
            _ => SETTLING,
        };
        if is_motion {
            self.reference = self.base + towards * way;
        }
        let decision = self.follow(now, if is_motion { towards * velocity } else { 0.0 })?;
        if is_window && self.new_readings > 0 {
            let stroke = self.seen.map_or(f64::NAN, |s| s.measurement.axes[0].signals.stroke);
            self.position.add(stroke - self.base);
            self.delivered.add(self.volume);
        }
        if self.time >= duration {
            if is_window {
                let rest = usize::from(self.phase / 3);
                let mean = self.position.mean() + self.base;
                if let Some(place) = self.rests.get_mut(rest) {
                    *place = [mean, self.delivered.mean()];
                }
                (self.position, self.delivered) = (Window::default(), Window::default());
                if rest == 2 {
                    self.judge_travel()?;
                    return Ok(Next::Passed);
                }
                // leakage at rest does not count as travel
                (self.base, self.reference) = (mean, mean);
            }
            if is_motion {
                self.base = self.reference;
            }
            self.begin_phase(self.phase + 1);
        }
        Ok(Next::Go(Action::Send(Outgoing::of(&decision))))
    }

    /// Sign and scale: leakage, the same in both directions, drops out of the difference.
    fn judge_travel(&mut self) -> Result<(), Finding> {
        let [[a, va], [b, vb], [c, vc]] = self.rests;
        self.quantities.travel = [b - a, c - b];
        let by_position = (b - a) - (c - b);
        let by_volume = ((vb - va) - (vc - vb)) / self.limits.flow.area;
        let ratio = by_position / by_volume;
        self.quantities.scale = ratio;
        if ratio < 0.0 {
            return Err(Finding::PositionReversed(b - a));
        }
        let gain = self.limits.flow.gain;
        let half = (gain.high - gain.low) / (gain.high + gain.low);
        let allowed = self.settings.scale_tolerance.max(half);
        let is_right = (ratio - 1.0).abs() <= allowed;
        if is_right { Ok(()) } else { Err(Finding::Scale([ratio, allowed])) }
    }

    /// Delay as the machine's connection measures it; where it measures none, the motor's reaction is judged instead.
    pub(super) fn judge_delay(&mut self, now: &Now) -> Result<Next, Finding> {
        self.follow(now, 0.0)?;
        self.base = self.smooth[STROKE];
        self.reference = self.base;
        let counted = self.seen.and_then(|seen| seen.link).and_then(|link| link.delay);
        // the motor's reaction contains the drive's response
        let response = (self.limits.drive.response / self.limits.period).ceil();
        let largest = self.settings.largest_delay + if counted.is_some() { 0.0 } else { response };
        let delay = counted.map_or(self.quantities.motor_reaction, |delay| delay.total);
        self.quantities.delay = counted.map_or(f64::NAN, |delay| delay.total);
        // below 0: the machine's clock is off by part of a cycle
        let is_right = (-0.5..=largest).contains(&delay);
        if is_right { Ok(Next::Passed) } else { Err(Finding::Delay([delay, largest])) }
    }

    /// An immediate stop from the travel's speed.
    pub(super) fn stop(&mut self, now: &Now) -> Result<Next, Finding> {
        let direction = self.limits.release.direction;
        let (speed, ramp) = self.ramp();
        if self.phase == 0 {
            let (way, velocity, _) = self.profile(self.time.min(ramp));
            self.reference = self.base + direction * way;
            let decision = match self.time >= ramp {
                true => {
                    self.begin_phase(1);
                    self.base = self.smooth[STROKE];
                    self.quantities.stop_distance = 0.0;
                    self.supervise(now, Request::EmergencyStop, 0.0)
                }
                false => self.follow(now, direction * velocity)?,
            };
            return Ok(Next::Go(Action::Send(Outgoing::of(&decision))));
        }
        let decision = self.supervise(now, Request::None, 0.0);
        let way = (self.smooth[STROKE] - self.base).abs();
        self.quantities.stop_distance = self.quantities.stop_distance.max(way);
        match decision.cause {
            Some(Cause::EmergencyStop) => {}
            Some(cause) => return Err(Finding::Supervisor(cause, self.moved())),
            None => return Err(Finding::NotEnabled),
        }
        let noise = 4.0 * self.quantities.noise[STROKE];
        let largest = speed * self.limits.stopping_time() + noise;
        if self.quantities.stop_distance > largest {
            return Err(Finding::StopDistance([self.quantities.stop_distance, largest]));
        }
        match self.time >= self.settings.watching && decision.is_at_rest() {
            true => Ok(Next::Passed),
            false => Ok(Next::Go(Action::Send(Outgoing::of(&decision)))),
        }
    }
}
