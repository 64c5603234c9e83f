//! The fault campaign: everything that can go wrong, at several moments, under every strategy.

use crate::fault::Fault;
use crate::lockstep::Lockstep;
use crate::operator::Operator;
use crate::setup::SetupError;
use crate::trouble::{Tampering, Trouble};
use hydroboom_control::{Cause, Motion, State, Strategy};
use hydroboom_description::Description;
use hydroboom_model::SimulationError;

/// When it goes wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Name in tables.
    pub name: &'static str,
    /// Time of the course \[s\].
    pub time: f64,
}

/// In the first ramp, in the cruise, and at rest at the far end.
pub fn moments(motion: &Motion<f64>) -> [Moment; 3] {
    let travel = motion.travel_time();
    [
        Moment { name: "ramp", time: motion.rest + 0.5 * motion.ramp },
        Moment { name: "cruise", time: motion.rest + 0.5 * travel },
        Moment { name: "rest", time: motion.rest + travel + 0.5 * motion.dwell },
    ]
}

/// What came of a fault.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// What went wrong.
    pub fault: Fault,
    /// Under which strategy.
    pub strategy: Strategy,
    /// When.
    pub moment: &'static str,
    /// What the supervisor found; none where the course was finished all the same.
    pub cause: Option<Cause>,
    /// Time from the fault to the safe state: motor at zero, valve de-energised \[s\]. For a
    /// finished course none.
    pub safe_after: Option<f64>,
    /// Whether the benchmark took over from the simulation.
    pub fallback: bool,
    /// How far the tracking error, truly, went from where it was at the fault, until the safe state or
    /// the end of the course \[m\].
    pub strayed: f64,
    /// How far the piston moved after the safe state, within two seconds \[m\].
    pub moved_after: f64,
    /// Why the machine broke, where it did.
    pub broke: Option<SimulationError>,
}

/// A case takes no longer than its course and this \[s\]: pre-loading, stopping, and two seconds more.
const LONGEST: f64 = 12.0;

/// A course on its way, in simulated time, up to the moment at which something is to go wrong: what
/// is the same for every fault, and is run once.
pub struct Underway {
    run: Lockstep,
    operator: Operator,
    trouble: Trouble,
    motion: Motion<f64>,
    strategy: Strategy,
    moment: Moment,
    /// Control period \[s\].
    period: f64,
    /// Periods that are left at most.
    left: u32,
    course_time: Option<f64>,
    /// Why the machine broke before anything went wrong, if it did.
    broke: Option<SimulationError>,
}

impl Underway {
    /// Runs the course up to the moment.
    ///
    /// # Errors
    ///
    /// [`SetupError`] when the cranes cannot be built, or there are no limits for the model.
    pub fn until(
        model: &Description,
        machine: &Description,
        motion: Motion<f64>,
        strategy: Strategy,
        moment: Moment,
    ) -> Result<Self, SetupError> {
        let period = model.numbers.control_period;
        let mut way = Self {
            run: Lockstep::new(model, machine, motion, strategy)?.learning(None),
            operator: Operator::automatic(period),
            trouble: Trouble::new(machine),
            motion,
            strategy,
            moment,
            period,
            left: ((motion.duration() + LONGEST) / period) as u32,
            course_time: None,
            broke: None,
        };
        while way.left > 0 && way.course_time.is_none_or(|time| time < moment.time) {
            way.left -= 1;
            match way.run.disturbed_period(&mut way.operator, strategy, &mut way.trouble) {
                Ok(record) => way.course_time = record.course_time.or(way.course_time),
                Err(error) => {
                    way.broke = Some(error);
                    break;
                }
            }
        }
        Ok(way)
    }

    /// What comes of a fault, from here to the end of the course or two seconds of safety.
    pub fn inject(&self, fault: Fault) -> Outcome {
        let Self { strategy, motion, moment, period, mut course_time, .. } = *self;
        let (mut run, mut operator) = (self.run.clone(), self.operator);
        let mut trouble = self.trouble.clone();
        let mut outcome = Outcome {
            fault,
            strategy,
            moment: moment.name,
            cause: None,
            safe_after: None,
            fallback: false,
            strayed: 0.0,
            moved_after: 0.0,
            broke: self.broke,
        };
        if outcome.broke.is_some() {
            return outcome;
        }
        trouble.tamper(Tampering::Fault(fault));
        operator.emergency |= fault == Fault::EmergencyStop;
        let (mut error_before, mut safe_at) = (None, None);
        let mut after_safe = 0;
        for since in 0..self.left {
            if after_safe >= (2.0 / period) as u32 {
                break;
            }
            let record = match run.disturbed_period(&mut operator, strategy, &mut trouble) {
                Ok(record) => record,
                Err(error) => {
                    outcome.broke = Some(error);
                    return outcome;
                }
            };
            trouble.pass();
            course_time = record.course_time.or(course_time);
            let stroke = run.truth().outputs.stroke;
            outcome.fallback |= record.fallback;
            let reference = motion.reference(course_time.unwrap_or(0.0)).position;
            let error = stroke - reference;
            let before = *error_before.get_or_insert(error);
            let command = &record.decision.command;
            let at_rest = command.motor_speed == 0.0 && command.holding_valve == 0.0;
            match (record.decision.state, safe_at) {
                (State::Fault, None) if at_rest => {
                    outcome.cause = record.decision.cause;
                    outcome.safe_after = Some(f64::from(since) * period);
                    safe_at = Some(stroke);
                }
                (State::Holding, None) if operator.is_done() && at_rest => safe_at = Some(stroke),
                (_, Some(at)) => outcome.moved_after = outcome.moved_after.max((stroke - at).abs()),
                (_, None) => outcome.strayed = outcome.strayed.max((error - before).abs()),
            }
            after_safe += u32::from(safe_at.is_some());
        }
        outcome
    }
}
