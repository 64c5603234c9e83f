//! What is left of a scenario's error whoever controls, beside what benchmark and model following have, on cranes of the family.
//!
//! `floors -- start-stop 24` for the first 24 cranes of seed 1, or another scenario; without a number for 16.

mod full_speed;
mod pull;
mod spring;

use hydroboom_description::Description;
use hydroboom_lab::LabError;
use hydroboom_lab::family::{Spread, member};
use hydroboom_lab::motion_test::{Run, Strategy, run};
use hydroboom_lab::scenario::{Course, CourseChoice};
use rayon::prelude::*;
use std::error::Error;

type Failure = Box<dyn Error + Send + Sync>;

const SEED: u64 = 1;
/// Without a number.
const CRANES: u64 = 16;

/// A crane along a course, and how model following steers it.
struct Case {
    model: Description,
    crane: Description,
    course: Box<dyn Course>,
    following: Run,
}

/// An error \[m\]: root of its mean square, and the farthest.
#[derive(Clone, Copy)]
struct Left {
    rms: f64,
    farthest: f64,
}

impl From<&Run> for Left {
    fn from(run: &Run) -> Self {
        Self { rms: run.rms(), farthest: run.score().peak().abs() }
    }
}

/// What is left at best, and by what that is reckoned: a scenario in which loads change, one that is faster than the motor, or another.
fn floor(case: &Case, scenario: &str) -> Result<Left, Failure> {
    match scenario {
        _ if !case.course.loads().is_empty() => pull::left(case),
        "saturation" => full_speed::left(case),
        _ => spring::left(case),
    }
}

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let scenario = arguments.next().ok_or("which scenario? `floors -- start-stop 24`, say")?;
    let count = match arguments.next() {
        Some(number) => {
            number.parse().map_err(|_| format!("`{number}` is no number of cranes: 24, say"))?
        }
        None => CRANES,
    };
    let model = Description::uia_single_boom()?;
    let nominal = Description::uia_virtual()?;
    let choice = CourseChoice::Scenario(scenario.clone());
    let one = |number: u64| -> Result<[Left; 3], Failure> {
        let crane = member(&nominal, SEED, number)?.crane;
        let course = choice.of(&crane)?;
        let of =
            |strategy| -> Result<Run, LabError> { run(&model, &crane, strategy, course.as_ref()) };
        let benchmark = Left::from(&of(Strategy::BenchmarkClosedLoop)?);
        let following = of(Strategy::ModelFollowing)?;
        let own = Left::from(&following);
        let best = floor(&Case { model: model.clone(), crane, course, following }, &scenario)?;
        Ok([best, benchmark, own])
    };
    let rows: Vec<_> = (0..count).into_par_iter().map(one).collect::<Result<_, _>>()?;
    println!("RMS, farthest [mm] {:>15} {:>15} {:>15}", "at best", "benchmark", "model following");
    for (number, row) in rows.iter().enumerate() {
        let [best, benchmark, own] =
            row.map(|left| format!("{:>7.2} {:>7.1}", 1e3 * left.rms, 1e3 * left.farthest));
        println!("crane {number:<12} {best:>15} {benchmark:>15} {own:>15}");
    }
    println!("RMS over the benchmark's in the median, at the 95th percentile, at most:");
    for (name, of) in [("at best", 0), ("model following", 2)] {
        let Spread { median, p95, worst, .. } =
            Spread::of(rows.iter().map(|row| row[of].rms / row[1].rms));
        println!("{name:>15}  {median:.2} {p95:.2} {worst:.2}");
    }
    Ok(())
}
