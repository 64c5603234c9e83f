//! Execution time of a control period of the exported scheduled LQR in C: `cargo bench -p hydroboom-export --bench
//! scheduled_lqr`. A course on the virtual crane is recorded and replayed several times. The minimum over the replays
//! of each period removes interference by other processes; the largest minimum is the worst case of the controller.

#![expect(clippy::unwrap_used, reason = "a measurement that cannot be set up has failed")]
#![allow(dead_code, reason = "the tests use more of what it shares with them")]

#[path = "../tests/integration/evaluator/mod.rs"]
mod evaluator;
#[path = "../tests/integration/recording/mod.rs"]
mod recording;

use hydroboom_export::c::{Precision, files};
use hydroboom_export::scheduled_lqr_controller;
use recording::{From, cranes, names, nothing, plain, recorded};
use std::process::Command;

/// Number of replays.
const ROUNDS: usize = 20;

/// Prints the least time \[ns\] of each period.
const MAIN: &str = r#"
#include "controller.h"
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
static hb_scheduled_lqr_controller_state s;
static hb_scheduled_lqr_controller_output y;
int main(int count, char **arguments)
{
    const size_t numbers = sizeof(hb_scheduled_lqr_controller_input) / sizeof(hb_real);
    const long periods = count > 1 ? atol(arguments[1]) : 0;
    hb_real *given = malloc((size_t)periods * numbers * sizeof *given);
    double *least = malloc((size_t)periods * sizeof *least);
    size_t i;
    long k;
    int round;
    for (i = 0; i < (size_t)periods * numbers; i++) {
        double value;
        if (fread(&value, sizeof value, 1, stdin) != 1) {
            return 1;
        }
        given[i] = (hb_real)value;
    }
    for (round = 0; round < ROUNDS; round++) {
        hb_scheduled_lqr_controller_start(&s);
        for (k = 0; k < periods; k++) {
            const hb_scheduled_lqr_controller_input *u =
                (const hb_scheduled_lqr_controller_input *)(given + (size_t)k * numbers);
            struct timespec a, b;
            double time;
            clock_gettime(CLOCK_MONOTONIC, &a);
            hb_scheduled_lqr_controller_update(&s, u, &y);
            clock_gettime(CLOCK_MONOTONIC, &b);
            time = (double)(b.tv_sec - a.tv_sec) * 1e9 + (double)(b.tv_nsec - a.tv_nsec);
            least[k] = round == 0 || time < least[k] ? time : least[k];
        }
    }
    for (k = 0; k < periods; k++) {
        printf("%.0f\n", least[k]);
    }
    return 0;
}
"#;

fn main() {
    println!(
        "preview | precision | options | median | 99.9 % | worst | worst while the rollout decides [us]"
    );
    println!("---|---|---|---|---|---|---");
    // without a preview feedback saturates at the beginning of a ramp, and the rollout is active
    [800, 0].into_iter().for_each(measured);
}

/// Measures the course with a preview of `length` control periods.
fn measured(length: usize) {
    let (model, _) = cranes();
    let (recording, outcome) = recorded(&plain(&model), length, nothing, (From::PowerUp, 12_000));
    assert!(outcome.is_controlled());
    let folder = std::env::temp_dir().join(format!("hydroboom-bench-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let numbers: Vec<u8> =
        recording.given.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
    std::fs::write(folder.join("given"), numbers).unwrap();
    let place = names().iter().position(|name| name == "lqr_rollout_is_evaluating").unwrap();
    let evaluating = |k: &usize| recording.wanted[*k][place] > 0.5;
    for (precision, options) in [
        (Precision::Double, &["-mfma", "-mavx2"][..]),
        (Precision::Double, &[]),
        (Precision::Single, &["-mfma", "-mavx2"]),
    ] {
        let block = scheduled_lqr_controller(&model).unwrap();
        let made = files(&[block], "controller", precision).unwrap();
        std::fs::write(folder.join("controller.h"), made.header).unwrap();
        std::fs::write(folder.join("controller.c"), made.source).unwrap();
        let main = MAIN.replace("ROUNDS", &ROUNDS.to_string());
        std::fs::write(folder.join("main.c"), main).unwrap();
        let status = Command::new("cc")
            .current_dir(&folder)
            .args(["-std=gnu99", "-O2", "-ffp-contract=off"])
            .args(options)
            .args(["controller.c", "main.c", "-lm", "-o", "program"])
            .status()
            .unwrap();
        assert!(status.success());
        let output = Command::new(folder.join("program"))
            .arg(recording.given.len().to_string())
            .stdin(std::fs::File::open(folder.join("given")).unwrap())
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stdout);
        let times: Vec<f64> =
            text.lines().map(|line| 1e-3 * line.parse::<f64>().unwrap()).collect();
        assert_eq!(times.len(), recording.given.len());
        let of_rollout = (0..times.len()).filter(evaluating).map(|k| times[k]).fold(0.0, f64::max);
        let mut sorted = times;
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
        println!(
            "{length} | {precision:?} | {} | {:.1} | {:.1} | {:.1} | {of_rollout:.1}",
            options.join(" "),
            at(0.5),
            at(0.999),
            at(1.0)
        );
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
