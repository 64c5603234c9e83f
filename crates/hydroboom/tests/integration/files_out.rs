//! No command loses a file: inputs are kept, outputs are complete or unchanged, and a failure of one does
//! not affect another.

use crate::support::command::{fails_with, files, folder, hydroboom};
use std::fs;
use std::os::unix::fs::{FileTypeExt, symlink};
use std::path::Path;
use std::process::{Command, Output};

/// Log of a short simulation.
fn log(path: &str) -> Vec<u8> {
    let made = hydroboom(&["simulate", "--hold-s", "0.3", "--valve", "0", "--log", path]);
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    fs::read(path).unwrap()
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name());
    let mut names: Vec<String> = entries.map(|name| name.into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn no_command_writes_over_its_input() {
    let at = files("over-input");
    let (csv, crane, baseline) = (at("v.csv"), at("crane.toml"), at("base.json"));
    assert!(hydroboom(&["new", &crane]).status.success());
    log(&csv);
    fs::write(at("map.toml"), "[log]\n").unwrap();
    fs::write(at("drive.csv"), "time_s,motor_speed_rpm\n0,0\n1,0\n").unwrap();
    fs::write(at("run.mcap"), "no log").unwrap();
    fs::write(at("run.csv"), "no log").unwrap();
    fs::write(&baseline, "{}").unwrap();
    assert!(hydroboom(&["virtual", "--survey", &at("survey.csv")]).status.success());
    let before = |name: &str| fs::read(at(name)).unwrap();
    let all = [
        "v.csv",
        "crane.toml",
        "map.toml",
        "drive.csv",
        "run.mcap",
        "base.json",
        "survey.csv",
        "run.csv",
    ];
    let kept: Vec<Vec<u8>> = all.iter().map(|name| before(name)).collect();
    let (map, drive, mcap, survey) =
        (at("map.toml"), at("drive.csv"), at("run.mcap"), at("survey.csv"));
    let run_csv = at("run.csv");
    let attempts: Vec<Vec<&str>> = vec![
        vec!["validate", "--log", &csv, "--report", &csv],
        vec!["validate", "--crane", &crane, "--log", &csv, "--report", &crane],
        vec!["validate", "--log", &csv, "--mapping", &map, "--report", &map],
        vec!["estimate", "--log", &csv, "--out", &csv],
        vec!["estimate", "--log", &csv, "--csv", &csv],
        vec!["tune", "--free", "auto", "--log", &csv, "--out", &csv],
        vec!["tune", "--free", "auto", "--crane", &crane, "--log", &csv, "--report", &crane],
        vec!["tune", "--free", "auto", "--log", &csv, "--test-log", &map, "--journal", &map],
        vec!["log", "inspect", &csv, "--mapping-out", &csv],
        vec!["log", "to-csv", &mcap, "--out", &mcap],
        vec!["log", "to-csv", &run_csv],
        vec!["simulate", "--input", &drive, "--log", &drive],
        vec!["virtual", "--input", &drive, "--log", &drive],
        vec!["virtual", "--model", &crane, "--survey", &crane],
        vec!["run", "--auto", "--simulated-time", "--crane", &crane, "--log", &crane],
        vec!["run", "--auto", "--simulated-time", "--crane", &crane, "--report", &crane],
        vec!["run", "--auto", "--simulated-time", "--crane", &crane, "--parameters", &crane],
        vec!["run", "--auto", "--simulated-time", "--machine", &crane, "--log", &crane],
        vec!["run", "--auto", "--baseline", &baseline, "--record-baseline", &baseline],
        vec!["tip", "--survey", &survey, "--out", &survey],
        vec!["sensitivity", "--crane", &crane, "--report", &crane],
        vec!["calibrate", "--crane", &crane, "--out", &crane],
        vec!["faults", "--crane", &crane, "--report", &crane],
        vec!["export", "fmu", "--what", "model", "--crane", &crane, "--out", &crane],
        vec!["export", "closed-loop", "--crane", &crane, "--csv", &crane],
    ];
    for attempt in &attempts {
        let output = hydroboom(attempt);
        assert!(!output.status.success(), "{attempt:?}");
        for (name, kept) in all.iter().zip(&kept) {
            assert_eq!(&before(name), kept, "{name} after {attempt:?}: {}", errors(&output));
        }
        // a file that is no log of a run is reported as such first
        if attempt[1] != "to-csv" {
            assert!(
                errors(&output).contains("it is the input"),
                "{attempt:?}: {}",
                errors(&output)
            );
        }
    }
}

#[test]
fn an_input_is_recognised_by_every_path() {
    let dir = folder("by-path");
    let at = |name: &str| dir.join(name).to_str().unwrap().to_string();
    let csv = at("v.csv");
    let kept = log(&csv);
    fs::create_dir(dir.join("sub")).unwrap();
    symlink("../v.csv", dir.join("sub/link.csv")).unwrap();
    fs::hard_link(&csv, dir.join("hard.csv")).unwrap();
    for way in ["sub/../v.csv", "sub/link.csv", "hard.csv"] {
        for (read, write) in [(csv.clone(), at(way)), (at(way), csv.clone())] {
            fails_with(
                &hydroboom(&["validate", "--log", &read, "--report", &write]),
                "it is the input",
            );
            assert_eq!(fs::read(&csv).unwrap(), kept, "{way}");
        }
    }
    // and by redirection
    let shell = format!("\"$0\" validate --log /dev/stdin --report {csv} < {csv}");
    let program = env!("CARGO_BIN_EXE_hydroboom");
    let output = Command::new("sh").args(["-c", &shell, program]).output().unwrap();
    fails_with(&output, "it is the input");
    assert_eq!(fs::read(&csv).unwrap(), kept);
    // a file in the folder of the outputs
    let crane = at("sub/motion.html");
    assert!(hydroboom(&["new", &crane]).status.success());
    let kept = fs::read(&crane).unwrap();
    fails_with(
        &hydroboom(&["motion", "--crane", &crane, "--scenario", "reversal", "--out", &at("sub")]),
        "it is the input",
    );
    assert_eq!(fs::read(&crane).unwrap(), kept);
}

#[test]
fn two_outputs_in_the_same_file_are_refused() {
    let at = files("two-outputs");
    let (log, report) = (at("x"), at("./x"));
    let output =
        hydroboom(&["run", "--auto", "--simulated-time", "--log", &log, "--report", &report]);
    fails_with(&output, "are the same file");
    assert!(!Path::new(&log).exists());
}

/// A full disk, or a missing folder: the results are printed, the other files are written, and the program
/// lists the missing ones at the end.
#[test]
fn a_failed_output_does_not_affect_the_others() {
    let dir = folder("other-outputs");
    let at = |name: &str| dir.join(name).to_str().unwrap().to_string();
    for lost in ["/dev/full".to_string(), at("none/run.mcap")] {
        let report = at("run.html");
        let arguments = ["run", "--auto", "--simulated-time", "--strategy", "velocity-feedforward"];
        let outputs = ["--log", &lost, "--report", &report, "--parameters", &at("kept.json")];
        let output = hydroboom(&[&arguments[..], &outputs[..]].concat());
        let message = errors(&output);
        assert!(!output.status.success(), "{message}");
        assert!(
            message.contains("not all outputs are written") && message.contains(&lost),
            "{message}"
        );
        assert!(!output.stdout.is_empty(), "{message}");
        let page = fs::read_to_string(&report).unwrap();
        assert!(page.ends_with("</html>"), "{message}");
        fs::remove_dir_all(at("run-figures")).unwrap();
        assert!(fs::metadata(at("kept.json")).unwrap().len() > 100, "{message}");
        fs::remove_file(&report).unwrap();
    }
    for arguments in [
        vec!["simulate", "--hold-s", "0.3", "--valve", "0", "--log", "/dev/full"],
        vec!["virtual", "--speed-mm-s", "120", "--log", "/dev/full"],
    ] {
        let output = hydroboom(&arguments);
        fails_with(&output, "No space left");
        assert!(!output.stdout.is_empty());
    }
    assert!(fs::metadata("/dev/full").unwrap().file_type().is_char_device());
    assert_eq!(names(&dir), ["kept.json"]);
}

/// The disk becomes full while a log is written: the previous log is kept.
#[test]
fn a_full_disk_keeps_the_previous_log() {
    let dir = folder("does-not-fit");
    let path = dir.join("x.csv");
    fs::write(&path, "before").unwrap();
    let program = env!("CARGO_BIN_EXE_hydroboom");
    let limited = format!(
        "ulimit -f 8; exec \"$0\" simulate --hold-s 2 --valve 0 --log-ms 1 --log {}",
        path.display()
    );
    let output = Command::new("sh").args(["-c", &limited, program]).output().unwrap();
    fails_with(&output, "x.csv cannot be written");
    assert!(String::from_utf8_lossy(&output.stdout).contains("NOT written"));
    assert_eq!(fs::read_to_string(&path).unwrap(), "before");
    assert_eq!(names(&dir), ["x.csv"]);
}

#[test]
fn a_failure_to_print_is_an_error_and_keeps_the_files() {
    let dir = folder("full-stdout");
    let path = dir.join("x.csv");
    let program = env!("CARGO_BIN_EXE_hydroboom");
    let command =
        format!("exec \"$0\" simulate --hold-s 0.3 --valve 0 --log {} > /dev/full", path.display());
    let output = Command::new("sh").args(["-c", &command, program]).output().unwrap();
    fails_with(&output, "cannot be printed");
    assert!(fs::metadata(&path).unwrap().len() > 1000);
}

/// Standard output named as a file: the table and the log follow each other.
#[test]
fn standard_output_is_written_in_place() {
    let dir = folder("in-place");
    let program = env!("CARGO_BIN_EXE_hydroboom");
    let out = dir.join("all.txt");
    let command = format!(
        "exec \"$0\" simulate --hold-s 0.1 --valve 0 --log /dev/stdout > {}",
        out.display()
    );
    let status = Command::new("sh").args(["-c", &command, program]).status().unwrap();
    assert!(status.success());
    let printed = fs::read_to_string(&out).unwrap();
    assert!(printed.starts_with("time_s,") && printed.contains("after 0.100 s"), "{printed}");
    // a pipe also takes the log of a run
    let command = "\"$0\" run --auto --simulated-time --log /dev/fd/3 3>&1 >/dev/null | head -c 8";
    let output = Command::new("bash").args(["-c", command, program]).output().unwrap();
    assert_eq!(output.stdout, b"\x89MCAP0\r\n", "{}", errors(&output));
    assert_eq!(names(&dir), ["all.txt"]);
}
