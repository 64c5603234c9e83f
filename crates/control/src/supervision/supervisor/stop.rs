//! Controlled and immediate stop: stop categories 1 and 0 of a fault, and of the end of a motion.

use super::{HELD, State, Supervisor};
use crate::measurement::AxisSignals;
use crate::supervision::fault::{Cause, Reaction};
use crate::supervision::limits::{Observation, ValveState};

/// Share of a controlled stop's duration for the motor's ramp to zero; in the rest the load comes to rest.
pub const CONTROLLED_RAMP: f64 = 0.75;

/// A stop under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stop {
    pub(super) reaction: Reaction,
    /// Motor speed as read when it began \[rev/s\].
    pub(super) from: f64,
    /// Time since then \[s\].
    pub(super) since: f64,
}

impl Supervisor {
    /// Goes to [`State::Fault`] with the reaction that suits the cause and what the machine does now.
    pub(super) fn fail(&mut self, cause: Cause, seen: &Observation) {
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
    pub(super) fn begin_stop(
        &mut self,
        reaction: Reaction,
        reading: &AxisSignals<f64>,
        is_trusted: bool,
    ) {
        let most = self.limits.motor_speed;
        let from = match is_trusted && reading.motor_speed.is_finite() {
            // no faster than the drive can be after what it was commanded
            true => self.drive.plausible(reading.motor_speed).max(-most).min(most),
            false => 0.0,
        };
        self.stop = Stop { reaction, from, since: 0.0 };
    }

    /// Goes on with a stop; true once motor and valve are commanded to rest.
    pub(super) fn continue_stop(&mut self) -> bool {
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
}
