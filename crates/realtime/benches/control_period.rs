//! What a control period costs: `cargo bench -p hydroboom-realtime`.
//!
//! A cycle is run several times, alike to the bit, and each of its periods counts with the shortest time that it ever took: what a
//! hypervisor or another program takes away falls on other periods each time, what the law itself needs does not. In one thread with the
//! virtual crane, whose steps leave the caches colder than a core of its own has them.

use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_realtime::lockstep::{Disturbance, Lockstep};
use hydroboom_realtime::machine::Incoming;
use hydroboom_realtime::operator::Operator;
use std::error::Error;
use std::time::Instant;

/// How often the cycle is run.
const TIMES: usize = 9;

/// Takes the time from when a reading comes in to when the simulation's steps are due: the control task.
struct Stopwatch {
    started: Instant,
    took: Vec<f64>,
}

impl Disturbance for Stopwatch {
    fn reading(&mut self, incoming: Incoming) -> Option<Incoming> {
        self.started = Instant::now();
        Some(incoming)
    }
    fn steps(&mut self, due: u32) -> u32 {
        self.took.push(self.started.elapsed().as_secs_f64() * 1e6);
        due
    }
}

/// Time of every period of one cycle \[us\].
fn cycle(strategy: Strategy) -> Result<Vec<f64>, Box<dyn Error>> {
    let model = Description::uia_single_boom()?;
    let machine = Description::uia_virtual()?;
    let motion = machine.motion(model.numbers.fast);
    let mut run = Lockstep::new(&model, &machine, motion, strategy)?;
    let mut operator = Operator::automatic(model.numbers.control_period);
    let mut watch = Stopwatch { started: Instant::now(), took: Vec::new() };
    while !operator.is_done() {
        run.disturbed_period(&mut operator, strategy, &mut watch)?;
    }
    Ok(watch.took)
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("{:32}{:>10}{:>10}{:>10}   [us]", "", "p50", "p99.9", "worst");
    for strategy in Strategy::ALL {
        let mut least = cycle(strategy)?;
        for _ in 1..TIMES {
            for (least, took) in least.iter_mut().zip(cycle(strategy)?) {
                *least = least.min(took);
            }
        }
        least.sort_by(f64::total_cmp);
        let share = |share: f64| least[(share * (least.len() - 1) as f64) as usize];
        println!(
            "{:32}{:10.2}{:10.2}{:10.2}",
            strategy.name(),
            share(0.5),
            share(0.999),
            share(1.0)
        );
    }
    Ok(())
}
