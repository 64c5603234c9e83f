//! Published results of the real crane, and the virtual crane's results in the same tests.

use crate::eigenfrequency::{locked_mode, without_friction};
use crate::{LabError, paper};
use crate::{motion_test::Run, motion_test::pressure_oscillation, motion_test::run};
use hydroboom_control::measurement::AxisSignals;
use hydroboom_control::reference::profile::OutAndBack;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use serde::Serialize;
use std::thread;

/// Result of the real crane as published in the paper.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Published {
    /// Name of the quantity with its unit.
    pub name: String,
    /// Number of the table in the paper.
    pub table: &'static str,
    /// Published value in the unit of the name.
    pub value: f64,
    /// Tolerance of the calibration as a share of the published value \[-\].
    pub tolerance: f64,
}

/// Number of published results: 3 eigenfrequencies, 4 errors each of two strategies, and 7 figures of Table 6.
pub const RESULTS: usize = 3 + 4 + 4 + 7;

/// All published results in the order of [`shown`].
pub fn published() -> Vec<Published> {
    let mut all = Vec::with_capacity(RESULTS);
    let mut add = |name: String, table, value, tolerance| {
        all.push(Published { name, table, value, tolerance });
    };
    for (stroke, hz) in paper::EIGEN_STROKE_MM.iter().zip(paper::EIGEN_MEASURED_HZ) {
        add(format!("eigenfrequency at {stroke} mm [Hz]"), "5", hz, 0.02);
    }
    for (strategy, table, tolerance, name) in [
        (Strategy::VelocityFeedforward, "7", 0.05, "velocity feedforward"),
        (Strategy::BenchmarkClosedLoop, "8", 0.20, "benchmark"),
    ] {
        let Some((rms, peak)) = paper::tracking_mm(strategy) else { continue };
        for (k, speed) in paper::SPEEDS_MM_S.iter().enumerate() {
            add(format!("{name}, {speed} mm/s, RMS [mm]"), table, rms[k], tolerance);
            add(format!("{name}, {speed} mm/s, peak [mm]"), table, peak[k], tolerance);
        }
    }
    for (signal, unit, _, rms) in paper::TABLE_6 {
        add(format!("crane less simulation, {signal} RMS [{unit}]"), "6", rms, 0.30);
    }
    let oscillation = "frequency of p_A's oscillation [Hz]";
    add(oscillation.into(), "6", paper::PRESSURE_OSCILLATION_MEASURED_HZ, 0.02);
    all
}

/// Runs of one virtual crane in the tests whose results are published.
#[derive(Clone, Debug)]
pub struct Tests {
    /// Eigenfrequencies at the three strokes of Table 5 \[Hz\].
    pub eigenfrequency: [f64; 3],
    /// Runs under velocity feedforward at the slow and the fast speed.
    pub velocity_feedforward: [Run; 2],
    /// Runs under the benchmark controller at the slow and the fast speed.
    pub benchmark: [Run; 2],
    /// The published model under velocity feedforward at the fast speed, for Table 6.
    pub simulated: Run,
    /// Fast motion, which defines the interval of constant speed.
    motion: OutAndBack<f64>,
}

/// Simulates the tests on a crane, with controllers designed for `model`, on two threads: Table 5 by linearisation
/// without friction, Tables 6 to 8 by runs at both speeds of the model.
///
/// # Errors
///
/// [`LabError::Plant`] if model or crane has no state of rest; [`LabError::Simulation`] if a state leaves the model's
/// range of validity. [`LabError::NoOscillation`] or [`LabError::Design`] if the linearised crane has no oscillatory
/// mode or its eigenvalues cannot be computed.
pub fn tests(model: &Description, crane: &Description) -> Result<Tests, LabError> {
    let [slow, fast] = [model.numbers.slow, model.numbers.fast];
    let pair = |strategy| -> Result<[Run; 2], LabError> {
        let along = |speed| run(model, crane, strategy, &crane.motion(speed));
        Ok([along(slow)?, along(fast)?])
    };
    thread::scope(|scope| {
        let other = scope.spawn(|| pair(Strategy::BenchmarkClosedLoop));
        let frictionless = without_friction(crane)?;
        let mut eigenfrequency = [0.0; 3];
        for (hz, stroke) in eigenfrequency.iter_mut().zip(paper::EIGEN_STROKE_MM) {
            *hz = locked_mode(&frictionless, stroke * 1e-3)?.frequency_hz;
        }
        let velocity_feedforward = pair(Strategy::VelocityFeedforward)?;
        let simulated = run(model, model, Strategy::VelocityFeedforward, &crane.motion(fast))?;
        let benchmark = match other.join() {
            Ok(runs) => runs?,
            Err(panic) => std::panic::resume_unwind(panic),
        };
        let motion = crane.motion(fast);
        Ok(Tests { eigenfrequency, velocity_feedforward, benchmark, simulated, motion })
    })
}

/// Results of the tests in the order and the units of [`published`].
///
/// # Errors
///
/// [`LabError::NoOscillation`] if p_A makes fewer than two whole periods at constant speed.
pub fn shown(tests: &Tests) -> Result<[f64; RESULTS], LabError> {
    let mut values = Vec::with_capacity(RESULTS);
    values.extend(tests.eigenfrequency);
    for run in tests.velocity_feedforward.iter().chain(&tests.benchmark) {
        values.extend([run.rms() * 1e3, run.peak() * 1e3]);
    }
    let fast = &tests.velocity_feedforward[1];
    values.extend(differences(&tests.simulated, fast).map(|(rms, _)| rms));
    values.push(pressure_oscillation(&tests.motion, fast)?);
    values.try_into().map_err(|_| LabError::NoOscillation("a result is missing".into()))
}

/// Table 6 of a crane: [`differences`] between the published model and the crane, both under velocity
/// feedforward along the crane's fast motion.
///
/// # Errors
///
/// [`LabError::Plant`] if model or crane has no state of rest; [`LabError::Simulation`] if a state leaves the model's
/// range of validity.
pub fn table_6(model: &Description, crane: &Description) -> Result<[(f64, f64); 6], LabError> {
    let course = crane.motion(model.numbers.fast);
    let drive = |plant| run(model, plant, Strategy::VelocityFeedforward, &course);
    Ok(differences(&drive(model)?, &drive(crane)?))
}

/// Table 6: RMS and peak of the difference, crane minus simulation, of each signal between two runs under
/// the same input, in the table's units: position \[mm\], then five pressures \[bar\]. The paper does not define the
/// sign. With this one all six signs of its peaks agree with the calibrated crane's; with the opposite one none does.
///
/// Signals are the measured ones, period by period. Zero if a run has no samples; NaN in a signal makes its RMS NaN.
pub fn differences(simulated: &Run, crane: &Run) -> [(f64, f64); 6] {
    let signals = |r: &AxisSignals<f64>| {
        [
            r.stroke * 1e3,
            r.pressure_a * 1e-5,
            r.pressure_b * 1e-5,
            r.pressure_pump_a * 1e-5,
            r.pressure_pump_b * 1e-5,
            r.pressure_accumulator * 1e-5,
        ]
    };
    let mut squares = [0.0; 6];
    let mut peaks = [0.0_f64; 6];
    for (s, c) in simulated.samples.iter().zip(&crane.samples) {
        let (s, c) = (signals(&s.signals), signals(&c.signals));
        for k in 0..6 {
            let difference = c[k] - s[k];
            squares[k] += difference * difference;
            if difference.abs() > peaks[k].abs() {
                peaks[k] = difference;
            }
        }
    }
    let count = simulated.samples.len().max(1) as f64;
    std::array::from_fn(|k| ((squares[k] / count).sqrt(), peaks[k]))
}
