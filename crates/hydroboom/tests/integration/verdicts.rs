//! Verdicts on loops: an unstable one is reported, and its numbers are no results.

use crate::support::command::{fails_with, folder, hydroboom, parsed};

/// Printed text; the command must succeed.
fn printed(arguments: &[&str]) -> String {
    let output = hydroboom(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A third of the payload leaves the load on soft oil, for which the paper's gains are too high.
const LIGHT: [&str; 2] = ["--set", "payload.mass_kg=100"];

#[test]
fn design_reports_an_unstable_loop_without_margins() {
    let text = printed(&[&["design"], &LIGHT[..]].concat());
    assert!(
        text.contains("benchmark: the closed loop is UNSTABLE at 25 to 475 mm, 19 of 19 positions"),
        "{text}"
    );
    assert!(!text.contains("scheduled LQR: the closed loop is UNSTABLE"), "{text}");
    let json = parsed(&[&["design", "--json"], &LIGHT[..]].concat());
    assert_eq!(json["stable"], false);
    let position = &json["positions"][2];
    assert_eq!(position["benchmark"]["stable"], false);
    assert!(position["benchmark"]["phase_deg"].is_null(), "{position}");
    assert_eq!(position["scheduled_lqr"]["stable"], true);
    let folder = folder("unstable-design");
    printed(&[&["design", "--out", folder.to_str().unwrap()], &LIGHT[..]].concat());
    let page = std::fs::read_to_string(folder.join("design.html")).unwrap();
    assert!(page.contains(r#"<td class="unstable">unstable</td>"#), "no cell says so");
    // the paper's crane is stable, and no text says otherwise
    let text = printed(&["design"]);
    assert!(!text.to_lowercase().contains("unstable"), "{text}");
    assert_eq!(parsed(&["design", "--json"])["stable"], true);
}

#[test]
fn motion_prints_no_error_of_a_run_in_sustained_oscillation() {
    let text = printed(&[&["motion", "--gains-as-given"], &LIGHT[..]].concat());
    let row = |strategy: &str| text.lines().find(|line| line.starts_with(strategy)).unwrap();
    assert_eq!(row("benchmark-closed-loop").matches("unstable").count(), 2, "{text}");
    assert!(!row("scheduled-lqr").contains("unstable"), "{text}");
    assert!(text.contains("UNSTABLE, in sustained oscillation of "), "{text}");
    let json = parsed(&[&["motion", "--gains-as-given", "--json"], &LIGHT[..]].concat());
    let rows = json["motion"].as_array().unwrap();
    let of = |strategy: &str| rows.iter().find(|row| row["strategy"] == strategy).unwrap();
    let oscillation = &of("benchmark-closed-loop")["sustained_oscillation"];
    assert_eq!(of("benchmark-closed-loop")["stable"], false);
    assert!(oscillation["amplitude_mm"].as_f64() > Some(2.0), "{oscillation}");
    let hz = oscillation["frequency_hz"].as_f64().unwrap();
    assert!((0.2..5.0).contains(&hz), "{hz} Hz");
    assert_eq!(of("scheduled-lqr")["stable"], true);
}

/// Text on standard error; the command must succeed.
fn warned(arguments: &[&str]) -> String {
    let output = hydroboom(arguments);
    let printed = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{printed}");
    printed
}

#[test]
fn check_warns_of_soft_oil_unstable_gains_and_a_load_beyond_the_boom() {
    let text = warned(&[&["check"], &LIGHT[..]].concat());
    assert!(text.contains("soft range: its bulk modulus is "), "{text}");
    assert!(text.contains("benchmark: the closed loop is UNSTABLE"), "{text}");
    let json = parsed(&[&["check", "--json"], &LIGHT[..]].concat());
    assert_eq!(json["stable"], false);
    assert_eq!(json["warnings"].as_array().unwrap().len(), 2, "{json}");
    // a motor that is too weak is reported by its torque, and by nothing else
    let text = warned(&["check", "--set", "drive.max_torque_nm=9"]);
    assert!(text.contains("the motor does not lift the load: "), "{text}");
    // stable, with smaller margins than tuned gains have
    let text = warned(&["check", "--set", "controller.integral_per_s2=30"]);
    assert!(
        text.contains("benchmark: its gains leave too little margin with 307 kg: M_s = "),
        "{text}"
    );
    assert!(!text.contains("UNSTABLE"), "{text}");
    let text = warned(&["check", "--set", "payload.x_mm=9000"]);
    assert!(text.contains("beyond the boom: payload.x_mm = 9000, and boom.length_mm = 3600"));
    assert!(!text.contains("soft range"), "{text}");
    // the paper's crane has no warning
    assert_eq!(warned(&["check"]), "");
}

/// Each limit lies between the load of the file's own values and the heaviest of its ranges, or below the pressure
/// that the supervision allows: the machine would be stopped later.
#[test]
fn check_warns_of_limits_that_the_heaviest_load_reaches() {
    let heaviest = parsed(&["check", "--json"])["load_pressure_bar"][2].as_f64().unwrap();
    assert!((100.0..200.0).contains(&heaviest), "{heaviest} bar");
    for (set, warning) in [
        ("supervision.pressure_bar=90", "supervision.pressure_bar = 90.0 stops the machine: "),
        ("sensors.pressure_span_bar=50", "sensors.pressure_span_bar = 50.0 is less than "),
        ("drive.max_torque_nm=15", "drive.max_torque_nm = 15.0 does not lift the heaviest load"),
    ] {
        let text = warned(&["check", "--set", set]);
        assert!(text.contains(warning), "{text}");
        assert_eq!(text.matches("warning: ").count(), 1, "{text}");
    }
    // an empty hook leaves the load on soft oil, although the nominal payload does not
    assert!(printed(&["check"]).contains("the oil is soft: its bulk modulus is "));
}

/// Payload at 9 m: with the lags of drive and fieldbus the scheduled LQR is stable. On the ideal plant that
/// `motion` uses without --plant it is not. Each command reports both, and the row of the table is marked.
#[test]
fn commands_report_with_which_lags_they_close_the_loop() {
    let far = ["--set", "payload.x_mm=9000"];
    for text in
        [printed(&[&["design"], &far[..]].concat()), warned(&[&["check"], &far[..]].concat())]
    {
        assert!(!text.contains("scheduled LQR: the closed loop is UNSTABLE"), "{text}");
        let remark = "with an ideal drive and no delay, as `motion` and `study` run a crane without a plant, the \
            closed loop of the scheduled LQR is UNSTABLE";
        assert!(text.contains(remark), "{text}");
        // and what to do about it
        for remedy in ["motion --plant virtual", "scheduled_lqr.command_tolerance_mm_s"] {
            assert!(text.contains(remedy), "{text}");
        }
    }
    let text = printed(&[&["motion", "--gains-as-given"], &far[..]].concat());
    let lqr = "scheduled LQR: the closed loop is UNSTABLE";
    let line = text.lines().find(|line| line.starts_with(lqr)).unwrap();
    assert!(line.ends_with("with an ideal drive and no delay)"), "{line}");
    assert!(text.contains("expect, as `design` and `check` judge it"), "{text}");
    let rows: Vec<&str> = text.lines().filter(|line| line.starts_with("scheduled-lqr")).collect();
    assert!(rows.len() == 2 && rows.iter().all(|row| row.contains("(!)")), "{text}");
    let forward = text.lines().filter(|line| line.starts_with("velocity-feedforward"));
    assert!(forward.clone().count() == 2 && !forward.clone().any(|row| row.contains("(!)")));
}

/// The input has no limit, so that a motor that is too slow has to be reported.
#[test]
fn simulate_warns_of_a_motor_beyond_its_largest_speed() {
    let run = ["simulate", "--hold-s", "0.5", "--motor-speed-rpm", "600", "--start-mm", "200"];
    let slow = ["--set", "motor.max_speed_rpm=500"];
    let text = warned(&[&run[..], &slow].concat());
    assert!(text.contains("up to 600 rpm, more than motor.max_speed_rpm = 500"), "{text}");
    assert_eq!(warned(&run), "");
    let json = parsed(&[&run[..], &["--json"]].concat());
    assert!((json["largest_motor_speed_rpm"].as_f64().unwrap() - 600.0).abs() < 1e-9, "{json}");
    let at_end = json["outputs"]["pressure_a"]["value"].as_f64().unwrap() * 1e-5;
    assert!(json["peak_pressure_bar"].as_f64().unwrap() >= at_end, "{json}");
    let text = printed(&run);
    assert!(text.contains("largest motor speed 600 rpm, peak pressure "), "{text}");
}

#[test]
fn linearise_begins_at_mid_stroke_and_warns_of_a_motor_beyond_its_largest_speed() {
    let of = |arguments: &[&str]| parsed(&[&["linearise", "--json"], arguments].concat());
    let at = |json: &serde_json::Value| json["stroke_mm"].as_f64().unwrap();
    assert!((at(&of(&["--set", "cylinder.stroke_mm=600"])) - 300.0).abs() < 1e-6);
    assert_eq!(of(&[])["A"], of(&["--stroke-mm", "250"])["A"]);
    let text =
        warned(&["linearise", "--motor-speed-rpm", "900", "--set", "motor.max_speed_rpm=800"]);
    assert!(text.contains("is beyond motor.max_speed_rpm = 800"), "{text}");
    assert_eq!(warned(&["linearise", "--motor-speed-rpm", "800"]), "");
}

#[test]
fn linearise_reports_the_dead_band_and_proposes_a_point_outside() {
    let json = parsed(&["linearise", "--stroke-mm", "250", "--json"]);
    assert_eq!(json["in_dead_band"], true);
    let remark = json["remark"].as_str().unwrap();
    let offered: Vec<&str> = remark
        .split("hydroboom ")
        .nth(1)
        .unwrap()
        .split(',')
        .next()
        .unwrap()
        .split_whitespace()
        .collect();
    let there = parsed(&[&offered[..], &["--json"]].concat());
    assert_eq!(there["in_dead_band"], false, "{remark}");
    // leakage raises the accumulator's pressure while the cylinder is shut, the faster the smaller it is
    let growth = |litres: &str| {
        let set = format!("accumulator.volume_l={litres}");
        let json = parsed(&["linearise", "--stroke-mm", "250", "--json", "--set", &set]);
        let remark = json["remark"].as_str().unwrap();
        let (_, rest) = remark.split_once("The growing real pole of ").expect(remark);
        rest.split(' ').next().unwrap().parse::<f64>().unwrap()
    };
    let ratio = growth("5") / growth("10");
    assert!((ratio - 2.0).abs() < 0.1, "{ratio}");
    // one second after the motor's start the load still oscillates: the poles apply to one instant
    assert!(there["remark"].as_str().unwrap().contains("The motion is not steady"), "{there}");
    let swing = there["pressure_change_bar"].as_f64().unwrap();
    assert!(swing > 0.02 * there["pressure_a_bar"].as_f64().unwrap(), "{there}");
    // a held load is not in the dead band
    assert_eq!(parsed(&["linearise", "--valve", "0", "--json"])["in_dead_band"], false);
}

#[test]
fn eigen_shows_the_linearised_mode_and_lists_failed_strokes() {
    let json =
        parsed(&["eigen", "--set", "cylinder.piston_mm=100", "--stroke-mm", "100,700", "--json"]);
    let [row] = &json["eigenfrequency"].as_array().unwrap()[..] else { panic!("{json}") };
    let of = |name: &str| row[name].as_f64().unwrap();
    assert!((of("frictionless_hz") / of("linearised_hz") - 1.0).abs() < 0.02, "{row}");
    assert_eq!(json["failed"][0]["stroke_mm"], 700.0);
    let text = printed(&["eigen", "--set", "payload.mass_kg=60"]);
    assert!(text.contains("At 400 mm friction ends the oscillation"), "{text}");
    assert!(text.contains("6.386"), "{text}");
    assert!(
        text.contains("trapped rod-side pressure is 34.5 bar (oscillation.rod_side_bar)"),
        "{text}"
    );
}

/// The virtual crane has ten segments and an elastic base: its last angle belongs to the base.
#[test]
fn eigen_names_the_angle_of_the_base() {
    let file = format!("{}/../../cranes/uia-virtual.toml", env!("CARGO_MANIFEST_DIR"));
    let text = printed(&["eigen", "--crane", &file, "--stroke-mm", "200"]);
    assert!(text.contains("angles of the segments, and of the base"), "{text}");
    assert!(!printed(&["eigen", "--stroke-mm", "200"]).contains("of the base"));
}

#[test]
fn stiff_bristles_take_substeps_or_are_refused() {
    let stiff = ["--set", "friction.law=lugre", "--set", "friction.bristle_stiffness_n_per_mm=3e5"];
    let run = ["simulate", "--speed-mm-s", "120", "--scheme", "published"];
    assert!(printed(&[&run[..], &stiff].concat()).contains("substeps per step: 3"));
    let checked = parsed(&[&["check", "--json"], &stiff[..]].concat());
    let limit = &checked["at_rest"][1]["step_limit_us"]["bristle"];
    assert!((5.0..36.0).contains(&limit.as_f64().unwrap()), "{limit}");
    let folder = folder("stiff-bristles");
    for target in ["c", "st"] {
        let arguments = ["export", target, "--out", folder.to_str().unwrap()];
        fails_with(&hydroboom(&[&arguments[..], &stiff].concat()), "2 g/(sigma_0 |v|)");
    }
}

#[test]
fn another_crane_is_compared_with_a_benchmark_that_is_tuned_for_it() {
    let json = parsed(&[&["motion", "--json"], &LIGHT[..]].concat());
    let remark = json["remark_on_gains"].as_str().unwrap();
    assert!(remark.contains("the file's gains are not tuned for this comparison"), "{remark}");
    for unit in [" 1/s, K_i = ", " 1/s2, k_f = ", " m3/(s Pa), tau = ", " s, by `hydroboom design"]
    {
        assert!(remark.contains(unit), "{unit}: {remark}");
    }
    assert_eq!(json["stable"], true, "{json}");
    let rows = json["motion"].as_array().unwrap();
    let rms = |strategy: &str| {
        let of = rows.iter().filter(|row| row["strategy"] == strategy);
        of.map(|row| row["rms_true_mm"].as_f64().unwrap()).collect::<Vec<_>>()
    };
    let pairs = rms("benchmark-closed-loop").into_iter().zip(rms("velocity-feedforward"));
    pairs.for_each(|(tuned, without)| assert!(tuned < 0.5 * without, "{tuned} mm"));
    // the paper's crane keeps the paper's gains for any plant
    let json = parsed(&["motion", "--plant-set", "payload.mass_kg=330", "--json"]);
    assert_eq!(json["benchmark_gains"]["proportional_per_s"], 4.5);
    assert!(json["remark_on_gains"].is_null());
}

#[test]
fn designed_gains_are_written_with_their_provenance() {
    let folder = folder("designed-gains");
    let [made, tuned] = ["crane.toml", "tuned.toml"].map(|name| folder.join(name));
    let [made, tuned] = [&made, &tuned].map(|path| path.to_str().unwrap());
    printed(&["new", made]);
    let designed = parsed(&[
        "design",
        "--benchmark",
        "--crane",
        made,
        "--payload-kg",
        "80:150",
        "--crane-out",
        tuned,
        "--json",
    ]);
    // a new file has gains designed for its numbers
    let shown = parsed(&["show", "--crane", made, "--json"]);
    let mut keys = shown["keys"].as_array().unwrap().iter();
    let key = keys.find(|key| key["key"] == "controller.proportional_per_s").unwrap();
    assert_eq!(key["provenance"], "placeholder");
    assert!(key["source"].as_str().unwrap().contains("hydroboom design --benchmark"), "{key}");
    let new = parsed(&["design", "--benchmark", "--crane", made, "--json"]);
    assert_eq!(new["own"]["worst"]["stable"], true, "{new}");
    assert_eq!(new["own"]["gains"], new["design"]["gains"]);
    let head = std::fs::read_to_string(made).unwrap();
    assert!(head.starts_with("# provenance \"placeholder\": the number is that of "), "{head}");
    // `motion` replaces these gains; `run` uses them and says so
    let run = ["run", "--simulated-time", "--crane", made, "--strategy", "benchmark-closed-loop"];
    let warned = warned(&run);
    assert!(warned.contains("not tuned for payloads of 307 to 307 kg (they are placeholders)"));
    // the file's gains are designed for all payloads; those of the comparison allow higher gains, which the
    // retuned baseline uses
    let motion = ["motion", "--scenario", "small-moves", "--crane", made, "--json"];
    let of = |motion: &serde_json::Value| motion["benchmark_gains"]["proportional_per_s"].as_f64();
    let compared = parsed(&motion);
    assert!(compared["remark_on_gains"].as_str().unwrap().contains("they are placeholders"));
    let given = parsed(&[&motion[..], &["--gains-as-given"]].concat());
    assert_eq!(of(&given), new["own"]["gains"]["proportional_per_s"].as_f64());
    assert!(of(&compared) > of(&given), "{:?} {:?}", of(&compared), of(&given));
    let worst = &designed["design"]["worst"];
    assert_eq!(worst["stable"], true);
    assert!(worst["sensitivity_peak"].as_f64() < Some(1.72), "{worst}");
    let shown = parsed(&["show", "--crane", tuned, "--json"]);
    let key = shown["keys"].as_array().unwrap().iter();
    let key = key.clone().find(|key| key["key"] == "controller.integral_per_s2").unwrap();
    assert_eq!(key["value"], designed["design"]["gains"]["integral_per_s2"], "{key}");
    assert_eq!(key["provenance"], "designed");
    assert!(key["source"].as_str().unwrap().contains("payloads of 80 to 150 kg"), "{key}");
}

#[test]
fn a_file_of_overrides_is_refused_as_a_crane_file() {
    for name in ["double-mass", "half-mass", "off-model", "other-lever"] {
        let file = format!("{}/../../cranes/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        for command in ["check", "design", "eigen", "linearise"] {
            let refused = hydroboom(&[command, "--crane", &file]);
            fails_with(&refused, "is a list of overrides, and no crane file");
            assert!(String::from_utf8_lossy(&refused.stderr).lines().count() < 8);
        }
    }
}
