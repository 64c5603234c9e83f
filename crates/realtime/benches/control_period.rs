//! Execution time of a control period: `cargo bench -p hydroboom-realtime`.
//!
//! A cycle is run several times, bit-identical, and each of its periods counts with its shortest time.
//! Interruptions by a hypervisor or another program hit other periods each time, so that the minimum is the
//! time of the controller itself. Controller and virtual crane share one thread, which leaves the caches
//! colder than a core of its own would.
//!
//! Below the strategies are the parts of the scheduled LQR, each alone with the measurements of a cycle
//! with a payload change at full speed. The controller then predicts alternatives (rollout), which makes
//! its longest periods.

use hydroboom_control::controller::Controller;
use hydroboom_control::estimation::tip::TipMemory;
use hydroboom_control::reference::preview::Preview;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;
use hydroboom_design::tip::tip_estimator;
use hydroboom_realtime::control_task::Record;
use hydroboom_realtime::lockstep::{Disturbance, Lockstep};
use hydroboom_realtime::machine::Incoming;
use hydroboom_realtime::operator::Operator;
use hydroboom_realtime::trouble::{Tampering, Trouble};
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

/// Number of repetitions of the cycle.
const TIMES: usize = 9;

/// Measures the time from the arrival of a measurement to the request for simulation steps: the control
/// task.
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

/// Time of the payload change \[s of the course\], interval after it in which the rollout is expected
/// \[s\], and new payload over the first.
const LOAD_CHANGE: f64 = 4.0;
const ROLLOUT: f64 = 0.5;
const PAYLOAD: f64 = 0.7;

/// Records of a cycle under the scheduled LQR with a payload change, in the periods in which it controls.
fn disturbed_cycle() -> Result<Vec<Record>, Box<dyn Error>> {
    let (model, machine) = (Description::uia_single_boom()?, Description::uia_virtual()?);
    let motion = machine.motion(model.numbers.fast);
    let strategy = Strategy::ScheduledLqr;
    let mut run = Lockstep::new(&model, &machine, motion, strategy)?;
    let mut operator = Operator::automatic(model.numbers.control_period);
    let (mut trouble, mut records) = (Trouble::new(&machine), Vec::new());
    let mut is_hung = false;
    while !operator.is_done() {
        let record = run.disturbed_period(&mut operator, strategy, &mut trouble)?;
        trouble.pass();
        let Some(time) = record.course_time else { continue };
        records.push(record);
        if time >= LOAD_CHANGE && !is_hung {
            is_hung = true;
            trouble.tamper(Tampering::Payload(PAYLOAD * machine.numbers.payload));
        }
    }
    Ok(records)
}

/// Parts of a period under the scheduled LQR.
const PARTS: [&str; 5] =
    ["  estimator", "  law", "  law after a load change, rollout", "  preview", "  tip"];

/// Time of every period of each part \[us\].
fn parts(records: &[Record]) -> Result<[Vec<f64>; PARTS.len()], Box<dyn Error>> {
    let (model, machine) = (Description::uia_single_boom()?, Description::uia_virtual()?);
    let motion = machine.motion(model.numbers.fast);
    let mut controller = scheduled_lqr_controller(&model)?;
    let mut preview = Preview::new(model.numbers.control_period, |after| motion.reference(after));
    let mut took = [const { Vec::new() }; PARTS.len()];
    let (mut command, tip) = (0.0, tip_estimator(&model));
    let mut memory = TipMemory::default();
    let us = |since: Instant| since.elapsed().as_secs_f64() * 1e6;
    for record in records {
        let (measurement, time) = (&record.measurement, record.course_time.unwrap_or(0.0));
        let started = Instant::now();
        preview.advance(|after| motion.reference(time + after));
        took[3].push(us(started));
        let started = Instant::now();
        controller.observe(measurement, command);
        let observed = us(started);
        if controller.law_state().is_some() {
            took[0].push(observed);
        }
        if let (Some(tip), Some(estimated)) = (&tip, controller.estimated()) {
            let filter = &controller.estimator().filter;
            let started = Instant::now();
            tip.update(&mut memory, filter, &estimated.filter);
            black_box(tip.estimate(&memory, &filter.model, &estimated.filter));
            took[4].push(us(started));
        }
        let started = Instant::now();
        black_box(controller.update(measurement, &preview, None));
        let is_rollout = (LOAD_CHANGE..LOAD_CHANGE + ROLLOUT).contains(&time);
        took[if is_rollout { 2 } else { 1 }].push(us(started));
        command = record.decision.command.motor_speed;
    }
    Ok(took)
}

/// Minimum per period.
fn keep_least(least: &mut [f64], took: impl IntoIterator<Item = f64>) {
    for (least, took) in least.iter_mut().zip(took) {
        *least = least.min(took);
    }
}

fn print(name: &str, mut times: Vec<f64>) {
    times.sort_by(f64::total_cmp);
    let share = |share: f64| times[(share * (times.len() - 1) as f64) as usize];
    println!("{name:36}{:10.2}{:10.2}{:10.2}", share(0.5), share(0.999), share(1.0));
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("{:36}{:>10}{:>10}{:>10}   [us]", "", "p50", "p99.9", "worst");
    for strategy in Strategy::ALL {
        let mut least = cycle(strategy)?;
        for _ in 1..TIMES {
            keep_least(&mut least, cycle(strategy)?);
        }
        print(strategy.name(), least);
    }
    let records = disturbed_cycle()?;
    let mut least = parts(&records)?;
    for _ in 1..TIMES {
        for (least, took) in least.iter_mut().zip(parts(&records)?) {
            keep_least(least, took);
        }
    }
    PARTS.iter().zip(least).for_each(|(name, times)| print(name, times));
    Ok(())
}
