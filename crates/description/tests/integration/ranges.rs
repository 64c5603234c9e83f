//! Ranges of values: of the crane file, and by default spreads.

use hydroboom_description::schema::KEYS;
use hydroboom_description::{Description, RangeSource, UIA_SINGLE_BOOM};

const PAYLOAD: &str = "mass_kg      = { value = 307.0, range = [0.0, 370.0],";

/// The paper's crane with another line for the payload's mass.
fn with_payload(line: &str) -> String {
    assert!(UIA_SINGLE_BOOM.contains(PAYLOAD));
    UIA_SINGLE_BOOM.replace(PAYLOAD, &format!("mass_kg = {{ {line},"))
}

/// Message, help and marked text of the only problem with a file.
fn problem(text: &str) -> (String, String, String) {
    let error = Description::parse("test.toml", text).expect_err("should be refused");
    assert_eq!(error.problems.len(), 1, "{:?}", error.problems);
    let problem = &error.problems[0];
    let span = problem.span.expect("a place in the file");
    let text = problem.source_code.as_ref().expect("an excerpt").inner();
    let marked = text[span.offset()..span.offset() + span.len()].to_string();
    (problem.message.clone(), problem.help.clone().unwrap_or_default(), marked)
}

#[test]
fn a_range_of_the_file_is_read_in_the_keys_unit() {
    let crane =
        Description::parse("test.toml", &with_payload("value = 307, range = [0, 3.2e2]")).unwrap();
    let range = crane.range("payload.mass_kg").unwrap();
    assert_eq!((range.low, range.high, range.source), (0.0, 320.0, RangeSource::File));
    let transition = crane.range("oil.transition_bar").unwrap();
    assert_eq!((transition.low, transition.high), (20e5, 45e5));
    let ranges = crane.ranges();
    assert_eq!((ranges.low.payload, ranges.high.payload), (0.0, 320.0));
    let place = KEYS.iter().position(|key| key.path() == "payload.mass_kg").unwrap();
    assert_eq!(ranges.sources[place], RangeSource::File);
    assert!(crane.range("payload.mass").is_none());
}

#[test]
fn wrong_ranges_are_refused_with_their_line() {
    for (line, says, helps, marked) in [
        ("value = 307, range = [370, 0]", "370 to 0 kg", "range = [0, 370]", "[370, 0]"),
        (
            "value = 400, range = [0, 370]",
            "is 400 kg, and its range is 0 to 370 kg",
            "correct",
            "[0, 370]",
        ),
        ("value = 307, range = [-5, 370]", "cannot be -5 kg", "0 to 1000000 kg", "[-5, 370]"),
        ("value = 307, range = [0, inf]", "cannot be inf kg", "0 to 1000000 kg", "[0, inf]"),
        ("value = 307, range = [0, nan]", "cannot be NaN kg", "0 to 1000000 kg", "[0, nan]"),
        ("value = 307, range = [0]", "two numbers [kg], not [0]", "[low, high]", "[0]"),
        ("value = 307, range = [0, \"x\"]", "two numbers [kg]", "[low, high]", "[0, \"x\"]"),
        ("value = 307, range = 370", "two numbers [kg], not 370", "[low, high]", "370"),
    ] {
        let (message, help, place) = problem(&with_payload(line));
        assert!(message.contains("payload.mass_kg") && message.contains(says), "{message}");
        assert!(help.contains(helps), "{help}");
        assert_eq!(place, marked);
    }
    let text =
        UIA_SINGLE_BOOM.replace("\"trapezoidal\"", "{ value = \"trapezoidal\", range = [0, 1] }");
    assert!(problem(&text).0.contains("`motion.profile` has no range"));
}

#[test]
fn a_range_that_reaches_an_impossible_machine_gives_a_warning() {
    let text = UIA_SINGLE_BOOM.replace("range = [2.0, 3.0]", "range = [0.2, 3.0]");
    let crane = Description::parse("test.toml", &text).unwrap();
    let warnings = crane.warnings();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].contains("accumulator.working_bar reaches 0.2 bar"), "{warnings:?}");
    assert!(warnings[0].contains("holds no oil"), "{warnings:?}");
}

#[test]
fn without_a_range_the_default_spread_follows_the_value() {
    let mut crane = Description::parse("test.toml", &with_payload("value = 300")).unwrap();
    let payload = |crane: &Description| crane.range("payload.mass_kg").unwrap();
    let range = payload(&crane);
    assert_eq!((range.low, range.source), (0.0, RangeSource::Default));
    assert!((range.high - 360.0).abs() < 1e-9);
    crane.set_within_range("payload.mass_kg=400").unwrap();
    assert!((payload(&crane).high - 480.0).abs() < 1e-9);
    // a key without a spread has a range of only its value
    let length = crane.range("boom.length_mm").unwrap();
    assert_eq!((length.low, length.high, length.source), (3.6, 3.6, RangeSource::Value));
}

#[test]
fn every_default_range_contains_its_value_and_has_possible_bounds() {
    for crane in [Description::uia_virtual().unwrap(), Description::patu_lift().unwrap()] {
        let (low, high) = (crane.ranges().low.to_array(), crane.ranges().high.to_array());
        for (index, (value, key)) in crane.numbers.to_array().iter().zip(KEYS).enumerate() {
            assert!((low[index]..=high[index]).contains(value), "{}", key.path());
            for bound in [low[index], high[index]].map(|bound| key.to_unit(bound)) {
                let is_own = crane.own_entries().any(|(own, ..)| own.path() == key.path());
                if is_own {
                    crane.clone().set(&format!("{}={bound}", key.path())).unwrap();
                }
            }
        }
    }
    // an accumulator that is hardly filled: its default spread ends at the precharge
    let text = UIA_SINGLE_BOOM.replace("value = 2.5, range = [2.0, 3.0],", "value = 0.5,");
    let crane = Description::parse("test.toml", &text).unwrap();
    let range = crane.range("accumulator.working_bar").unwrap();
    assert_eq!((range.low, range.source), (0.5e5, RangeSource::Default));
    assert!((range.high - 0.8e5).abs() < 1.0);
}

#[test]
fn an_override_outside_of_the_files_range_is_refused() {
    let mut crane = Description::uia_single_boom().unwrap();
    crane.set_within_range("payload.mass_kg=370").unwrap();
    let error = crane.set_within_range("payload.mass_kg = 371").unwrap_err();
    let problem = &error.problems[0];
    assert!(problem.message.contains("0 to 370 kg"), "{}", problem.message);
    let line = 1 + UIA_SINGLE_BOOM.lines().position(|line| line.starts_with(PAYLOAD)).unwrap();
    // the line is that of the file, until an override replaces the value
    let mut fresh = Description::parse("my-crane.toml", UIA_SINGLE_BOOM).unwrap();
    let error = fresh.set_within_range("payload.mass_kg=371").unwrap_err();
    let help = error.problems[0].help.clone().unwrap();
    assert!(help.contains(&format!("line {line}")), "{help}");
    assert_eq!(crane.numbers.payload, 370.0);
    // an override may leave the range, and extends it
    crane.set("payload.mass_kg=500").unwrap();
    assert_eq!(crane.range("payload.mass_kg").unwrap().high, 500.0);
    // text that is not a number is refused as in `set`
    assert!(crane.set_within_range("payload.mass_kg=heavy").is_err());
    assert!(crane.set_within_range("friction.law=dahl").is_err());
    crane.set_within_range("friction.law=lugre").unwrap();
}

/// Contradicting limits of estimator and control law are refused with both keys and values.
#[test]
fn limits_that_contradict_each_other_are_refused() {
    for (assignment, other) in [
        ("estimator.lowest_transition_bar=100", "estimator.highest_transition_bar is 65 bar"),
        ("estimator.shortest_drive_lag_ms=250", "estimator.drive_lag_ms is 6.2 ms"),
        ("estimator.drive_lag_ms=250", "estimator.longest_drive_lag_ms is 200 ms"),
        ("scheduled_lqr.longest_window_ms=10", "scheduled_lqr.shortest_window_ms is 15 ms"),
        ("scheduled_lqr.rollout_short_ms=400", "scheduled_lqr.rollout_long_ms is 100 ms"),
        ("scheduled_lqr.position_feedback_percent=80", "scheduled_lqr.feedback_percent is 40 %"),
    ] {
        let mut crane = Description::uia_single_boom().unwrap();
        let message = crane.set(assignment).unwrap_err().problems[0].message.clone();
        let key = assignment.split('=').next().unwrap();
        assert!(message.contains(other) && message.contains(key), "{assignment}: {message}");
    }
}

/// Two numbers that are each correlated by 0.9 with a third cannot be uncorrelated.
#[test]
fn correlations_that_no_covariance_matrix_can_have_are_refused() {
    let mut crane = Description::uia_single_boom().unwrap();
    crane.set("tip.bending_base_correlation=-0.9").unwrap();
    let message =
        crane.set("tip.bending_offset_correlation=0.9").unwrap_err().problems[0].message.clone();
    assert!(message.contains("-0.9, 0.9") && message.contains("tip.base_offset"), "{message}");
    // a refused value is not stored
    assert!(crane.set("tip.base_offset_correlation=-0.8").is_err());
    let both = ["tip.base_offset_correlation=-0.8", "tip.bending_offset_correlation=0.9"];
    crane.set_together(both).unwrap();
}

#[test]
fn overrides_valid_together_are_accepted_in_any_order() {
    let crane = Description::uia_single_boom().unwrap();
    let thick = ["cylinder.rod_mm=70", "cylinder.piston_mm=100"];
    assert!(crane.clone().set(thick[0]).is_err());
    for order in [[0, 1], [1, 0]] {
        let mut both = crane.clone();
        both.set_together_within_range(order.map(|k| thick[k])).unwrap();
        assert_eq!((both.numbers.rod, both.numbers.piston), (0.07, 0.1));
    }
    // no value of an impossible combination is stored
    let mut kept = crane.clone();
    let error = kept.set_together(["payload.mass_kg=200", thick[0]]).unwrap_err().to_string();
    assert!(error.contains("payload.mass_kg=200") && error.contains("rod_mm=70"), "{error}");
    assert_eq!(kept.digest(), crane.digest());
}
