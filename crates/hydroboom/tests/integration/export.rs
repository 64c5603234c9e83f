//! Export of model and controllers as source code.

use crate::support::command::{fails_with, files, hydroboom, keys, parsed};
use hydroboom_description::Description;

#[test]
fn exported_files_are_listed_and_reproducible() {
    let path = files("export");
    for (target, first) in [("st", "FB_HydraulicModel.st"), ("c", "hydroboom.h")] {
        let (once, again) = (path(&format!("{target}-1")), path(&format!("{target}-2")));
        let found = parsed(&["export", target, "--out", &once, "--json"]);
        keys(&found["files"][0], &["file", "bytes", "sha256"]);
        keys(&found["flops"][0], &["entry", "flops"]);
        assert!(found["files"][0]["file"].as_str().is_some_and(|f| f.ends_with(first)), "{found}");
        assert!(hydroboom(&["export", target, "--out", &again]).status.success());
        for file in found["files"].as_array().unwrap() {
            let file = file["file"].as_str().unwrap();
            let other = file.replace(&once, &again);
            assert!(
                std::fs::read(file).unwrap() == std::fs::read(&other).unwrap(),
                "{file} differs"
            );
        }
    }
    let header = std::fs::read_to_string(path("c-1") + "/hydroboom.h").unwrap();
    assert!(header.contains("void hb_scheduled_lqr_controller_update("), "{header}");
    let counts = parsed(&["export", "count", "--json"]);
    let of = |block: &str, call: &str| {
        let all = counts.as_array().unwrap();
        let found = all.iter().find(|c| c["block"] == block && c["call"] == call).unwrap();
        found["flops"].as_u64().unwrap()
    };
    // the step is that of both blocks, except for the boom's outputs at its end
    assert!(of("model", "step") < of("hydraulic_model", "step") + of("flexible_boom", "step"));
    assert!(of("model", "step") > of("flexible_boom", "step"));
}

#[test]
fn cranes_that_cannot_be_exported_are_refused_with_the_reason() {
    let path = files("export-refused");
    let out = path("out");
    fails_with(
        &hydroboom(&["export", "c", "--out", &out, "--set", "boom.segments=10"]),
        "3 segments",
    );
    let crane = path("lift.toml");
    assert!(hydroboom(&["new", &crane, "--circuit", "valve-controlled"]).status.success());
    fails_with(&hydroboom(&["export", "st", "--crane", &crane, "--out", &out]), "self-contained");
    assert!(!std::path::Path::new(&out).exists(), "something was written");
    std::fs::write(&out, "in the way").unwrap();
    fails_with(
        &hydroboom(&["export", "c", "--out", &out]),
        "is a file, and files are to be written into it",
    );
    // single precision has no test bench: the file of an earlier export is reported
    std::fs::remove_file(&out).unwrap();
    assert!(hydroboom(&["export", "st", "--out", &out]).status.success());
    let output = hydroboom(&["export", "st", "--single", "--out", &out]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(
        message.contains("files of another export") && message.contains("PRG_TestBench.st"),
        "{message}"
    );
}

/// Scripts for earlier versions request it.
#[test]
fn model_following_is_refused_with_its_successor_and_the_choices() {
    let out = files("export-replaced")("following.fmu");
    let output = hydroboom(&["export", "fmu", "--what", "model-following", "--out", &out]);
    assert!(!output.status.success() && !std::path::Path::new(&out).exists());
    let message = String::from_utf8_lossy(&output.stderr);
    // the lines of a terminal are narrower than the sentence
    let message =
        message.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
    assert!(message.contains("model following has been replaced by scheduled-lqr"), "{message}");
    let (_, today) = message.split_once("today --what is one of ").unwrap();
    let names: Vec<&str> = today.split(", ").collect();
    assert_eq!(names, ["model", "plant", "controller", "simulation-feedforward", "scheduled-lqr"]);
    // it is neither offered nor exported together with others
    let offered = hydroboom(&["export", "fmu", "--help"]).stdout;
    assert!(!String::from_utf8_lossy(&offered).contains("model-following"));
    for target in ["st", "c"] {
        let found =
            parsed(&["export", target, "--out", &out.replace("following.fmu", target), "--json"]);
        assert!(!found.to_string().to_lowercase().contains("following"), "{found}");
    }
}

/// Plant and controller as FMUs, simulated by FMPy, reproduce the results of `motion` for the same pair.
/// Skipped unless `HYDROBOOM_FMPY` names a Python with FMPy.
#[test]
fn a_closed_loop_of_two_fmus_reproduces_the_motion_test() {
    let Ok(python) = std::env::var("HYDROBOOM_FMPY") else {
        eprintln!("skipped: HYDROBOOM_FMPY names no Python with FMPy");
        return;
    };
    let path = files("fmu-loop");
    let (plant, course) = (path("plant.fmu"), path("course.csv"));
    let changed = "pump.flow_gain=0.88";
    let made =
        parsed(&["export", "fmu", "--what", "plant", "--set", changed, "--out", &plant, "--json"]);
    assert_eq!(made["binaries"][0], "Linux", "{made}");

    let model = Description::uia_single_boom().unwrap();
    let motion = model.motion(model.numbers.fast);
    let mut rows = String::from("position,velocity\n");
    for k in 0..=(motion.duration() / 1e-3).round() as u32 {
        let reference = motion.reference(f64::from(k) * 1e-3);
        rows += &format!("{:?},{:?}\n", reference.position, reference.velocity);
    }
    std::fs::write(&course, rows).unwrap();
    let closed = |what: &str| -> f64 {
        let controller = path(&format!("{what}.fmu"));
        // a plant without noise has constant signals at rest
        let quiet = ["--set", "supervision.stuck_ms=0"];
        let made = ["export", "fmu", "--what", what, "--fmi", "3", "--out", &controller];
        let made = [&made[..], &quiet].concat();
        assert!(hydroboom(&made).status.success());
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../export/tests/fmi_check.py");
        let output = std::process::Command::new(&python)
            .args([script, "closed", &plant, &controller, &course])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).trim().parse().unwrap()
    };

    let rows = parsed(&["motion", "--plant-set", changed, "--json"]);
    let motion_rms = |strategy: &str| {
        let rows = rows["motion"].as_array().unwrap();
        let of =
            |row: &&serde_json::Value| row["strategy"] == strategy && row["speed_mm_s"] == 120.0;
        rows.iter().find(of).unwrap()["rms_measured_mm"].as_f64().unwrap()
    };
    let pairs = [
        ("controller", "benchmark-closed-loop"),
        ("simulation-feedforward", "simulation-feedforward-closed-loop"),
    ];
    for (what, strategy) in pairs {
        let (found, wanted) = (closed(what), motion_rms(strategy));
        // a released load starts at a higher position with other pressures
        assert!((found / wanted - 1.0).abs() < 0.02, "{what}: {found} mm, motion says {wanted} mm");
    }
}

#[test]
fn a_prefix_begins_all_exported_names_and_a_wrong_one_is_refused() {
    let path = files("export-prefix");
    let out = path("out");
    let made = parsed(&["export", "c", "--prefix", "my_", "--out", &out, "--json"]);
    let header = made["files"][0]["file"].as_str().unwrap();
    assert!(header.ends_with("my_hydroboom.h"), "{header}");
    let header = std::fs::read_to_string(header).unwrap();
    assert!(header.contains("my_model_step") && !header.contains("hb_"));
    fails_with(
        &hydroboom(&["export", "c", "--prefix", "1st", "--out", &out]),
        "begins with a letter",
    );
}
