//! Digest of a description, for comparing machines.

use crate::Description;
use crate::schema::{Choices, KEYS};
use sha2::{Digest, Sha256};
use std::fmt::Write;

impl Description {
    /// SHA-256 of all numbers, choices and segment shares, as 64 hexadecimal digits.
    ///
    /// Names, comments, sources, ranges and the order of the file have no effect. Keys and choices at their default
    /// have none either, so that the digest of a file stays the same when later versions add keys. Numbers count to
    /// their last bit, shares to 12 digits.
    pub fn digest(&self) -> String {
        let numbers = self.numbers.to_array();
        let mut lines: Vec<String> = self
            .own_keys()
            .filter(|index| {
                let key = &KEYS[*index];
                key.absent.map(|value| key.to_si(value)) != Some(numbers[*index])
            })
            // adding zero turns -0 into 0
            .map(|index| {
                format!("{}={:016x}", KEYS[index].path(), (numbers[index] + 0.0).to_bits())
            })
            .collect();
        let (left_out, required) = Choices::read(|_| None);
        let usual = left_out.list();
        lines.extend(
            self.own_choices()
                .into_iter()
                .filter(|choice| required.contains(&choice.0) || !usual.contains(choice))
                .map(|(path, name)| format!("{path}={name}")),
        );
        lines.sort_unstable();
        let whole: f64 = self.segment_shares.iter().sum();
        lines.extend(self.segment_shares.iter().map(|share| format!("{:.12e}", share / whole)));
        digest_of(&lines.join("\n"))
    }
}

/// SHA-256 of a text, as 64 hexadecimal digits.
pub fn digest_of(text: &str) -> String {
    let mut digits = String::new();
    for byte in Sha256::digest(text.as_bytes()) {
        // writing to a String cannot fail
        let _ = write!(digits, "{byte:02x}");
    }
    digits
}
