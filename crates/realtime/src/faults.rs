//! The fault campaign: everything that can go wrong, at several moments, under every strategy.

use crate::fault::Fault;
use crate::lockstep::Lockstep;
use crate::operator::Operator;
use crate::trouble::{Tampering, Trouble};
use hydroboom_control::{Cause, Motion, State, Strategy};
use hydroboom_description::Description;
use hydroboom_model::SimulationError;
use hydroboom_plant::PlantError;

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

/// One fault, under one strategy, at one moment, in simulated time.
///
/// # Errors
///
/// [`PlantError`] when the cranes cannot be built.
pub fn inject(
    model: &Description,
    machine: &Description,
    motion: Motion<f64>,
    strategy: Strategy,
    fault: Fault,
    moment: &Moment,
) -> Result<Outcome, PlantError> {
    let mut run = Lockstep::new(model, machine, motion, strategy)?.learning(None);
    let mut operator = Operator::new(true);
    let mut trouble = Trouble::new(machine);
    // periods since it went wrong
    let mut wrong_for: Option<u32> = None;
    let mut outcome = Outcome {
        fault,
        strategy,
        moment: moment.name,
        cause: None,
        safe_after: None,
        fallback: false,
        strayed: 0.0,
        moved_after: 0.0,
        broke: None,
    };
    let period = model.numbers.control_period;
    let (mut error_before, mut safe_at, mut course_time) = (None, None, None);
    let mut after_safe = 0;
    let longest = motion.duration() + LONGEST;
    for _ in 0..(longest / period) as u32 {
        if after_safe >= (2.0 / period) as u32 {
            break;
        }
        let is_due = course_time.is_some_and(|time| time >= moment.time);
        match wrong_for {
            Some(periods) => {
                trouble.pass();
                wrong_for = Some(periods + 1);
            }
            None if is_due => {
                trouble.tamper(Tampering::Fault(fault));
                operator.emergency |= fault == Fault::EmergencyStop;
                wrong_for = Some(0);
            }
            None => {}
        }
        let record = match run.disturbed_period(&mut operator, strategy, &mut trouble) {
            Ok(record) => record,
            Err(error) => {
                outcome.broke = Some(error);
                return Ok(outcome);
            }
        };
        course_time = record.course_time.or(course_time);
        let stroke = run.truth().outputs.stroke;
        let Some(since) = wrong_for else { continue };
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
    Ok(outcome)
}
