//! Eigenfrequencies with the load held, and the pressure's oscillation with the valve open.

use super::{optional, percent};
use crate::LabError;
use crate::report::drawing_data::figure;
use crate::report::figure::{Axes, Figure, Series};
use crate::study::Study;
use maud::{Markup, html};

pub(super) fn eigenfrequencies(study: &Study) -> Result<Markup, LabError> {
    let beside_paper = study.is_papers_crane;
    let ringing = match &study.oscillation {
        Some(seen) => {
            let shown = seen.time.iter().zip(&seen.pressure_a).map(|(t, p)| (*t, p * 1e-5));
            let series = Series::list([("p_A", shown.collect())]);
            figure(
                "Figure 17: the boom dropped onto its locked cylinder at 200 mm, with friction.",
                &Figure { x: "time [s]", y: "p_A [bar]", series, axes: Axes::Linear }.drawn()?,
            )
        }
        None => html! {},
    };
    Ok(html! {
        h2 { @if beside_paper { "Table 5: e" } @else { "E" } "igenfrequencies, load-holding valve closed" }
        div.wide { table {
            thead { tr {
                th { "x_cyl [mm]" } @if beside_paper { th { "paper, simulated [Hz]" } } th { "here, linearised [Hz]" }
                @if beside_paper { th { "difference" } } th { "here, oscillation without friction [Hz]" }
                th { "here, with friction [Hz]" } @if beside_paper { th { "paper, measured [Hz]" } }
                @if study.virtual_eigenfrequency_hz.is_some() { th { "virtual crane [Hz]" } }
            } }
            tbody { @for (k, row) in study.eigenfrequency.iter().enumerate() { tr {
                td { (format!("{:.0}", row.stroke_mm)) }
                @if beside_paper { td { (optional(row.paper_simulated_hz, 2)) } }
                td { (format!("{:.3}", row.linearised_hz)) }
                @if beside_paper { td { (row.paper_simulated_hz.map_or(String::new(), |p| percent(row.linearised_hz / p - 1.0))) } }
                td { (optional(row.frictionless_hz, 3)) }
                td { (optional(row.oscillation_hz, 3)) }
                @if beside_paper { td { (optional(row.paper_measured_hz, 2)) } }
                @if let Some(hz) = study.virtual_eigenfrequency_hz { td { (format!("{:.3}", hz[k])) } }
            } } }
        } }
        p.soft {
            "Compared without friction, at a drop of 0.2 mm at the tip, with the trapped rod-side pressure of "
            "the crane file. " @if beside_paper { "The boom's stiffness is calibrated to the paper's simulated values. " } "With friction "
            "the drop is the crane file's; the frequency then differs, because friction dissipates within a few "
            "periods while the oil's stiffness changes with the large pressure swing, and near rest the smoothed friction "
            "is a stiff damper that all but locks the piston."
        }
        (ringing)
        @match study.pressure_oscillation_hz {
            Some(hz) => p {
                "With the valve open, during the fast motion, p_A oscillates at " strong { (format!("{hz:.3} Hz")) }
                @if let Some(paper) = study.paper_pressure_oscillation_hz {
                    " (paper's simulation: " (format!("{paper:.3}")) " Hz, " (percent(hz / paper - 1.0)) "; nothing was fitted to it)"
                }
                "."
            },
            None => p { "The fast motion does not show two whole periods of an oscillation of p_A with the valve open." },
        }
    })
}
