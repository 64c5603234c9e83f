//! Tables of `hydroboom design`.

use super::cells::{Rows, fixed, number, row, significant};
use serde_json::Value;

/// Stability margins over the stroke.
pub fn margins(printed: &Value) -> Rows {
    // of all positions, with a printed count of digits
    let over_stroke = |controller: &str, key: &str, text: fn(f64) -> String| {
        let positions = printed["positions"].as_array().unwrap().iter();
        let all: Vec<f64> = positions.map(|position| number(&position[controller][key])).collect();
        let least = all.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        format!("{} to {}", text(least), text(largest))
    };
    let both = |words: &str, key: &str, unit: &str, text: fn(f64) -> String| {
        let of = |controller: &str| format!("{}{unit}", over_stroke(controller, key, text));
        row([words, &of("scheduled_lqr"), &of("benchmark")])
    };
    vec![
        row(["margin", "scheduled LQR", "benchmark"]),
        both("phase margin", "phase_deg", " degrees", |value| format!("{value:.0}")),
        both("gain margin, a factor of", "gain", "", |value| significant(value, 2)),
        both("modulus margin", "modulus_margin", "", |value| format!("{value:.2}")),
    ]
}

/// Payloads of the table of gains \[kg\]: the paper's, 250 to 370 kg, and the range of its crane file.
pub const PAYLOADS_KG: [[f64; 2]; 3] = [[307.0, 307.0], [250.0, 370.0], [0.0, 370.0]];

/// Gains of the benchmark as printed and as designed, with the largest sensitivity and its margins.
pub fn benchmark_gains(printed: &Value) -> Rows {
    let gains = |words: &str, of: &Value, three: bool| {
        let text = |key: &str| match three {
            true => significant(number(&of["gains"][key]), 3),
            false => number(&of["gains"][key]).to_string(),
        };
        let feedback = number(&of["gains"]["pressure_feedback_m3_per_spa"]);
        let mut cells = row([
            words,
            &text("proportional_per_s"),
            &text("integral_per_s2"),
            &format!("{feedback:.2e}"),
            &text("high_pass_s"),
        ]);
        let worst = &of["worst"];
        cells.extend(match worst["stable"] == true {
            true => [
                fixed(&worst["sensitivity_peak"], 2),
                fixed(&worst["phase_deg"], 0),
                fixed(&worst["gain"], 1),
            ],
            false => ["unstable", "", ""].map(String::from),
        });
        cells
    };
    let [paper, narrow, whole] = [&printed[0], &printed[1], &printed[2]];
    vec![
        row([
            "crane, payloads [kg]",
            "K_p [1/s]",
            "K_i [1/s²]",
            "k_f [m³/(s Pa)]",
            "tau [s]",
            "M_s",
            "phase margin [deg]",
            "gain margin",
        ]),
        gains("the paper's, 307: as printed", &paper["own"], false),
        gains("the same, designed", &paper["design"], true),
        gains("the paper's, 250 to 370, designed", &narrow["design"], true),
        gains("the paper's, 0 to 370: as printed", &whole["own"], false),
        gains("the same, designed", &whole["design"], true),
    ]
}
