//! What was learned of a machine, as a file to go on with.

use hydroboom_control::{Believed, Learned, TRANSITIONS};
use hydroboom_description::Description;
use hydroboom_design::{DesignError, flow_balance, schedule};
use serde_json::{Value, json};
use std::path::Path;
use thiserror::Error;

/// Pascal in a bar, m³/s in a L/min.
const BAR: f64 = 1e5;
const LITRES_PER_MINUTE: f64 = 1e-3 / 60.0;

/// Names of what is believed in the file, with units, and what one of each is in SI.
const COLUMNS: [(&str, f64); 7] = [
    ("transition_bar", BAR),
    ("flow_gain", 1.0),
    ("leakage_l_min", LITRES_PER_MINUTE),
    ("flow_gain_variance", 1.0),
    ("covariance_l_min", LITRES_PER_MINUTE),
    ("leakage_variance_l2_min2", LITRES_PER_MINUTE * LITRES_PER_MINUTE),
    ("log_likelihood", 1.0),
];

/// Why a file does not say what was learned.
#[derive(Debug, Error)]
pub enum LearnedError {
    /// It cannot be read or written.
    #[error("{path}: {error}")]
    File {
        /// Its path.
        path: String,
        /// What the system says.
        error: std::io::Error,
    },
    /// It is no such file, or about another crane.
    #[error("{path}: {reason}")]
    Other {
        /// Its path.
        path: String,
        /// What is wrong.
        reason: String,
    },
    /// The crane has no model following that could learn.
    #[error(transparent)]
    Design(#[from] DesignError),
}

/// What was learned, as JSON: a summary for people, then all that is believed.
pub fn text(model: &Description, learned: &Learned) -> String {
    let believed: Vec<Value> = learned
        .flow
        .believed()
        .iter()
        .map(|b| {
            let pairs = COLUMNS.iter().zip(b.to_array());
            pairs.map(|((name, unit), value)| ((*name).to_string(), json!(value / unit))).collect()
        })
        .collect();
    let balance = &learned.flow.balance;
    let value = json!({
        "learned_of": model.name,
        "payload_kg": learned.payload,
        "flow_gain": balance.flow_gain,
        "leakage_l_min": balance.leakage / LITRES_PER_MINUTE,
        "transition_bar": balance.transition / BAR,
        "transition_deviation_bar": learned.flow.doubt / BAR,
        "under_each_transition": believed,
    });
    format!("{value:#}\n")
}

/// Reads such a file.
///
/// # Errors
///
/// [`LearnedError`] when there is none, or it is about another crane.
pub fn read(model: &Description, path: &Path) -> Result<Learned, LearnedError> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path)
        .map_err(|error| LearnedError::File { path: name.clone(), error })?;
    let other = |reason: String| LearnedError::Other { path: name.clone(), reason };
    let value: Value = serde_json::from_str(&text)
        .map_err(|e| other(format!("not what `hydroboom run --learned` writes: {e}")))?;
    let number = |of: &Value, key: &str| {
        of[key].as_f64().ok_or_else(|| other(format!("a number is missing: {key}")))
    };
    let rows = value["under_each_transition"].as_array().filter(|rows| rows.len() == TRANSITIONS);
    let rows = rows.ok_or_else(|| {
        other(format!("\"under_each_transition\" is not a list of {TRANSITIONS}"))
    })?;
    let mut believed = [Believed::default(); TRANSITIONS];
    for (into, row) in believed.iter_mut().zip(rows) {
        let mut numbers = [0.0; COLUMNS.len()];
        for (into, (name, unit)) in numbers.iter_mut().zip(COLUMNS) {
            *into = number(row, name)? * unit;
        }
        *into = Believed::from_array(numbers);
    }
    let schedule = schedule(model)?;
    let payload = number(&value, "payload_kg")?;
    let heaviest = schedule.heaviest();
    if !(0.0..=heaviest).contains(&payload) {
        return Err(other(format!(
            "payload_kg = {payload}: it is 0 to {heaviest:.0} for this crane"
        )));
    }
    let flow = flow_balance(model, &schedule).resume(&believed).ok_or_else(|| {
        other(format!(
            "it was learned of \"{}\" with another crane file, or changed by hand: with another oil.transition_bar it is to be learned anew",
            value["learned_of"].as_str().unwrap_or("?")
        ))
    })?;
    Ok(Learned { payload, flow })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::{Learner, Reading};

    #[test]
    fn what_was_learned_comes_back_from_its_file_and_not_for_another_crane() {
        let model = Description::uia_single_boom().unwrap();
        let schedule = schedule(&model).unwrap();
        let flow = flow_balance(&model, &schedule);
        let mut reading = Reading { stroke: 0.2, pressure_a: 70e5, ..Reading::default() };
        let mut learner = Learner::start(&schedule, &flow, 210.0, &reading, 66e5);
        // a pump that delivers a tenth more
        for _ in 0..3000 {
            reading.motor_speed = 20.0;
            let flow_in = 1.1 * flow.before.flow_gain * flow.displacement * reading.motor_speed;
            reading.stroke += flow_in / flow.piston_area * flow.period;
            learner.balances(&reading);
        }
        let learned = *learner.learned();
        assert!(learned.flow.balance.flow_gain > 1.05 * flow.before.flow_gain);
        let path = std::env::temp_dir().join(format!("hydroboom-learned-{}", std::process::id()));
        std::fs::write(&path, text(&model, &learned)).unwrap();
        let back = read(&model, &path).unwrap();
        let mut other = model.clone();
        other.set("oil.transition_bar=30").unwrap();
        let refused = read(&other, &path).unwrap_err().to_string();
        std::fs::write(&path, "{\"payload_kg\": 3}").unwrap();
        let cut = read(&model, &path).unwrap_err().to_string();
        std::fs::remove_file(&path).unwrap();
        assert!((back.payload - learned.payload).abs() < 1e-9);
        for (a, b) in back.flow.believed().iter().zip(learned.flow.believed()) {
            for (a, b) in a.to_array().iter().zip(b.to_array()) {
                assert!((a - b).abs() <= 1e-12 * b.abs(), "{a} for {b}");
            }
        }
        let (a, b) = (back.flow.balance, learned.flow.balance);
        assert!((a.flow_gain / b.flow_gain - 1.0).abs() < 1e-12, "{a:?} for {b:?}");
        assert!(refused.contains("another crane file"), "{refused}");
        assert!(cut.contains("under_each_transition"), "{cut}");
    }
}
