//! Tracking error and p_A of machines under the scheduled LQR, which uses the described crane only.

use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_identify::Free;
use hydroboom_lab::LabError;
use hydroboom_lab::closed_loop::simulation::simulate_closed_loop;
use hydroboom_sensitivity::with_value;
use rayon::prelude::*;

/// RMS true tracking error \[m\] and RMS of p_A about its mean \[Pa\] of a machine with these numbers,
/// ideal sensors and motor, along the motion at a speed \[m/s\].
///
/// # Errors
///
/// [`LabError`] if there is no such machine, or its state leaves the model's range of validity.
pub fn rerun(
    crane: &Description,
    numbers: &Numbers<f64>,
    speed: f64,
) -> Result<[f64; 2], LabError> {
    let mut machine = crane.clone();
    machine.numbers = *numbers;
    let (model, machine) = (crane.without_equipment(), machine.without_equipment());
    let (mut square, mut pressures) = (0.0, Vec::new());
    let course = model.motion(speed);
    simulate_closed_loop(&model, &machine, Strategy::ScheduledLqr, &course, |sample| {
        square += sample.true_error().powi(2);
        pressures.push(sample.truth.outputs.pressure_a);
        Ok(())
    })?;
    let count = pressures.len().max(1) as f64;
    let mean = pressures.iter().sum::<f64>() / count;
    let swing = pressures.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / count;
    Ok([(square / count).sqrt(), swing.sqrt()])
}

/// The same with each key at both ends of its range \[SI\]; none if there is no such machine, or it cannot
/// follow.
pub fn at_ends(
    crane: &Description,
    ends: &[(Free, [f64; 2])],
    speed: f64,
) -> Vec<[Option<[f64; 2]>; 2]> {
    let at = |key: Free, value: f64| rerun(crane, &with_value(crane, key, value), speed).ok();
    ends.par_iter().map(|(key, values)| values.map(|value| at(*key, value))).collect()
}
