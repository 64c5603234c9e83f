//! Checks of every step: measurements valid and in their ranges, no fault of the machine, the load where it has to be.

use super::{MOTOR, STROKE, Sequence};
use crate::commissioning::finding::Finding;
use crate::commissioning::step::Step;
use crate::machine::Incoming;
use hydroboom_control::measurement::Validity;
use hydroboom_control::supervision::limits::{MachineStatus, ValveState};
use hydroboom_control::supervision::plausibility::ranges;

impl Sequence {
    /// Checks of every step: those of the measurement in each period in which it has to arrive, or arrives.
    pub(super) fn judge(&self) -> Result<(), Finding> {
        let Some(seen) = self.seen else {
            return match self.time > self.settings.ready {
                true => Err(Finding::Silent(self.time)),
                false => Ok(()),
            };
        };
        match self.may_be_silent {
            true if self.new_readings == 0 => return Ok(()),
            false if self.age.is_nan() || self.age > self.limits.stale => {
                return Err(Finding::Silent(self.age));
            }
            _ => {}
        }
        self.judge_signals(&seen)?;
        if let (false, Some(MachineStatus::Fault { code })) = (self.may_have_fault, seen.status) {
            return Err(Finding::MachineFault(code));
        }
        let is_held = self.is_held();
        // from the release on this is the supervisor's; while commands are withheld, none is to arrive
        let has_to_arrive = is_held && !self.may_be_silent;
        if has_to_arrive && seen.link.is_some_and(|link| link.commands_lost) {
            return Err(Finding::CommandsLate);
        }
        let stroke = seen.measurement.axes[0].signals.stroke;
        let allowed = match self.step {
            _ if is_held => self.settings.held_movement.min(self.limits.creep),
            Step::Release => self.settings.release_movement,
            _ => {
                self.settings.release_movement
                    + self.settings.travel
                    + 2.0 * self.settings.travel_deviation
            }
        };
        if let Some(origin) = self.origin
            && (stroke - origin).abs() > allowed
        {
            return Err(Finding::Moved([(stroke - origin).abs(), allowed]));
        }
        match seen.valve {
            Some(ValveState::Open) if is_held => Err(Finding::ValveOpen),
            _ => Ok(()),
        }
    }

    /// Each signal is a number in its range, and each pressure within its limit.
    fn judge_signals(&self, seen: &Incoming) -> Result<(), Finding> {
        let axis = &seen.measurement.axes[0];
        let values = axis.signals.to_array();
        let validity = axis.validity.to_array();
        let allowed = ranges(&self.limits).to_array();
        for (signal, ((value, is), (low, high))) in
            values.into_iter().zip(validity).zip(allowed).enumerate()
        {
            let is_beyond = !(low..=high).contains(&value);
            match is {
                // a value that is NaN for being out of range is reported as not a number
                Validity::OutOfRange if value.is_finite() => {
                    return Err(Finding::OutOfRange(signal, [value, low, high]));
                }
                _ if !value.is_finite() => return Err(Finding::NotANumber(signal)),
                _ if is_beyond => return Err(Finding::OutOfRange(signal, [value, low, high])),
                _ => {}
            }
            if signal != STROKE && signal != MOTOR && value > self.limits.pressure {
                return Err(Finding::Pressure(signal, [value, self.limits.pressure]));
            }
        }
        Ok(())
    }
}
