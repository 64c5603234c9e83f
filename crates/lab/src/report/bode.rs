//! Bode diagrams of the linearised crane.

use super::document::{Page, document};
use super::drawing_data::figure;
use super::figure::{Axes, Figure, Series};
use crate::LabError;
use crate::linearise::{Mode, response};
use maud::html;
use nalgebra::{Complex, DMatrix};

/// Lowest and highest frequency \[Hz\], and number of points.
const LOW: f64 = 0.05;
const HIGH: f64 = 200.0;
const POINTS: i32 = 600;

/// Page with the frequency responses of selected outputs to the motor speed, and the poles.
///
/// The system is x' = A x + B u, y = C x in SI units. `outputs` has for each response its name, its row of C, and the
/// factor from SI units per rev/s to the displayed unit per rpm.
///
/// # Errors
///
/// [`LabError::Figure`] if a figure cannot be drawn, as without outputs.
pub fn bode_page(
    title: &str,
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    c: &DMatrix<f64>,
    outputs: &[(&str, usize, f64)],
    modes: &[Mode],
) -> Result<Page, LabError> {
    let frequencies: Vec<f64> =
        (0..=POINTS).map(|i| LOW * (HIGH / LOW).powf(f64::from(i) / f64::from(POINTS))).collect();
    let (mut sizes, mut phases) = (Vec::new(), Vec::new());
    for (name, row, factor) in outputs {
        let c_row: Vec<f64> = c.row(*row).iter().copied().collect();
        let of = |f: f64| Some((f, response(a, b, &c_row, f)? * Complex::from(*factor)));
        let (size, phase) = size_and_phase(frequencies.iter().filter_map(|f| of(*f)));
        sizes.push((*name, size));
        phases.push((*name, phase));
    }
    let x = "frequency [Hz]";
    let y = "magnitude [unit/rpm]";
    let sizes = Figure { x, y, series: Series::list(sizes), axes: Axes::Logarithmic };
    let y = "phase [deg]";
    let phases = Figure { x, y, series: Series::list(phases), axes: Axes::LogarithmicX };
    let body = html! {
        p.soft { "From motor speed [rpm], by exact derivatives of the model at this operating point." }
        (figure("Magnitude: gain of each output per rpm of motor speed, by frequency.", &sizes.drawn()?))
        (figure("Phase of each output; a change of -180 deg marks a mode of the load.", &phases.drawn()?))
        h2 { "Poles" }
        div.wide { table {
            thead { tr { th { "real [1/s]" } th { "imaginary [rad/s]" } th { "frequency [Hz]" } th { "damping ratio" } } }
            tbody { @for mode in modes { tr {
                td { (format!("{:.4}", mode.real)) } td { (format!("{:.4}", mode.imaginary)) }
                td { (format!("{:.4}", mode.frequency_hz)) } td { (format!("{:.5}", mode.damping_ratio)) }
            } } }
        } }
    };
    Ok(document(title, &body))
}

/// Points of a figure.
type Points = Vec<(f64, f64)>;

/// Magnitude, and unwrapped phase \[deg\], over the frequency.
pub(super) fn size_and_phase(
    values: impl Iterator<Item = (f64, Complex<f64>)>,
) -> (Points, Points) {
    let mut last: Option<f64> = None;
    let both = values.map(|(f, value)| {
        let mut angle = value.arg().to_degrees();
        if let Some(last) = last {
            angle -= ((angle - last) / 360.0).round() * 360.0;
        }
        last = Some(angle);
        ((f, value.norm()), (f, angle))
    });
    both.unzip()
}
