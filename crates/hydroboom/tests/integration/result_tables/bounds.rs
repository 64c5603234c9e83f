//! Tables of `hydroboom bounds`.

use super::cells::{Rows, entry, number, row, significant};
use serde_json::{Value, json};

/// Lower bounds of the tracking error with each limit, and with all others.
pub fn limits(printed: &Value) -> Rows {
    let found = &printed["bounds"];
    let condition =
        |name: &str| number(&entry(&found["conditions"], &[("name", json!(name))])["value"]);
    let three = |value: &Value| significant(number(value), 3);
    let range = entry(&found["conditions"], &[("name", json!("payload unknown by (std)"))]);
    let range = range["source"].as_str().unwrap().replace("uniform from ", "");
    let limited = |limit: &str, words: &str, kind: &str| {
        let of = entry(&found["limits"], &[("limit", json!(limit))]);
        row([words, &three(&of["alone_mm"]), &three(&of["all_others_mm"]), kind])
    };
    let disturbed = "bound under the stated disturbances";
    let speed = format!("motor speed, {:.0} rpm", condition("largest motor speed"));
    let slew = format!("motor slew rate, {:.0} rpm/s", condition("motor slew rate"));
    let delay = format!("delay, {:.1} ms", condition("delay from position to motor"));
    let noise = format!(
        "sensor noise, {:.4} mm and {:.3} bar",
        condition("position noise"),
        condition("load pressure noise")
    );
    vec![
        row(["limit", "this alone [mm]", "all but this [mm]", "kind"]),
        row(["none", &three(&found["none_mm"]), "", "exact"]),
        limited("motor-speed", &speed, "bound of the linearised crane"),
        limited("slew", &slew, "bound of the linearised crane"),
        limited("delay", &delay, disturbed),
        limited("sensor-noise", &noise, disturbed),
        limited("unknown-payload", &format!("unknown payload, {range}"), disturbed),
        row(["all", &three(&found["all_mm"]), "", ""]),
        row(["all, not known ahead", &three(&found["not_known_ahead_mm"]), "", "estimate"]),
        row(["feedforward alone", &three(&found["feedforward_mm"]), "", "estimate"]),
    ]
}

/// Errors of the strategies over the bound with all limits.
pub fn over_the_bound(printed: &Value) -> Rows {
    let strategies = [
        ("velocity feedforward", "velocity-feedforward"),
        ("simulation feedforward, open loop", "simulation-feedforward-open-loop"),
        ("benchmark, closed loop", "benchmark-closed-loop"),
        ("simulation feedforward, closed loop", "simulation-feedforward-closed-loop"),
        ("scheduled LQR", "scheduled-lqr"),
    ];
    let of_strategy = strategies.map(|(words, strategy)| {
        let of = entry(&printed["strategies"], &[("strategy", json!(strategy))]);
        let three = |key: &str| significant(number(&of[key]), 3);
        row([words, &three("rms_true_mm"), &three("over_bound")])
    });
    let head = row(["strategy", "RMS true [mm]", "over the bound"]);
    std::iter::once(head).chain(of_strategy).collect()
}
