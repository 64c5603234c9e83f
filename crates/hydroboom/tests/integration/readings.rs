//! Consistency of the printed results for cranes that differ from the paper's.

use crate::support::command::{files, hydroboom, parsed};

/// Printed text; the command must succeed.
fn printed(arguments: &[&str]) -> String {
    let output = hydroboom(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn the_papers_columns_are_not_shown_for_other_cranes() {
    assert!(printed(&["eigen", "--stroke-mm", "200"]).contains("paper measured"));
    assert!(
        printed(&["eigen", "--stroke-mm", "200", "--set", "boom.segments=5"]).contains("paper")
    );
    for other in ["payload.mass_kg=60", "cylinder.piston_mm=100", "payload.x_mm=9000"] {
        let text = printed(&["eigen", "--stroke-mm", "200", "--set", other]);
        assert!(!text.contains("paper") && !text.contains("Table 5"), "{other}: {text}");
    }
}

/// Simulation feedforward for a light load on a plant with a heavy one runs into the end stop; the other
/// strategies do not.
#[test]
fn an_aborted_run_is_marked_in_its_row_and_the_others_are_kept() {
    let arguments = [
        "motion",
        "--gains-as-given",
        "--set",
        "payload.mass_kg=60",
        "--plant-set",
        "payload.mass_kg=316",
    ];
    let text = printed(&arguments);
    let row = |strategy: &str| text.lines().find(|line| line.starts_with(strategy)).unwrap();
    assert_eq!(row("simulation-feedforward-open-loop").matches("stopped").count(), 2, "{text}");
    assert!(!row("benchmark-closed-loop").contains("stopped"), "{text}");
    let remark = "simulation-feedforward-open-loop on changed at 25 mm/s: STOPPED: at t = ";
    assert!(text.contains(remark) && text.contains("a pressure rose above 1000 bar"), "{text}");
    assert!(!text.contains("NaN") && !text.contains("inf "), "{text}");
    let json = parsed(&[&arguments[..], &["--json"]].concat());
    let rows = json["motion"].as_array().unwrap();
    assert_eq!(rows.len(), 10);
    for row in rows {
        let stopped = !row["stopped"].is_null();
        assert_eq!(row["rms_true_mm"].is_null(), stopped, "{row}");
        assert!(!stopped || row["stable"] == false, "{row}");
    }
    assert!(rows.iter().any(|row| !row["stopped"].is_null()));
}

/// Cranes of the tests as overrides: those of `cranes/`, and unusual ones.
const CRANES: [&[&str]; 8] = [
    &[],
    &["payload.mass_kg=155"],
    &[
        "payload.mass_kg=620",
        "supervision.pressure_bar=300",
        "drive.max_torque_nm=60",
        "drive.inertia_kgm2=0.009",
        "controller.proportional_per_s=3",
        "controller.integral_per_s2=6",
    ],
    &[
        "geometry.mount_x_mm=700",
        "cylinder.piston_mm=80",
        "cylinder.rod_mm=45",
        "pump.displacement_cm3=16",
        "payload.mass_kg=400",
    ],
    &["friction.coulomb_n=715", "boom.youngs_modulus_gpa=208.9", "payload.mass_kg=316"],
    &["payload.mass_kg=60"],
    &["cylinder.piston_mm=100"],
    &["payload.x_mm=9000"],
];

/// Text and numbers of `design` and `eigen` agree: stability, and both methods for the frequency.
#[test]
fn text_agrees_with_json_for_every_crane() {
    // the paper's crane without ranges, which the other cranes exceed
    let file = files("every-crane")("crane.toml");
    assert!(hydroboom(&["new", &file]).status.success());
    let text = std::fs::read_to_string(&file).unwrap();
    let without_range = |line: &str| match line.split_once("range = [") {
        Some((before, rest)) => {
            format!("{before}{}", rest.split_once("], ").map_or("", |(_, after)| after))
        }
        None => line.into(),
    };
    let lines: Vec<String> = text.lines().map(without_range).collect();
    std::fs::write(&file, lines.join("\n")).unwrap();
    for crane in CRANES {
        let set: Vec<&str> = crane.iter().flat_map(|set| ["--set", set]).collect();
        let of = |command: &[&'static str]| [command, &["--crane", &file], &set].concat();
        let json = parsed(&of(&["design", "--json"]));
        let positions = json["positions"].as_array().unwrap();
        let stable = |loop_of: &str| {
            positions.iter().all(|at| {
                let margins = &at[loop_of];
                let is_stable = margins["unstable_poles"] == 0;
                assert_eq!(margins["stable"], is_stable, "{crane:?}: {margins}");
                // no margins without a stable loop
                assert_eq!(margins["phase_deg"].is_null() && !is_stable, !is_stable, "{margins}");
                is_stable
            })
        };
        let both = [stable("benchmark"), stable("scheduled_lqr")];
        assert_eq!(json["stable"], both[0] && both[1], "{crane:?}");
        let text = printed(&of(&["design"]));
        for (name, is_stable) in ["benchmark", "scheduled LQR"].into_iter().zip(both) {
            let is_reported = text.contains(&format!("{name}: the closed loop is UNSTABLE"));
            assert_eq!(is_reported, !is_stable, "{crane:?}: {text}");
        }
        let eigen = parsed(&of(&["eigen", "--stroke-mm", "200", "--json"]));
        let row = &eigen["eigenfrequency"][0];
        let apart =
            row["frictionless_hz"].as_f64().unwrap() / row["linearised_hz"].as_f64().unwrap() - 1.0;
        // soft oil stiffens during the drop: 8 % with a piston of 100 mm, which the text mentions with the
        // pressures
        assert!(apart.abs() < 0.1, "{crane:?}: {row}");
        let eigen_text = printed(&of(&["eigen", "--stroke-mm", "200"]));
        let largest = format!("they differ by {:.1} % at most", 100.0 * apart.abs());
        assert!(eigen_text.contains(&largest), "{largest}: {eigen_text}");
        assert_eq!(
            eigen_text.contains("At 200 mm the drop of"),
            apart.abs() > 0.005,
            "{eigen_text}"
        );
        for text in [text, eigen_text] {
            assert!(!text.contains("NaN") && !text.contains(" inf"), "{crane:?}: {text}");
        }
    }
}

/// JSON of commands that close a loop, with benchmark gains that are too high for a load on soft oil.
#[test]
fn every_unstable_loop_is_flagged_in_json() {
    let path = files("flags");
    let (crane, light) = (path("crane.toml"), path("light.toml"));
    assert!(hydroboom(&["new", &crane]).status.success());
    let text = std::fs::read_to_string(&crane).unwrap();
    let light_text: Vec<String> = text
        .lines()
        .map(|line| match line.starts_with("mass_kg") && line.contains("value = 307.0") {
            true => line.replace("value = 307.0", "value = 100.0"),
            false => line.into(),
        })
        .collect();
    std::fs::write(&light, light_text.join("\n")).unwrap();
    let benchmark = ["--strategy", "benchmark-closed-loop"];
    let of = |command: &[&str]| parsed(&[command, &benchmark].concat());
    let found = of(&["virtual", "--json", "--set", "payload.mass_kg=60"]);
    assert_eq!(found["stable"], false, "{found}");
    assert!(found["sustained_oscillation"]["amplitude_mm"].as_f64() > Some(2.0), "{found}");
    assert_eq!(of(&["virtual", "--json"])["stable"], true);
    // the piston oscillates up to its stop, and the supervisor ends the course: it has no errors
    let run = ["run", "--simulated-time", "--json", "--crane", &light];
    let papers_gains = [
        "--set=controller.proportional_per_s=4.5",
        "--set=controller.integral_per_s2=14.45",
        "--set=controller.pressure_feedback_m3_per_spa=4.77e-11",
        "--set=controller.high_pass_s=1.04",
    ];
    let found = of(&[&run[..], &papers_gains].concat());
    assert_eq!((&found["stable"], found["fault"].is_null()), (&false.into(), false), "{found}");
    assert!(found["rms_true_mm"].is_null() && found["rms_measured_mm"].is_null(), "{found}");
    assert_eq!(of(&["run", "--simulated-time", "--json"])["stable"], true);
    let only = |name: &str| {
        parsed(&["export", "closed-loop", "--json", "--target", "rust", "--only", name])["rows"][0]
            .clone()
    };
    let row = only("0 kg moved from 350 mm");
    assert_eq!((&row["stable"], &row["oscillates"]), (&false.into(), &true.into()), "{row}");
    assert!(row["oscillation_amplitude_mm"].as_f64() > Some(2.0), "{row}");
    assert_eq!(only("200 kg moved from 350 mm")["stable"], true);
}

/// One sample per second resolves neither an oscillation of 2 Hz nor the motor's input in between: nothing
/// is judged.
#[test]
fn too_coarse_samples_give_no_verdict() {
    let path = files("far-apart");
    let (log, thin) = (path("log.csv"), path("thin.csv"));
    let simulate = ["simulate", "--speed-mm-s", "120", "--log", &log];
    assert!(hydroboom(&simulate).status.success());
    let text = std::fs::read_to_string(&log).unwrap();
    let mut lines = text.lines();
    let head = lines.next();
    let kept: Vec<&str> = head.into_iter().chain(lines.step_by(100)).collect();
    std::fs::write(&thin, kept.join("\n")).unwrap();
    let found = parsed(&["validate", "--log", &thin, "--json"]);
    assert_eq!(found["verdict"].as_array().unwrap().len(), 0, "{found}");
    for signal in found["signals"].as_array().unwrap() {
        assert_eq!(signal["judged"], false, "{signal}");
        assert!(signal["ringing"].is_null(), "{signal}");
        let sentence = signal["said"].as_str().unwrap();
        assert!(sentence.contains("samples are 1000 ms apart"), "{sentence}");
        assert!(signal["sensor_error"].is_null(), "{signal}");
    }
    assert_eq!(found["remedies"].as_array().unwrap().len(), 0, "{found}");
    // with a sample every 0.01 s the aspects are judged, and the model is right for its own log
    let found = parsed(&["validate", "--log", &log, "--json"]);
    let verdict = found["verdict"].as_array().unwrap();
    // the oscillation is damped too strongly at this speed for a reliable frequency
    let aspects: Vec<&str> = verdict.iter().map(|of| of["aspect"].as_str().unwrap()).collect();
    assert_eq!(aspects, ["position", "pressures", "damping"], "{found}");
    assert!(verdict.iter().all(|aspect| aspect["right"] == true), "{found}");
    let words = printed(&["validate", "--log", &log]);
    let fine = ["That is within its limit.", "only sensor noise remains."];
    let count: usize = fine.iter().map(|sentence| words.matches(sentence).count()).sum();
    assert_eq!(count, 6, "{words}");
}

/// Log with one column changed row by row, its head kept or replaced.
#[expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]
fn changed(from: &str, to: &str, column: &str, heading: &str, change: impl Fn(f64) -> f64) {
    let text = std::fs::read_to_string(from).unwrap();
    let mut lines = text.lines();
    let head = lines.next().unwrap();
    let place = head.split(',').position(|name| name == column).unwrap();
    let mut rows = vec![head.replacen(column, heading, 1)];
    for line in lines {
        let mut cells: Vec<String> = line.split(',').map(String::from).collect();
        cells[place] = change(cells[place].parse().unwrap()).to_string();
        rows.push(cells.join(","));
    }
    std::fs::write(to, rows.join("\n")).unwrap();
}

/// Log with one column delayed by some rows.
#[expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]
fn late(from: &str, to: &str, column: &str, rows: usize) {
    let text = std::fs::read_to_string(from).unwrap();
    let head = text.lines().next().unwrap();
    let place = head.split(',').position(|name| name == column).unwrap();
    let cell = |line: &str| line.split(',').nth(place).unwrap().to_string();
    let mut before: Vec<String> = text.lines().skip(1).map(cell).collect();
    before.splice(0..0, std::iter::repeat_n(before[0].clone(), rows));
    let mut lines = vec![head.to_string()];
    for (line, value) in text.lines().skip(1).zip(before) {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells[place] = &value;
        lines.push(cells.join(","));
    }
    std::fs::write(to, lines.join("\n")).unwrap();
}

/// One sensor has an offset of 5 bar or a scale error of 4 %. It is isolated, and no key is proposed,
/// because the sensor on the other side of the open valve contradicts it. A wrong load shows in both
/// sensors and is no sensor fault.
#[test]
fn a_sensor_fault_is_isolated_and_a_wrong_load_is_none() {
    let path = files("sensors");
    let (log, off) = (path("log.csv"), path("off.csv"));
    printed(&["simulate", "--speed-mm-s", "120", "--log", &log]);
    let head = std::fs::read_to_string(&log).unwrap().lines().next().unwrap().to_string();
    let column = head.split(',').find(|name| name.starts_with("pressure_a")).unwrap().to_string();
    for (change, wanted, mapping) in [
        (
            &(|bar| bar + 5.0) as &dyn Fn(f64) -> f64,
            "A constant offset of its sensor by +5.0",
            "add -5.0",
        ),
        (
            &|bar| 1.04 * bar,
            "A scale of its sensor that is wrong by +4.0",
            "scale and offset times 0.961",
        ),
    ] {
        changed(&log, &off, &column, &column, change);
        let text = printed(&["validate", "--log", &off]);
        let line = text.lines().find(|line| line.starts_with("p_A: ")).unwrap();
        assert!(line.contains(wanted) && line.contains(mapping), "{line}");
        assert!(line.contains("p_PA does not show it"), "{line}");
        assert!(!text.contains("each key on its own"), "{text}");
    }
    // a motor speed delayed relative to all other signals is one delay, not several advanced sensors
    late(&log, &off, "motor_speed_rpm", 2);
    let text = printed(&["validate", "--log", &off]);
    assert!(text.contains("motor speed: 20.0 ms late relative to x_cyl"), "{text}");
    assert!(!text.contains("delay of sensor") && !text.contains("each key on its own"), "{text}");
    let text = printed(&["validate", "--set", "payload.mass_kg=280", "--log", &log]);
    assert!(!text.contains("of its sensor"), "{text}");
    assert_eq!(text.matches("each key on its own").count(), 1, "{text}");
    let advice = text.lines().find(|line| line.contains("each key on its own")).unwrap();
    assert_eq!(advice.matches("payload.mass_kg").count(), 1, "{advice}");
}

/// Numbers without a unit in MPa and rad/s: assumed to be bar and rpm by their magnitude, and suspected
/// because of the crane's expected values.
#[test]
fn wrongly_guessed_units_are_suspected_by_magnitude() {
    let path = files("guessed-units");
    let (log, one, both) = (path("log.csv"), path("one.csv"), path("both.csv"));
    printed(&["simulate", "--speed-mm-s", "120", "--log", &log]);
    let head = std::fs::read_to_string(&log).unwrap().lines().next().unwrap().to_string();
    let column =
        |begins: &str| head.split(',').find(|name| name.starts_with(begins)).unwrap().to_string();
    let (pressure, motor) = (column("pressure_a"), column("motor_speed"));
    changed(&log, &one, &pressure, "pressure_a", |bar| 0.1 * bar);
    changed(&one, &both, &motor, "motor_speed", |rpm| rpm * std::f64::consts::TAU / 60.0);
    let suspicions = |log: &str| {
        let found = parsed(&["log", "inspect", log, "--json"]);
        let all = found["suspicions"].as_array().unwrap().iter();
        all.map(|text| text.as_str().unwrap().to_string()).collect::<Vec<_>>().join("; ")
    };
    let text = suspicions(&both);
    assert!(text.contains("is it in MPa?") && text.contains("is it in rad/s?"), "{text}");
    assert_eq!(suspicions(&log), "");
    // in bar and rpm the assumption is right
    changed(&log, &one, &pressure, "pressure_a", |bar| bar);
    changed(&one, &both, &motor, "motor_speed", |rpm| rpm);
    assert_eq!(suspicions(&both), "");
}

/// The paper's crane with another load, without noise, with free delays and offsets of the channels: a load
/// that is 35 % lighter is found.
#[test]
fn a_load_35_percent_lighter_is_identified() {
    is_found_or_called_local("another-load", 200.0);
}

/// An almost empty hook, whose pressure is in the soft range of the oil, may be beyond a local minimum: then
/// nothing is called determined, and the wider search is named.
#[test]
#[ignore = "campaign"]
fn campaign_an_empty_hook_is_identified_or_the_search_called_local() {
    is_found_or_called_local("empty-hook", 60.0);
}

fn is_found_or_called_local(folder: &str, mass: f64) {
    let log = files(folder)("log.csv");
    let set = format!("payload.mass_kg={mass}");
    printed(&["simulate", "--set", &set, "--speed-mm-s", "120", "--log", &log]);
    let text = printed(&["tune", "--log", &log, "--to-s", "9", "--free", "payload.mass_kg"]);
    let row = text.lines().find(|line| line.starts_with("payload.mass_kg")).unwrap();
    let numbers: Vec<f64> = row.split_whitespace().filter_map(|n| n.parse().ok()).collect();
    let [_, found, low, high] = numbers[..4] else { panic!("{row}") };
    let is_found = (found - mass).abs() < 1.0 && low < mass && mass < high;
    let is_called_local = text.contains("NOT right") && text.contains("--generations 20");
    assert!(is_found || (mass < 200.0 && is_called_local), "{mass}: {text}");
    assert_eq!(row.contains("yes"), is_found, "{row}");
}
