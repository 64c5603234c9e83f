//! Verdict on a model as text and JSON.

use crate::output::three_digits;
use hydroboom_identify::{Aspect, Judgement, LIMITS};
use serde_json::{Value, json};

/// Name of an aspect in text and JSON.
pub fn name(aspect: Aspect) -> &'static str {
    match aspect {
        Aspect::Position => "position",
        Aspect::Pressures => "pressures",
        Aspect::Frequency => "frequency",
        Aspect::Damping => "damping",
    }
}

/// Deviation of an aspect with its limit: RMS in the signal's unit, or relative \[%\].
fn deviation(j: &Judgement) -> String {
    match j.aspect {
        Aspect::Position | Aspect::Pressures => {
            let (unit, size) = j.signal.shown();
            let (found, limit) = (j.found / size, j.limit / size);
            format!(
                "{} {} {unit} RMS, limit {}",
                j.signal.symbol(),
                three_digits(found),
                three_digits(limit)
            )
        }
        Aspect::Damping if j.limit > LIMITS.damping => format!(
            "{} {:+.1} %, limit {:.0} %, a damping ratio of {}",
            j.signal.symbol(),
            j.found * 100.0,
            j.limit * 100.0,
            LIMITS.least_damping
        ),
        Aspect::Frequency | Aspect::Damping => {
            let (found, limit) = (j.found * 100.0, j.limit * 100.0);
            format!("{} {found:+.1} %, limit {limit:.1} %", j.signal.symbol())
        }
    }
}

/// One sentence with the aspects beyond and within their limits, and those that the log does not show.
pub fn sentence(judgements: &[Judgement]) -> String {
    let of = |is_right: bool| {
        let all = judgements.iter().filter(|j| j.is_right() == is_right);
        all.map(|j| format!("{} ({})", name(j.aspect), deviation(j))).collect::<Vec<_>>().join(", ")
    };
    let unjudged = [Aspect::Position, Aspect::Pressures, Aspect::Frequency, Aspect::Damping];
    let unjudged = unjudged.into_iter().filter(|a| judgements.iter().all(|j| j.aspect != *a));
    let mut unjudged: Vec<&str> = unjudged.map(name).collect();
    let (right, wrong) = (of(true), of(false));
    let mut parts = Vec::new();
    if !wrong.is_empty() {
        parts.push(format!("NOT right for {wrong}"));
    }
    if !right.is_empty() {
        parts.push(format!("right for {right}"));
    }
    if !unjudged.is_empty() {
        let last = unjudged.pop().unwrap_or_default();
        let others = unjudged.join(", ");
        let and = if others.is_empty() { "" } else { " and " };
        parts.push(format!("the log does not tell {others}{and}{last}"));
    }
    format!("The model is {}.", parts.join("; ")).replace("is the log", "is not judged: the log")
}

/// Judgements as JSON, in SI units; frequency and damping as relative deviations \[-\].
pub fn in_json(judgements: &[Judgement]) -> Vec<Value> {
    let of = |j: &Judgement| {
        json!({
            "aspect": name(j.aspect), "right": j.is_right(), "signal": j.signal.key(),
            "found": j.found, "limit": j.limit,
        })
    };
    judgements.iter().map(of).collect()
}
