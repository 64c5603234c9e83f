//! The command line as a user meets it, wrong inputs included.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use std::path::PathBuf;
use std::process::{Command, Output};

fn hydroboom(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_hydroboom")).args(arguments).output().unwrap()
}

/// An empty folder for one test.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

fn says(output: &Output, wanted: &str) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "should fail and say {wanted}");
    assert!(said.contains(wanted), "{said}");
}

#[test]
fn every_command_explains_itself_with_an_example() {
    for command in [
        "new",
        "check",
        "show",
        "simulate",
        "eigen",
        "linearise",
        "energy",
        "motion",
        "study",
        "bench",
    ] {
        let help = hydroboom(&[command, "--help"]);
        assert!(String::from_utf8_lossy(&help.stdout).contains("Example"), "{command}");
    }
}

#[test]
fn a_new_crane_file_is_checked_and_shown() {
    let file = folder("new").join("crane.toml");
    let path = file.to_str().unwrap();
    assert!(hydroboom(&["new", path]).status.success());
    says(&hydroboom(&["new", path]), "exists already");
    assert!(hydroboom(&["check", "--crane", path]).status.success());
    let shown = hydroboom(&["show", "--crane", path, "--json"]);
    let shown: serde_json::Value = serde_json::from_slice(&shown.stdout).unwrap();
    assert_eq!(shown["crane"], "UiA single boom");
}

#[test]
fn wrong_crane_files_are_refused_with_a_reason() {
    let folder = folder("wrong");
    let write = |name: &str, content: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, content).unwrap();
        path.to_str().unwrap().to_string()
    };
    says(&hydroboom(&["check", "--crane", "/nowhere.toml"]), "cannot be read");
    let binary = write("binary.toml", &[0, 159, 146, 150]);
    says(&hydroboom(&["check", "--crane", &binary]), "not a text file");
    let empty = write("empty.toml", b"");
    says(&hydroboom(&["check", "--crane", &empty]), "missing");
    says(&hydroboom(&["check", "--set", "boom.segments=99"]), "1 to 50");
}

#[test]
fn wrong_inputs_are_refused_and_leave_nothing_behind() {
    let folder = folder("inputs");
    let log = folder.join("log.csv");
    let log_path = log.to_str().unwrap();
    for (name, content, reason) in [
        ("empty.csv", "", "no column"),
        ("columns.csv", "t,n\n0,1\n", "no column"),
        ("nan.csv", "time_s,motor_speed_rpm\n0,0\n1,nan\n", "line 3"),
        ("text.csv", "time_s,motor_speed_rpm\n0,0\n1,fast\n", "line 3"),
        ("back.csv", "time_s,motor_speed_rpm\n0,0\n1,0\n0.5,0\n", "does not increase"),
        ("valve.csv", "time_s,motor_speed_rpm,valve\n0,0,1\n1,0,24\n", "0 to 1"),
        ("unit.csv", "time_s,motor_speed_rpm\n0,0\n1,2e6\n", "rpm?"),
    ] {
        let path = folder.join(name);
        std::fs::write(&path, content).unwrap();
        let input = path.to_str().unwrap();
        says(&hydroboom(&["simulate", "--input", input, "--log", log_path]), reason);
    }
    // a drive that breaks the crane
    let slam = ["simulate", "--hold-s", "10", "--motor-speed-rpm", "3000", "--log", log_path];
    says(&hydroboom(&slam), "at t =");
    let left: Vec<_> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.contains("log"))
        .collect();
    assert!(left.is_empty(), "left behind: {left:?}");
}

#[test]
fn a_recorded_input_drives_the_crane_and_the_log_names_its_units() {
    let folder = folder("recorded");
    let (input, log) = (folder.join("in.csv"), folder.join("out.csv"));
    std::fs::write(&input, "time_s,motor_speed_rpm,valve\n0,0,1\n0.5,600,1\n2,0,1\n3,0,1\n")
        .unwrap();
    let done = hydroboom(&[
        "simulate",
        "--input",
        input.to_str().unwrap(),
        "--log",
        log.to_str().unwrap(),
        "--json",
    ]);
    let done: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    // 1.5 s at 600 rpm of 10.6 cm3 on 33.2 cm2, less compression and leakage
    let stroke = done["outputs"]["stroke"]["value"].as_f64().unwrap();
    assert!((0.06..0.098).contains(&stroke), "{stroke}");
    let log = std::fs::read_to_string(log).unwrap();
    let header = log.lines().next().unwrap();
    for column in ["time_s", "motor_speed_rpm", "stroke_mm", "pressure_a_bar", "flow_to_a_l_min"] {
        assert!(header.split(',').any(|name| name == column), "{column} in {header}");
    }
    assert_eq!(log.lines().count(), 302);
}
