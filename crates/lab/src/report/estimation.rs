//! Estimated states and parameters along a log with their bounds.

use super::document::{Page, document};
use super::drawing_data::{Drawing, figure};
use super::figure::{Axes, Figure, Series};
use crate::LabError;
use crate::log_estimation::{ESTIMATES, EstimateRow, INNOVATIONS, LogEstimate, readable, unit};
use crate::log_verdict::InnovationSummary;
use maud::{Markup, html};

/// Page with estimated states and parameters along a log. Log and crane are given by their names; `notes` are remarks
/// on the reading of the log.
///
/// # Errors
///
/// [`LabError::Figure`] if a figure cannot be drawn, as without a finite estimate.
pub fn estimation_page(
    log: &str,
    crane: &str,
    found: &LogEstimate,
    notes: &[String],
) -> Result<Page, LabError> {
    let verdict = &found.verdict;
    let mut figures = Vec::new();
    for (k, (name, _)) in ESTIMATES.iter().enumerate() {
        if found.rows.iter().any(|row| row.estimate[k].is_finite()) {
            figures.push((*name, estimate_figure(found, k)?));
        }
    }
    let mut innovations = Vec::new();
    for (k, (name, _)) in INNOVATIONS.iter().enumerate() {
        if found.rows.iter().any(|row| row.innovation[k].is_finite()) {
            innovations.push((*name, innovation_figure(found, k)?));
        }
    }
    let body = html! {
        p { strong { (capital(&verdict.sentence())) "." } }
        p.soft {
            "The log " code { (log) } " beside \"" (crane) "\", from " (format!("{:.3}", found.begin)) " s on for "
            (format!("{:.1}", found.duration)) " s: estimates of the extended Kalman filter at the time of each measurement. Bounds are two standard deviations \
            of the error covariance, in which pump, friction, mass, load position and sensor lag have the spread of the crane file. The verdict judges the innovations; \
            bounds of what was not measured rest on that spread. How often they hold on virtual cranes: docs/reference/estimation.md."
        }
        h2 { "Findings on the signals" }
        @if verdict.findings.is_empty() { p { "None was found." } }
        ul { @for finding in &verdict.findings { li { (capital(&finding.text)) "." } } }
        h2 { "Not observable in this log" }
        ul { @for text in &verdict.unobservable { li { (capital(text)) "." } } }
        h2 { (capital(&found.last_heading())) }
        (table_of_estimates(found))
        h2 { "Innovations" }
        (table_of_innovations(found))
        p.soft {
            "Innovation: measurement less prediction of the filter. NIS: its square over its variance, 1 on average for a consistent filter. A second is \
            consistent where the mean NIS is at most 2; 90 % of the seconds must be. Measurement noise used: position "
            (format!("{:.3}", found.noise[0] * 1e3)) " mm, load pressure " (format!("{:.3}", found.noise[1] * 1e-5)) " bar."
        }
        @for (name, svg) in &innovations {
            (figure(&format!("Innovation of the {} (measured less predicted), and the band of two standard deviations that contains 95 % of it for a consistent filter.", readable(name)), svg))
        }
        h2 { "Over time" }
        @for (name, svg) in &figures {
            (figure(&format!("{}: estimate, and the band of two standard deviations about it.", capital(&readable(name))), svg))
        }
        h2 { "How the log was used" }
        ul { @for note in notes.iter().chain(&found.remarks) { li { (capital(note)) "." } } }
    };
    Ok(document("Hydroboom: estimates along a log", &body))
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    // a one-letter symbol keeps its case
    match (letters.next(), text.chars().nth(1)) {
        (Some(first), Some(second)) if second != '_' => {
            first.to_uppercase().chain(letters).collect()
        }
        _ => text.into(),
    }
}

fn table_of_estimates(found: &LogEstimate) -> Markup {
    let last = found.last_released();
    html! {
        div.wide { table {
            thead { tr { th { "estimate" } th { "value" } th { "bound (2 sigma)" } th { "bound at the start" } th { "unit" } } }
            tbody { @for (k, (name, _)) in ESTIMATES.iter().enumerate() { @if let Some(last) = last.filter(|row| row.estimate[k].is_finite()) { tr {
                td { (readable(name)) }
                td { (format!("{:.2}", last.estimate[k])) }
                td { (format!("{:.2}", 2.0 * last.deviation[k])) }
                td { (format!("{:.2}", 2.0 * found.initial_deviation[k])) }
                td.text { (unit(name)) }
            } } } }
        } }
    }
}

fn table_of_innovations(found: &LogEstimate) -> Markup {
    let verdict = &found.verdict;
    let row = |name: &str, s: &InnovationSummary| {
        html! { tr {
            td { (name) } td { (s.windows) } td { (format!("{:.2}", s.mean_nis)) }
            td { (format!("{:.0}", s.consistent_percent)) } td { (format!("{:+.2}", s.mean_over_sigma)) }
        } }
    };
    html! {
        div.wide { table {
            thead { tr { th { "measured" } th { "seconds" } th { "mean NIS" } th { "consistent [%]" } th { "mean [sigma]" } } }
            tbody {
                (row("position", &verdict.position))
                (row("load pressure", &verdict.load_pressure))
            }
        } }
    }
}

fn estimate_figure(found: &LogEstimate, k: usize) -> Result<Drawing, LabError> {
    let name = ESTIMATES[k].0;
    let of = |side: f64| {
        let at = |row: &EstimateRow| (row.time, row.estimate[k] + side * row.deviation[k]);
        found.rows.iter().map(at).collect()
    };
    let label = format!("{} [{}]", readable(name), unit(name));
    svg(&label, of(0.0), of(2.0), of(-2.0), "estimate")
}

fn innovation_figure(found: &LogEstimate, k: usize) -> Result<Drawing, LabError> {
    let name = INNOVATIONS[k].0;
    let of = |at: &dyn Fn(&EstimateRow) -> f64| {
        found.rows.iter().map(|row| (row.time, at(row))).collect()
    };
    let label = format!("innovation, {} [{}]", readable(name), unit(name));
    svg(
        &label,
        of(&|row| row.innovation[k]),
        of(&|row| 2.0 * row.innovation_deviation[k]),
        of(&|row| -2.0 * row.innovation_deviation[k]),
        "innovation",
    )
}

fn svg(
    y: &str,
    value: Vec<(f64, f64)>,
    upper: Vec<(f64, f64)>,
    lower: Vec<(f64, f64)>,
    name: &str,
) -> Result<Drawing, LabError> {
    let series = vec![
        Series { name: "+2 sigma", points: upper, colour: 1 },
        Series { name: "-2 sigma", points: lower, colour: 1 },
        Series { name, points: value, colour: 0 },
    ];
    Figure { x: "time of the log [s]", y, series, axes: Axes::Linear }.drawn()
}
