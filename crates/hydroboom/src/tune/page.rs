//! Report of a tuning.

use super::five_digits::FiveDigits;
use super::hold_out::{self, Fold};
use super::outcome::{Outcome, biased_keys, determination, undetermined_keys};
use super::{channels, profiles};
use crate::verdict_text;
use hydroboom_description::schema::KEYS;
use hydroboom_identify::{COMPARED, Fit, Tuned, experiment_for};
use hydroboom_lab::LabError;
use hydroboom_lab::report::{Axes, Figure, Page, Series, document, figure};
use maud::{Markup, html};

/// Page with verdicts, keys, validation, correlations, and figures of logs and model.
///
/// # Errors
///
/// [`LabError`] if a figure cannot be drawn.
pub fn page(outcome: &Outcome<'_>) -> Result<Page, LabError> {
    let fit = &outcome.fit;
    let profiles = outcome.profiles.iter().map(|profile| profiles::profile_figure(profile, fit));
    let profiles = profiles.collect::<Result<Vec<Markup>, LabError>>()?;
    let figures = log_figures(outcome)?;
    let body = html! {
        (verdicts_and_logs(outcome))
        h2 { "The keys" }
        (key_table(fit))
        (channel_table(fit))
        (undetermined(fit))
        @if !profiles.is_empty() {
            h2 { "Profile likelihood of single keys" }
            p {
                "Each key is fixed at values about its optimum, and all others are fitted again: rise of the sum by the "
                "logs alone, without the key's own prior."
            }
            @for figure in &profiles { (figure) }
        }
        h2 { "Differences before and after" }
        (differences(outcome))
        @if let Some(remark) = outcome.remark_on_test_logs() { p.soft { (remark) } }
        @if !outcome.held_out.is_empty() {
            h2 { "Held-out stretches" }
            (hold_out_tables(outcome))
        }
        @if !outcome.folds.is_empty() {
            h2 { "Result of each search" }
            (folds_table(&outcome.folds))
        }
        h2 { "Correlations of the keys" }
        (correlations(fit))
        h2 { "Log and model" }
        @for figure in &figures { (figure) }
    };
    Ok(document("Hydroboom: tuning", &body))
}

/// Figures of each log's signals over time, with the model before and after the fit.
fn log_figures(outcome: &Outcome<'_>) -> Result<Vec<Markup>, LabError> {
    let predictions = &outcome.fit.predictions;
    let mut figures = Vec::new();
    for (log, experiment) in outcome.experiments.iter().enumerate() {
        for (place, signal) in COMPARED.into_iter().enumerate() {
            let (unit, size) = signal.shown();
            let measured: Vec<(f64, f64)> = experiment
                .samples
                .iter()
                .filter_map(|s| Some((s.time, s.values[place]? / size)))
                .collect();
            if measured.is_empty() {
                continue;
            }
            let model = |predictions: &[Vec<[f64; COMPARED.len()]>]| -> Vec<(f64, f64)> {
                let samples = experiment.samples.iter().zip(&predictions[log]);
                samples.map(|(s, p)| (s.time, p[place] / size)).collect()
            };
            let lines = [
                ("log", measured),
                ("model before", model(&predictions.0)),
                ("model after", model(&predictions.1)),
            ];
            let x = "time since the experiment began [s]";
            let y = format!("{} [{unit}]", signal.symbol());
            let svg =
                Figure { x, y: &y, series: Series::list(lines), axes: Axes::Linear }.drawn()?;
            let caption = format!(
                "{} of {}: log, and model before and after.",
                signal.symbol(),
                experiment.name
            );
            figures.push(figure(&caption, &svg));
        }
    }
    Ok(figures)
}

/// Verdicts, size of the search, logs with their digests, and notes.
fn verdicts_and_logs(outcome: &Outcome<'_>) -> Markup {
    let Outcome { crane, experiments, fit, experiment_digests, notes, .. } = outcome;
    html! {
        @for (log, judgements) in outcome.verdicts() {
            p { b { (verdict_text::sentence(&judgements)) } " " code { (log) } }
        }
        p.soft {
            (fit.tuned.len()) " keys of \"" (crane.name) "\" tuned until the model reproduces the logs; "
            (fit.evaluations) " runs of the model."
            @if !fit.has_converged { " The search has not converged: tune again from the file that is written." }
        }
        p.soft { "Logs: " @for (e, digest) in experiments.iter().zip(experiment_digests) {
            code { (e.name) } " (SHA-256 " (&digest[..16]) "), " (format!("{:.1} s. ", e.duration()))
        } }
        @for note in notes { p.soft { "Note: " (note) } }
    }
}

/// Table of the keys, with an explanation of its uncertainties.
fn key_table(fit: &Fit) -> Markup {
    html! {
        div.wide { table {
            thead { tr {
                @for name in ["key", "unit", "before", "after", "95 % from", "to", "prior sd [%]", "sd from logs [%]", "determined"] {
                    th { (name) }
                }
            } }
            tbody { @for t in &fit.tuned {
                @let key = &KEYS[t.key.place];
                @let (low, high) = t.interval();
                tr {
                    td { (key.path()) } td { (key.unit) }
                    @for v in [t.value.0, t.value.1, low, high] { td { (FiveDigits(key.to_unit(v)).to_string()) } }
                    td { (format!("{:.1}", t.prior * 100.0)) }
                    td { @if t.from_logs.is_finite() { (crate::output::three_digits(t.from_logs * 100.0)) } @else { "nothing" } }
                    td { @if t.is_determined() { "yes" } @else { b { (determination(t)) } } }
                }
            } }
        } }
        p.soft {
            "The interval is that of the sandwich covariance: residuals count with their correlation in time and \
             between channels, fixed keys with their prior. "
            "Prior sd: prior standard deviation by provenance and range. Sd from logs: standard deviation from \
             the logs alone."
        }
    }
}

/// Delay and offset of each channel; empty if all are fixed.
fn channel_table(fit: &Fit) -> Markup {
    html! {
        @if !fit.channels.is_empty() {
            h2 { "Delay and offset of each channel" }
            p.soft { "Nuisance parameters of the same problem: their uncertainty is in the intervals of the keys. Write values that are not zero into the mapping (delay_ms, offset), or fix known ones by --fix." }
            div.wide { table {
                thead { tr { th { "log" } @for name in channels::HEADER { th { (name) } } } }
                tbody { @for c in &fit.channels { tr { td { (c.log) } @for cell in channels::row(c) { td { (cell) } } } } }
            } }
        }
    }
}

/// Biased keys, and keys that the logs do not determine, with experiments that would.
fn undetermined(fit: &Fit) -> Markup {
    let undetermined: Vec<(&Tuned, String)> = undetermined_keys(fit).collect();
    html! {
        @for (t, reason) in biased_keys(fit) {
            p { code { (t.key.path()) } " is biased, of an equivalent model: " (reason) "." }
        }
        @if !undetermined.is_empty() {
            h2 { "Keys that the logs do not determine, and experiments that would" }
            p { "The value of these is no result: the prior determines it, or the model is not the true one." }
            ul { @for (t, reason) in &undetermined { li {
                code { (t.key.path()) } ": " (reason) ". Experiment: " (experiment_for(t.key)) "."
            } } }
        }
    }
}

/// RMS differences of log and model before and after the fit, of the fitted logs and of the test logs.
fn differences(outcome: &Outcome<'_>) -> Markup {
    let used = outcome.fit.improvements.iter().map(|i| (i, "used"));
    let all: Vec<_> = used.chain(outcome.tests.iter().map(|i| (i, "not used"))).collect();
    html! { div.wide { table {
        thead { tr { @for name in ["log", "for tuning", "signal", "RMS before", "after"] { th { (name) } } } }
        tbody { @for (improvement, how) in all {
            @for (signal, rms) in COMPARED.iter().zip(&improvement.rms) {
                @if let Some((before, after)) = rms {
                    @let (unit, size) = signal.shown();
                    tr {
                        td { (improvement.log) } td { (how) } td { (signal.symbol()) " [" (unit) "]" }
                        td { (format!("{:.3}", before / size)) } td { (format!("{:.3}", after / size)) }
                    }
                }
            }
        } }
    } } }
}

/// Prediction errors on the held-out stretches, and the oscillations of log and model.
fn hold_out_tables(outcome: &Outcome<'_>) -> Markup {
    let number = |v: Option<f64>, digits: usize| crate::output::optional(v, digits);
    html! {
        p {
            "RMS differences on stretches that were not fitted. Beside the model: the regression line through \
             half as long a "
            "stretch before, the last value, and the regression line through the stretch itself, which is no \
             prediction: no smooth course is "
            "much better."
        }
        div.wide { table {
            thead { tr {
                @for name in ["stretch [s]", "signal", "model", "line before", "last value", "line through it"] { th { (name) } }
            } }
            tbody { @for h in &outcome.held_out { @for f in &h.signals {
                @let (unit, size) = f.signal.shown();
                tr {
                    td { (h.stretch.from) " to " (h.stretch.to) } td { (f.signal.symbol()) " [" (unit) "]" }
                    td { b { (format!("{:.3}", f.model / size)) } }
                    td { (number(f.line.map(|v| v / size), 3)) }
                    td { (number(f.constant.map(|v| v / size), 3)) }
                    td { (format!("{:.3}", f.own_line / size)) }
                }
            } } }
        } }
        p { "Oscillation of the whole log, and of the model fitted without the stretch:" }
        div.wide { table {
            thead { tr {
                @for name in ["without [s]", "signal", "log [Hz]", "model [Hz]", "damping of the log", "of the model"] { th { (name) } }
            } }
            tbody { @for h in &outcome.held_out { @for d in &h.whole {
                @if let (Some(log), Some(model)) = (d.ringing, d.model_ringing) {
                    tr {
                        td { (h.stretch.from) " to " (h.stretch.to) } td { (d.signal.symbol()) }
                        td { (format!("{:.3}", log.frequency)) } td { (format!("{:.3}", model.frequency)) }
                        td { (number(log.damping, 4)) } td { (number(model.damping, 4)) }
                    }
                }
            } } }
        } }
    }
}

/// Estimates of the searches that held out one stretch after the other.
fn folds_table(folds: &[Fold]) -> Markup {
    html! {
        p.soft { "Each column is a search without the stretch in its head; behind each value its 95 % interval." }
        div.wide { table {
            thead { tr { @for name in hold_out::folds_header(folds) { th { (name) } } } }
            tbody { @for row in hold_out::folds_rows(folds) { tr { @for cell in row { td { (cell) } } } } }
        } }
        @for key in hold_out::contradicting_keys(folds) { p { code { (key) } ": " (hold_out::CONTRADICTION) "." } }
    }
}

/// Tables of the posterior correlations of keys and channels, with the strong ones emphasised.
fn correlations(fit: &Fit) -> Markup {
    html! {
        p.soft { "Correlations of the estimates. Near 1 or -1 the logs determine a combination of the two keys, and neither alone." }
        div.wide { table {
            thead { tr { th { "" } @for k in 1..=fit.tuned.len() { th { (k) } } } }
            tbody { @for (k, (t, row)) in fit.tuned.iter().zip(&fit.correlation).enumerate() {
                tr {
                    td { (k + 1) " " (t.key.path()) }
                    @for (j, c) in row.iter().enumerate() {
                        @let strength = if j == k { 0.0 } else { c.abs() };
                        td style=(format!("background:rgba(213,94,0,{:.2})", 0.6 * strength.powi(2))) { (format!("{c:+.2}")) }
                    }
                }
            } }
        } }
        @if !fit.channels.is_empty() {
            p.soft { "And with delay and offset of each channel:" }
            div.wide { table {
                thead { tr { th { "delay or offset" } @for k in 1..=fit.tuned.len() { th { (k) } } } }
                tbody { @for (j, channel) in fit.channels.iter().enumerate() { tr {
                    td { (channel.nuisance.path()) ", " (channel.log) }
                    @for row in &fit.channel_correlation {
                        td style=(format!("background:rgba(213,94,0,{:.2})", 0.6 * row[j].powi(2))) { (format!("{:+.2}", row[j])) }
                    }
                } } }
            } }
        }
    }
}
