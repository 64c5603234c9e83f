//! What a load that changes leaves of the error whoever controls. A crane is steered by model following up to the change; from that very instant, as if
//! it had been known, the motor is told all its speed against the pull, and as soon as the piston is pulled no farther it counts as back
//! for the rest of the course. Nothing that turns this motor has less. Beside it what benchmark and model following have, and how far the piston is
//! pulled off.
//!
//! `load_floor -- payload-change 32` for the first 32 cranes of seed 1, or `load-in-motion`; without a number for 16.

use hydroboom_description::Description;
use hydroboom_lab::LabError;
use hydroboom_lab::family::member;
use hydroboom_lab::motion_test::{Run, Strategy, run};
use hydroboom_lab::scenario::{Course, CourseChoice};
use hydroboom_virtual_crane::VirtualCrane;
use rayon::prelude::*;
use std::error::Error;

type Failure = Box<dyn Error + Send + Sync>;

const SEED: u64 = 1;
const CRANES: u64 = 16;
/// A pull is over once the piston is nearer by this than it was \[m\].
const NEARER: f64 = 1e-3;
/// It is over by then \[s\].
const LONGEST: f64 = 2.0;

/// Sum of squares \[m²\] over the samples in which the piston is pulled off by the change of the given number, and how far it is \[m\]; led until then as in
/// a run.
fn pull(
    crane: &Description,
    course: &dyn Course,
    led: &Run,
    number: usize,
) -> Result<[f64; 2], Failure> {
    let change = course.loads()[number];
    let mut machine = VirtualCrane::new(crane, &crane.start(course.reference(0.0).position))?;
    let mut loads = course.loads()[..=number].iter().peekable();
    let mut mass = crane.numbers.payload;
    let mut against = 0.0;
    let [mut square, mut farthest, mut begins] = [0.0; 3];
    for sample in &led.samples {
        let error = sample.reference.position - machine.truth().outputs.stroke;
        while let Some(load) = loads.next_if(|load| load.time <= sample.time) {
            against = if load.mass > mass { 1.0 } else { -1.0 };
            mass = load.mass;
            machine.set_payload(mass)?;
            (begins, farthest) = (error, 0.0);
        }
        let mut command = sample.command;
        if sample.time >= change.time {
            command.motor_speed = against * crane.numbers.motor_speed;
            let pulled: f64 = against * (error - begins);
            if pulled < farthest - NEARER || sample.time > change.time + LONGEST {
                break;
            }
            farthest = farthest.max(pulled);
            square += pulled.max(0.0).powi(2);
        }
        machine.advance(&command)?;
    }
    Ok([square, farthest])
}

/// Root of the mean square, and how far the piston is pulled off at most \[mm\]: at best, and under each of two strategies.
fn compared(
    model: &Description,
    crane: &Description,
    choice: &CourseChoice,
) -> Result<[[f64; 2]; 3], Failure> {
    let course = choice.of(crane)?;
    let of = |strategy| -> Result<Run, LabError> { run(model, crane, strategy, course.as_ref()) };
    let [benchmark, own] = [of(Strategy::BenchmarkClosedLoop)?, of(Strategy::ModelFollowing)?];
    let [mut square, mut farthest] = [0.0, 0.0_f64];
    for number in 0..course.loads().len() {
        let [more, far] = pull(crane, course.as_ref(), &own, number)?;
        square += more;
        farthest = farthest.max(far);
    }
    let best = [(square / own.samples.len() as f64).sqrt(), farthest];
    let steered = [benchmark, own].map(|run| [run.rms(), run.score().peak().abs()]);
    Ok([best, steered[0], steered[1]].map(|pair| pair.map(|error| 1e3 * error)))
}

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let scenario = arguments.next().unwrap_or_else(|| "payload-change".into());
    let count = arguments.next().map_or(Ok(CRANES), |number| number.parse())?;
    let model = Description::uia_single_boom()?;
    let nominal = Description::uia_virtual()?;
    let choice = CourseChoice::Scenario(scenario);
    let one = |number| compared(&model, &member(&nominal, SEED, number)?.crane, &choice);
    let rows: Vec<_> = (0..count).into_par_iter().map(one).collect::<Result<_, _>>()?;
    println!("RMS, farthest [mm]     at best      benchmark   model following");
    for (number, row) in rows.iter().enumerate() {
        let [best, benchmark, following] =
            row.map(|[rms, farthest]| format!("{rms:>6.2} {farthest:>6.1}"));
        println!("crane {number:>3}      {best:>14} {benchmark:>14} {following:>17}");
    }
    println!("RMS of the benchmark's, in the median, at the 95th percentile, at most:");
    for (name, of) in [("at best", 0), ("model following", 2)] {
        let mut shares: Vec<_> = rows.iter().map(|row| row[of][0] / row[1][0]).collect();
        shares.sort_by(f64::total_cmp);
        let last = shares.len().saturating_sub(1) as f64;
        let at =
            |share: f64| shares.get((share * last).round() as usize).copied().unwrap_or(f64::NAN);
        println!("{name:>16}  {:.2} {:.2} {:.2}", at(0.5), at(0.95), at(1.0));
    }
    Ok(())
}
