//! Loops of the benchmark and of the scheduled LQR, before anything moves.

use super::bode::size_and_phase;
use super::document::{document, figure};
use super::figure::{Axes, Figure, Series};
use crate::LabError;
use hydroboom_description::Description;
use hydroboom_design::{DesignReport, LinearisedPlant, benchmark_loop, scheduled_lqr_loop};
use maud::html;

/// Lowest and highest frequency \[Hz\], and points between them.
const FREQUENCIES: [f64; 2] = [0.05, 200.0];
const POINTS: u32 = 600;

/// A page with the loop's Bode figures at mid-stroke, and all margins.
///
/// # Errors
///
/// [`LabError`] when a figure cannot be drawn, or the crane not be linearised.
pub fn design_page(crane: &Description, reports: &[DesignReport]) -> Result<String, LabError> {
    let stroke = 0.5 * crane.numbers.stroke;
    let linear = LinearisedPlant::new(crane, stroke)?;
    let loops = [
        ("benchmark", benchmark_loop(crane)),
        ("scheduled LQR", scheduled_lqr_loop(crane, stroke)?),
    ];
    let [low, high] = FREQUENCIES;
    let frequency = |k: u32| low * (high / low).powf(f64::from(k) / f64::from(POINTS));
    let (mut sizes, mut phases) = (Vec::new(), Vec::new());
    for (name, around) in &loops {
        let of = |f: f64| Ok::<_, LabError>((f, around.gain(&linear.responses(f)?, f)));
        let values = (0..=POINTS).map(|k| of(frequency(k))).collect::<Result<Vec<_>, _>>()?;
        let (size, phase) = size_and_phase(values.into_iter());
        sizes.push((*name, size));
        phases.push((*name, phase));
    }
    let x = "frequency [Hz]";
    let bode = |y, points, axes| Figure { x, y, series: Series::list(points), axes }.svg();
    let size = bode("loop gain", sizes, Axes::Logarithmic)?;
    let phase = bode("phase [deg]", phases, Axes::LogarithmicX)?;
    let body = html! {
        h2 { "Loop at mid-stroke, broken at the motor" }
        (figure("Gain.", &size))
        (figure("Phase.", &phase))
        h2 { "Margins" }
        @for report in reports {
            h3 { (format!("{:.0} mm: load mode {:.2} Hz, damping ratio {:.4}", report.stroke_mm, report.load_mode.frequency_hz, report.load_mode.damping_ratio)) }
            div.wide { table {
                thead { tr { th { "loop" } th { "phase margin [deg]" } th { "gain margin" } th { "modulus margin" } th { "at [Hz]" } th { "crossover [Hz]" } } }
                tbody { @for (name, m) in [("benchmark", &report.benchmark), ("scheduled LQR", &report.scheduled_lqr)] { tr {
                    td { (name) } td { (format!("{:.0}", m.phase_deg)) }
                    td { @if m.gain.is_finite() { (format!("{:.1}", m.gain)) } @else { "none" } }
                    td { (format!("{:.2}", m.modulus_margin)) } td { (format!("{:.2}", m.at_hz)) } td { (format!("{:.2}", m.crossover_hz)) }
                } } }
            } }
        }
    };
    Ok(document(&format!("{}: loops of the benchmark and of the scheduled LQR", crane.name), &body))
}
