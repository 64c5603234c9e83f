//! Inputs have bounded size, numbers have ranges, and messages cannot control a terminal.

use crate::support::command::{fails_with, files, hydroboom, parsed};
use crate::support::short_crane::short_crane;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// Runs the program with limits of memory (2 GB) and time (ten seconds).
fn limited(arguments: &[&str]) -> Output {
    let shell = "ulimit -v 2000000; exec timeout 10 \"$0\" \"$@\"";
    let program = env!("CARGO_BIN_EXE_hydroboom");
    Command::new("sh").args(["-c", shell, program]).args(arguments).output().unwrap()
}

#[test]
fn an_endless_device_is_refused_as_an_input() {
    let at = files("endless");
    let (log, zero) = (at("v.csv"), "/dev/zero");
    let made = hydroboom(&["simulate", "--hold-s", "0.3", "--valve", "0", "--log", &log]);
    assert!(made.status.success());
    let run = ["run", "--auto", "--simulated-time"];
    for arguments in [
        vec!["check", "--crane", zero],
        vec!["validate", "--log", &log, "--crane", zero],
        vec!["validate", "--log", &log, "--mapping", zero],
        vec!["validate", "--log", zero],
        vec!["estimate", "--log", zero],
        vec!["simulate", "--input", zero],
        vec!["virtual", "--input", zero],
        vec!["motion", "--plant", zero],
        vec!["tip", "--survey", zero],
        vec!["log", "to-csv", zero, "--out", &at("x.csv")],
        vec!["log", "inspect", zero],
        vec!["run", "--replay", zero],
        [&run[..], &["--parameters", zero]].concat(),
        [&run[..], &["--baseline", zero]].concat(),
        [&run[..], &["--machine", zero]].concat(),
    ] {
        let output = limited(&arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
        assert!(message.contains(zero) && message.len() < 2000, "{arguments:?}: {message}");
    }
}

#[test]
fn numbers_are_finite_and_within_their_ranges() {
    let at = files("numbers");
    let log = at("v.csv");
    assert!(hydroboom(&["simulate", "--hold-s", "0.3", "--log", &log]).status.success());
    let options: [&[&str]; 14] = [
        &["simulate", "--speed-mm-s"],
        &["simulate", "--hold-s"],
        &["simulate", "--hold-s", "1", "--motor-speed-rpm"],
        &["simulate", "--start-mm"],
        &["simulate", "--step-us"],
        &["simulate", "--log-ms"],
        &["virtual", "--speed-mm-s"],
        &["virtual", "--log-ms"],
        &["run", "--auto", "--simulated-time", "--speed-mm-s"],
        &["sensitivity", "--speed-mm-s"],
        &["linearise", "--stroke-mm"],
        &["linearise", "--settle-s"],
        &["energy", "--step-us"],
        &["eigen", "--stroke-mm"],
    ];
    for option in options {
        for wrong in ["nan", "inf", "-inf", "1e300", "-30000", "many"] {
            let output = limited(&[option, &[wrong]].concat());
            let message = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(2), "{option:?} {wrong}: {message}");
            // -inf is taken for an option
            let is_refused = message.contains("a number from") || wrong == "-inf";
            assert!(is_refused, "{option:?} {wrong}: {message}");
        }
    }
    for wrong in ["nan", "inf", "-1e300"] {
        fails_with(&hydroboom(&["validate", "--log", &log, "--from-s", wrong]), "a number from");
        fails_with(&hydroboom(&["check", "--set", &format!("payload.mass_kg={wrong}")]), "mass_kg");
    }
    // finite, but too fast for the length of this motion
    for command in ["simulate", "virtual", "sensitivity"] {
        fails_with(&hydroboom(&[command, "--speed-mm-s", "9000"]), "for this motion, not 9000");
    }
}

#[test]
fn an_error_shows_an_excerpt_without_control_characters() {
    let at = files("excerpts");
    let (crane, log) = (at("crane.toml"), at("v.csv"));
    assert!(hydroboom(&["simulate", "--hold-s", "0.3", "--log", &log]).status.success());
    for text in [
        "[".repeat(200_000),
        format!("[crane]\nname = {}", "[".repeat(200_000)),
        format!("[crane]\n{} = 1", "x".repeat(200_000)),
        format!("[crane]\nname = \"{}", "\u{1b}[2J".repeat(50_000)),
        "[crane]\n\u{1b}]0;owned\u{7} = 1\n".into(),
    ] {
        fs::write(&crane, text).unwrap();
        for arguments in [
            vec!["check", "--crane", &crane],
            vec!["validate", "--log", &log, "--mapping", &crane],
            vec!["virtual", "--crane", &crane],
        ] {
            let output = limited(&arguments);
            assert_eq!(output.status.code(), Some(1), "{arguments:?}");
            let message = String::from_utf8_lossy(&output.stderr);
            assert!(message.len() < 40_000, "{arguments:?}: {} bytes", message.len());
            assert!(
                !message.contains('\u{1b}') && !message.contains('\u{7}'),
                "{arguments:?}: {message}"
            );
        }
    }
    // a name that is read from a file and printed
    assert!(hydroboom(&["new", &at("named.toml")]).status.success());
    let named = fs::read_to_string(at("named.toml")).unwrap();
    let named = named.replacen("name = \"UiA single boom\"", "name = \"\\u001b[2Jowned\"", 1);
    fs::write(&crane, named).unwrap();
    let shown = hydroboom(&["check", "--crane", &crane]);
    assert!(shown.status.success());
    let message = String::from_utf8_lossy(&shown.stdout);
    assert!(message.contains("\\u{1b}[2Jowned") && !message.contains('\u{1b}'), "{message}");
    let asked = limited(&["simulate", "--speed-mm-s", "\u{1b}[2J"]);
    assert!(!asked.stderr.contains(&0x1b));
}

/// Estimator parameters that are invalid are refused when they are read, and accepted ones run. No
/// parameter file ends the control task.
#[test]
fn invalid_retained_parameters_do_not_end_the_control_task() {
    let at = files("parameters");
    let path = at("p.json");
    let crane = short_crane(Path::new(&path).parent().unwrap());
    let run =
        ["run", "--auto", "--simulated-time", "--json", "--crane", &crane, "--parameters", &path];
    assert!(hydroboom(&run).status.success());
    let kept: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let deviations = [
        "unknown_flow_deviation_rpm",
        "transition_pressure_deviation_bar",
        "drive_lag_deviation_ms",
    ];
    for (key, values) in [
        (deviations[0], vec![json!(0.0), json!(1e5), json!(1e300), json!(-1.0)]),
        (deviations[1], vec![json!(0.0), json!(1e4), json!(1e300), json!(-1.0)]),
        (deviations[2], vec![json!(0.0), json!(1e5), json!(1e300), json!(-1.0)]),
        ("flow_transition_correlation", vec![json!(-1.0), json!(1.0), json!(2.0)]),
    ] {
        for value in values {
            let mut changed = kept.clone();
            changed[key] = value.clone();
            fs::write(&path, changed.to_string()).unwrap();
            let output = hydroboom(&run);
            let message = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(!message.contains("panicked"), "{key} = {value}: {message}");
            if output.status.success() {
                let result: Value = serde_json::from_slice(&output.stdout).unwrap();
                let rms = result["rms_measured_mm"].as_f64().unwrap();
                assert!(
                    result["fault"].is_null() && rms < 20.0,
                    "{key} = {value}: {rms} {message}"
                );
            } else {
                assert!(
                    message.contains(key) || message.contains("deviations"),
                    "{key} = {value}: {message}"
                );
            }
        }
    }
    // all at once
    let mut changed = kept.clone();
    deviations.iter().for_each(|key| changed[*key] = json!(1e4));
    changed["flow_transition_correlation"] = json!(1.0);
    fs::write(&path, changed.to_string()).unwrap();
    let result = parsed(&run);
    assert!(result["fault"].is_null(), "{result}");
}
