//! Sensitivities as text.

use super::analysis::Analysis;
use crate::output;
use hydroboom_sensitivity::Index;

/// Number of keys in the table of an output.
const MOST_KEYS: usize = 10;

/// Explanation of the columns.
const ENDS: &str = "less, more: the ends of the key's prior range, by its provenance, and the output of the machine re-run there \
    (-: no such machine exists, or it cannot follow).\n% per %: exact slope at the described machine. The ten \
    keys of the largest change";

/// Table of the keys of the largest change for each output, and the global study.
pub fn analysis_text(analysis: &Analysis) -> String {
    let mut text = String::new();
    for (k, output) in analysis.outputs.iter().enumerate() {
        let (unit, size) = output.unit();
        text += &format!("{}: {:.4} {unit}\n", output.title(), analysis.values[k] / size);
        if let Some(conditions) = analysis.case.conditions(*output) {
            text += &format!("{conditions}\n");
        }
        text += &table(analysis, k);
        text += "\n\n";
    }
    text += ENDS;
    text + &global_text(analysis)
}

/// Keys of the largest change of an output: the output at both ends of the key's range, relative sensitivity, indices.
fn table(analysis: &Analysis, k: usize) -> String {
    let output = &analysis.outputs[k];
    let (unit, size) = output.unit();
    let row = |key: usize| {
        let there = |end| output::optional(analysis.at_end(key, end, k).map(|v| v / size), 4);
        let mut row = vec![
            analysis.local[key].key.path(),
            analysis.end_text(key, 0),
            there(0),
            analysis.end_text(key, 1),
            there(1),
        ];
        if output.has_slopes() {
            let slope = analysis.slope(key, k);
            row.push(slope.map_or("-".into(), |slope| format!("{slope:+.3}")));
        }
        if let Some(indices) = analysis.indices(k) {
            row.extend([&indices.first[key], &indices.total[key]].map(index_text));
        }
        row
    };
    let rows: Vec<Vec<String>> = analysis.ranked(k).into_iter().take(MOST_KEYS).map(row).collect();
    let there = format!("{unit} there");
    let mut header = vec!["key", "less", there.as_str(), "more", there.as_str()];
    if output.has_slopes() {
        header.push("% per %");
    }
    if analysis.indices(k).is_some() {
        header.extend(["Sobol first (95 %)", "total (95 %)"]);
    }
    output::table(&header, &rows)
}

/// Mean and standard deviation of each output in the global study; empty without one.
fn global_text(analysis: &Analysis) -> String {
    let Some((indices, rows)) = &analysis.global else { return String::new() };
    let mut text = format!("\n{rows} rows of the global study were simulated whole; there");
    for (output, sobol) in analysis.outputs.iter().zip(indices) {
        let (unit, size) = output.unit();
        text += &format!(
            "\n  {}: {:.3} {unit}, scattering by {:.3}",
            output.title(),
            sobol.mean / size,
            sobol.deviation / size
        );
    }
    text
}

/// Sobol index with its 95 % interval.
fn index_text(index: &Index) -> String {
    format!("{:.2} ({:.2} .. {:.2})", index.value, index.low, index.high)
}
