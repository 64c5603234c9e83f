//! Hold-out validation and cross-validation: options, and results.

use super::five_digits::FiveDigits;
use super::outcome_json::key_in_json;
use crate::output;
use clap::Args;
use hydroboom_description::schema::KEYS;
use hydroboom_identify::{Experiment, Fit, HeldOut, Stretch, Tuned};
use miette::{Result, miette};
use serde_json::{Value, json};

/// The options that keep parts of the logs from the search.
#[derive(Args, Clone)]
pub struct HoldOut {
    /// Keep a stretch of the logs' time from the search and say how the model does there, as FROM:TO in seconds; can be
    /// repeated.
    #[arg(long, value_name = "FROM:TO", allow_hyphen_values = true, value_parser = stretch)]
    pub hold_out: Vec<Stretch>,
    /// Hold out one stretch after the other, with a search for each, before the search over all of them.
    #[arg(long, requires = "hold_out")]
    pub in_turn: bool,
}

/// Smallest number of samples in a stretch, and outside it.
const LEAST_SAMPLES: usize = 10;

impl HoldOut {
    /// Checks that each stretch has at least ten samples of a log, and that as many remain for each fit.
    ///
    /// # Errors
    ///
    /// If not, with the times of the logs.
    pub fn check(&self, logs: &[Experiment]) -> Result<()> {
        let times = |log: &Experiment| {
            let measured = log.samples.iter().filter(|s| s.values.iter().any(Option::is_some));
            let begin = log.begin;
            measured.map(move |s| begin + s.time).collect::<Vec<f64>>()
        };
        let all: Vec<Vec<f64>> = logs.iter().map(times).collect();
        let spans = || {
            let of = logs.iter().zip(&all).filter_map(|(log, times)| {
                Some(format!("{}: {:.3} to {:.3} s", log.name, times.first()?, times.last()?))
            });
            of.collect::<Vec<_>>().join("; ")
        };
        let is_in = |s: &Stretch, t: &f64| (s.from..s.to).contains(t);
        for s in &self.hold_out {
            let held = all.iter().map(|times| times.iter().filter(|t| is_in(s, t)).count()).max();
            if held.is_none_or(|held| held < LEAST_SAMPLES) {
                return Err(miette!(
                    help = format!(
                        "a stretch with at least {LEAST_SAMPLES} samples of a log: {}",
                        spans()
                    ),
                    "--hold-out {}:{} is outside the logs, or has fewer than {LEAST_SAMPLES} samples of one",
                    s.from,
                    s.to
                ));
            }
        }
        // with stretches held out in turn, each search uses the other stretches
        let sets: Vec<&[Stretch]> = match self.in_turn {
            true => self.hold_out.chunks(1).collect(),
            false => vec![&self.hold_out],
        };
        for held in sets {
            let is_left = |t: &&f64| !held.iter().any(|s| is_in(s, t));
            if all.iter().flatten().filter(is_left).count() < LEAST_SAMPLES {
                return Err(miette!(
                    help = format!("hold out less of {}", spans()),
                    "--hold-out leaves nothing of the logs to be tuned to"
                ));
            }
        }
        Ok(())
    }

    /// Experiments of the last search: without the stretches, or whole if these were held out in turn before.
    pub fn fitted(&self, experiments: &[Experiment]) -> Vec<Experiment> {
        match self.in_turn {
            true => experiments.to_vec(),
            false => experiments.iter().map(|e| e.without(&self.hold_out)).collect(),
        }
    }
}

/// Fold of a cross-validation: the estimates of a search that held out one stretch.
pub struct Fold {
    /// Stretch that was held out.
    pub stretch: Stretch,
    /// Estimates of the keys.
    pub tuned: Vec<Tuned>,
    /// Posterior correlation matrix of the keys \[-\].
    pub correlation: Vec<Vec<f64>>,
}

impl Fold {
    /// Fold of a fit without a stretch.
    pub fn new(stretch: Stretch, fit: &Fit) -> Self {
        Self { stretch, tuned: fit.tuned.clone(), correlation: fit.correlation.clone() }
    }

    /// Fold as JSON.
    pub fn in_json(&self) -> Value {
        json!({
            "from_s": self.stretch.from, "to_s": self.stretch.to,
            "keys": self.tuned.iter().map(key_in_json).collect::<Vec<_>>(), "correlation": self.correlation,
        })
    }
}

/// Column headings of the table of all folds: the key, then a column per held-out stretch.
pub fn folds_header(folds: &[Fold]) -> Vec<String> {
    let without = |s: &Fold| format!("without {} to {} s", s.stretch.from, s.stretch.to);
    std::iter::once("key".into()).chain(folds.iter().map(without)).collect()
}

/// Rows of the table: a key each, with its values and their 95 % intervals in its unit.
pub fn folds_rows(folds: &[Fold]) -> Vec<Vec<String>> {
    let Some(first) = folds.first() else { return Vec::new() };
    let row = |(k, t): (usize, &Tuned)| {
        let key = &KEYS[t.key.place];
        let cell = |s: &Fold| {
            let t = &s.tuned[k];
            let (low, high) = t.interval();
            let shown = |value: f64| FiveDigits(key.to_unit(value));
            format!("{} ({} to {})", shown(t.value.1), shown(low), shown(high))
        };
        std::iter::once(key.path()).chain(folds.iter().map(cell)).collect()
    };
    first.tuned.iter().enumerate().map(row).collect()
}

/// Paths of the keys whose 95 % intervals from two folds are disjoint.
pub fn contradicting_keys(folds: &[Fold]) -> Vec<String> {
    let Some(first) = folds.first() else { return Vec::new() };
    let is_apart = |k: usize| {
        let intervals = || folds.iter().map(|s| s.tuned[k].interval());
        let highest_low = intervals().map(|i| i.0).fold(f64::NEG_INFINITY, f64::max);
        let lowest_high = intervals().map(|i| i.1).fold(f64::INFINITY, f64::min);
        highest_low > lowest_high
    };
    let apart = first.tuned.iter().enumerate().filter(|(k, _)| is_apart(*k));
    apart.map(|(_, t)| t.key.path()).collect()
}

/// Parses a stretch, FROM:TO in seconds.
fn stretch(text: &str) -> std::result::Result<Stretch, String> {
    let read = |part: &str| part.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    let pair = text.split_once(':').and_then(|(from, to)| Some((read(from)?, read(to)?)));
    match pair {
        Some((from, to)) if from < to => Ok(Stretch { from, to }),
        _ => Err("a stretch is FROM:TO in seconds, FROM before TO, such as 10:18".into()),
    }
}

/// Table of the RMS prediction errors in the signals' units, followed by the oscillations of log and model.
pub fn text(held: &[HeldOut]) -> String {
    let mut rows = Vec::new();
    for h in held {
        for f in &h.signals {
            let (unit, size) = f.signal.shown();
            rows.push(vec![
                format!("{} to {} s", h.stretch.from, h.stretch.to),
                format!("{} [{unit}]", f.signal.symbol()),
                format!("{:.3}", f.model / size),
                output::optional(f.line.map(|v| v / size), 3),
                output::optional(f.constant.map(|v| v / size), 3),
                format!("{:.3}", f.own_line / size),
            ]);
        }
    }
    let header = ["held out", "RMS of", "model", "line before", "last value", "line through it"];
    let mut text = output::table(&header, &rows);
    for h in held {
        for d in &h.whole {
            let (Some(log), Some(model)) = (d.ringing, d.model_ringing) else { continue };
            text += &format!(
                "\nwithout {} to {} s: {} oscillates at {:.3} Hz, the model at {:.3} Hz ({:+.1} %); damping {}, \
                 the model's {}",
                h.stretch.from,
                h.stretch.to,
                d.signal.symbol(),
                log.frequency,
                model.frequency,
                (model.frequency / log.frequency - 1.0) * 100.0,
                output::optional(log.damping, 4),
                output::optional(model.damping, 4)
            );
        }
    }
    text
}

/// Table of the folds, and the keys on which they contradict each other.
pub fn folds_text(folds: &[Fold]) -> String {
    let header = folds_header(folds);
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut text = output::table(&header, &folds_rows(folds));
    for key in contradicting_keys(folds) {
        text += &format!("\n{key}: {CONTRADICTION}");
    }
    text
}

/// Note on a key whose result depends on the part of the log.
pub const CONTRADICTION: &str = "intervals of two of these searches have nothing in common: an effect that the model omits is attributed to it";

/// Hold-out validation as JSON.
pub fn in_json(held: &[HeldOut]) -> Vec<Value> {
    held.iter()
        .map(|h| {
            json!({
                "log": h.log, "from_s": h.stretch.from, "to_s": h.stretch.to,
                "signals": h.signals.iter().map(|f| {
                    let (unit, size) = f.signal.shown();
                    json!({
                        "signal": f.signal.key(), "unit": unit, "model": f.model / size,
                        "line_before": f.line.map(|v| v / size), "last_value": f.constant.map(|v| v / size),
                        "line_in_hindsight": f.own_line / size,
                    })
                }).collect::<Vec<_>>(),
                "ringing": h.whole.iter().filter_map(|d| {
                    let (log, model) = (d.ringing?, d.model_ringing?);
                    Some(json!({
                        "signal": d.signal.key(), "frequency_hz": log.frequency, "model_frequency_hz": model.frequency,
                        "damping": log.damping, "model_damping": model.damping,
                    }))
                }).collect::<Vec<_>>(),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_identify::Free;

    #[test]
    fn searches_with_disjoint_intervals_contradict_each_other() {
        let found = |value: f64, deviation: f64| Tuned {
            key: Free::from_path("payload.mass_kg").unwrap(),
            value: (200.0, value),
            prior: 0.5,
            deviation,
            from_logs: deviation,
            others_exact: deviation,
            determination: hydroboom_identify::Determination::Determined,
            partner: None,
        };
        let without = |from: f64, tuned: Tuned| Fold {
            stretch: Stretch { from, to: 18.0 },
            tuned: vec![tuned],
            correlation: vec![vec![1.0]],
        };
        // a factor of exp(1.96 times 0.0255) in both directions
        let near = [without(10.0, found(200.0, 0.0255)), without(14.0, found(215.0, 0.0255))];
        assert!(contradicting_keys(&near).is_empty());
        assert_eq!(folds_rows(&near)[0][1], "200.00 (190.25 to 210.25)");
        let apart = [without(10.0, found(200.0, 0.0255)), without(14.0, found(225.0, 0.0255))];
        assert_eq!(contradicting_keys(&apart), ["payload.mass_kg"]);
        assert!(folds_text(&apart).contains("nothing in common"));
    }
}
