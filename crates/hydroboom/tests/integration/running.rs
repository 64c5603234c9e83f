//! Runs with a machine, as users start them.

use crate::support::command::{fails_with, folder, hydroboom, keys, parsed};
use std::process::Command;

#[test]
fn a_run_in_simulated_time_is_logged_and_converted() {
    let folder = folder("run");
    let log = folder.join("run.mcap");
    let run = parsed(&["run", "--simulated-time", "--json", "--log", log.to_str().unwrap()]);
    keys(
        &run,
        &[
            "courses",
            "rms_true_mm",
            "rms_measured_mm",
            "peak_true_mm",
            "peak_measured_mm",
            "paper",
            "fault",
            "processor",
        ],
    );
    assert!(run["fault"].is_null(), "{run}");
    assert!(run["rms_measured_mm"].as_f64().unwrap() < 1.1, "{run}");
    // in simulated time the true position is known: it has neither the encoder's noise nor the fieldbus's
    // delay
    let [truth, measured] =
        ["rms_true_mm", "rms_measured_mm"].map(|key| run[key].as_f64().unwrap());
    assert!(truth > 0.0 && truth != measured, "{run}");
    assert!((truth - measured).abs() < 0.1, "{run}");
    let rows = |log: &std::path::Path| {
        let csv = log.with_extension("csv");
        let arguments = ["log", "to-csv", log.to_str().unwrap(), "--out", csv.to_str().unwrap()];
        let output = hydroboom(&arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        std::fs::read_to_string(csv).unwrap().lines().count() - 1
    };
    let whole = rows(&log);
    assert!(whole > 20_000, "{whole} rows");
    // with a truncation anywhere, less than a second is lost
    let bytes = std::fs::read(&log).unwrap();
    let cut = folder.join("cut.mcap");
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let left = rows(&cut);
    assert!(left > 5_000 && left < whole, "{left} rows of {whole}");
    let foreign = hydroboom(&["log", "to-csv", folder.join("cut.csv").to_str().unwrap()]);
    assert!(!foreign.status.success());
}

/// Options of earlier versions are refused with their replacement.
#[test]
fn replaced_options_are_refused_with_their_successors() {
    fails_with(
        &hydroboom(&["run", "--simulated-time", "--learned", "learned.json"]),
        "scheduled-lqr",
    );
    for command in ["run", "virtual"] {
        fails_with(&hydroboom(&[command, "--strategy", "model-following"]), "scheduled-lqr");
    }
}

#[test]
fn a_run_is_replayed_and_reported_with_its_limitations() {
    let folder = folder("replay");
    let (log, report) = (folder.join("run.mcap"), folder.join("run.html"));
    let (log, report) = (log.to_str().unwrap(), report.to_str().unwrap());
    let run =
        ["run", "--simulated-time", "--scenario", "reversal", "--log", log, "--report", report];
    let output = hydroboom(&run);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let page = std::fs::read_to_string(report).unwrap();
    assert!(page.contains("reversal") && page.matches("<svg").count() >= 4);
    let replayed = parsed(&["run", "--replay", log, "--json"]);
    assert_eq!(replayed["periods_in_another_state"], 0, "{replayed}");
    assert!(replayed["command_differs_by_rpm"].as_f64().unwrap() < 20.0, "{replayed}");
    fails_with(&hydroboom(&["run", "--simulated-time", "--scenario", "none"]), "reversal");
    fails_with(&hydroboom(&["run", "--simulated-time", "--speed-mm-s", "900"]), "0.1 to 240 mm/s");
    fails_with(&hydroboom(&["run", "--replay", report]), "not a log");
    fails_with(
        &hydroboom(&["run", "--simulated-time", "--dashboard", "0.0.0.0:0"]),
        "--allow-remote",
    );
}

#[test]
fn results_of_several_courses_are_summarised() {
    let run = parsed(&["run", "--simulated-time", "--cycles", "3", "--json"]);
    let courses = run["courses"].as_array().unwrap();
    assert_eq!(courses.len(), 3);
    for course in courses {
        keys(
            course,
            &[
                "course",
                "strategy",
                "begun_s",
                "rms_true_mm",
                "rms_measured_mm",
                "peak_measured_mm",
                "fault",
                "memory_mb",
            ],
        );
    }
}

#[test]
fn a_full_disk_ends_the_log_and_not_the_run() {
    let folder = folder("full");
    let log = folder.join("run.mcap");
    // file size limited to 500 kB: the system refuses further writes, as on a full disk
    let script = r#"ulimit -f 500 && exec "$0" run --simulated-time --json --log "$1""#;
    let output = Command::new("bash")
        .args(["-c", script, env!("CARGO_BIN_EXE_hydroboom"), log.to_str().unwrap()])
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success() && message.contains("not all outputs are written"),
        "{message}"
    );
    let (_, kept) =
        message.split_once("the log ends here; the part written is in ").expect(&message);
    let (kept, _) = kept.split_once(".partial: ").expect(&message);
    let kept = format!("{kept}.partial");
    let full: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let free = parsed(&["run", "--simulated-time", "--json"]);
    assert_eq!(full["rms_measured_mm"], free["rms_measured_mm"], "the control noticed it");
    assert!(full["fault"].is_null());
    let csv = folder.join("run.csv");
    let read = hydroboom(&["log", "to-csv", &kept, "--out", csv.to_str().unwrap()]);
    assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
    let rows = std::fs::read_to_string(csv).unwrap().lines().count();
    assert!(rows > 2000, "{rows} rows are left");
}

#[test]
fn a_killed_machine_is_detected_and_a_killed_run_leaves_the_load_held() {
    // a computer that stalls may end the run early: then it is tried again
    for _ in 0..6 {
        let run = std::process::Command::new(env!("CARGO_BIN_EXE_hydroboom"))
            .args(["run", "--auto", "--json"])
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::null())
            .spawn()
            .unwrap();
        let children = format!("/proc/{0}/task/{0}/children", run.id());
        let machine = (0..3000).find_map(|_| {
            std::thread::sleep(std::time::Duration::from_millis(20));
            let children = std::fs::read_to_string(&children).ok()?;
            children.split_whitespace().next().map(str::to_string)
        });
        std::thread::sleep(std::time::Duration::from_secs(4));
        let killed = std::process::Command::new("kill")
            .args(["-9", &machine.expect("the machine's process")])
            .status()
            .is_ok_and(|status| status.success());
        let begun = std::time::Instant::now();
        let output = run.wait_with_output().unwrap();
        assert!(!output.status.success());
        assert!(begun.elapsed().as_secs() < 5, "it went on");
        let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        match result["fault"].as_str() {
            Some("machine-lost") if killed => return,
            Some(_) => {}
            None => panic!("it went on without a machine: {result}"),
        }
    }
    panic!("deadlines were missed every time");
}

/// The campaign is tested in its own crate; here the output of the command for a part of it.
#[test]
fn the_fault_campaign_reports_the_outcome_of_every_case() {
    let campaign = parsed(&["faults", "--only", "p_A shows 0", "--json"]);
    let outcomes = campaign["outcomes"].as_array().unwrap();
    // five strategies at five moments
    let faults = campaign["faults"].as_u64().unwrap();
    assert!(faults >= 1 && outcomes.len() as u64 == 25 * faults);
    assert_eq!(campaign["beyond_bounds"], 0, "{campaign}");
    for o in outcomes {
        assert!(o["broke"].is_null() && o["within_bounds"] == true, "{o}");
        assert!(o["dropped_mm"].as_f64().unwrap() < 3.0, "{o}");
        assert!(o["moved_mm"].as_f64().unwrap() <= o["movement_bound_mm"].as_f64().unwrap(), "{o}");
        assert!(o["peak_pressure_bar"].as_f64().unwrap() > 10.0, "{o}");
    }
    // under one strategy the same cases have the same results
    let one = ["faults", "--only", "p_A shows 0", "--strategy", "scheduled-lqr", "--json"];
    let part = parsed(&one);
    let is_of_it = |o: &&serde_json::Value| o["strategy"] == "scheduled-lqr";
    let expected: Vec<_> = outcomes.iter().filter(is_of_it).collect();
    assert_eq!(expected.len() as u64, 5 * faults);
    assert_eq!(part["outcomes"].as_array().unwrap().iter().collect::<Vec<_>>(), expected);
}
