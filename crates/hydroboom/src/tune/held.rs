//! The options that keep parts of the logs from the search, and what comes of them.

use crate::output;
use clap::Args;
use hydroboom_identify::{Experiment, HeldOut, Stretch};
use miette::{Result, miette};
use serde_json::{Value, json};

/// The options that keep parts of the logs from the search.
#[derive(Args, Clone)]
pub struct HoldOut {
    /// Keep a stretch of the logs' time from the search and say how the model does there, as FROM:TO in seconds; can be
    /// repeated.
    #[arg(long, value_name = "FROM:TO", value_parser = stretch)]
    pub hold_out: Vec<Stretch>,
    /// Hold out one stretch after the other, with a search for each, before the search over all of them.
    #[arg(long, requires = "hold_out")]
    pub in_turn: bool,
}

/// A stretch has at least so many samples of a log, and as many are left beside it.
const LEAST: usize = 10;

impl HoldOut {
    /// Whether each stretch is within a log, and something is left to be tuned to.
    pub fn checked(&self, logs: &[Experiment]) -> Result<()> {
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
            if held.is_none_or(|held| held < LEAST) {
                return Err(miette!(
                    help = format!("a stretch with at least {LEAST} samples of a log: {}", spans()),
                    "--hold-out {}:{} is outside the logs",
                    s.from,
                    s.to
                ));
            }
        }
        // held out in turn, each search sees the other stretches
        let sets: Vec<&[Stretch]> = match self.in_turn {
            true => self.hold_out.chunks(1).collect(),
            false => vec![&self.hold_out],
        };
        for held in sets {
            let is_left = |t: &&f64| !held.iter().any(|s| is_in(s, t));
            if all.iter().flatten().filter(is_left).count() < LEAST {
                return Err(miette!(
                    help = format!("hold out less of {}", spans()),
                    "--hold-out leaves nothing of the logs to be tuned to"
                ));
            }
        }
        Ok(())
    }
}

fn stretch(text: &str) -> std::result::Result<Stretch, String> {
    let read = |part: &str| part.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    let pair = text.split_once(':').and_then(|(from, to)| Some((read(from)?, read(to)?)));
    match pair {
        Some((from, to)) if from < to => Ok(Stretch { from, to }),
        _ => Err("a stretch is FROM:TO in seconds, FROM before TO, such as 10:18".into()),
    }
}

/// A table of what was foretold, and the ringing below it.
pub fn said(held: &[HeldOut]) -> String {
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
                format!("{:.3}", f.hindsight / size),
            ]);
        }
    }
    let header = ["held out", "RMS of", "model", "line before", "last value", "line in hindsight"];
    let mut said = output::table(&header, &rows);
    for h in held {
        for d in &h.whole {
            let (Some(log), Some(model)) = (d.ringing, d.model_ringing) else { continue };
            said += &format!(
                "\nwithout {} to {} s: {} rings at {:.3} Hz, the model at {:.3} Hz ({:+.1} %); damping {}, the model's {}",
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
    said
}

/// The same for machines.
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
                        "line_in_hindsight": f.hindsight / size,
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
