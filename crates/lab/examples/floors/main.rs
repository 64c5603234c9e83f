//! Lower bounds of the error due to load changes for any controller, on the nonlinear crane. They are
//! compared with the errors of benchmark controller and scheduled LQR on cranes of the family. For
//! references that are not known ahead `hydroboom bounds` gives the bounds.
//!
//! `floors -- payload-change 24` runs the first 24 cranes of seed 1; the other scenario is load-in-motion.
//! The default is 16 cranes.

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
/// Default number of cranes.
const CRANES: u64 = 16;

/// Crane, course, and a run under the scheduled LQR.
struct Case {
    crane: Description,
    course: Box<dyn Course>,
    scheduled: Run,
}

/// Largest motor speed over the benchmark's that counts as equal to it.
const TWENTIETH: f64 = 1.05;
/// Name of the bound with that motor speed.
const WITHIN: &str = "so within 1.05";
/// The same with detection of the change by its measured effect.
const SHOWN_WITHIN: &str = "shown, in 1.05";
/// The same with braking by the motor.
const BRAKED: &str = "and braked";
const SCHEDULED: &str = "scheduled LQR";
const BENCHMARK: &str = "benchmark";

/// Error \[m\]: RMS and largest magnitude.
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

/// Lower bounds of the error, by name; `most` is the crane's largest motor speed \[rev/s\] under the
/// benchmark controller.
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

/// Results of a crane along a course.
struct Row {
    /// Errors by name of the bound or controller.
    columns: Vec<(&'static str, Left)>,
    /// Largest motor speed under the scheduled LQR over that under the benchmark controller.
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

    /// RMS error of a column over the benchmark's; none if there is no such column.
    fn over_benchmark(&self, name: &str) -> Option<f64> {
        let rms =
            |name| self.columns.iter().find(|(own, _)| *own == name).map(|(_, left)| left.rms);
        Some(rms(name)? / rms(BENCHMARK)?)
    }
}

/// Prints median, 95th percentile and maximum of the RMS error over the benchmark's for each column.
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
