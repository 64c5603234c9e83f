//! Instructions per integration step, a measure that other programs on the computer do not affect: `cargo
//! bench -p hydroboom-lab --bench instructions`. Needs valgrind.
//!
//! The program runs itself under valgrind with two numbers of steps. The difference is due to the steps
//! alone.

use hydroboom_description::Description;
use hydroboom_model::stepping::{Implicit, published};
use hydroboom_model::{Crane, CraneState, Input};
use std::error::Error;
use std::hint::black_box;
use std::process::Command;

type Step = fn(&Crane<f64, 3>, CraneState<f64, 3>, u64) -> CraneState<f64, 3>;

const STEPS: [(&str, Step); 2] = [("published", run_published), ("implicit", run_implicit)];
const INPUT: Input<f64> = Input { pump_speed: 10.0, holding_valve: 1.0 };

fn run_published(
    crane: &Crane<f64, 3>,
    mut state: CraneState<f64, 3>,
    n: u64,
) -> CraneState<f64, 3> {
    for _ in 0..n {
        published(crane, &mut state, black_box(&INPUT), 50e-6);
    }
    state
}

fn run_implicit(
    crane: &Crane<f64, 3>,
    mut state: CraneState<f64, 3>,
    n: u64,
) -> CraneState<f64, 3> {
    let scheme = Implicit::new(crane);
    for _ in 0..n {
        scheme.step(crane, &mut state, black_box(&INPUT), 50e-6);
    }
    state
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    if let [_, flag, name, count] = &arguments[..]
        && flag == "--steps"
    {
        let description = Description::uia_single_boom()?;
        let crane = description.crane::<3>()?;
        let start = crane.at_rest(&description.start(0.25))?;
        let (_, step) = STEPS.iter().find(|(known, _)| known == name).ok_or("no such scheme")?;
        black_box(step(&crane, start, count.parse()?));
        return Ok(());
    }
    for (name, _) in STEPS {
        let per_step = (collected(name, 2000)? - collected(name, 1000)?) / 1000.0;
        println!("{name}: {per_step:.0} instructions per step");
    }
    Ok(())
}

/// Instructions of the whole program with the given number of steps.
fn collected(name: &str, steps: u32) -> Result<f64, Box<dyn Error>> {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(std::env::current_exe()?)
        .args(["--steps", name, &steps.to_string()])
        .output()
        .map_err(|error| format!("valgrind is needed (apt-get install valgrind): {error}"))?;
    let said = String::from_utf8_lossy(&output.stderr);
    let count = said
        .lines()
        .find_map(|line| line.split_once("Collected :"))
        .ok_or_else(|| format!("valgrind counted nothing:\n{said}"))?;
    Ok(count.1.trim().parse()?)
}
