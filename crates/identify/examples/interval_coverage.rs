//! Coverage of the 95 % intervals of `tune` on logs of virtual cranes: the plant with its equipment, which
//! contains effects that the model omits.
//!
//! Each draw is a crane of the widened family (oil, wear, air, friction, drive, beam, base, volumes,
//! sensors, fieldbus). Its payload is within 10 % of the value in the model's file. Its fast motion is
//! logged. The paper's crane, with friction that holds at rest, is tuned to the log as by `hydroboom tune`.
//!
//! ```sh
//! # seed, first crane, crane after the last; `brief` for half the stroke and rests of a second, as in the tests
//! cargo run --release -p hydroboom-identify --example interval_coverage -- 2031 0 100
//! cargo run --release -p hydroboom-identify --example interval_coverage -- 2031 0 100 brief
//! ```

#![expect(clippy::unwrap_used, reason = "an example that cannot set up has failed")]

#[path = "../tests/integration/made/draws.rs"]
mod draws;

use draws::{Course, KEYS, coverage};

fn main() {
    let arguments: Vec<u64> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let [seed, from, to] = arguments[..] else {
        eprintln!("interval_coverage SEED FROM TO [brief]");
        std::process::exit(2);
    };
    let course = match std::env::args().any(|argument| argument == "brief") {
        true => Course::Brief,
        false => Course::OfFile,
    };
    let rows = coverage(seed, from..to, course);
    println!(
        "| key | determined: holds the truth | not determined: holds | called biased: holds | mean deviation | why biased |"
    );
    println!("|---|---|---|---|---|---|");
    for (key, row) in KEYS.iter().zip(&rows) {
        let of = |[all, holds]: [u32; 2]| match all {
            0 => "-".to_string(),
            _ => format!("{holds} of {all}"),
        };
        let all = row.determined[0] + row.open[0] + row.biased[0];
        println!(
            "| {key} | {} | {} | {} | {:.1} % | {} |",
            of(row.determined),
            of(row.open),
            of(row.biased),
            100.0 * row.deviations / f64::from(all.max(1)),
            row.reason
        );
    }
}
