//! Comparison of a segment of a log with the model as text.

use super::segment::{Finding, SegmentComparison};
use crate::output;
use crate::verdict_text;
use hydroboom_identify::Ringing;

/// Text before the verdict on the corrected log, in which keys are searched.
pub const AFTER_CORRECTION: &str = "After this correction:";

/// Column headings of the table of differences.
pub const HEADER: [&str; 10] = [
    "signal",
    "RMS",
    "peak",
    "bias",
    "fit [%]",
    "correlation",
    "delay [ms]",
    "rings [Hz], model",
    "damping, model",
    "coloured",
];

/// Index of the frequencies among the columns.
const FREQUENCIES: usize = 7;
/// Note on frequencies in brackets.
pub const UNRELIABLE_FREQUENCY: &str = "(...): this frequency is not judged. It is a peak of the spectrum without a fitted \
    decaying oscillation, or the oscillation decays within fewer than four periods.";

/// Row of that table, in the signal's unit of display.
pub fn row(finding: &Finding) -> Vec<String> {
    let d = &finding.difference;
    let (unit, size) = d.signal.shown();
    let frequency = |r: Option<Ringing>| {
        let text = output::optional(r.map(|r| r.frequency), 3);
        if r.is_some_and(|r| !r.has_reliable_frequency()) { format!("({text})") } else { text }
    };
    let damping = |r: Option<Ringing>| output::optional(r.and_then(|r| r.damping), 3);
    vec![
        format!("{} [{unit}]", d.signal.symbol()),
        format!("{:.3}", d.rms / size),
        format!("{:.3}", d.peak / size),
        format!("{:.3}", d.bias / size),
        output::optional(d.fit, 1),
        output::optional(d.correlation, 4),
        output::optional(d.delay.map(|s| s * 1e3), 1),
        format!("{}, {}", frequency(d.ringing), frequency(d.model_ringing)),
        format!("{}, {}", damping(d.ringing), damping(d.model_ringing)),
        format!("{:.2}{}", d.coloured, if d.is_white { ", white" } else { "" }),
    ]
}

/// Whether the frequencies of a row are not judged, and therefore in brackets.
pub fn has_unreliable_frequency(row: &[String]) -> bool {
    row[FREQUENCIES].contains('(')
}

/// Verdict, table of the differences, descriptions, and advice.
pub fn segment_text(segment: &SegmentComparison, crane: &str) -> String {
    let rows: Vec<Vec<String>> = segment.findings.iter().map(row).collect();
    let mut text = format!(
        "{}\n\n{}: {:.1} s beside \"{crane}\", log less model\n{}\n",
        verdict_text::sentence(&segment.verdict),
        segment.experiment.name,
        segment.experiment.duration(),
        output::table(&HEADER, &rows)
    );
    if rows.iter().any(|row| has_unreliable_frequency(row)) {
        text += &format!("{UNRELIABLE_FREQUENCY}\n");
    }
    for finding in &segment.findings {
        text += &format!("\n{}", finding.text);
    }
    for input in &segment.delayed_inputs {
        text += &format!("\n{input}");
    }
    if let Some(verdict) = &segment.corrected_verdict {
        text += &format!("\n{AFTER_CORRECTION} {}", verdict_text::sentence(verdict));
    }
    if let Some(advice) = &segment.advice {
        text += &format!("\n{advice}");
    }
    text
}
