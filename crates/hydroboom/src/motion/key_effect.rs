//! Effect of a single key in which the plant differs from the model.

use crate::output;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::{Description, Difference};
use hydroboom_lab::LabError;
use hydroboom_lab::eigenfrequency::{locked_mode, without_friction};
use hydroboom_lab::motion_test::run;
use serde::Serialize;

/// Effect of one changed key at the fast speed; all other keys are the model's.
#[derive(Serialize)]
pub struct KeyEffect {
    /// Path of the key.
    key: String,
    /// Value of the model, in the key's unit.
    model: String,
    /// Value of the plant, in the key's unit.
    plant: String,
    /// Unit of both values; empty for a choice.
    unit: String,
    /// RMS true tracking error under velocity feedforward \[mm\]: of the model, and of the changed plant.
    velocity_feedforward_rms_true_mm: [f64; 2],
    /// RMS difference of p_A between both \[bar\].
    pressure_a_rms_bar: f64,
    /// Lowest natural frequency with locked valve and without friction at mid-stroke \[Hz\]: of the model, and of the
    /// changed plant.
    eigenfrequency_hz: [f64; 2],
}

impl KeyEffect {
    /// Changes one key of the model, and simulates the fast motion of both.
    ///
    /// # Errors
    ///
    /// [`LabError`] if there is no such crane, its simulation fails, or it has no oscillatory mode.
    pub fn new(model: &Description, difference: &Difference) -> Result<Self, LabError> {
        let mut plant = model.clone();
        plant.set(&difference.assignment())?;
        let course = model.motion(model.numbers.fast);
        let drive = |plant| run(model, plant, Strategy::VelocityFeedforward, &course);
        let (before, after) = (drive(model)?, drive(&plant)?);
        let pairs = before.samples.iter().zip(&after.samples);
        let square: f64 = pairs
            .map(|(a, b)| (a.truth.outputs.pressure_a - b.truth.outputs.pressure_a).powi(2))
            .sum();
        let frequency = |description: &Description| -> Result<f64, LabError> {
            let frictionless = without_friction(description)?;
            Ok(locked_mode(&frictionless, 0.5 * description.numbers.stroke)?.frequency_hz)
        };
        Ok(Self {
            key: difference.key.clone(),
            model: difference.here.clone(),
            plant: difference.there.clone(),
            unit: difference.unit.into(),
            velocity_feedforward_rms_true_mm: [&before, &after]
                .map(|run| run.metrics().true_rms() * 1e3),
            pressure_a_rms_bar: (square / before.samples.len().max(1) as f64).sqrt() * 1e-5,
            eigenfrequency_hz: [frequency(model)?, frequency(&plant)?],
        })
    }

    fn cells(&self) -> Vec<String> {
        let [rms, changed_rms] = self.velocity_feedforward_rms_true_mm;
        let [f, changed_f] = self.eigenfrequency_hz;
        vec![
            self.key.clone(),
            self.model.clone(),
            self.plant.clone(),
            self.unit.clone(),
            format!("{rms:.3} -> {changed_rms:.3}"),
            format!("{:.3}", self.pressure_a_rms_bar),
            format!("{f:.3} -> {changed_f:.3}"),
        ]
    }
}

/// Table of the effects, a row for each key.
pub fn table(effects: &[KeyEffect]) -> String {
    let cells: Vec<Vec<String>> = effects.iter().map(KeyEffect::cells).collect();
    let header = [
        "changed key",
        "model",
        "plant",
        "unit",
        "velocity-FF RMS true [mm]",
        "p_A RMS [bar]",
        "eigenfrequency [Hz]",
    ];
    output::table(&header, &cells)
}
