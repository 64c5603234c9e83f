//! Design report: loops of the benchmark and of the scheduled LQR.

use super::bode::size_and_phase;
use super::document::{Page, document};
use super::drawing_data::figure;
use super::figure::{Axes, Figure, Series};
use super::palette::colour_of;
use crate::LabError;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_design::linear::Mode;
use hydroboom_design::stability::LoopStability;
use hydroboom_design::{DesignReport, LinearisedPlant, benchmark_loop, scheduled_lqr_loop};
use maud::html;

/// Lowest and highest frequency \[Hz\], and number of points.
const FREQUENCIES: [f64; 2] = [0.05, 200.0];
const POINTS: u32 = 600;

fn load_mode(mode: Option<&Mode>) -> String {
    mode.map_or_else(
        || "load mode overdamped".into(),
        |mode| {
            format!(
                "load mode {:.2} Hz, damping ratio {:.4}",
                mode.frequency_hz, mode.damping_ratio
            )
        },
    )
}

/// Page with the Bode diagrams of the control loops at mid-stroke and all stability margins.
///
/// # Errors
///
/// [`LabError::Figure`] if a figure cannot be drawn; [`LabError::Design`] if the crane cannot be linearised, or the
/// scheduled LQR cannot be designed for it.
pub fn design_page(
    crane: &Description,
    reports: &[DesignReport],
    loops: &[LoopStability],
) -> Result<Page, LabError> {
    let stroke = 0.5 * crane.numbers.stroke;
    let linear = LinearisedPlant::new(crane, stroke)?;
    let shown = [
        ("benchmark", benchmark_loop(crane)),
        ("scheduled LQR", scheduled_lqr_loop(crane, stroke)?),
    ];
    let [low, high] = FREQUENCIES;
    let frequency = |k: u32| low * (high / low).powf(f64::from(k) / f64::from(POINTS));
    let (mut sizes, mut phases) = (Vec::new(), Vec::new());
    for (name, around) in &shown {
        let of = |f: f64| Ok::<_, LabError>((f, around.gain(&linear.responses(f)?, f)));
        let values = (0..=POINTS).map(|k| of(frequency(k))).collect::<Result<Vec<_>, _>>()?;
        let (size, phase) = size_and_phase(values.into_iter());
        sizes.push((*name, size));
        phases.push((*name, phase));
    }
    let x = "frequency [Hz]";
    let bode = |y, lines: Vec<(&'static str, Vec<(f64, f64)>)>, axes| {
        let places = [Strategy::BenchmarkClosedLoop, Strategy::ScheduledLqr].map(colour_of);
        let named = lines.into_iter().zip(places);
        let series =
            named.map(|((name, points), colour)| Series { name, points, colour }).collect();
        Figure { x, y, series, axes }.drawn()
    };
    let size = bode("loop gain", sizes, Axes::Logarithmic)?;
    let phase = bode("phase [deg]", phases, Axes::LogarithmicX)?;
    let body = html! {
        h2 { "Loop at mid-stroke, broken at the motor" }
        (figure("Loop gain: errors are suppressed where it is above 1; the peak is the load mode.", &size))
        (figure("Loop phase: its distance from -180 deg where the gain crosses 1 is the phase margin.", &phase))
        h2 { "Margins" }
        @for stability in loops.iter().filter(|of| !of.stable) {
            p.unstable { (stability.to_string()) }
        }
        @for report in reports {
            h3 { (format!("{:.0} mm: {}", report.stroke_mm, load_mode(report.load_mode.as_ref()))) }
            div.wide { table {
                thead { tr { th { "loop" } th { "phase margin [deg]" } th { "gain margin" } th { "modulus margin" } th { "at [Hz]" } th { "crossover [Hz]" } } }
                tbody { @for (name, m) in [("benchmark", &report.benchmark), ("scheduled LQR", &report.scheduled_lqr)] { tr {
                    td { (name) }
                    @if m.is_stable() {
                        td { (format!("{:.0}", m.phase_deg)) }
                        td { @if m.gain.is_finite() { (format!("{:.1}", m.gain)) } @else { "none" } }
                        td { (format!("{:.2}", m.modulus_margin)) } td { (format!("{:.2}", m.at_hz)) } td { (format!("{:.2}", m.crossover_hz)) }
                    } @else {
                        td.unstable { "unstable" } td { "-" } td { "-" } td { "-" } td { "-" }
                    }
                } } }
            } }
        }
    };
    Ok(document(&format!("{}: loops of the benchmark and of the scheduled LQR", crane.name), &body))
}
