//! Tables of `hydroboom export count`.

use super::cells::{Rows, entry, row};
use serde_json::{Value, json};

/// Operations of the exported blocks.
pub fn operations(printed: &Value) -> Rows {
    let flops = |block: &str, call: &str| {
        let found = entry(printed, &[("block", json!(block)), ("call", json!(call))]);
        found["flops"].to_string()
    };
    let update = |block: &str| flops(block, "update");
    vec![
        row(["block", "state", "step [flop]"]),
        row([
            "whole crane (`model`)",
            "6 angles and velocities, bristle, 5 pressures, gas volume",
            &flops("model", "step"),
        ]),
        row([
            "`hydraulic_model`",
            "bristle, 5 pressures, gas volume",
            &flops("hydraulic_model", "step"),
        ]),
        row(["`flexible_boom`", "6 angles and velocities", &flops("flexible_boom", "step")]),
        row([
            "`benchmark_controller`",
            "state of the frame (phase, release, monitors), integral, low-passed pressure",
            &format!("{} a period", update("benchmark_controller")),
        ]),
        row([
            "`scheduled_lqr_controller`",
            "state of the frame, estimator, regulator, reference of the last 0.3 s",
            &format!(
                "{} a period at most: a rollout that samples and predicts in one period",
                update("scheduled_lqr_controller")
            ),
        ]),
        row([
            "`simulation_feedforward`",
            "state of `benchmark_controller`, of the simulated crane and of its controller",
            &format!(
                "{} a period, {} a step",
                update("simulation_feedforward"),
                flops("simulation_feedforward", "step")
            ),
        ]),
    ]
}

/// Numbers of the exported scheduled LQR.
pub fn memory(printed: &Value) -> Rows {
    let wanted = [("block", json!("scheduled_lqr_controller")), ("call", json!("update"))];
    let block = entry(printed, &wanted);
    let of = |words: &str, key: &str| {
        let count = block[key].as_u64().unwrap();
        row([words, &count.to_string(), &(8 * count).to_string()])
    };
    vec![row(["", "numbers", "bytes"]), of("state", "states"), of("input", "inputs")]
}
