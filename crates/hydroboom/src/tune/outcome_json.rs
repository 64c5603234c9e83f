//! Results of tuning as JSON.

use super::hold_out::{self, Fold};
use super::outcome::Outcome;
use super::{channels, profiles};
use crate::paths::InputFile;
use crate::verdict_text;
use hydroboom_description::schema::KEYS;
use hydroboom_identify::{COMPARED, Improvement, Tuned};
use serde_json::{Value, json};

/// All results; `logs` are the paths as named.
pub fn outcome_in_json(outcome: &Outcome<'_>, logs: &[InputFile]) -> Value {
    let fit = &outcome.fit;
    let verdicts = outcome.verdicts().map(
        |(log, judgements)| json!({ "log": log, "aspects": verdict_text::in_json(&judgements) }),
    );
    json!({
        "held_out": hold_out::in_json(&outcome.held_out),
        "in_turn": outcome.folds.iter().map(Fold::in_json).collect::<Vec<_>>(),
        "tests": outcome.tests.iter().map(improvement_in_json).collect::<Vec<_>>(),
        "crane": outcome.crane.name, "logs": logs, "sha256": outcome.digests, "notes": outcome.notes,
        "runs": fit.evaluations, "converged": fit.has_converged,
        "keys": fit.tuned.iter().map(key_in_json).collect::<Vec<_>>(),
        "verdicts": verdicts.collect::<Vec<_>>(),
        "channels": channels::in_json(&fit.channels), "correlation": fit.correlation,
        "channel_correlation": fit.channel_correlation, "profiles": profiles::in_json(&outcome.profiles),
        "differences": fit.improvements.iter().map(improvement_in_json).collect::<Vec<_>>(),
    })
}

/// Fitted key in its unit, with interval, standard deviations, determination and strongest correlation.
pub fn key_in_json(tuned: &Tuned) -> Value {
    let key = &KEYS[tuned.key.place];
    let (low, high) = tuned.interval();
    let finite_percent = |share: f64| share.is_finite().then_some(share * 100.0);
    json!({
        "key": key.path(), "before": key.to_unit(tuned.value.0), "after": key.to_unit(tuned.value.1),
        "interval_95": [key.to_unit(low), key.to_unit(high)], "known_to_percent": tuned.prior * 100.0,
        "logs_say_to_percent": finite_percent(tuned.from_logs),
        "others_exact_percent": finite_percent(tuned.others_exact),
        "determined": tuned.is_determined(), "biased": tuned.biased(),
        "not_determined": tuned.determination.reason(),
        "partner": tuned.partner.as_ref().map(|(k, _)| k),
        "correlation": tuned.partner.as_ref().map(|(_, c)| c),
    })
}

/// RMS residuals of a log's signals before and after the fit, in the units of display.
fn improvement_in_json(of: &Improvement) -> Value {
    let signals = COMPARED.iter().zip(&of.rms).filter_map(|(signal, rms)| {
        let (unit, size) = signal.shown();
        let (before, after) = (*rms)?;
        Some(json!({
            "signal": signal.key(), "unit": unit, "before": before / size, "after": after / size,
        }))
    });
    json!({ "log": of.log, "rms": signals.collect::<Vec<_>>() })
}
