//! Report of the comparison of a log with the model.

use super::segment::{Finding, SegmentComparison};
use super::segment_text::{
    AFTER_CORRECTION, HEADER, UNRELIABLE_FREQUENCY, has_unreliable_frequency, row,
};
use crate::verdict_text;
use hydroboom_description::Description;
use hydroboom_description::schema::CircuitChoice;
use hydroboom_identify::{COMPARED, Experiment};
use hydroboom_lab::LabError;
use hydroboom_lab::paper;
use hydroboom_lab::report::{Axes, Drawing, Figure, Page, Series, document, figure};
use hydroboom_measurement::Signal;
use maud::{Markup, html};
use std::path::Path;

/// Page with verdicts, findings, table, and figures of every signal in every segment.
///
/// # Errors
///
/// [`LabError`] if a figure cannot be drawn.
pub fn page(
    log: &Path,
    crane: &Description,
    segments: &[SegmentComparison],
    notes: &[String],
) -> Result<Page, LabError> {
    // the paper's values are shown for its own crane only
    let is_published = paper::is_its_crane(crane);
    let figures = figures(segments, is_published)?;
    let body = html! {
        (conditions(log, crane, segments))
        @for note in notes { p.soft { "Note: " (note) } }
        h2 { "Findings" }
        (findings_text(segments))
        h2 { "In numbers" @if is_published { ", beside Table 6" } }
        (difference_table(segments, is_published))
        @for figure in &figures { (figure) }
    };
    Ok(document("Hydroboom: log and model", &body))
}

/// Verdicts, and the conditions of the comparison.
fn conditions(log: &Path, crane: &Description, segments: &[SegmentComparison]) -> Markup {
    let driven_by = match crane.choices.circuit {
        CircuitChoice::SelfContained => {
            "the log's motor speed and valve. It starts at rest at the log's piston position with the log's pressures, except for the one \
                 that carries the load"
        }
        CircuitChoice::ValveControlled => {
            "the log's valve command, supply and tank pressure. It starts at rest at the log's piston position with the log's pressures, \
                  as far as friction carries the remaining load"
        }
    };
    html! {
        @for segment in segments {
            p { b { (verdict_text::sentence(&segment.verdict)) } (segment_name(segments, &segment.experiment)) }
        }
        p.soft {
            "The log " code { (log.display()) } " beside \"" (crane.name) "\""
            @for SegmentComparison { experiment, .. } in segments { ", from " (format!("{:.3}", experiment.begin)) " s on for " (format!("{:.1}", experiment.duration())) " s" } ". The model is driven by " (driven_by) ". All differences are log less model."
        }
    }
}

/// Descriptions of the differences and of delayed inputs, verdicts after correction, and advice.
fn findings_text(segments: &[SegmentComparison]) -> Markup {
    html! {
        @for (segment, finding) in findings(segments) {
            p { (finding.text) (segment_name(segments, &segment.experiment)) }
        }
        @for segment in segments { @for input in &segment.delayed_inputs {
            p { (input) (segment_name(segments, &segment.experiment)) }
        } }
        @for segment in segments { @if let Some(verdict) = &segment.corrected_verdict {
            p { (AFTER_CORRECTION) " " (verdict_text::sentence(verdict)) (segment_name(segments, &segment.experiment)) }
        } }
        @for segment in segments { @if let Some(advice) = &segment.advice {
            p { (advice) (segment_name(segments, &segment.experiment)) }
        } }
        p.soft {
            "Candidate keys follow from exact derivatives and are tested by running the model with that key changed: "
            "a hint where to look, no result. " code { "hydroboom show" } " lists where each value comes from."
        }
    }
}

/// Table of the differences, beside the paper's for its crane, and its explanation.
fn difference_table(segments: &[SegmentComparison], is_published: bool) -> Markup {
    let paper_row = |signal: Signal| paper::TABLE_6.iter().find(|row| row.0 == signal.symbol());
    let is_unreliable = |finding: &Finding| has_unreliable_frequency(&row(finding));
    html! {
        div.wide { table {
            thead { tr { @for name in HEADER { th { (name) } } @if is_published { th { "paper's RMS" } th { "paper's peak" } } } }
            tbody { @for (segment, finding) in findings(segments) { tr {
                @for (k, cell) in row(finding).into_iter().enumerate() {
                    td { (cell) @if k == 0 { (segment_name(segments, &segment.experiment)) } }
                }
                @if is_published { @match paper_row(finding.difference.signal) {
                    Some((_, _, peak, rms)) => { td { (format!("{rms:.3}")) } td { (format!("{peak:.3}")) } }
                    None => { td { "-" } td { "-" } }
                } }
            } } }
        } }
        p.soft {
            "Fit: 100 % less the share of the log's own standard deviation that the model misses. Coloured: share \
             of the difference's autocorrelations, up to a "
            "second, outside the 95 % band of white noise; 0.05 for white noise."
            @if findings(segments).any(|(_, finding)| is_unreliable(finding)) { " " (UNRELIABLE_FREQUENCY) }
            @if is_published { " The paper's numbers are of its own crane at 120 mm/s." }
        }
    }
}

/// Two figures for each signal of each segment: log and model, and their difference.
fn figures(segments: &[SegmentComparison], is_published: bool) -> Result<Vec<Markup>, LabError> {
    let mut figures = Vec::new();
    for (segment, finding) in findings(segments) {
        let signal = finding.difference.signal;
        let [both, difference] = drawings(segment, signal)?;
        let name = segment_name(segments, &segment.experiment);
        let paper = match is_published {
            true => format!(", as the paper's figure {}", paper_figure(signal)),
            false => String::new(),
        };
        let symbol = signal.symbol();
        figures.push(html! {
            (figure(&format!("{symbol}{name}{paper}: log and model, over the time since the log's first sample that is compared."), &both))
            (figure(&format!("{symbol}{name}, log less model. For a correct model this is sensor noise about zero."), &difference))
        });
    }
    Ok(figures)
}

/// A signal of a segment over time in its unit of display: log and model, and log less model.
fn drawings(segment: &SegmentComparison, signal: Signal) -> Result<[Drawing; 2], LabError> {
    let k = COMPARED.iter().position(|s| *s == signal).unwrap_or(0);
    let (unit, size) = signal.shown();
    let samples = || segment.experiment.samples.iter().zip(&segment.prediction);
    let log: Vec<(f64, f64)> =
        samples().filter_map(|(s, _)| Some((s.time, s.values[k]? / size))).collect();
    let model: Vec<(f64, f64)> = samples().map(|(s, p)| (s.time, p[k] / size)).collect();
    let less: Vec<(f64, f64)> =
        samples().filter_map(|(s, p)| Some((s.time, (s.values[k]? - p[k]) / size))).collect();
    let x = "time since the experiment began [s]";
    let y = format!("{} [{unit}]", signal.symbol());
    let series = Series::list([("log", log), ("model", model)]);
    let both = Figure { x, y: &y, series, axes: Axes::Linear }.drawn()?;
    let y = format!("log less model [{unit}]");
    let series = vec![Series { name: "difference", points: less, colour: 2 }];
    let difference = Figure { x, y: &y, series, axes: Axes::Linear }.drawn()?;
    Ok([both, difference])
}

/// All findings with their segments.
fn findings(
    segments: &[SegmentComparison],
) -> impl Iterator<Item = (&SegmentComparison, &Finding)> {
    segments.iter().flat_map(|segment| segment.findings.iter().map(move |f| (segment, f)))
}

/// Number of the paper's figure of a signal.
fn paper_figure(signal: Signal) -> u32 {
    const FIGURES: [Signal; 6] = [
        Signal::Stroke,
        Signal::PressureA,
        Signal::PressurePumpA,
        Signal::PressurePumpB,
        Signal::PressureB,
        Signal::PressureAccumulator,
    ];
    18 + FIGURES.iter().position(|s| *s == signal).unwrap_or(0) as u32
}

/// Name of the segment of an experiment; empty if the log has only one.
fn segment_name(segments: &[SegmentComparison], experiment: &Experiment) -> String {
    match segments.len() {
        0 | 1 => String::new(),
        _ => format!(" (from {:.3} s)", experiment.begin),
    }
}
