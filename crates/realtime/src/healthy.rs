//! False-alarm test: courses on healthy machines, from held load to held load, which no fault may stop.

use crate::lockstep::Lockstep;
use crate::operator::Operator;
use crate::setup::SetupError;
use crate::trouble::{Tampering, Trouble};
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::plausibility::RUNAWAY;
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_model::SimulationError;
use std::sync::Arc;

/// Result of a course on a healthy machine, which must not be stopped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HealthyRun {
    /// Fault that the supervisor reported; none if the course was finished.
    pub cause: Option<Cause>,
    /// Course time of the stop \[s\]; none without a stop, and before the load was released.
    pub stopped_at: Option<f64>,
    /// Whether the machine itself had exceeded a limit at the stop: tracking error, piston speed, distance
    /// to an end stop, or a pressure. Such a stop is caused by the controller and is no false alarm.
    pub limit_exceeded: bool,
    /// Duration of the release \[s\].
    pub release_time: f64,
    /// Largest lift of the load during the release, and largest drop until the course began \[m\].
    pub release_motion: (f64, f64),
    /// Error of the machine's simulation; none if it ran to the end.
    pub broke: Option<SimulationError>,
}

/// Largest duration of a course in excess of its trajectory \[s\].
const LONGEST: f64 = 60.0;
/// Share of a limit that the true quantity reaches where its measurement reaches the limit.
const LIMIT_FRACTION: f64 = 0.9;

/// Simulates a trajectory on a healthy machine whose payload changes during the course: `loads` has the course time
/// \[s\] and the new mass \[kg\] of each change, in order of time. It ends at the latest 60 s after the duration of
/// the trajectory.
///
/// # Errors
///
/// [`SetupError`] if a crane cannot be built, or there are no supervision limits for the model.
pub fn healthy_run(
    model: &Description,
    machine: &Description,
    path: Arc<dyn Trajectory>,
    loads: &[(f64, f64)],
    strategy: Strategy,
) -> Result<HealthyRun, SetupError> {
    let period = model.numbers.control_period;
    let periods = ((path.duration() + LONGEST) / period) as u32;
    let mut run = Lockstep::along(model, machine, path, strategy)?;
    let mut operator = Operator::automatic(period);
    let mut trouble = Trouble::new(machine);
    let n = &model.numbers;
    let tracking = match strategy.measures() {
        true => n.supervision_tracking,
        false => n.supervision_tracking_open_loop,
    };
    let limits = limits(model, n.fast)?;
    let fastest = RUNAWAY * limits.motor_speed * limits.speed_per_motor_speed;
    let held = run.truth().outputs.stroke;
    let mut healthy = HealthyRun {
        cause: None,
        stopped_at: None,
        limit_exceeded: false,
        release_time: 0.0,
        release_motion: (0.0, 0.0),
        broke: None,
    };
    let mut loads = loads;
    let (mut fastest_of_late, velocity_step) = (0.0_f64, fastest / 100.0);
    for _ in 0..periods {
        let record = match run.disturbed_period(&mut operator, strategy, &mut trouble) {
            Ok(record) => record,
            Err(error) => {
                healthy.broke = Some(error);
                return Ok(healthy);
            }
        };
        trouble.pass();
        // the supervisor's piston velocity is a mean over twenty measurements
        let velocity = run.truth().outputs.velocity.abs();
        fastest_of_late = velocity.max(fastest_of_late - velocity_step);
        if record.decision.releasing {
            healthy.release_time += period;
        }
        match record.course_time {
            None if healthy.stopped_at.is_none() => {
                let moved = run.truth().outputs.stroke - held;
                let (lifted, sank) = healthy.release_motion;
                healthy.release_motion = (lifted.max(moved), sank.max(-moved));
            }
            None => {}
            Some(time) => {
                healthy.stopped_at = Some(time);
                while let Some(((at, mass), later)) = loads.split_first()
                    && *at <= time
                {
                    trouble.tamper(Tampering::Payload(*mass));
                    loads = later;
                }
            }
        }
        if operator.is_done() {
            healthy.cause = record.decision.cause;
            healthy.limit_exceeded = record.decision.cause.is_some_and(|cause| {
                let outputs = run.truth().outputs;
                let apart = (outputs.stroke - record.reference.position).abs();
                match cause {
                    Cause::TrackingError => apart > LIMIT_FRACTION * tracking,
                    Cause::Runaway => fastest_of_late > LIMIT_FRACTION * fastest,
                    Cause::EndOfStroke => {
                        let left = outputs.stroke.min(limits.stroke - outputs.stroke);
                        LIMIT_FRACTION * left < limits.end_margin(fastest_of_late)
                    }
                    Cause::OverPressure => {
                        let pressures = [
                            outputs.pressure_pump_a,
                            outputs.pressure_a,
                            outputs.pressure_b,
                            outputs.pressure_pump_b,
                        ];
                        pressures.into_iter().fold(0.0, f64::max) > LIMIT_FRACTION * limits.pressure
                    }
                    _ => false,
                }
            });
            break;
        }
    }
    Ok(healthy)
}
