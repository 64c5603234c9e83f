//! What a load that changes leaves of a scenario's error whoever controls, on the nonlinear crane, beside what benchmark and scheduled LQR have, on cranes of the family.
//! Along references that are not known ahead `hydroboom bounds` says so.
//!
//! `floors -- payload-change 24` for the first 24 cranes of seed 1, or load-in-motion; without a number for 16.

mod pull;

use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::LabError;
use hydroboom_lab::closed_loop::monte_carlo::{Percentiles, member};
use hydroboom_lab::closed_loop::scenario::{Course, CourseChoice};
use hydroboom_lab::{motion_test::Run, motion_test::run};
use pull::{Home, Knows};
use rayon::prelude::*;
use std::error::Error;

type Failure = Box<dyn Error + Send + Sync>;

const SEED: u64 = 1;
/// Without a number.
const CRANES: u64 = 16;

/// A crane along a course, and a run under the scheduled LQR.
struct Case {
    crane: Description,
    course: Box<dyn Course>,
    scheduled: Run,
}

/// A motor that turns no faster than so many times the benchmark's is as good as that.
const TWENTIETH: f64 = 1.05;
/// What is left with such a motor.
const WITHIN: &str = "so within 1.05";
/// The same once the change shows.
const SHOWN_WITHIN: &str = "shown, in 1.05";
/// And braked by that motor, too.
const BRAKED: &str = "and braked";
const SCHEDULED: &str = "scheduled LQR";
const BENCHMARK: &str = "benchmark";

/// An error \[m\]: root of its mean square, and the farthest.
#[derive(Clone, Copy)]
struct Left {
    rms: f64,
    farthest: f64,
}

impl From<&Run> for Left {
    fn from(run: &Run) -> Self {
        Self { rms: run.rms(), farthest: run.metrics().peak().abs() }
    }
}

/// What is left at best, by name, of a crane whose motor turns at `most` \[rev/s\] under the benchmark.
fn floors(case: &Case, most: f64) -> Result<Vec<(&'static str, Left)>, Failure> {
    if case.course.loads().is_empty() {
        let name = case.course.name();
        return Err(
            format!("no load changes along {name}: `hydroboom bounds --scenario {name}`").into()
        );
    }
    let speed = case.crane.numbers.motor_speed;
    let within = speed.min(TWENTIETH * most);
    Ok(vec![
        ("at best", pull::left(case, speed, Knows::AtOnce, Home::Stopped)?),
        (WITHIN, pull::left(case, within, Knows::AtOnce, Home::Stopped)?),
        ("once it shows", pull::left(case, speed, Knows::OnceItShows, Home::Stopped)?),
        (SHOWN_WITHIN, pull::left(case, within, Knows::OnceItShows, Home::Stopped)?),
        (BRAKED, pull::left(case, within, Knows::OnceItShows, Home::Braked)?),
    ])
}

/// What a crane of the family has along a course.
struct Row {
    /// Names of what is left, by whom, and what is.
    columns: Vec<(&'static str, Left)>,
    /// Its largest motor speed under the scheduled LQR over that under the benchmark.
    motor: f64,
}

impl Row {
    fn of(model: &Description, crane: Description, scenario: &str) -> Result<Self, Failure> {
        let course = CourseChoice::Scenario(scenario.into()).of(&crane)?;
        let along =
            |strategy| -> Result<Run, LabError> { run(model, &crane, strategy, course.as_ref()) };
        let benchmark = along(Strategy::BenchmarkClosedLoop)?;
        let scheduled = along(Strategy::ScheduledLqr)?;
        let [most, own] =
            [&benchmark, &scheduled].map(|run| run.metrics().effort().motor_speed_rpm / 60.0);
        let [benchmark, left] = [&benchmark, &scheduled].map(Left::from);
        let case = Case { crane, course, scheduled };
        let mut columns = floors(&case, most)?;
        columns.extend([(SCHEDULED, left), (BENCHMARK, benchmark)]);
        Ok(Self { columns, motor: own / most })
    }

    /// RMS of what is left under that name over the benchmark's; none where there is none of it.
    fn over_benchmark(&self, name: &str) -> Option<f64> {
        let rms =
            |name| self.columns.iter().find(|(own, _)| *own == name).map(|(_, left)| left.rms);
        Some(rms(name)? / rms(BENCHMARK)?)
    }
}

/// Prints RMS over the benchmark's, of each column.
fn print_spreads<'a>(rows: impl Iterator<Item = &'a Row> + Clone) {
    let Some(first) = rows.clone().next() else { return };
    for (name, _) in &first.columns {
        let over = rows.clone().filter_map(|row| row.over_benchmark(name));
        let Percentiles { median, p95, worst, .. } = Percentiles::of(over);
        println!("{name:>15}  {median:.2} {p95:.2} {worst:.2}");
    }
}

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let scenario = arguments.next().ok_or("which scenario? `floors -- payload-change 24`, say")?;
    let count = match arguments.next() {
        Some(number) => {
            number.parse().map_err(|_| format!("`{number}` is no number of cranes: 24, say"))?
        }
        None => CRANES,
    };
    let model = Description::uia_single_boom()?;
    let nominal = Description::uia_virtual()?;
    let one = |number| Row::of(&model, member(&nominal, SEED, number)?.crane, &scenario);
    let rows: Vec<_> = (0..count).into_par_iter().map(one).collect::<Result<_, _>>()?;
    let Some(first) = rows.first() else { return Ok(()) };
    let names: String = first.columns.iter().map(|(name, _)| format!(" {name:>15}")).collect();
    println!("RMS, farthest [mm] {names}   motor over the benchmark's");
    for (number, row) in rows.iter().enumerate() {
        let left = |(_, Left { rms, farthest }): &(_, Left)| {
            format!(" {:>7.2} {:>7.1}", 1e3 * rms, 1e3 * farthest)
        };
        let left: String = row.columns.iter().map(left).collect();
        println!("crane {number:<12} {left}   {:.3}", row.motor);
    }
    println!("RMS over the benchmark's in the median, at the 95th percentile, at most:");
    print_spreads(rows.iter());
    let within = |row: &Row| row.over_benchmark(WITHIN);
    let beyond = rows.iter().filter(|row| within(row).is_some() && row.motor > TWENTIETH);
    let behind = |row: &&Row| within(row) > row.over_benchmark(SCHEDULED);
    let (beyond_count, behind) = (beyond.clone().count(), beyond.clone().filter(behind).count());
    if beyond_count > 0 {
        println!(
            "on the {beyond_count} whose motor turns beyond 1.05 of the benchmark's, which on {behind} nobody equals within it:"
        );
        print_spreads(beyond);
    }
    Ok(())
}
