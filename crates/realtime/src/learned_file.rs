//! What was learned of a machine, as a file to go on with.

use hydroboom_control::{Believed, BelievedLag, BelievedLoad, Learned, TRANSITIONS};
use hydroboom_description::Description;
use hydroboom_design::{DesignError, balances, informed, overrides, schedule};
use serde_json::{Value, json};
use std::path::Path;
use thiserror::Error;

/// Pascal in a bar, m³/s in a L/min.
const BAR: f64 = 1e5;
const LITRES_PER_MINUTE: f64 = 1e-3 / 60.0;
/// m³/(rev Pa) in a cm³/(rev bar).
const SLIP: f64 = 1e-6 / BAR;

/// Names of what is believed in the file, with units, and what one of each is in SI.
const COLUMNS: [(&str, f64); 11] = [
    ("transition_bar", BAR),
    ("flow_gain", 1.0),
    ("leakage_l_min", LITRES_PER_MINUTE),
    ("slip_cm3_per_rev_bar", SLIP),
    ("flow_gain_variance", 1.0),
    ("flow_gain_leakage_l_min", LITRES_PER_MINUTE),
    ("flow_gain_slip_cm3_per_rev_bar", SLIP),
    ("leakage_variance_l2_min2", LITRES_PER_MINUTE * LITRES_PER_MINUTE),
    ("leakage_l_min_slip_cm3_per_rev_bar", LITRES_PER_MINUTE * SLIP),
    ("slip_variance_cm6_per_rev2_bar2", SLIP * SLIP),
    ("log_likelihood", 1.0),
];

/// Names of what is believed of the load, with units.
const LOAD: [&str; 9] = [
    "payload_kg",
    "coulomb_friction",
    "viscous_friction",
    "payload_variance_kg2",
    "payload_coulomb_friction_kg",
    "payload_viscous_friction_kg",
    "coulomb_friction_variance",
    "coulomb_viscous_friction",
    "viscous_friction_variance",
];

/// Names of what is believed of the motor's lag, with units, and what one of each is in SI.
const LAG: [(&str, f64); 2] = [("lag_ms", 1e-3), ("lag_variance_ms2", 1e-6)];

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

/// What was learned, as JSON: a summary for people, overrides (`set`) that put it into the crane file, then all that is believed.
///
/// # Errors
///
/// [`DesignError`] when the crane has no model following that could have learned.
pub fn text(model: &Description, learned: &Learned) -> Result<String, DesignError> {
    let set = overrides(model, &informed(model, &schedule(model)?, &learned.known()));

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
    let mut value = json!({
        "learned_of": model.name,
        "weighed_kg": learned.weighed,
        "flow_gain": balance.flow_gain,
        "leakage_l_min": balance.leakage / LITRES_PER_MINUTE,
        "slip_cm3_per_rev_bar": balance.slip / SLIP,
        "transition_bar": balance.transition / BAR,
        "transition_deviation_bar": learned.flow.doubt / BAR,
        "set": set,
        "under_each_transition": believed,
    });
    for (name, number) in LOAD.into_iter().zip(learned.load.believed().to_array()) {
        value[name] = json!(number);
    }
    for ((name, unit), number) in LAG.into_iter().zip(learned.lag.believed().to_array()) {
        value[name] = json!(number / unit);
    }
    Ok(format!("{value:#}\n"))
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
        of[key].as_f64().ok_or_else(|| {
            other(format!(
                "a number is missing: {key}; what another version wrote is to be learned anew"
            ))
        })
    };
    let rows = value["under_each_transition"].as_array().filter(|rows| rows.len() == TRANSITIONS);
    let rows = rows.ok_or_else(|| {
        other(format!("\"under_each_transition\" is not a list of {TRANSITIONS}: what another version wrote is to be learned anew"))
    })?;
    let mut believed = [Believed::default(); TRANSITIONS];
    for (into, row) in believed.iter_mut().zip(rows) {
        let mut numbers = [0.0; COLUMNS.len()];
        for (into, (name, unit)) in numbers.iter_mut().zip(COLUMNS) {
            *into = number(row, name)? * unit;
        }
        *into = Believed::from_array(numbers);
    }
    let weighed = number(&value, "weighed_kg")?;
    let mut load = [0.0; LOAD.len()];
    for (into, name) in load.iter_mut().zip(LOAD) {
        *into = number(&value, name)?;
    }
    let mut lag = [0.0; LAG.len()];
    for (into, (name, unit)) in lag.iter_mut().zip(LAG) {
        *into = number(&value, name)? * unit;
    }
    let schedule = schedule(model)?;
    let balances = balances(model, &schedule);
    let lag = BelievedLag::from_array(lag);
    let lag = balances.lag.resume(&lag).ok_or_else(|| {
        other(format!("lag_variance_ms2 = {} cannot be: a variance is above 0", lag.variance * 1e6))
    })?;
    let load = BelievedLoad::from_array(load);
    let resumed = balances.load.resume(&schedule, &load);
    let load = resumed.filter(|_| (0.0..=schedule.heaviest()).contains(&weighed)).ok_or_else(|| {
        other(format!(
            "weighed_kg = {weighed}, payload_kg = {}, coulomb_friction = {} and viscous_friction = {} with their variances cannot be: a payload is 0 to {:.0} for this crane",
            load.payload, load.coulomb, load.viscous, schedule.heaviest()
        ))
    })?;
    let flow = balances.flow.resume(&believed).ok_or_else(|| {
        other(format!(
            "it was learned of \"{}\" with another crane file, or changed by hand: with another oil.transition_bar it is to be learned anew",
            value["learned_of"].as_str().unwrap_or("?")
        ))
    })?;
    Ok(Learned { weighed, load, flow, lag })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::{Learner, Reading};
    use hydroboom_description::schema::Numbers;

    #[test]
    fn what_was_learned_comes_back_from_its_file_and_not_for_another_crane() {
        let model = Description::uia_single_boom().unwrap();
        let schedule = schedule(&model).unwrap();
        let balances = balances(&model, &schedule);
        let flow = balances.flow;
        let mut reading =
            Reading { stroke: 0.2, pressure_a: 70e5, pressure_pump_a: 70e5, ..Reading::default() };
        let mut learner = Learner::start(&schedule, &balances, 210.0, &reading, 66e5);
        // a pump that delivers a fifth more: more than it is said to displace
        for _ in 0..3000 {
            reading.motor_speed = 20.0;
            let flow_in = 1.2 * flow.before.flow_gain * flow.displacement * reading.motor_speed;
            reading.stroke += flow_in / flow.piston_area * flow.period;
            learner.learn_in_motion(19.0, &reading, 66e5);
        }
        let learned = *learner.learned();
        assert!(learned.flow.balance.flow_gain > 1.05 * flow.before.flow_gain);
        let path = std::env::temp_dir().join(format!("hydroboom-learned-{}", std::process::id()));
        std::fs::write(&path, text(&model, &learned).unwrap()).unwrap();
        let back = read(&model, &path).unwrap();
        // and as overrides for every command
        let value: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        let mut known = model.clone();
        for set in value["set"].as_array().unwrap() {
            known.set(set.as_str().unwrap()).unwrap();
        }
        let heavy = text(&model, &Learned { weighed: 9e3, ..learned }).unwrap();
        std::fs::write(&path, heavy).unwrap();
        let heavy = read(&model, &path).unwrap_err().to_string();
        std::fs::write(&path, text(&model, &learned).unwrap()).unwrap();
        let mut other = model.clone();
        other.set("oil.transition_bar=30").unwrap();
        let refused = read(&other, &path).unwrap_err().to_string();
        std::fs::write(&path, "{\"payload_kg\": 3}").unwrap();
        let cut = read(&model, &path).unwrap_err().to_string();
        std::fs::remove_file(&path).unwrap();
        let gain = learned.flow.balance.flow_gain;
        let delivers = |n: &Numbers<f64>| n.flow_gain * n.displacement;
        let delivered = delivers(&known.numbers) / (gain * model.numbers.displacement);
        assert!((delivered - 1.0).abs() < 1e-4 && gain > 1.01, "{value:#}");
        assert!((known.numbers.payload - learned.load.payload()).abs() < 1e-2, "{value:#}");
        assert_eq!(back.weighed, learned.weighed);
        let all = |learned: &Learned| {
            let mut all: Vec<f64> =
                learned.flow.believed().iter().flat_map(|b| b.to_array()).collect();
            all.extend(learned.load.believed().to_array());
            all.extend(learned.lag.believed().to_array());
            all
        };
        for (a, b) in all(&back).iter().zip(all(&learned)) {
            // decimals and back
            assert!((a - b).abs() <= 1e-12 * b.abs(), "{a} for {b}");
        }
        let (a, b) = (back.flow.balance, learned.flow.balance);
        assert!((a.flow_gain / b.flow_gain - 1.0).abs() < 1e-12, "{a:?} for {b:?}");
        assert!(heavy.contains("weighed_kg = 9000"), "{heavy}");
        assert!(refused.contains("another crane file"), "{refused}");
        assert!(cut.contains("under_each_transition"), "{cut}");
    }
}
