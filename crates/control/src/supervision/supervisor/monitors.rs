//! Monitors of the supervisor: what is wrong in a control period, and the most severe of it.

use super::{State, Supervisor};
use crate::supervision::fault::Cause;
use crate::supervision::flow_monitor::FlowReading;
use crate::supervision::limits::{MachineStatus, Observation, ValveState};
use crate::supervision::plausibility::RUNAWAY;

/// Time constant in which the peak velocity of a swinging load is forgotten, in periods of the load
/// mode: what counts is the last swing.
const SWING_MEMORY: f64 = 1.5;

/// The most severe cause that was found, if any.
struct MostSevere(Option<Cause>);

impl MostSevere {
    fn found(&mut self, cause: Cause) {
        self.0 = Some(self.0.map_or(cause, |known| known.worse(cause)));
    }
}

impl Supervisor {
    /// The most severe of all that is wrong, if anything. Monitors of measurements, drive, valve and deadlines
    /// take in every period in every state; position against flow, and pump side against cylinder, while the
    /// valve is open; course and end stops while the controller moves the load.
    pub(super) fn judge(
        &mut self,
        seen: &Observation,
        elapsed: f64,
        has_passed: bool,
    ) -> Option<Cause> {
        let mut wrong = MostSevere(None);
        if seen.clock_jumped || !has_passed {
            wrong.found(Cause::ClockJumped);
        }
        self.judge_machine(seen, elapsed, &mut wrong);
        self.judge_measurements(seen, &mut wrong);
        self.judge_drive_and_valve(seen, elapsed, &mut wrong);
        self.judge_load(seen, &mut wrong);
        if self.has_opened() {
            self.judge_open_valve(seen, elapsed, &mut wrong);
        }
        wrong.0
    }

    /// The machine's watchdog and what it reports.
    fn judge_machine(&self, seen: &Observation, elapsed: f64, wrong: &mut MostSevere) {
        // first, because readings step over such an interval
        let is_active = self.is_active();
        if is_active && (elapsed > self.limits.watchdog || seen.commands_lost) {
            wrong.found(Cause::WatchdogExpired);
        }
        match seen.machine {
            Some(MachineStatus::Fault { .. }) => wrong.found(Cause::MachineFault),
            Some(MachineStatus::Absent | MachineStatus::Starting) => {
                wrong.found(Cause::MachineNotReady);
            }
            Some(MachineStatus::Ready) if is_active => wrong.found(Cause::MachineNotReady),
            Some(MachineStatus::Ready | MachineStatus::Enabled) | None => {}
        }
    }

    /// Measurements, deadlines, and the operator's attendance.
    fn judge_measurements(&mut self, seen: &Observation, wrong: &mut MostSevere) {
        let l = self.limits;
        // pressures that were shut in step when the valve opens or shuts
        let is_switching = self.valve_since < l.valve_time + l.stale;
        if let Some(cause) = self.plausibility.judge(seen, &l, is_switching) {
            wrong.found(cause);
        }
        self.plausibility.remember(seen, &l, SWING_MEMORY * l.still.1);
        if self.deadlines.executed(seen.missed) > l.missed {
            wrong.found(Cause::Overruns);
        }
        if seen.new_readings > 0 && self.losses.executed(seen.lost_readings) > l.missed {
            wrong.found(Cause::MeasurementsLost);
        }
        if self.state != State::Fault && self.is_active() && !seen.attended {
            wrong.found(Cause::OperatorLost);
        }
    }

    /// Drive and load-holding valve against what they are commanded.
    fn judge_drive_and_valve(&mut self, seen: &Observation, elapsed: f64, wrong: &mut MostSevere) {
        let l = self.limits;
        let r = &seen.reading;
        if r.motor_speed.is_finite() && self.state != State::Idle {
            let commanded = self.command.motor_speed;
            let load = r.pressure_pump_a - r.pressure_pump_b;
            let verdict = l.drive.judge(&mut self.drive, commanded, r.motor_speed, load, elapsed);
            if verdict.uncommanded {
                wrong.found(Cause::DriveUncommanded);
            } else if verdict.deviates && self.is_active() {
                wrong.found(Cause::DriveNotFollowing);
            }
        }
        let commanded = match self.command.holding_valve > 0.0 {
            true => ValveState::Open,
            false => ValveState::Shut,
        };
        let has_switched = self.valve_since > l.valve_time + l.stale;
        if self.state != State::Idle && has_switched && seen.valve.is_some_and(|v| v != commanded) {
            wrong.found(Cause::ValveNotFollowing);
        }
    }

    /// The load: held, sinking, on its course, and within its stroke.
    fn judge_load(&self, seen: &Observation, wrong: &mut MostSevere) {
        let l = &self.limits;
        let r = &seen.reading;
        // faster than the pump can drive it: the piston moves by itself
        let fastest = l.motor_speed * l.speed_per_motor_speed;
        if self.plausibility.velocity().abs() > RUNAWAY * fastest.max(l.speed) {
            wrong.found(Cause::Runaway);
        }
        match self.state {
            State::Ready | State::Holding | State::Fault => {
                // a release lifts the load, and never lowers it
                let moved = self.held_at.map_or(0.0, |at| r.stroke - at);
                let against = -l.release.direction * moved;
                let releasing = self.release.is_some();
                if (if releasing { against } else { moved.abs() }) > l.creep {
                    wrong.found(Cause::LoadNotHeld);
                }
            }
            State::Moving if !self.controls() => {
                let sank = self.held_at.map_or(0.0, |at| l.release.direction * (at - r.stroke));
                if sank > l.creep {
                    wrong.found(Cause::LoadSank);
                }
            }
            State::Moving => {
                if !seen.wanted.is_finite() {
                    wrong.found(Cause::ControllerInvalid);
                }
                // a reference that is not a number is no reference
                let is_near = (r.stroke - seen.reference).abs() <= seen.tracking;
                if !is_near {
                    wrong.found(Cause::TrackingError);
                }
                // slower than this a piston may touch its stop
                let touches = l.creep / l.still.1;
                let velocity = self.plausibility.velocity();
                let margin = l.end_margin(velocity);
                let is_low = r.stroke < margin && velocity < -touches;
                let is_high = r.stroke > l.stroke - margin && velocity > touches;
                if is_low || is_high {
                    wrong.found(Cause::EndOfStroke);
                }
            }
            _ => {}
        }
    }

    /// Behind an open valve: pump side against cylinder, and position against delivered flow.
    fn judge_open_valve(&mut self, seen: &Observation, elapsed: f64, wrong: &mut MostSevere) {
        let l = self.limits;
        let r = &seen.reading;
        let [pump, load, other_pump, _] = self.sides(r);
        let (most, time) = l.pressure_agreement;
        let apart = (pump - load).abs() > most;
        self.disagreeing = if apart { self.disagreeing + elapsed } else { 0.0 };
        if self.disagreeing > time {
            wrong.found(Cause::PressureDisagrees);
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
                wrong.found(Cause::PositionFlowDisagree);
            }
        }
    }
}
