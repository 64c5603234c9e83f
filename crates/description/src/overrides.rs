//! Overrides of single keys, as `--set` states them.

use crate::error::DescriptionError;
use crate::excerpt::quoted;
use crate::limit::{number_problem, valid_lengths, whole_segments};
use crate::schema::{Choices, CircuitChoice, KEYS, Numbers, StructureChoice};
use crate::suggestion::{NAME, SEGMENT_LENGTHS, SEGMENTS, suggestion};
use crate::{Description, Origin};
use hydroboom_model::MAX_SEGMENTS;

impl Description {
    /// Overrides one key, as `--set boom.segments=10` does.
    ///
    /// # Errors
    ///
    /// [`DescriptionError`] if the key is unknown, the value is not allowed, or the resulting machine is impossible.
    pub fn set(&mut self, assignment: &str) -> Result<(), DescriptionError> {
        self.set_together([assignment])
    }

    /// Overrides several keys at once. Only the machine with all overrides must be possible, so their order has no
    /// effect. Choices and segments are set before the numbers that depend on them; if a key is given twice, the last
    /// value applies.
    ///
    /// # Errors
    ///
    /// As for [`set`](Self::set); no key is changed then.
    pub fn set_together<'a>(
        &mut self,
        assignments: impl IntoIterator<Item = &'a str>,
    ) -> Result<(), DescriptionError> {
        let is_number = |assignment: &&str| {
            let path = assignment.split_once('=').map_or("", |(path, _)| path.trim());
            KEYS.iter().any(|key| key.path() == path)
        };
        let all: Vec<&str> = assignments.into_iter().collect();
        let (numbers, structure): (Vec<&str>, Vec<&str>) = all.iter().partition(|a| is_number(a));
        let mut changed = self.clone();
        for assignment in structure.into_iter().chain(numbers) {
            changed.assign(assignment)?;
        }
        if let Some((_, message, help)) = changed.impossible() {
            let named: Vec<String> = all.iter().map(|a| format!("--set {}", quoted(a))).collect();
            return Err(DescriptionError::of(&named.join(" "), message, Some(help)));
        }
        *self = changed;
        Ok(())
    }

    /// Overrides one key without checking the resulting machine.
    fn assign(&mut self, assignment: &str) -> Result<(), DescriptionError> {
        let wrong = |message: String, help: String| {
            DescriptionError::of(&format!("--set {}", quoted(assignment)), message, Some(help))
        };
        let Some((path, text)) = assignment.split_once('=') else {
            let help = "write section.key=value, for example --set boom.segments=10".into();
            return Err(wrong("no `=` in it".into(), help));
        };
        let (path, text) = (path.trim(), text.trim().trim_matches('"'));
        if let Some(index) = KEYS.iter().position(|key| key.path() == path) {
            let key = &KEYS[index];
            let segments = self.segment_shares.len();
            if let Some(why) = self.choices.excludes(key.section, key.name, segments) {
                return Err(wrong(format!("this crane has no {path}"), why.into()));
            }
            let value: f64 = text.parse().map_err(|_| {
                wrong(
                    format!("`{}` is not a number", quoted(text)),
                    format!("{path}: {}", key.meaning),
                )
            })?;
            if let Some((message, help)) = number_problem(key, value) {
                return Err(wrong(message, help));
            }
            let mut values = self.numbers.to_array();
            values[index] = key.to_si(value);
            self.numbers = Numbers::from_array(values);
            self.origins[index] =
                Origin { provenance: "set".into(), source: "--set".into(), line: None };
        } else if path == SEGMENTS {
            let count = text.parse().ok().and_then(whole_segments).ok_or_else(|| {
                let help = "3 is the published real-time model, 10 the high-fidelity one".into();
                wrong(format!("segments are a whole number from 1 to {MAX_SEGMENTS}"), help)
            })?;
            self.segment_shares = vec![1.0; count];
        } else if path == SEGMENT_LENGTHS {
            let list = text.trim_matches(['[', ']']);
            let lengths: Result<Vec<f64>, _> =
                list.split(',').map(|item| item.trim().parse::<f64>()).collect();
            self.segment_shares = lengths.ok().filter(|l| valid_lengths(l)).ok_or_else(|| {
                let help = "for example --set boom.segment_lengths_mm=1200,1200,1200".into();
                wrong(format!("not a list of 1 to {MAX_SEGMENTS} lengths"), help)
            })?;
        } else if path == NAME {
            self.name = text.into();
        } else if let Some(allowed) = Choices::allowed(path) {
            let unknown = || {
                wrong(
                    format!("`{}` is not known", quoted(text)),
                    format!("one of: {}", allowed.join(", ")),
                )
            };
            if path == CircuitChoice::PATH || path == StructureChoice::PATH {
                let help =
                    "another circuit or structure needs other keys: write a crane file".into();
                return Err(wrong(format!("{path} cannot be overridden"), help));
            }
            if !self.choices.set(path, text) {
                return Err(unknown());
            }
        } else {
            return Err(wrong(format!("unknown key `{}`", quoted(path)), suggestion(path)));
        }
        Ok(())
    }
}
