//! Healthy machines: a course from the held load to the held load, on which nothing may stop it.

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

/// What a course on a healthy machine came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HealthyRun {
    /// What stopped it, if anything.
    pub cause: Option<Cause>,
    /// Time of the course when it was stopped \[s\]; none before the load was released.
    pub stopped_at: Option<f64>,
    /// Whether the machine itself had left its limits then: the piston too far from its reference, faster
    /// than its pump can drive it or too close to an end stop, or a pressure too high. Such a stop is the
    /// controller's doing and no false alarm.
    pub limit_exceeded: bool,
    /// Duration of the release \[s\].
    pub release_time: f64,
    /// How far the release lifted the load, and how far it sank until the course began \[m\].
    pub release_motion: (f64, f64),
    /// Why the simulated machine broke, where it did.
    pub broke: Option<SimulationError>,
}

/// A course takes no longer than its path and this \[s\].
const LONGEST: f64 = 60.0;
/// Share of a limit that the machine itself reaches where what is read of it reaches the limit.
const LIMIT_FRACTION: f64 = 0.9;

/// Runs a path on a machine whose payload changes at times of the course: (time \[s\], mass \[kg\]).
///
/// # Errors
///
/// [`SetupError`] when a crane cannot be set up.
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
        // what is read of the piston's velocity is a mean over twenty readings
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
