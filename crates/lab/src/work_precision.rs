//! Work-precision diagram: error relative to a converged reference over step size and computing time.

use crate::LabError;
use crate::energy_audit::scheme_name;
use hydroboom_description::{BuildError, Description};
use hydroboom_model::stepping::{Implicit, published, runge_kutta_4};
use hydroboom_model::{Crane, CraneState, Input, Scheme};
use serde::Serialize;
use std::time::Instant;

/// Motor speed over time with which the integration schemes are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Excitation {
    /// First two seconds of the fast motion, whose velocity is ramped.
    Motion,
    /// Steps of the motor speed between rest and the fast motion's speed in both directions, without ramps
    /// and drive lag.
    SpeedSteps,
}

impl Excitation {
    /// All excitations, in the order of tables.
    pub const ALL: [Self; 2] = [Self::Motion, Self::SpeedSteps];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Motion => "fast motion, ramped",
            Self::SpeedSteps => "steps of the motor's speed",
        }
    }
}

/// Error and computing time of one integration scheme with one step under one excitation.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Motor speed over time.
    pub excitation: Excitation,
    /// Name of the integration scheme.
    pub scheme: String,
    /// Integration step \[us\].
    pub step_us: f64,
    /// Largest error of the piston position over the motion \[mm\]; infinite if the scheme diverged.
    pub stroke_error_mm: f64,
    /// Largest error of the piston-side pressure over the motion \[bar\]; infinite if the scheme diverged.
    pub pressure_error_bar: f64,
    /// Computing time per simulated second \[ms/s\].
    pub time_ms_per_s: f64,
}

/// Duration of a trial \[s\]: the fast motion's ramp and one second at constant speed.
const DURATION: f64 = 2.0;
/// Interval at which the input changes and trajectories are compared \[s\]; a multiple of every step.
const INTERVAL: f64 = 2e-3;

/// Motor speed over that of the fast motion in each quarter of the trial with steps.
const STEPS: [f64; 4] = [0.0, 1.0, -1.0, 0.0];

/// Error and computing time of the integration schemes over the step, without substeps, so that their own stability
/// limits show. The reference is the explicit Runge-Kutta scheme with a step of 1 us.
///
/// # Errors
///
/// [`LabError::Build`] if no model of three segments can be built from the crane file, or it has no state of rest.
pub fn work_precision(description: &Description) -> Result<Vec<Point>, LabError> {
    let three = description.divided(3);
    let crane = three.crane::<3>()?;
    let motion = three.motion(three.numbers.fast);
    let start = crane.at_rest(&three.start(motion.start)).map_err(BuildError::from)?;
    let controller = three.benchmark();
    let cruise = motion.reference(motion.rest + motion.ramp + INTERVAL);
    let mut points = Vec::new();
    for excitation in Excitation::ALL {
        let count = (DURATION / INTERVAL) as usize;
        let inputs: Vec<Input<f64>> = (0..count)
            .map(|k| {
                let pump_speed = match excitation {
                    Excitation::Motion => {
                        let reference = motion.reference(motion.rest + k as f64 * INTERVAL);
                        controller.velocity_feedforward(&reference)
                    }
                    Excitation::SpeedSteps => {
                        STEPS[4 * k / count] * controller.velocity_feedforward(&cruise)
                    }
                };
                Input { pump_speed, holding_valve: 1.0 }
            })
            .collect();
        points.extend(trials(&crane, &start, &inputs, excitation));
    }
    Ok(points)
}

/// All schemes with all steps under one input sequence.
fn trials(
    crane: &Crane<f64, 3>,
    start: &CraneState<f64, 3>,
    inputs: &[Input<f64>],
    excitation: Excitation,
) -> Vec<Point> {
    let (reference, _) = trajectory(crane, start, inputs, Scheme::RungeKutta4, 1e-6);
    let trials: [(Scheme, &[f64]); 3] = [
        (Scheme::Published, &[5e-6, 10e-6, 20e-6, 50e-6, 100e-6, 200e-6, 500e-6, 1000e-6]),
        (Scheme::Implicit, &[20e-6, 50e-6, 100e-6, 200e-6, 500e-6, 1000e-6, 2000e-6]),
        (Scheme::RungeKutta4, &[2e-6, 5e-6, 10e-6]),
    ];
    let mut points = Vec::new();
    for (scheme, steps) in trials {
        for &step in steps {
            let (seen, seconds) = trajectory(crane, start, inputs, scheme, step);
            let worst = |of: fn(&(f64, f64)) -> f64| {
                let errors = seen.iter().zip(&reference).map(|(a, b)| (of(a) - of(b)).abs());
                errors.fold(
                    0.0,
                    |worst: f64, e| if e.is_nan() { f64::INFINITY } else { worst.max(e) },
                )
            };
            points.push(Point {
                excitation,
                scheme: scheme_name(scheme).into(),
                step_us: step * 1e6,
                stroke_error_mm: worst(|p| p.0) * 1e3,
                pressure_error_bar: worst(|p| p.1) * 1e-5,
                time_ms_per_s: seconds / DURATION * 1e3,
            });
        }
    }
    points
}

/// Piston position \[m\] and pressure \[Pa\] after every interval, and the computing time \[s\].
fn trajectory(
    crane: &Crane<f64, 3>,
    start: &CraneState<f64, 3>,
    inputs: &[Input<f64>],
    scheme: Scheme,
    step: f64,
) -> (Vec<(f64, f64)>, f64) {
    let implicit = Implicit::new(crane);
    let count = (INTERVAL / step).round() as usize;
    let mut state = *start;
    let mut states = Vec::with_capacity(inputs.len());
    let clock = Instant::now();
    for input in inputs {
        for _ in 0..count {
            match scheme {
                Scheme::Published => published(crane, &mut state, input, step),
                Scheme::Implicit => {
                    implicit.step(crane, &mut state, input, step);
                }
                Scheme::RungeKutta4 => runge_kutta_4(crane, &mut state, input, step),
            }
        }
        states.push(state);
    }
    let seconds = clock.elapsed().as_secs_f64();
    let seen = states.iter().map(|state| {
        let outputs = crane.outputs(state);
        (outputs.stroke, outputs.pressure_a)
    });
    (seen.collect(), seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of docs/reference/computing-time.md: largest errors of p_A \[bar\].
    #[test]
    fn errors_match_the_documented_values() {
        let points = work_precision(&Description::uia_single_boom().unwrap()).unwrap();
        for (excitation, scheme, step_us, stated) in [
            (Excitation::Motion, "implicit", 500.0, 4.4e-4),
            (Excitation::Motion, "implicit", 1000.0, 1.7e-3),
            (Excitation::Motion, "implicit", 2000.0, 7e-3),
            (Excitation::Motion, "published", 50.0, 0.14),
            (Excitation::SpeedSteps, "implicit", 500.0, 0.43),
            (Excitation::SpeedSteps, "implicit", 1000.0, 2.1),
            (Excitation::SpeedSteps, "implicit", 2000.0, 1.4),
            (Excitation::SpeedSteps, "published", 50.0, 0.54),
        ] {
            let is = |p: &&Point| {
                p.excitation == excitation
                    && p.scheme == scheme
                    && (p.step_us - step_us).abs() < 1e-6
            };
            let bar = points.iter().find(is).unwrap().pressure_error_bar;
            assert!(
                (bar / stated - 1.0).abs() < 0.05,
                "{excitation:?}, {scheme}, {step_us} us: {bar} bar"
            );
        }
    }
}
