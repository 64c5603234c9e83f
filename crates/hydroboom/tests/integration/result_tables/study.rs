//! Tables of `hydroboom study`.

use super::cells::{Rows, entry, fixed, listed, number, row, two_digits};
use serde_json::{Value, json};

/// Tracking errors in the study.
fn tracking<'a>(study: &'a Value, plant: &str, strategy: &str, speed_mm_s: f64) -> &'a Value {
    let wanted =
        [("plant", json!(plant)), ("strategy", json!(strategy)), ("speed_mm_s", json!(speed_mm_s))];
    entry(&study["motion"], &wanted)
}

/// Results with the published model, beside the paper's.
pub fn published_model(study: &Value) -> Rows {
    let feedforward = |words: &str, speed_mm_s: f64| {
        let errors = tracking(study, "nominal", "velocity-feedforward", speed_mm_s);
        let pair = |rms: &str, peak: &str| {
            format!("{} / {}", fixed(&errors[rms], 2), fixed(&errors[peak], 2))
        };
        let paper = format!("{} (measured)", pair("paper_rms_mm", "paper_peak_mm"));
        row([words, &paper, &pair("rms_measured_mm", "peak_measured_mm")])
    };
    let modes = |key: &str| {
        let [a, b, c] = [0, 1, 2].map(|k| &study["eigenfrequency"][k][key]);
        listed(&[a, b, c], 2)
    };
    let oscillation = |key: &str| fixed(&study[key], 2);
    vec![
        row(["", "paper", "here"]),
        feedforward("velocity feedforward at 25 mm/s, RMS / peak [mm]", 25.0),
        feedforward("the same at 120 mm/s", 120.0),
        row([
            "locked-valve eigenfrequency at 100, 200, 400 mm [Hz]",
            &format!("{} (simulated)", modes("paper_simulated_hz")),
            &modes("frictionless_hz"),
        ]),
        row([
            "p_A oscillation with the valve open [Hz]",
            &format!("{} (simulated)", oscillation("paper_pressure_oscillation_hz")),
            &format!("{}, not fitted", oscillation("pressure_oscillation_hz")),
        ]),
    ]
}

/// Errors of the strategies on the virtual crane at 120 mm/s.
pub fn virtual_crane(study: &Value) -> Rows {
    let strategies = [
        ("simulation feedforward, open loop", "simulation-feedforward-open-loop"),
        ("benchmark (PI, velocity feedforward, pressure feedback)", "benchmark-closed-loop"),
        ("simulation feedforward, closed loop", "simulation-feedforward-closed-loop"),
        ("scheduled LQR (ours)", "scheduled-lqr"),
    ];
    let of_strategy = strategies.map(|(words, strategy)| {
        let errors = tracking(study, "virtual", strategy, 120.0);
        let error = |key: &str| {
            let decimals = if number(&errors[key]) < 0.1 { 3 } else { 2 };
            fixed(&errors[key], decimals)
        };
        let paper = match errors["paper_rms_mm"].is_null() {
            true => String::new(),
            false => error("paper_rms_mm"),
        };
        row([words, &paper, &error("rms_measured_mm"), &error("rms_true_mm")])
    });
    let head = row(["strategy", "paper, measured", "measured", "true"]);
    std::iter::once(head).chain(of_strategy).collect()
}

/// Errors with the pressure feedback acting on the load pressure, and on its deviation from the simulated one.
pub fn double_damping(study: &Value) -> Rows {
    let laws = |words: &str, plant: &str, kind: &str| {
        let found = entry(&study["double_damping"], &[("plant", json!(plant))]);
        let cells = ["benchmark", "damped_twice", "damped_once"].map(|law| {
            let error = |name: &str| &found[law][format!("{name}_{kind}_mm").as_str()];
            format!("{} / {}", fixed(error("rms"), 3), fixed(error("peak"), 2))
        });
        std::iter::once(words.to_string()).chain(cells).collect()
    };
    vec![
        row(["", "benchmark, E", "published, E'", "pressure feedback on p - p_s, E''"]),
        laws("model equal to plant", "nominal", "measured"),
        laws("virtual crane", "virtual", "measured"),
        laws("virtual crane, true", "virtual", "true"),
    ]
}

/// Largest errors of p_A by integration scheme and step.
pub fn step_errors(study: &Value) -> Rows {
    let steps = [
        ("implicit, 0.5 ms (default)", "implicit", 500.0),
        ("implicit, 1 ms", "implicit", 1000.0),
        ("implicit, 2 ms", "implicit", 2000.0),
        ("published, 50 us", "published", 50.0),
    ];
    let of_step = steps.map(|(words, scheme, step_us)| {
        let error = |excitation: &str| {
            let wanted = [
                ("excitation", json!(excitation)),
                ("scheme", json!(scheme)),
                ("step_us", json!(step_us)),
            ];
            let point = entry(&study["work_precision"], &wanted);
            format!("{} bar", two_digits(number(&point["pressure_error_bar"])))
        };
        row([words, &error("motion"), &error("speed-steps")])
    });
    let head = row([
        "",
        "first 2 s of the motion at 120 mm/s, ramped",
        "motor's speed in steps: 0, that of 120 mm/s out, back, 0, each 0.5 s",
    ]);
    std::iter::once(head).chain(of_step).collect()
}

/// Results that the calibration of the virtual crane does not use.
pub fn not_calibrated(study: &Value) -> Rows {
    let peaks = |signals: &[&str], key: &str| {
        let of = |signal: &&str| &entry(&study["differences"], &[("signal", json!(*signal))])[key];
        listed(&signals.iter().map(of).collect::<Vec<_>>(), 2)
    };
    let compared = |words: &str, signals: &[&str]| {
        row([words, &peaks(signals, "paper_peak"), &peaks(signals, "virtual_peak")])
    };
    let open_loop = |words: &str, speed_mm_s: f64| {
        let errors = tracking(study, "virtual", "simulation-feedforward-open-loop", speed_mm_s);
        let pair = |rms: &str, peak: &str| {
            format!("{} / {}", fixed(&errors[rms], 2), fixed(&errors[peak], 2))
        };
        let measured = pair("rms_measured_mm", "peak_measured_mm");
        let here = format!("{measured}, true {}", pair("rms_true_mm", "peak_true_mm"));
        row([words, &pair("paper_rms_mm", "paper_peak_mm"), &here])
    };
    let closed_loop = |key: &str| {
        let of =
            |speed| &tracking(study, "virtual", "simulation-feedforward-closed-loop", speed)[key];
        listed(&[of(25.0), of(120.0)], 2)
    };
    vec![
        row(["", "paper", "virtual crane"]),
        compared("peak of x_cyl [mm]", &["x_cyl"]),
        compared("peaks of p_A, p_PA [bar]", &["p_A", "p_PA"]),
        compared("peaks of p_B, p_PB, p_acc [bar]", &["p_B", "p_PB", "p_acc"]),
        open_loop("simulation feedforward, open loop, RMS / peak measured at 25 mm/s [mm]", 25.0),
        open_loop("the same at 120 mm/s [mm]", 120.0),
        row([
            "simulation feedforward, closed loop, RMS measured at 25, 120 mm/s [mm]",
            &closed_loop("paper_rms_mm"),
            &format!("{}, true {}", closed_loop("rms_measured_mm"), closed_loop("rms_true_mm")),
        ]),
    ]
}
