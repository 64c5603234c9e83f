//! What was learned of a machine, as a file to go on with.
//!
//! A file may have been changed by hand, or come from another version or crane. So every number that is read is checked:
//! it is within its physical range, and the covariance matrices are positive definite. What is refused is named by its key.

use hydroboom_control::command_lag::BelievedLag;
use hydroboom_control::flow_balance::{Believed, TRANSITIONS};
use hydroboom_control::learner::{Balances, Learned};
use hydroboom_control::load_balance::BelievedLoad;
use hydroboom_control::out_of_range::OutOfRange;
use hydroboom_control::schedule::Schedule;
use hydroboom_description::Description;
use hydroboom_design::{DesignError, balances, informed, overrides, schedule};
use serde_json::{Map, Value, json};
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

/// The key of the rows of [`COLUMNS`].
const ROWS: &str = "under_each_transition";

/// The key of the payload as it was weighed at rest.
const WEIGHED: &str = "weighed_kg";

/// Names of what is believed of the load, with units, which are those of SI.
const LOAD: [(&str, f64); 9] = [
    ("payload_kg", 1.0),
    ("coulomb_friction", 1.0),
    ("viscous_friction", 1.0),
    ("payload_variance_kg2", 1.0),
    ("payload_coulomb_friction_kg", 1.0),
    ("payload_viscous_friction_kg", 1.0),
    ("coulomb_friction_variance", 1.0),
    ("coulomb_viscous_friction", 1.0),
    ("viscous_friction_variance", 1.0),
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
    /// It is no such file, about another crane, or says what cannot be.
    #[error("{path}: {reason}. Without the file it is learned anew")]
    Refused {
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

    let named = |columns: &[(&str, f64)], numbers: &[f64]| -> Map<String, Value> {
        let pairs = columns.iter().zip(numbers);
        pairs.map(|((name, unit), number)| ((*name).to_string(), json!(number / unit))).collect()
    };
    let believed = learned.flow.believed().map(|row| named(&COLUMNS, &row.to_array()));
    let balance = &learned.flow.balance;
    let mut value = json!({
        "learned_of": model.name,
        WEIGHED: learned.weighed,
        "flow_gain": balance.flow_gain,
        "leakage_l_min": balance.leakage / LITRES_PER_MINUTE,
        "slip_cm3_per_rev_bar": balance.slip / SLIP,
        "transition_bar": balance.transition / BAR,
        "transition_deviation_bar": learned.flow.doubt / BAR,
        "set": set,
        ROWS: believed.to_vec(),
    });
    if let Value::Object(all) = &mut value {
        all.extend(named(&LOAD, &learned.load.believed().to_array()));
        all.extend(named(&LAG, &learned.lag.believed().to_array()));
    }
    Ok(format!("{value:#}\n"))
}

/// Reads such a file.
///
/// # Errors
///
/// [`LearnedError`] when there is none, it is about another crane, or a number of it cannot have been learned.
pub fn read(model: &Description, path: &Path) -> Result<Learned, LearnedError> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path)
        .map_err(|error| LearnedError::File { path: name.clone(), error })?;
    let schedule = schedule(model)?;
    let balances = balances(model, &schedule);
    parsed(&text, &schedule, &balances)
        .map_err(|reason| LearnedError::Refused { path: name, reason })
}

/// What the text of such a file says of a crane.
///
/// # Errors
///
/// What is wrong with it.
fn parsed(text: &str, schedule: &Schedule, balances: &Balances) -> Result<Learned, String> {
    let value: Value = serde_json::from_str(text)
        .map_err(|e| format!("not what `hydroboom run --learned` writes: {e}"))?;
    let rows =
        value[ROWS].as_array().and_then(|rows| <&[Value; TRANSITIONS]>::try_from(&rows[..]).ok());
    let rows = rows.ok_or_else(|| {
        format!("{ROWS} is not a list of {TRANSITIONS}: another version wrote it")
    })?;
    let mut believed = [Believed::default(); TRANSITIONS];
    for (k, (into, row)) in believed.iter_mut().zip(rows).enumerate() {
        *into = Believed::from_array(numbers(row, &COLUMNS, &row_key(k))?);
    }
    let flow = balances.flow.resume(&believed).map_err(|(k, wrong)| {
        let reason = refused(&rows[k], &COLUMNS, &row_key(k), wrong);
        match wrong.field {
            0 => format!(
                "{reason} by oil.transition_bar: it was learned with another crane file, of \"{}\"",
                value["learned_of"].as_str().unwrap_or("?")
            ),
            _ => reason,
        }
    })?;
    let load = BelievedLoad::from_array(numbers(&value, &LOAD, "")?);
    let load = balances.load.resume(schedule, &load);
    let load = load.map_err(|wrong| refused(&value, &LOAD, "", wrong))?;
    let lag = BelievedLag::from_array(numbers(&value, &LAG, "")?);
    let lag = balances.lag.resume(&lag);
    let lag = lag.map_err(|wrong| refused(&value, &LAG, "", wrong))?;
    let columns = [(WEIGHED, 1.0)];
    let [weighed] = numbers(&value, &columns, "")?;
    let wrong = OutOfRange { field: 0, range: [0.0, schedule.heaviest()] };
    match (0.0..=schedule.heaviest()).contains(&weighed) {
        true => Ok(Learned { weighed, load, flow, lag }),
        false => Err(refused(&value, &columns, "", wrong)),
    }
}

/// What a row's keys begin with.
fn row_key(row: usize) -> String {
    format!("{ROWS}[{row}].")
}

/// The numbers of some keys, in SI.
fn numbers<const N: usize>(
    of: &Value,
    columns: &[(&str, f64); N],
    begin: &str,
) -> Result<[f64; N], String> {
    let mut numbers = [0.0; N];
    for (into, (name, unit)) in numbers.iter_mut().zip(columns) {
        let number = of[*name].as_f64().ok_or_else(|| match &of[*name] {
            Value::Null => format!("{begin}{name} is missing: a number is needed"),
            other => format!("{begin}{name} = {other}: a number is needed"),
        })?;
        *into = number * unit;
    }
    Ok(numbers)
}

/// Says what was read of a key and what is allowed.
fn refused(of: &Value, columns: &[(&str, f64)], begin: &str, wrong: OutOfRange) -> String {
    let (name, unit) = columns[wrong.field];
    let [lowest, highest] = wrong.range.map(|end| shown(end / unit));
    format!("{begin}{name} = {}: {lowest} to {highest} is possible", of[name])
}

/// A number to as many digits as tell it from others.
fn shown(number: f64) -> String {
    let rounded = format!("{number:.7e}").parse().unwrap_or(number);
    match (1e-3..1e6).contains(&f64::abs(rounded)) || rounded == 0.0 {
        true => format!("{rounded}"),
        false => format!("{rounded:e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::controller::AxisState;
    use hydroboom_control::feedback::benchmark::BenchmarkInput;
    use hydroboom_control::follower::Follower;
    use hydroboom_control::learner::Learner;
    use hydroboom_control::measurement::AxisSignals;
    use hydroboom_control::reference::profile::SetPoint;
    use hydroboom_description::schema::Numbers;
    use proptest::prelude::*;
    use std::sync::LazyLock;

    /// A crane, and what can be learned of it.
    struct Crane {
        model: Description,
        schedule: Schedule,
        balances: Balances,
    }

    static CRANE: LazyLock<Crane> = LazyLock::new(|| {
        let model = Description::uia_single_boom().unwrap();
        let schedule = schedule(&model).unwrap();
        let balances = balances(&model, &schedule);
        Crane { model, schedule, balances }
    });

    /// What a machine is told and read: up and down, with a flow gain of its pump.
    struct Machine {
        told: f64,
        reading: AxisSignals<f64>,
        delivers: f64,
        time: f64,
    }

    impl Machine {
        fn new(delivers: f64) -> Self {
            let pressure = 70e5;
            let reading = AxisSignals {
                stroke: 0.2,
                pressure_a: pressure,
                pressure_pump_a: pressure,
                pressure_b: 3e5,
                pressure_pump_b: 3e5,
                ..AxisSignals::default()
            };
            Self { told: 0.0, reading, delivers, time: 0.0 }
        }

        fn period(&mut self) {
            let flow = &CRANE.balances.flow;
            self.time += flow.period;
            self.told = 20.0 * (0.8 * self.time).sin();
            let reading = &mut self.reading;
            reading.motor_speed += 0.15 * (self.told - reading.motor_speed);
            let delivered = self.delivers * flow.displacement * reading.motor_speed;
            reading.stroke += delivered / flow.piston_area * flow.period;
            reading.pressure_a = 70e5 + 4e5 * (6.0 * self.time).sin() + 1e4 * self.told;
            reading.pressure_pump_a = reading.pressure_a;
        }

        fn measured(&self) -> BenchmarkInput<f64> {
            let AxisSignals { stroke, pressure_a, pressure_b, .. } = self.reading;
            BenchmarkInput { stroke, load_pressure: pressure_a - 0.7 * pressure_b }
        }
    }

    /// What a machine teaches within some seconds.
    fn learned(delivers: f64, seconds: u32) -> Learned {
        let Crane { schedule, balances, .. } = &*CRANE;
        let mut machine = Machine::new(delivers);
        let pressure = machine.measured().load_pressure;
        let mut learner = Learner::start(schedule, balances, 210.0, &machine.reading, pressure);
        for _ in 0..1000 * seconds {
            machine.period();
            let pressure = machine.measured().load_pressure;
            learner.learn_in_motion(machine.told, &machine.reading, pressure);
        }
        *learner.learned()
    }

    fn all(learned: &Learned) -> Vec<f64> {
        let mut all: Vec<f64> = learned.flow.believed().iter().flat_map(|b| b.to_array()).collect();
        all.extend(learned.load.believed().to_array());
        all.extend(learned.lag.believed().to_array());
        all.push(learned.weighed);
        all
    }

    #[test]
    fn what_was_learned_comes_back_from_its_file_and_not_for_another_crane() {
        let Crane { model, balances, .. } = &*CRANE;
        // a pump that delivers more than it is said to displace
        let learned = learned(1.2 * balances.flow.before.flow_gain, 6);
        let path = std::env::temp_dir().join(format!("hydroboom-learned-{}", std::process::id()));
        let written = |learned: &Learned| std::fs::write(&path, text(model, learned).unwrap());
        written(&learned).unwrap();
        let back = read(model, &path).unwrap();
        // and as overrides for every command
        let value: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        let mut known = model.clone();
        for set in value["set"].as_array().unwrap() {
            known.set(set.as_str().unwrap()).unwrap();
        }
        written(&Learned { weighed: 9e3, ..learned }).unwrap();
        let heavy = read(model, &path).unwrap_err().to_string();
        written(&learned).unwrap();
        let mut other = model.clone();
        other.set("oil.transition_bar=30").unwrap();
        let refused = read(&other, &path).unwrap_err().to_string();
        std::fs::write(&path, "{\"payload_kg\": 3}").unwrap();
        let cut = read(model, &path).unwrap_err().to_string();
        std::fs::remove_file(&path).unwrap();
        let gain = learned.flow.balance.flow_gain;
        let delivers = |n: &Numbers<f64>| n.flow_gain * n.displacement;
        let delivered = delivers(&known.numbers) / (gain * model.numbers.displacement);
        assert!((delivered - 1.0).abs() < 1e-4 && gain > 1.01, "{value:#}");
        assert!((known.numbers.payload - learned.load.payload()).abs() < 1e-2, "{value:#}");
        for (a, b) in all(&back).iter().zip(all(&learned)) {
            // decimals and back
            assert!((a - b).abs() <= 1e-12 * b.abs(), "{a} for {b}");
        }
        let (a, b) = (back.flow.balance, learned.flow.balance);
        assert!((a.flow_gain / b.flow_gain - 1.0).abs() < 1e-12, "{a:?} for {b:?}");
        assert!(heavy.contains("weighed_kg = 9000"), "{heavy}");
        let named = "under_each_transition[0].transition_bar = ";
        assert!(refused.contains(named) && refused.contains("another crane file"), "{refused}");
        assert!(cut.contains("under_each_transition"), "{cut}");
    }

    /// However a machine behaves: what is learned of it can be read back.
    #[test]
    fn whatever_is_learned_can_be_read_back() {
        let Crane { model, schedule, balances } = &*CRANE;
        for delivers in [-1.0, 0.0, 0.2, 3.0] {
            let learned = learned(delivers, 20);
            let back = parsed(&text(model, &learned).unwrap(), schedule, balances);
            let back = back.unwrap_or_else(|reason| panic!("{delivers}: {reason}"));
            for (a, b) in all(&back).iter().zip(all(&learned)) {
                assert!((a - b).abs() <= 1e-12 * b.abs(), "{a} for {b}");
            }
        }
    }

    /// Where a number is: in which row, if in one, and its key.
    type Place = (Option<usize>, String);

    /// A file, and where its numbers are.
    static FILE: LazyLock<(Value, Vec<Place>)> = LazyLock::new(|| {
        let text = text(&CRANE.model, &learned(1.02 * CRANE.balances.flow.before.flow_gain, 12));
        let file: Value = serde_json::from_str(&text.unwrap()).unwrap();
        let keys = |of: &Value, row| -> Vec<Place> {
            let numbers = of.as_object().unwrap().iter().filter(|(_, value)| value.is_number());
            numbers.map(|(key, _)| (row, key.clone())).collect()
        };
        let mut places = keys(&file, None);
        let rows = file[ROWS].as_array().unwrap();
        places.extend(rows.iter().enumerate().flat_map(|(k, row)| keys(row, Some(k))));
        (file, places)
    });

    /// Keys whose numbers are checked each by itself, and not as a part of a covariance.
    const ALONE: [&str; 10] = [
        "transition_bar",
        "flow_gain",
        "leakage_l_min",
        "slip_cm3_per_rev_bar",
        "log_likelihood",
        "payload_kg",
        "coulomb_friction",
        "viscous_friction",
        "lag_ms",
        WEIGHED,
    ];

    /// What takes the place of a number.
    #[derive(Clone, Debug)]
    enum Change {
        To(f64),
        Times(f64),
        Text,
        Nothing,
    }

    const SPECIAL: [f64; 5] = [0.0, -0.0, 5e-324, f64::MIN_POSITIVE, f64::MAX];

    fn changes() -> impl Strategy<Value = Change> {
        let sides = prop_oneof![Just(1.0), Just(-1.0)];
        let decades = -330.0..309.0;
        prop_oneof![
            4 => any::<f64>().prop_map(Change::To),
            2 => (sides.clone(), decades).prop_map(|(side, log)| Change::To(side * 10f64.powf(log))),
            1 => prop::sample::select(&SPECIAL[..]).prop_map(Change::To),
            4 => (sides, -9.0..9.0).prop_map(|(side, log)| Change::Times(side * 10f64.powf(log))),
            4 => (-1e-2..1e-2).prop_map(|more: f64| Change::Times(1.0 + more)),
            1 => Just(Change::Text),
            1 => Just(Change::Nothing),
        ]
    }

    /// Half a second beside a machine, by what a file says: what is known, and asked of the motors, is finite.
    fn goes_on(learned: Learned) -> Result<(), TestCaseError> {
        let Crane { schedule, balances, .. } = &*CRANE;
        let mut machine = Machine::new(balances.flow.before.flow_gain);
        let pressure = machine.measured().load_pressure;
        let learner = Learner::start(schedule, balances, 210.0, &machine.reading, pressure);
        let mut follower = Follower::new(learner.with(learned));
        for k in 0..500 {
            machine.period();
            let measured = machine.measured();
            let seen =
                AxisState { stroke: measured.stroke + 1e-3, velocity: 0.01, load_pressure: 66e5 };
            let reference = SetPoint { position: seen.stroke, velocity: 0.01 };
            let reading = &machine.reading;
            let speeds = follower.period(machine.told, &reference, &seen, reading, &measured);
            if k % 100 == 50 {
                follower.weigh_held(reading, &measured);
            }
            let known = follower.known();
            let mut numbers = known.balance.to_array().to_vec();
            numbers.extend(known.friction);
            numbers.extend([known.weighed, known.payload, known.lag]);
            numbers.extend(all(follower.learner().learned()));
            let learner = follower.learner();
            numbers.extend([learner.correction(), learner.learned().flow.doubt]);
            numbers.extend(speeds);
            prop_assert!(numbers.iter().all(|n| n.is_finite()), "{k}: {numbers:?}");
            prop_assert!(learner.correction() > 0.0);
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]

        /// Any number of a file in the place of any other: refused by its key, or harmless.
        #[test]
        fn no_number_of_a_file_makes_what_reads_it_panic(
            place in 0..FILE.1.len(),
            change in changes(),
        ) {
            let (file, places) = &*FILE;
            let (row, key) = &places[place];
            let mut file = file.clone();
            let number = match row {
                Some(row) => &mut file[ROWS][row][key],
                None => &mut file[key],
            };
            let before = number.as_f64().unwrap();
            *number = match change {
                // what is no number is null in JSON
                Change::To(other) => json!(other),
                Change::Times(factor) => json!(factor * before),
                Change::Text => json!("NaN"),
                Change::Nothing => Value::Null,
            };
            match parsed(&file.to_string(), &CRANE.schedule, &CRANE.balances) {
                Ok(learned) => goes_on(learned)?,
                Err(reason) => {
                    let begin = row.map(row_key).unwrap_or_default();
                    // which entry of a covariance is the wrong one cannot be told
                    let named = match ALONE.contains(&key.as_str()) {
                        true => format!("{begin}{key} "),
                        false => begin,
                    };
                    prop_assert!(reason.starts_with(&named), "{key}: {reason}");
                    let says = ["is possible", "a number is needed"];
                    prop_assert!(says.iter().any(|says| reason.contains(says)), "{reason}");
                }
            }
        }
    }
}
