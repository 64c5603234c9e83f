//! The reference of all keys, docs/reference/crane-file.md: complete, and as generated from the schema.

use hydroboom_description::schema::{KEYS, OTHER_KEYS};
use hydroboom_description::section::SECTIONS;
use hydroboom_description::{Choices, suggestion};

#[path = "../../examples/crane_file_reference.rs"]
#[expect(dead_code, reason = "main of the example")]
mod generated;

const COMMITTED: &str = include_str!("../../../../docs/reference/crane-file.md");

#[test]
fn the_page_is_the_generated_one() {
    let generated = generated::page().unwrap();
    let differs = generated.lines().zip(COMMITTED.lines()).find(|(new, old)| new != old);
    assert!(
        generated == COMMITTED,
        "docs/reference/crane-file.md is not as generated, first at {differs:?}. This writes it:\n\
         cargo run -p hydroboom-description --example crane_file_reference > docs/reference/crane-file.md"
    );
}

/// A row in the table of its section for every key, once.
#[test]
fn every_key_is_on_the_page_in_its_section() {
    let numbers = KEYS.iter().map(|key| key.path());
    let others = OTHER_KEYS.iter().map(|key| key.path.to_string());
    let choices = Choices::PATHS.iter().map(|path| path.to_string());
    let mut count = 0;
    for path in numbers.chain(choices).chain(others) {
        let (section, name) = path.split_once('.').unwrap();
        let (_, rest) = COMMITTED.split_once(&format!("\n## `[{section}]`\n")).expect(section);
        let table = rest.split("\n## ").next().unwrap_or_default();
        assert_eq!(table.matches(&format!("\n| `{name}` | ")).count(), 1, "{path}");
        count += 1;
    }
    assert_eq!(COMMITTED.matches("\n| `").count(), count);
    assert_eq!(COMMITTED.matches("\n## `[").count(), SECTIONS.len());
}

/// What is listed beside numbers and choices are keys that a file may have.
#[test]
fn keys_that_are_no_numbers_are_known() {
    for key in OTHER_KEYS.iter().filter(|key| key.path != "machine.ethercat") {
        assert_eq!(suggestion(key.path), format!("did you mean `{}`?", key.path));
    }
}
