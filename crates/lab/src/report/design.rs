//! A design of model following, before anything moves.

use super::bode::size_and_phase;
use super::document::{document, figure};
use super::figure::{Axes, Figure, Series};
use crate::LabError;
use hydroboom_control::model_following::ModelFollowing;
use hydroboom_description::Description;
use hydroboom_design::{Lifting, Look, Loop, machine_loops};
use maud::html;

/// Lowest and highest frequency \[Hz\], and points between them.
const FREQUENCIES: [f64; 2] = [0.05, 200.0];
const POINTS: u32 = 600;

/// A page with the loops' Bode figures at mid-stroke, a step of the simulated crane, its poles and all margins.
///
/// # Errors
///
/// [`LabError`] when a figure cannot be drawn, or the crane not be linearised.
pub fn design_page(
    crane: &Description,
    law: &ModelFollowing<f64>,
    looks: &[Look],
    step: &[[f64; 3]],
) -> Result<String, LabError> {
    let stroke = 0.5 * crane.numbers.stroke;
    let linear = Lifting::new(crane, stroke)?;
    let state = Loop::of_state(law, stroke);
    let [machine, benchmark] = machine_loops(law, crane, stroke);
    let loops = [
        ("state feedback on the simulated crane", state),
        ("feedback from the machine", machine),
        ("benchmark", benchmark),
    ];
    let [low, high] = FREQUENCIES;
    let (mut sizes, mut phases) = (Vec::new(), Vec::new());
    for (name, around) in &loops {
        let frequency = |k: u32| low * (high / low).powf(f64::from(k) / f64::from(POINTS));
        let of = |f: f64| Ok::<_, LabError>((f, around.gain(&linear.responses(f)?, f)));
        let values = (0..=POINTS).map(|k| of(frequency(k))).collect::<Result<Vec<_>, _>>()?;
        let (size, phase) = size_and_phase(values.into_iter());
        sizes.push((*name, size));
        phases.push((*name, phase));
    }
    let x = "frequency [Hz]";
    let bode = |y, list, axes| Figure { x, y, series: Series::list(list), axes }.svg();
    let size = bode("loop gain", sizes, Axes::Logarithmic)?;
    let phase = bode("phase [deg]", phases, Axes::LogarithmicX)?;
    let over = |k: usize, factor: f64| step.iter().map(|s| (s[0], s[k] * factor)).collect();
    let time = |y, name, points| {
        let series = Series::list([(name, points)]);
        Figure { x: "time [s]", y, series, axes: Axes::Linear }.svg()
    };
    let position = time("position [mm]", "simulated crane", over(1, 1e3))?;
    let motor = time("motor speed [rpm]", "simulated motor", over(2, 60.0))?;
    let n = &crane.numbers;
    let body = html! {
        p {
            "Bandwidth " (n.following_bandwidth) " Hz, damping ratio " (n.following_damping) ", lead "
            (format!("{:.1}", n.following_lead * 1e3)) " ms, observer of what the machine differs " (n.following_observer) " Hz (keys of [following] in the crane file)."
        }
        h2 { "Loops at mid-stroke, broken at the motor" }
        (figure("Gain.", &size))
        (figure("Phase.", &phase))
        h2 { "A step of 1 mm of the simulated crane's reference" }
        (figure("Position.", &position))
        (figure("Motor speed, within its limits.", &motor))
        h2 { "Poles and margins" }
        p.soft {
            "A slow pole at about +0.1 1/s is that of the low-pressure side, whose check valves are shut where the crane was linearised; they "
            "open before it matters."
        }
        @for look in looks {
            h3 { (format!("{:.0} mm: rings at {:.2} Hz, damping ratio {:.4}", look.stroke_mm, look.rings.frequency_hz, look.rings.damping_ratio)) }
            div.wide { table {
                thead { tr { th { "loop" } th { "phase margin [deg]" } th { "gain margin" } th { "distance from -1" } th { "at [Hz]" } th { "crossover [Hz]" } } }
                tbody { @for (name, m) in [("state feedback", &look.state_feedback), ("machine", &look.machine), ("benchmark", &look.benchmark)] { tr {
                    td { (name) } td { (format!("{:.0}", m.phase_deg)) }
                    td { @if m.gain.is_finite() { (format!("{:.1}", m.gain)) } @else { "none" } }
                    td { (format!("{:.2}", m.distance)) } td { (format!("{:.2}", m.at_hz)) } td { (format!("{:.2}", m.crossover_hz)) }
                } } }
            } }
            p.soft {
                "Poles with state feedback [1/s]: "
                @for pole in &look.poles {
                    @if pole.imaginary > 0.0 { (format!("{:.1} ± {:.1}i", pole.real, pole.imaginary)) } @else { (format!("{:.1}", pole.real)) }
                    ", "
                }
                "all of the linearised crane, bending included, without the smoothing."
            }
        }
    };
    Ok(document(&format!("{}: model following, designed", crane.name), &body))
}
