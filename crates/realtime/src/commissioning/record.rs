//! Record of a commissioning: what was commissioned, with what result; and what has changed since.
//!
//! The digest is SHA-256 over all of the record's text, with an empty digest in it. It finds changes; it is no safety
//! function, and no protection against somebody who writes another record.

use super::finding::{Outcome, SIGNALS};
use super::sequence::{Quantities, Sequence};
use super::step::Step;
use hydroboom_description::digest_of;
use hydroboom_files::{FileError, own_text};
use std::path::Path;
use thiserror::Error;
use toml::{Table, Value};

/// Version of the file's layout.
const FORMAT: i64 = 2;
/// Longest file that is read \[B\].
const LONGEST: u64 = 1_000_000;
/// Result of a passed commissioning, and of another one.
const PASSED: &str = "passed";
const FAILED: &str = "failed";
/// Result of a step that could not be done.
const SKIPPED: &str = "skipped";

/// A device as it reports itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Device {
    /// Name by which the operator finds it.
    pub name: String,
    /// Its identity: kind, vendor, product, revision, serial number.
    pub identity: String,
    /// Its firmware, as it states it.
    pub firmware: String,
}

/// What a commissioning is valid for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Basis {
    /// Digest of the crane file with its overrides.
    pub crane: String,
    /// Digest of the bus table; empty where there is none.
    pub bus_table: String,
    /// The devices in their order.
    pub devices: Vec<Device>,
    /// Version of this program.
    pub version: String,
    /// Whether the machine says that it is simulated.
    pub is_simulated: bool,
}

impl Basis {
    /// What differs now from what was commissioned, one sentence each.
    pub fn differences(&self, now: &Self) -> Vec<String> {
        let mut found = Vec::new();
        if self.is_simulated != now.is_simulated {
            let which = |is| if is { "simulated" } else { "real" };
            found.push(format!(
                "the machine: a {} one was commissioned, and this is a {} one",
                which(self.is_simulated),
                which(now.is_simulated)
            ));
        }
        if self.crane != now.crane {
            found.push("the crane file: a number or choice of it, or an override (--set)".into());
        }
        if self.bus_table != now.bus_table {
            found.push("the bus table: a value of it; comments do not count".into());
        }
        if self.version != now.version {
            found.push(format!(
                "the version of this program: {} then, {} now",
                self.version, now.version
            ));
        }
        if self.devices.len() != now.devices.len() {
            found.push(format!(
                "the number of devices: {} then, {} now",
                self.devices.len(),
                now.devices.len()
            ));
        }
        for (then, is) in self.devices.iter().zip(&now.devices) {
            for (what, then_is, now_is) in [
                ("identity", &then.identity, &is.identity),
                ("firmware", &then.firmware, &is.firmware),
            ] {
                if then_is != now_is {
                    found.push(format!("{what} of {}: {then_is} then, {now_is} now", is.name));
                }
            }
        }
        found
    }
}

/// Line of a digest in a record.
fn digest_line(digest: &str) -> String {
    format!("digest = \"{digest}\"")
}

/// A record's text with the digest of that text in place of the empty one.
fn with_digest(text: &str) -> String {
    text.replacen(&digest_line(""), &digest_line(&digest_of(text)), 1)
}

/// Whether a record's digest is that of its text.
fn is_unchanged(text: &str, digest: &str) -> bool {
    digest_of(&text.replacen(&digest_line(digest), &digest_line(""), 1)) == digest
}

/// Whether a commissioning permits motion: every step passed or was skipped, and the stop circuit of a real machine was
/// not skipped.
pub fn permits_motion(basis: &Basis, sequence: &Sequence) -> bool {
    let stop_circuit = sequence.outcomes()[Step::StopCircuit.place()];
    let has_skipped_it = matches!(stop_circuit, Some(Outcome::Skipped(_)));
    sequence.has_passed() && (basis.is_simulated || !has_skipped_it)
}

/// Error of reading a record, or reason for which it does not permit motion.
#[derive(Debug, Error)]
pub enum RecordError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is no record.
    #[error("{path}: {reason}")]
    Other {
        /// Its path.
        path: String,
        /// What was read, and what is allowed.
        reason: String,
    },
    /// A step failed or was not reached.
    #[error("{path}: step {step} {how}: commission the machine again")]
    NotPassed {
        /// Its path.
        path: String,
        /// Name of the step.
        step: String,
        /// Result of the step.
        how: String,
    },
    /// Something differs from what was commissioned.
    #[error("{path}: this is not what was commissioned. It differs in\n  {}", differences.join("\n  "))]
    Differs {
        /// Its path.
        path: String,
        /// What differs, one sentence each.
        differences: Vec<String>,
    },
}

/// The record of a sequence, as TOML; `machine` names the machine as on the command line, `date` is the time of the
/// end.
pub fn text(basis: &Basis, machine: &str, date: &str, sequence: &Sequence) -> String {
    let results = results(sequence);
    let mut head = Table::new();
    let string = |text: &str| Value::String(text.into());
    head.insert("format".into(), Value::Integer(FORMAT));
    head.insert("machine".into(), string(machine));
    head.insert("is_simulated".into(), Value::Boolean(basis.is_simulated));
    head.insert("date".into(), string(date));
    head.insert("version".into(), string(&basis.version));
    let result = if permits_motion(basis, sequence) { PASSED } else { FAILED };
    head.insert("result".into(), string(result));
    head.insert("digest".into(), string(""));
    let mut digests = Table::new();
    digests.insert("crane".into(), string(&basis.crane));
    digests.insert("bus_table".into(), string(&basis.bus_table));
    let devices = basis.devices.iter().map(|device| {
        let mut table = Table::new();
        table.insert("name".into(), string(&device.name));
        table.insert("identity".into(), string(&device.identity));
        table.insert("firmware".into(), string(&device.firmware));
        Value::Table(table)
    });
    let steps = Step::ALL.iter().zip(sequence.outcomes()).zip(&results).map(
        |((step, outcome), (name, result))| {
            let mut table = Table::new();
            table.insert("axis".into(), Value::Integer(0));
            table.insert("name".into(), string(name));
            table.insert("outcome".into(), string(result));
            match outcome {
                Some(Outcome::Skipped(reason)) => {
                    table.insert("reason".into(), string(&reason.to_string()));
                }
                Some(Outcome::Failed(finding)) => {
                    table.insert("finding".into(), string(&finding.to_string()));
                }
                _ => {}
            }
            for (key, value) in measured(*step, sequence.quantities()) {
                if value.is_finite() {
                    table.insert(key, Value::Float(value));
                }
            }
            Value::Table(table)
        },
    );
    let mut all = Table::new();
    all.insert("commissioning".into(), Value::Table(head));
    all.insert("digests".into(), Value::Table(digests));
    all.insert("device".into(), Value::Array(devices.collect()));
    all.insert("step".into(), Value::Array(steps.collect()));
    with_digest(&format!(
        "# Written by `hydroboom commission`. `hydroboom run --commissioning` compares it with the machine.\n\
         # The digest finds changes of this text. It is no safety function.\n\n{all}"
    ))
}

/// Name and result of each step.
fn results(sequence: &Sequence) -> Vec<(String, String)> {
    let result = |outcome: &Option<Outcome>| outcome.as_ref().map_or("not reached", Outcome::name);
    let steps = Step::ALL.iter().zip(sequence.outcomes());
    steps.map(|(step, outcome)| (step.name().into(), result(outcome).into())).collect()
}

/// What was measured in a step, with units in the keys.
pub fn measured(step: Step, q: &Quantities) -> Vec<(String, f64)> {
    let of = |pairs: &[(&str, f64)]| -> Vec<(String, f64)> {
        pairs.iter().map(|(key, value)| ((*key).into(), *value)).collect()
    };
    match step {
        Step::Identity => Vec::new(),
        Step::Listening => {
            let rest = SIGNALS.iter().zip(q.rest).map(|(name, v)| (format!("rest_{name}"), v));
            let noise = SIGNALS.iter().zip(q.noise).map(|(name, v)| (format!("noise_{name}"), v));
            rest.chain(noise).collect()
        }
        Step::StopCircuit => of(&[("machine_code", q.stop_circuit_code)]),
        Step::Watchdog => of(&[
            ("motor_stopped_after_ms", q.watchdog * 1e3),
            ("motor_speed_ratio", q.motor_ratio),
            ("motor_reaction_cycles", q.motor_reaction),
        ]),
        Step::Polarity => of(&[
            ("pressure_rise_bar", q.polarity_rise * 1e-5),
            ("revolutions", q.polarity_revolutions),
        ]),
        Step::Release => of(&[("lift_mm", q.release_lift * 1e3), ("duration_s", q.release_time)]),
        Step::Travel => of(&[
            ("against_the_load_mm", q.travel[0] * 1e3),
            ("back_mm", q.travel[1] * 1e3),
            ("position_over_pump_volume", q.scale),
        ]),
        Step::Delay => of(&[("delay_cycles", q.delay)]),
        Step::StopDistance => of(&[
            ("stop_distance_mm", q.stop_distance * 1e3),
            ("largest_movement_mm", q.largest_movement * 1e3),
        ]),
    }
}

/// Checks that a record has passed, and is valid for the present machine.
///
/// # Errors
///
/// - [`RecordError::File`] if the file cannot be read.
/// - [`RecordError::Other`] if it is no record of this format, or was changed.
/// - [`RecordError::NotPassed`] if a step failed or was not reached.
/// - [`RecordError::Differs`] if crane, bus table, devices or program are not those of `now`.
pub fn check(path: &Path, now: &Basis) -> Result<(), RecordError> {
    let text = own_text(path, "record of a commissioning", LONGEST)?;
    check_text(&path.display().to_string(), &text, now)
}

fn check_text(path: &str, text: &str, now: &Basis) -> Result<(), RecordError> {
    let other = |reason: String| RecordError::Other { path: path.into(), reason };
    let table: Table = text
        .parse()
        .map_err(|error| other(format!("not what `hydroboom commission` writes: {error}")))?;
    let string = |place: Option<&Table>, section: &str, key: &str| {
        let found = place.and_then(|table| table.get(key)).and_then(Value::as_str);
        found.map(str::to_string).ok_or_else(|| {
            other(format!("{section}.{key} is missing or no text: commission the machine again"))
        })
    };
    let head = table.get("commissioning").and_then(Value::as_table);
    let format = head.and_then(|head| head.get("format")).and_then(Value::as_integer);
    if format != Some(FORMAT) {
        return Err(other(format!(
            "commissioning.format is {}, expected {FORMAT}: commission the machine again",
            format.map_or("missing".into(), |format| format.to_string())
        )));
    }
    let digests = table.get("digests").and_then(Value::as_table);
    let tables = |key: &str| -> Vec<&Table> {
        let all = table.get(key).and_then(Value::as_array);
        all.into_iter().flatten().filter_map(Value::as_table).collect()
    };
    let mut devices = Vec::new();
    for device in tables("device") {
        devices.push(Device {
            name: string(Some(device), "device", "name")?,
            identity: string(Some(device), "device", "identity")?,
            firmware: string(Some(device), "device", "firmware")?,
        });
    }
    let is_simulated = head.and_then(|head| head.get("is_simulated")).and_then(Value::as_bool);
    let then = Basis {
        crane: string(digests, "digests", "crane")?,
        bus_table: string(digests, "digests", "bus_table")?,
        devices,
        version: string(head, "commissioning", "version")?,
        is_simulated: is_simulated.unwrap_or(true),
    };
    let mut results = Vec::new();
    for step in tables("step") {
        results.push((string(Some(step), "step", "name")?, string(Some(step), "step", "outcome")?));
    }
    if !is_unchanged(text, &string(head, "commissioning", "digest")?) {
        return Err(other(
            "its digest is not that of its text: it was changed after it was written; commission the machine again"
                .into(),
        ));
    }
    for step in Step::ALL {
        let result = results.iter().find(|(name, _)| name == step.name());
        let how = match result.map(|(_, how)| how.as_str()) {
            Some(SKIPPED) if step == Step::StopCircuit && !then.is_simulated => {
                "was skipped, and run requires it of a real machine"
            }
            Some(PASSED | SKIPPED) => continue,
            Some(how) if how == FAILED => "failed",
            _ => "was not reached",
        };
        let (step, how) = (step.name().into(), how.into());
        return Err(RecordError::NotPassed { path: path.into(), step, how });
    }
    match then.differences(now) {
        differences if differences.is_empty() => Ok(()),
        differences => Err(RecordError::Differs { path: path.into(), differences }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn basis() -> Basis {
        let device = Device {
            name: "drive".into(),
            identity: "vendor 1".into(),
            firmware: "\"1.2\"".into(),
        };
        Basis {
            crane: "c".into(),
            bus_table: "t".into(),
            devices: vec![device],
            version: "0.1".into(),
            is_simulated: false,
        }
    }

    fn written(results: &[(&str, &str)]) -> String {
        let steps: String = results
            .iter()
            .map(|(step, how)| format!("[[step]]\nname = \"{step}\"\noutcome = \"{how}\"\n"))
            .collect();
        with_digest(&format!(
            "[commissioning]\ndate = \"then\"\nformat = 2\nis_simulated = false\nversion = \"0.1\"\ndigest = \"\"\n\
             [digests]\ncrane = \"c\"\nbus_table = \"t\"\n[[device]]\nname = \"drive\"\nidentity = \"vendor 1\"\n\
             firmware = '\"1.2\"'\n{steps}"
        ))
    }

    fn all() -> Vec<(&'static str, &'static str)> {
        Step::ALL.iter().map(|step| (step.name(), "passed")).collect()
    }

    #[test]
    fn what_differs_is_named() {
        let text = written(&all());
        assert!(check_text("r", &text, &basis()).is_ok());
        type Change = (fn(&mut Basis), &'static str);
        let changes: [Change; 6] = [
            (|b| b.crane = "other".into(), "crane file"),
            (|b| b.bus_table = "other".into(), "bus table"),
            (|b| b.version = "0.2".into(), "0.1 then, 0.2 now"),
            (|b| b.devices[0].firmware = "1.3".into(), "firmware of drive"),
            (|b| b.devices[0].identity = "vendor 2".into(), "identity of drive"),
            (|b| b.devices.clear(), "number of devices"),
        ];
        for (change, named) in changes {
            let mut now = basis();
            change(&mut now);
            let said = check_text("r", &text, &now).unwrap_err().to_string();
            assert!(said.contains(named) && said.matches("\n  ").count() == 1, "{said}");
        }
    }

    #[test]
    fn a_real_machine_whose_stop_circuit_was_skipped_is_refused() {
        let mut skipped = all();
        skipped[Step::Polarity.place()].1 = "skipped";
        assert!(check_text("r", &written(&skipped), &basis()).is_ok());
        skipped[Step::StopCircuit.place()].1 = "skipped";
        let said = check_text("r", &written(&skipped), &basis()).unwrap_err().to_string();
        assert!(said.contains("stop-circuit was skipped"), "{said}");
    }

    #[test]
    fn a_record_that_failed_is_incomplete_or_was_changed_is_refused() {
        let mut failed = all();
        failed[4].1 = "failed";
        let said = check_text("r", &written(&failed), &basis()).unwrap_err().to_string();
        assert!(said.contains("polarity failed"), "{said}");
        let said = check_text("r", &written(&all()[..6]), &basis()).unwrap_err().to_string();
        assert!(said.contains("travel was not reached"), "{said}");
        let results = written(&failed).replace("\"failed\"", "\"passed\"");
        let date = written(&all()).replace("\"then\"", "\"now\"");
        let value = written(&all()) + "delay_cycles = 1.0\n";
        let comment = written(&all()) + "# another line\n";
        for changed in [results, date, value, comment] {
            let said = check_text("r", &changed, &basis()).unwrap_err().to_string();
            assert!(said.contains("changed after it was written"), "{said}");
        }
        for text in ["", "x", "[commissioning]\nformat = 1", "[commissioning]\nformat = 2"] {
            assert!(check_text("r", text, &basis()).is_err(), "{text}");
        }
    }
}
