//! Results of tuning as text.

use super::five_digits::FiveDigits;
use super::outcome::{Outcome, biased_keys, determination, undetermined_keys};
use super::{channels, hold_out, profiles};
use crate::output;
use crate::verdict_text;
use hydroboom_description::schema::KEYS;
use hydroboom_identify::{COMPARED, Fit, Improvement, Tuned, experiment_for};

/// All results.
pub fn outcome_text(outcome: &Outcome<'_>) -> String {
    let mut text = String::new();
    for (log, judgements) in outcome.verdicts() {
        text += &format!("{log}: {}\n", verdict_text::sentence(&judgements));
    }
    text += &fit_text(&outcome.fit);
    text += &residuals_text(outcome);
    text += &validation_text(outcome);
    text += &undetermined_text(&outcome.fit);
    for note in &outcome.notes {
        text += &format!("\nnote: {note}");
    }
    text
}

/// Estimates of the keys, and of the delays and offsets of the channels.
fn fit_text(fit: &Fit) -> String {
    let header = [
        "key",
        "before",
        "after",
        "95 %",
        "prior sd [%]",
        "sd from logs [%]",
        "determined",
        "strongest correlation",
    ];
    let rows: Vec<Vec<String>> = fit.tuned.iter().map(key_row).collect();
    let mut text = format!(
        "\n{} {} tuned, {} runs of the model{}\n{}\n",
        fit.tuned.len(),
        if fit.tuned.len() == 1 { "key" } else { "keys" },
        fit.evaluations,
        if fit.has_converged {
            ""
        } else {
            "; not converged: tune again from the file that is written"
        },
        output::table(&header, &rows)
    );
    if !fit.channels.is_empty() {
        text += &format!("\n{}\n", channels::text(&fit.channels));
    }
    text
}

fn key_row(tuned: &Tuned) -> Vec<String> {
    let key = &KEYS[tuned.key.place];
    let (low, high) = tuned.interval();
    let number = |v: f64| FiveDigits(key.to_unit(v)).to_string();
    vec![
        key.path(),
        number(tuned.value.0),
        number(tuned.value.1),
        format!("{} to {}", number(low), number(high)),
        format!("{:.1}", tuned.prior * 100.0),
        match tuned.from_logs.is_finite() {
            true => output::three_digits(tuned.from_logs * 100.0),
            false => "nothing".into(),
        },
        determination(tuned).into(),
        tuned.partner.as_ref().map_or(String::new(), |(k, c)| format!("{k} ({c:+.2})")),
    ]
}

/// RMS residuals of the fitted logs and of the test logs before and after the fit.
fn residuals_text(outcome: &Outcome<'_>) -> String {
    let mut text = String::new();
    for improvement in &outcome.fit.improvements {
        text += &format!("\n{}, RMS: {}", improvement.log, before_and_after(improvement));
    }
    for improvement in &outcome.tests {
        text += &format!(
            "\n{}, not used for tuning, RMS: {}",
            improvement.log,
            before_and_after(improvement)
        );
    }
    if let Some(remark) = outcome.remark_on_test_logs() {
        text += &format!("\n{remark}");
    }
    text
}

/// RMS residual of each signal before and after the fit, in its unit of display.
fn before_and_after(improvement: &Improvement) -> String {
    let parts = COMPARED.iter().zip(&improvement.rms).filter_map(|(signal, rms)| {
        let (unit, size) = signal.shown();
        let (a, b) = (*rms)?;
        Some(format!("{} {:.3} to {:.3} {unit}", signal.symbol(), a / size, b / size))
    });
    parts.collect::<Vec<_>>().join(", ")
}

/// Hold-out validation, the keys of each search, and profile likelihoods, where they were asked for.
fn validation_text(outcome: &Outcome<'_>) -> String {
    let mut text = String::new();
    if !outcome.held_out.is_empty() {
        text += &format!("\n\n{}\n", hold_out::text(&outcome.held_out));
    }
    if !outcome.folds.is_empty() {
        text += &format!("\n{}\n", hold_out::folds_text(&outcome.folds));
    }
    if !outcome.profiles.is_empty() {
        text += &format!("\n\n{}\n", profiles::text(&outcome.profiles));
    }
    text
}

/// Biased keys, and keys that the logs do not determine, with experiments that would.
fn undetermined_text(fit: &Fit) -> String {
    let mut text = String::new();
    for (tuned, reason) in biased_keys(fit) {
        text += &format!("\n{} is biased, of an equivalent model: {reason}", tuned.key.path());
    }
    let mut undetermined = undetermined_keys(fit).peekable();
    if undetermined.peek().is_some() {
        text += "\nthe logs do not determine these. Reason, and an experiment that would:";
    }
    for (tuned, reason) in undetermined {
        let experiment = experiment_for(tuned.key);
        text += &format!("\n  {}: {reason}. Experiment: {experiment}", tuned.key.path());
    }
    text
}
