//! Figures 18 to 23: position and pressures of the published model compared with a crane.

use super::drawing_data::figure;
use super::figure::{Axes, Figure, Series};
use crate::LabError;
use crate::motion_test::Run;
use hydroboom_control::measurement::AxisSignals;
use maud::{Markup, html};

type Signal = (u32, &'static str, &'static str, fn(&AxisSignals<f64>) -> f64);

/// Number of the paper's figure, signal, axis, value in the axis' unit.
const SIGNALS: [Signal; 6] = [
    (18, "x_cyl", "x_cyl [mm]", |r| r.stroke * 1e3),
    (19, "p_A", "p_A [bar]", |r| r.pressure_a * 1e-5),
    (20, "p_PA", "p_PA [bar]", |r| r.pressure_pump_a * 1e-5),
    (21, "p_PB", "p_PB [bar]", |r| r.pressure_pump_b * 1e-5),
    (22, "p_B", "p_B [bar]", |r| r.pressure_b * 1e-5),
    (23, "p_acc", "p_acc [bar]", |r| r.pressure_accumulator * 1e-5),
];

/// Figures of position and pressures of the published model and a crane, both under velocity feedforward along the
/// same course; `name` is the crane's.
///
/// # Errors
///
/// [`LabError::Figure`] if a figure cannot be drawn.
pub fn panels(simulated: &Run, crane: &Run, name: &str) -> Result<Markup, LabError> {
    let mut shown = Vec::new();
    for (number, signal, axis, of) in SIGNALS {
        let over = |run: &Run| -> Vec<(f64, f64)> {
            run.samples.iter().map(|s| (s.time, of(&s.signals))).collect()
        };
        let pairs = simulated.samples.iter().zip(&crane.samples);
        let difference: Vec<(f64, f64)> =
            pairs.map(|(s, c)| (s.time, of(&c.signals) - of(&s.signals))).collect();
        let square: f64 = difference.iter().map(|(_, d)| d * d).sum();
        let rms = (square / difference.len().max(1) as f64).sqrt();
        let most = difference.iter().map(|(_, d)| d.abs()).fold(0.0, f64::max);
        let svg = |y: &str, series| Figure { x: "time [s]", y, series, axes: Axes::Linear }.drawn();
        let both = [(name, over(crane)), ("published model", over(simulated))];
        let difference = vec![Series { name: "difference", points: difference, colour: 2 }];
        shown.push((
            format!("Figure {number} (a): {signal} of the {name} and of the published model, commanded alike."),
            svg(axis, Series::list(both))?,
            format!("(b) {axis}, {name} less published model: RMS {rms:.2}, at most {most:.2}."),
            svg(&format!("difference of {axis}"), difference)?,
        ));
    }
    Ok(html! {
        @for (above, signals, below, difference) in &shown {
            (figure(above, signals))
            (figure(below, difference))
        }
    })
}
