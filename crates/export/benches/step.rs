//! Execution time of a simulation step in generated C and in Rust: `cargo bench -p hydroboom-export`. Both run in turn,
//! so that other processes disturb both alike; the minima are compared.

#![expect(clippy::unwrap_used, reason = "a measurement that cannot be set up has failed")]

use hydroboom_description::Description;
use hydroboom_export::c::{Precision, files};
use hydroboom_export::crane_model;
use hydroboom_model::Input;
use hydroboom_model::stepping::published;
use std::process::Command;
use std::time::Instant;

const STEPS: u32 = 200_000;
const ROUNDS: u32 = 20;

/// Prints the time of a step \[ns\].
const MAIN: &str = r#"
#include "crane.h"
#include <stdio.h>
#include <time.h>
int main(void)
{
    hb_model_parameters p;
    hb_model_prepared c;
    hb_model_state s;
    hb_model_input u;
    struct timespec a, b;
    long k;
    hb_model_describe(&p);
    hb_model_prepare(&p, &c);
    hb_model_start(&s);
    u.step = 50e-6;
    u.holding_valve = 1.0;
    clock_gettime(CLOCK_MONOTONIC, &a);
    for (k = 0; k < STEPS; k++) {
        u.pump_speed = 10.0 * (double)(k & 1023) / 1024.0;
        hb_model_step(&c, &s, &u);
    }
    clock_gettime(CLOCK_MONOTONIC, &b);
    printf("%.3f\n", ((double)(b.tv_sec - a.tv_sec) * 1e9 + (double)(b.tv_nsec - a.tv_nsec)) / STEPS);
    return s.gas_volume > 0.0 ? 0 : 1;
}
"#;

fn main() {
    let description = Description::uia_single_boom().unwrap();
    let folder = std::env::temp_dir().join(format!("hydroboom-bench-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let made = files(&[crane_model(&description).unwrap()], "crane", Precision::Double).unwrap();
    std::fs::write(folder.join("crane.h"), made.header).unwrap();
    std::fs::write(folder.join("crane.c"), made.source).unwrap();
    std::fs::write(folder.join("main.c"), MAIN.replace("STEPS", &format!("{STEPS}L"))).unwrap();
    for options in [&["-mfma"][..], &[]] {
        let status = Command::new("cc")
            .current_dir(&folder)
            .args(["-std=gnu99", "-O2", "-ffp-contract=off"])
            .args(options)
            .args(["crane.c", "main.c", "-lm", "-o", "program"])
            .status()
            .unwrap();
        assert!(status.success());
        let (mut rust, mut c) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..ROUNDS {
            rust = rust.min(in_rust(&description));
            let output = Command::new(folder.join("program")).output().unwrap();
            c = c.min(String::from_utf8_lossy(&output.stdout).trim().parse().unwrap());
        }
        println!("a step in Rust {rust:.1} ns, in C {c:.1} ns {options:?}: {:.2} times", c / rust);
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Time of a step \[ns\].
fn in_rust(description: &Description) -> f64 {
    let crane = description.crane::<3>().unwrap();
    let n = &description.numbers;
    let mut state = crane.at_rest(&description.start_over(n, n.motion_start)).unwrap();
    let begin = Instant::now();
    for k in 0..STEPS {
        let pump_speed = 10.0 * f64::from(k & 1023) / 1024.0;
        published(&crane, &mut state, &Input { pump_speed, holding_valve: 1.0 }, 50e-6);
    }
    let time = begin.elapsed().as_secs_f64() * 1e9 / f64::from(STEPS);
    assert!(state.circuit.gas_volume > 0.0);
    time
}
