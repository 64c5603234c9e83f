//! Randomly damaged crane files: read or refused with short messages, without a panic, within 10 s each and 500 MB in
//! all.

#[path = "../../../measurement/tests/damage/mod.rs"]
mod damage;

use damage::{Chance, damaged, each};
use hydroboom_description::{Description, PATU_LIFT, UIA_SINGLE_BOOM, UIA_VIRTUAL};

/// Largest length of all messages about a file: 20 problems, each with an excerpt.
const MOST_SAID: usize = 200_000;

#[test]
fn damaged_crane_files_are_read_or_refused_with_a_short_message() {
    each("crane file", |seed| {
        let whole = [UIA_SINGLE_BOOM, UIA_VIRTUAL, PATU_LIFT];
        let bytes = damaged(whole[seed as usize % 3].as_bytes(), &mut Chance::new(seed));
        let text = String::from_utf8_lossy(&bytes);
        match Description::parse("damaged.toml", &text) {
            Ok(crane) => {
                let is_within = |(key, value, _): (&hydroboom_description::Key, f64, _)| {
                    assert!(value.is_finite(), "seed {seed}: {} is {value}", key.path());
                };
                crane.entries().for_each(is_within);
            }
            Err(error) => {
                assert!(!error.problems.is_empty() && error.problems.len() <= 21, "seed {seed}");
                let letters: usize = error
                    .problems
                    .iter()
                    .map(|p| {
                        let excerpt = p.source_code.as_ref().map_or(0, |text| text.inner().len());
                        p.message.len() + p.help.as_ref().map_or(0, String::len) + excerpt
                    })
                    .sum();
                assert!(letters < MOST_SAID, "seed {seed}: {letters} letters");
            }
        }
    });
}
