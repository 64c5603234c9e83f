//! Report of a tuning.

use super::held::{self, InTurn};
use super::{Outcome, Shown, channels, determination, profiles};
use crate::verdict_text;
use hydroboom_description::schema::KEYS;
use hydroboom_identify::{COMPARED, Fit, Tuned, experiment_for};
use hydroboom_lab::LabError;
use hydroboom_lab::report::{Axes, Figure, Page, Series, document, figure};
use maud::{Markup, html};

/// Complete page.
pub fn page(outcome: &Outcome<'_>) -> Result<Page, LabError> {
    let Outcome { crane, experiments, found, held, notes, digests_of, .. } = outcome;
    let drawn = outcome.profiles.iter().map(|profile| profiles::drawn(profile, found));
    let drawn = drawn.collect::<Result<Vec<Markup>, LabError>>()?;
    let mut figures = Vec::new();
    for (log, experiment) in experiments.iter().enumerate() {
        for (place, signal) in COMPARED.into_iter().enumerate() {
            let (unit, size) = signal.shown();
            let seen: Vec<(f64, f64)> = experiment
                .samples
                .iter()
                .filter_map(|s| Some((s.time, s.values[place]? / size)))
                .collect();
            if seen.is_empty() {
                continue;
            }
            let model = |predictions: &[Vec<[f64; COMPARED.len()]>]| -> Vec<(f64, f64)> {
                let samples = experiment.samples.iter().zip(&predictions[log]);
                samples.map(|(s, p)| (s.time, p[place] / size)).collect()
            };
            let lines = [
                ("log", seen),
                ("model before", model(&found.predictions.0)),
                ("model after", model(&found.predictions.1)),
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
    let open: Vec<(&Tuned, String)> = super::open(found).collect();
    let body = html! {
        @for (log, judged) in outcome.judged() { p { b { (verdict_text::said(&judged)) } " " code { (log) } } }
        p.soft {
            (found.tuned.len()) " keys of \"" (crane.name) "\" tuned until the model reproduces the logs; "
            (found.evaluations) " runs of the model."
            @if !found.has_converged { " The search has not converged: tune again from the file that is written." }
        }
        p.soft { "Logs: " @for (e, digest) in experiments.iter().zip(digests_of) {
            code { (e.name) } " (SHA-256 " (&digest[..16]) "), " (format!("{:.1} s. ", e.duration()))
        } }
        @for note in notes { p.soft { "Note: " (note) } }
        h2 { "The keys" }
        (keys(found))
        p.soft {
            "The interval is that of the sandwich covariance: residuals count with their correlation in time and \
             between channels, fixed keys with their prior. "
            "Prior sd: prior standard deviation by provenance and range. Sd from logs: standard deviation from \
             the logs alone."
        }
        @if !found.channels.is_empty() {
            h2 { "Delay and offset of each channel" }
            p.soft { "Nuisance parameters of the same problem: their uncertainty is in the intervals of the keys. Write values that are not zero into the mapping (delay_ms, offset), or fix known ones by --fix." }
            div.wide { table {
                thead { tr { th { "log" } @for name in channels::HEADER { th { (name) } } } }
                tbody { @for c in &found.channels { tr { td { (c.log) } @for cell in channels::row(c) { td { (cell) } } } } }
            } }
        }
        @for (t, reason) in found.tuned.iter().filter_map(|t| Some((t, t.biased()?))) {
            p { code { (t.key.path()) } " is biased, of an equivalent model: " (reason) "." }
        }
        @if !open.is_empty() {
            h2 { "Keys that the logs do not determine, and experiments that would" }
            p { "The value of these is no result: the prior determines it, or the model is not the true one." }
            ul { @for (t, reason) in &open { li {
                code { (t.key.path()) } ": " (reason) ". Experiment: " (experiment_for(t.key)) "."
            } } }
        }
        @if !drawn.is_empty() {
            h2 { "Profile likelihood of single keys" }
            p {
                "Each key is fixed at values about its optimum, and all others are fitted again: rise of the sum by the "
                "logs alone, without the key's own prior."
            }
            @for figure in &drawn { (figure) }
        }
        h2 { "Differences before and after" }
        (differences(outcome))
        @if let Some(carried) = super::carried(outcome) { p.soft { (carried) } }
        @if !held.is_empty() {
            h2 { "Held-out stretches" }
            (foretold(outcome))
        }
        @if !outcome.in_turn.is_empty() {
            h2 { "Result of each search" }
            (keys_in_turn(&outcome.in_turn))
        }
        h2 { "Correlations of the keys" }
        (correlations(found))
        h2 { "Log and model" }
        @for figure in &figures { (figure) }
    };
    Ok(document("Hydroboom: tuning", &body))
}

fn keys(found: &Fit) -> Markup {
    html! { div.wide { table {
        thead { tr {
            @for name in ["key", "unit", "before", "after", "95 % from", "to", "prior sd [%]", "sd from logs [%]", "determined"] {
                th { (name) }
            }
        } }
        tbody { @for t in &found.tuned {
            @let key = &KEYS[t.key.place];
            @let (low, high) = t.interval();
            tr {
                td { (key.path()) } td { (key.unit) }
                @for v in [t.value.0, t.value.1, low, high] { td { (Shown(key.to_unit(v)).to_string()) } }
                td { (format!("{:.1}", t.prior * 100.0)) }
                td { @if t.from_logs.is_finite() { (crate::output::three_digits(t.from_logs * 100.0)) } @else { "nothing" } }
                td { @if t.is_determined() { "yes" } @else { b { (determination(t)) } } }
            }
        } }
    } } }
}

fn differences(outcome: &Outcome<'_>) -> Markup {
    let used = outcome.found.improvements.iter().map(|i| (i, "used"));
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

fn foretold(outcome: &Outcome<'_>) -> Markup {
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
            tbody { @for h in &outcome.held { @for f in &h.signals {
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
            tbody { @for h in &outcome.held { @for d in &h.whole {
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

/// Results of the searches that held out one stretch after the other.
fn keys_in_turn(searches: &[InTurn]) -> Markup {
    html! {
        p.soft { "Each column is a search without the stretch in its head; behind each value its 95 % interval." }
        div.wide { table {
            thead { tr { @for name in held::keys_header(searches) { th { (name) } } } }
            tbody { @for row in held::keys_rows(searches) { tr { @for cell in row { td { (cell) } } } } }
        } }
        @for key in held::contradicting(searches) { p { code { (key) } ": " (held::APART) "." } }
    }
}

/// Table of correlations with the strong ones emphasised.
fn correlations(found: &Fit) -> Markup {
    html! {
        p.soft { "Correlations of the estimates. Near 1 or -1 the logs determine a combination of the two keys, and neither alone." }
        div.wide { table {
            thead { tr { th { "" } @for k in 1..=found.tuned.len() { th { (k) } } } }
            tbody { @for (k, (t, row)) in found.tuned.iter().zip(&found.correlation).enumerate() {
                tr {
                    td { (k + 1) " " (t.key.path()) }
                    @for (j, c) in row.iter().enumerate() {
                        @let strength = if j == k { 0.0 } else { c.abs() };
                        td style=(format!("background:rgba(213,94,0,{:.2})", 0.6 * strength.powi(2))) { (format!("{c:+.2}")) }
                    }
                }
            } }
        } }
        @if !found.channels.is_empty() {
            p.soft { "And with delay and offset of each channel:" }
            div.wide { table {
                thead { tr { th { "delay or offset" } @for k in 1..=found.tuned.len() { th { (k) } } } }
                tbody { @for (j, channel) in found.channels.iter().enumerate() { tr {
                    td { (channel.nuisance.path()) ", " (channel.log) }
                    @for row in &found.channel_correlation {
                        td style=(format!("background:rgba(213,94,0,{:.2})", 0.6 * row[j].powi(2))) { (format!("{:+.2}", row[j])) }
                    }
                } } }
            } }
        }
    }
}
