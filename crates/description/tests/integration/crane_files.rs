//! Crane files: accepted and refused ones, and their error messages.

use hydroboom_description::schema::CircuitChoice;
use hydroboom_description::{BuildError, Description, PATU_LIFT, UIA_SINGLE_BOOM};

/// All messages and helps of the problems with a changed crane file.
fn refused(text: &str) -> String {
    let error = Description::parse("test.toml", text).expect_err("should be refused");
    error
        .problems
        .iter()
        .map(|p| format!("{} ({})\n", p.message, p.help.clone().unwrap_or_default()))
        .collect()
}

fn changed(from: &str, to: &str) -> String {
    assert!(UIA_SINGLE_BOOM.contains(from), "{from}");
    UIA_SINGLE_BOOM.replace(from, to)
}

#[test]
fn the_embedded_crane_is_complete_and_without_warnings() {
    let crane = Description::uia_single_boom().unwrap();
    assert_eq!(crane.numbers.boom_length, 3.6);
    assert!(crane.warnings().is_empty(), "{:?}", crane.warnings());
    assert!(crane.entries().all(|(_, _, origin)| !origin.provenance.is_empty()));
    assert!(crane.entries().all(|(_, _, origin)| !origin.source.is_empty()));
}

#[test]
fn a_value_is_shown_in_the_unit_of_its_file() {
    let crane = Description::uia_single_boom().unwrap();
    let value = |path: &str| crane.entries().find(|(key, ..)| key.path() == path).unwrap().1;
    assert_eq!(value("cylinder.piston_mm"), 65.0);
    assert_eq!(value("pump.displacement_cm3"), 10.6);
    assert_eq!(value("oil.bulk_modulus_max_mpa"), 1600.0);
    assert_eq!(value("motor.max_speed_rpm"), 3000.0);
}

#[test]
fn an_unknown_key_is_refused_with_a_suggestion() {
    let message = refused(&changed("length_mm          =", "lenght_mm ="));
    assert!(message.contains("unknown key `boom.lenght_mm`"), "{message}");
    assert!(message.contains("did you mean `boom.length_mm`?"), "{message}");
}

/// One problem, in place of one for each of its keys.
#[test]
fn an_unknown_section_is_refused_with_a_suggestion() {
    let message = refused(&changed("[pump]", "[pumpe]"));
    assert_eq!(message, "unknown section `[pumpe]` (did you mean `[pump]`?)\n");
    let message =
        refused(&format!("{UIA_SINGLE_BOOM}\n[zzzz]\nflow = {{ value = 1, range = [0, 2] }}\n"));
    assert_eq!(message, "unknown section `[zzzz]` (`hydroboom show` lists all keys)\n");
    // a misspelt key with a range is unknown, and nothing else
    let message = refused(&changed("flow_gain  ", "flow_gian  "));
    assert_eq!(message, "unknown key `pump.flow_gian` (did you mean `pump.flow_gain`?)\n");
}

#[test]
fn a_number_with_its_unit_is_refused_with_the_number_alone() {
    let from = "piston_mm               = { value = 65.0, provenance = \"printed\", source = \"section 2.2\" }";
    let message = refused(&changed(from, "piston_mm = 80 mm"));
    assert!(message.contains("write 80 alone: the unit is in the name of the key"), "{message}");
    let message = refused(&changed(from, "piston_mm = \"80 mm\""));
    assert!(message.contains("write 80 without quotes and unit if it is in mm"), "{message}");
    let message = refused(&changed(from, "piston_mm = \"80,5\""));
    assert!(message.contains("not a string") && !message.contains("write 80"), "{message}");
}

/// Ten thousand times the leakage: the pump loses more than it displaces.
#[test]
fn leakage_beyond_the_pumps_delivery_gives_a_warning() {
    let mut crane = Description::uia_single_boom().unwrap();
    crane.set("pump.internal_leakage_m3_s_sqrtpa=3.4e-6").unwrap();
    let warnings = crane.warnings();
    let key = "pump.internal_leakage_m3_s_sqrtpa = 3.4e-6";
    assert!(warnings.iter().any(|warning| warning.contains(key)), "{warnings:?}");
}

#[test]
fn a_value_in_the_wrong_unit_is_refused_with_a_hint() {
    let message = refused(&changed("value = 10.6,", "value = 10.6e-6,"));
    assert!(message.contains("10.6 cm3/rev"), "{message}");
    let message = refused(&changed("value = 34.5,", "value = 3450000,"));
    assert!(message.contains("3450000 Pa would be 34.5 bar"), "{message}");
}

/// A count is never rounded: a fraction is refused in files, in their ranges and as an override.
#[test]
fn a_count_with_a_fraction_is_refused() {
    let with = |keys: &str| format!("{UIA_SINGLE_BOOM}\n{keys}\n");
    let message = refused(&with("[learning]\ncycles = 2.5"));
    assert!(
        message.contains("`learning.cycles` is a whole number from 1 to 100, not 2.5"),
        "{message}"
    );
    let message = refused(&with("[fieldbus]\ndelay_cycles = { value = 1, range = [1, 1.5] }"));
    assert!(message.contains("`fieldbus.delay_cycles` is a whole number"), "{message}");
    assert!(message.contains("not 1.5"), "{message}");
    let mut crane = Description::uia_single_boom().unwrap();
    for key in [
        "learning.cycles",
        "learning.corner_points",
        "fieldbus.delay_cycles",
        "pump.pistons",
        "sensors.pressure_bits",
        "virtual.seed",
    ] {
        let error = crane.set(&format!("{key}=3.5")).unwrap_err();
        assert!(error.problems[0].message.contains("is a whole number"), "{key}: {error:?}");
        assert_eq!(error.name, format!("--set {key}=3.5"));
        crane.set(&format!("{key}=7")).unwrap();
    }
    assert!(crane.set("learning.cycles=101").is_err());
}

#[test]
fn an_error_points_at_its_line_and_value() {
    let text = changed("value = 10.6,", "value = -3,");
    let error = Description::parse("test.toml", &text).unwrap_err();
    let span = error.problems[0].span.unwrap();
    let shown = error.problems[0].source_code.as_ref().unwrap().inner();
    assert_eq!(&shown[span.offset()..span.offset() + span.len()], "-3");
    // line number in the file
    let line = |text: &str, at: usize| text[..at].matches('\n').count();
    assert_eq!(line(shown, span.offset()), line(&text, text.find("value = -3,").unwrap()));
}

/// An endless line and a thousand mistakes give messages of bounded length.
#[test]
fn an_error_message_fits_on_a_screen() {
    let lines = "wrong = 1\n".repeat(10_000);
    for text in ["[".repeat(200_000), format!("[a]\nb = \"{}\"", "x".repeat(200_000)), lines] {
        let error = Description::parse("test.toml", &text).unwrap_err();
        let shown: usize = error
            .problems
            .iter()
            .map(|p| p.message.len() + p.source_code.as_ref().map_or(0, |s| s.inner().len()))
            .sum();
        assert!(shown < 250_000 && error.problems.len() <= 21, "{shown}");
        assert!(error.problems.iter().all(|p| p.message.len() < 1000));
    }
}

#[test]
fn not_a_number_and_infinity_are_refused() {
    for value in ["nan", "inf", "-inf", "\"3600\"", "true"] {
        refused(&changed(
            "length_mm          = { value = 3600.0",
            &format!("length_mm = {{ value = {value}"),
        ));
    }
}

#[test]
fn impossible_machines_are_refused() {
    for (from, to, says) in [
        ("value = 772.0", "value = 300.0", "cannot reach"),
        (
            "value = 35.0, provenance = \"printed\", source = \"section 2.2",
            "value = 66.0, provenance = \"printed\", source = \"section 2.2",
            "not thinner",
        ),
        ("end_mm    = { value = 450.0", "end_mm    = { value = 600.0", "beyond the stroke"),
        (
            "cracking_bar                 = { value = 1.0",
            "cracking_bar                 = { value = 2.0",
            "before it begins to open",
        ),
        (
            "working_bar         = { value = 2.5, range = [2.0, 3.0]",
            "working_bar         = { value = 0.2",
            "holds no oil",
        ),
    ] {
        let message = refused(&changed(from, to));
        assert!(message.contains(says), "{message}");
    }
}

/// A pump that delivers 91 % of its displacement must turn faster for the same piston velocity. Computed
/// delivery has no such factor.
#[test]
fn the_required_motor_speed_includes_the_pumps_flow_gain() {
    let mut crane = Description::uia_single_boom().unwrap();
    let n = &crane.numbers;
    let displaced = n.fast * crane.cylinder().piston_area / n.displacement * 60.0;
    let delivered = displaced / n.flow_gain;
    let between = format!("motor.max_speed_rpm={}", 0.5 * (displaced + delivered));
    crane.set(&between).unwrap();
    let warnings = crane.warnings();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].contains(&format!("needs {delivered:.0} rpm")), "{warnings:?}");
    crane.set("pump.delivery=computed").unwrap();
    assert!(crane.warnings().is_empty(), "{:?}", crane.warnings());
}

#[test]
fn friction_that_falls_with_speed_gives_a_warning() {
    let mut crane = Description::uia_single_boom().unwrap();
    crane.set("friction.viscous_ns_per_m=1000").unwrap();
    crane.set("friction.stiction_n=350").unwrap();
    assert!(crane.warnings()[0].contains("negative damping"), "{:?}", crane.warnings());
}

#[test]
fn truncated_binary_and_huge_files_are_refused() {
    for end in [0, 1, 100, 2000, 5000] {
        refused(&UIA_SINGLE_BOOM[..end]);
    }
    refused("\u{0}\u{1}\u{7f}[[[\n===");
    refused(&"# padding\n".repeat(200_000));
}

/// Keys of model following are refused with their successors, in a file and as overrides.
#[test]
fn replaced_keys_are_refused_with_their_successors() {
    let text = format!("{UIA_SINGLE_BOOM}\n[following]\nbandwidth_hz = 2.0\n");
    let message = refused(&text);
    assert!(message.contains("`following.bandwidth_hz`"), "{message}");
    assert!(message.contains("[estimator]") && message.contains("[scheduled_lqr]"), "{message}");
    let mut crane = Description::uia_single_boom().unwrap();
    let error = crane.set("following.lead_ms=5").unwrap_err();
    let help: String = error.problems.iter().filter_map(|p| p.help.clone()).collect();
    assert!(help.contains("[scheduled_lqr]"), "{help}");
}

#[test]
fn overrides_are_checked_like_the_file() {
    let mut crane = Description::uia_single_boom().unwrap();
    crane.set("boom.segments=10").unwrap();
    assert_eq!(crane.segment_shares.len(), 10);
    crane.set("payload.mass_kg=316").unwrap();
    assert_eq!(crane.numbers.payload, 316.0);
    for wrong in [
        "boom.segments=0",
        "boom.segments=51",
        "boom.segments=2.5",
        "payload.mass_kg=heavy",
        "payload.mas_kg=3",
        "payload.mass_kg",
        "friction.law=dahl",
        "cylinder.rod_mm=80",
    ] {
        assert!(crane.clone().set(wrong).is_err(), "{wrong}");
    }
}

#[test]
fn a_valve_controlled_crane_has_the_keys_of_its_circuit_only() {
    let crane = Description::patu_lift().unwrap();
    assert_eq!(crane.choices.circuit, CircuitChoice::ValveControlled);
    let has = |path: &str| crane.own_entries().any(|(key, ..)| key.path() == path);
    assert!(has("valve.neutral_v") && has("link_2.mass_kg") && has("friction.coulomb_n"));
    assert!(!has("pump.flow_gain") && !has("link_3.mass_kg") && !has("boom.youngs_modulus_gpa"));
    assert!(crane.own_entries().all(|(_, _, origin)| origin.provenance != "foreign"));

    let with = |line: &str| refused(&format!("{PATU_LIFT}\n{line}\n"));
    let message = with("[pump]\nflow_gain = 0.9");
    assert!(
        message.contains("no `pump.flow_gain`") && message.contains("self-contained"),
        "{message}"
    );
    let message = with("[link_3]\nmass_kg = 10.0");
    assert!(message.contains("fewer links"), "{message}");
    let message = refused(&PATU_LIFT.replace("segments     = 2", "segments     = 4"));
    assert!(message.contains("at most 3"), "{message}");
    let message = refused(&PATU_LIFT.replace("neutral_v ", "neutral "));
    assert!(message.contains("did you mean `valve.neutral_v`?"), "{message}");
    let message = refused(&PATU_LIFT.replace("value = 2.77,", "value = 5.77,"));
    assert!(message.contains("full travel"), "{message}");
    let message = refused(&format!("{UIA_SINGLE_BOOM}\n[valve]\nneutral_v = 5.0\n"));
    assert!(message.contains("no `valve.neutral_v`"), "{message}");
}

#[test]
fn a_crane_with_the_wrong_circuit_is_refused_with_a_reason() {
    let valve = Description::patu_lift().unwrap();
    let error = valve.crane::<2>().unwrap_err();
    assert!(matches!(error, BuildError::Circuit { .. }));
    assert!(error.to_string().contains("self-contained"), "{error}");
    let pump = Description::uia_single_boom().unwrap();
    assert!(pump.valve_crane_over::<f64, 3>(&pump.numbers).is_err());
    let mut valve = valve;
    let before = valve.choices;
    assert!(valve.set("circuit.type=self-contained").is_err());
    assert!(valve.set("pump.flow_gain=0.9").is_err());
    assert_eq!(valve.choices, before);
}
