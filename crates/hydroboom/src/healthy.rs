//! `hydroboom faults --healthy`: false-alarm test on courses of healthy virtual cranes.

use crate::interruptible::{Interruptible, of_requested};
use crate::output;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::closed_loop::monte_carlo::member;
use hydroboom_lab::closed_loop::scenario::{CourseChoice, scenarios};
use hydroboom_realtime::healthy::{HealthyRun, healthy_run};
use miette::{IntoDiagnostic, Result};
use rayon::prelude::*;
use serde_json::json;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Number of cycles after which the scenario of a shift is ended.
const SHIFT_CYCLES: f64 = 20.0;
/// Name of that scenario.
const SHIFT: &str = "shift";

/// Trajectory that is ended early.
struct ShortenedTrajectory {
    path: Arc<dyn Trajectory>,
    /// Time of its end \[s\].
    duration: f64,
}

impl Trajectory for ShortenedTrajectory {
    fn reference(&self, time: f64) -> SetPoint<f64> {
        self.path.reference(time)
    }
    fn duration(&self) -> f64 {
        self.duration
    }
    fn speed(&self) -> f64 {
        self.path.speed()
    }
}

/// Course of a crane under a strategy.
struct Job {
    /// Number of the crane in its family.
    number: u64,
    course: CourseChoice,
    strategy: Strategy,
}

/// Runs the cranes of a family, given by count and seed, under strategies along every course, and prints the stops. An
/// interrupted run prints the courses so far.
///
/// # Errors
///
/// If a crane cannot be built or simulated.
pub fn run(
    model: &Description,
    nominal: &Description,
    (count, seed): (u64, u64),
    strategies: &[Strategy],
    json: bool,
) -> Result<()> {
    let strategies: Vec<Strategy> = match strategies.is_empty() {
        true => {
            vec![Strategy::BenchmarkClosedLoop, Strategy::SimulationFeedforwardClosedLoop]
        }
        false => strategies.to_vec(),
    };
    let n = &nominal.numbers;
    let mut courses = vec![CourseChoice::Motion(n.slow), CourseChoice::Motion(n.fast)];
    courses.extend(scenarios(nominal).iter().map(|s| CourseChoice::Scenario(s.name.into())));
    let mut jobs = Vec::new();
    for number in 0..count {
        for strategy in &strategies {
            jobs.extend(courses.iter().map(|c| Job {
                number,
                course: c.clone(),
                strategy: *strategy,
            }));
        }
    }
    let progress = Interruptible::new(jobs.len() as u64, "courses")?;
    let runs = jobs
        .par_iter()
        .map(|job| {
            if !progress.one_more() {
                return Ok(None);
            }
            Ok(Some((job, run_job(model, nominal, seed, job)?)))
        })
        .collect::<Result<Vec<_>>>()?;
    drop(progress);
    let runs: Vec<(&Job, (String, HealthyRun))> = runs.into_iter().flatten().collect();
    report(&runs, jobs.len(), json)
}

/// Runs one course of one crane; returns its name and result.
fn run_job(
    model: &Description,
    nominal: &Description,
    seed: u64,
    job: &Job,
) -> Result<(String, HealthyRun)> {
    let mut crane = member(nominal, seed, job.number).into_diagnostic()?.crane;
    // one step per control period: the implicit scheme's error is below the sensor noise, at a quarter of
    // the time
    crane.numbers.virtual_step = crane.numbers.control_period;
    let course = job.course.of(&crane).into_diagnostic()?;
    let name = course.name();
    let loads: Vec<(f64, f64)> = course.loads().iter().map(|load| (load.time, load.mass)).collect();
    let mut path: Arc<dyn Trajectory> = Arc::from(course as Box<dyn Trajectory>);
    if name == SHIFT {
        // a cycle of the shift is the fast motion out and back
        let cycle = crane.motion(crane.numbers.fast).duration();
        let duration = SHIFT_CYCLES * cycle;
        path = Arc::new(ShortenedTrajectory { path, duration });
    }
    let run = healthy_run(model, &crane, path, &loads, job.strategy).into_diagnostic()?;
    Ok((name, run))
}

/// Courses that may be stopped: the motor is at its limit, or a sudden load change on soft oil exceeds the
/// tracking limit.
fn may_stop(course: &str) -> bool {
    ["saturation", "load-in-motion", "payload-change"].contains(&course)
}

/// Kind of stop: equal ones are counted together, with the numbers of their cranes.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Stop {
    course: String,
    strategy: &'static str,
    /// Code of the cause, or the error of the simulation; also whether it came before the load's release.
    cause: String,
    /// Whether the machine was outside of its limits, so that the stop was right.
    limit_exceeded: bool,
}

impl Stop {
    /// Stop of a run; none for a completed one.
    fn of(job: &Job, course: &str, run: &HealthyRun) -> Option<Self> {
        let cause = match (run.broke, run.cause) {
            (Some(error), _) => error.to_string(),
            (None, Some(cause)) => cause.code().to_string(),
            (None, None) => return None,
        };
        let cause = match run.stopped_at {
            Some(_) => cause,
            None => format!("{cause}, before release"),
        };
        Some(Self {
            course: course.into(),
            strategy: job.strategy.name(),
            cause,
            limit_exceeded: run.limit_exceeded,
        })
    }

    /// Whether neither the machine's limits nor the course explain it.
    fn is_false_alarm(&self) -> bool {
        !self.limit_exceeded && !may_stop(&self.course)
    }

    /// Whether the course explains it.
    fn is_expected(&self) -> bool {
        !self.limit_exceeded && may_stop(&self.course)
    }

    /// Judgement for the table.
    fn judgement(&self) -> &'static str {
        match (self.limit_exceeded, may_stop(&self.course)) {
            (true, _) => "limit exceeded",
            (false, true) => "may stop",
            (false, false) => "FALSE ALARM",
        }
    }
}

/// Largest number of cranes that are listed in a row.
const MOST_CRANES: usize = 8;

/// Prints the stops, and the largest times and motions of the release.
fn report(runs: &[(&Job, (String, HealthyRun))], requested: usize, json: bool) -> Result<()> {
    let mut stops: BTreeMap<Stop, Vec<u64>> = BTreeMap::new();
    for (job, (course, run)) in runs {
        if let Some(stop) = Stop::of(job, course, run) {
            stops.entry(stop).or_default().push(job.number);
        }
    }
    let count = |is: &dyn Fn(&Stop) -> bool| -> usize {
        stops.iter().filter(|(stop, _)| is(stop)).map(|(_, cranes)| cranes.len()).sum()
    };
    let false_alarms = count(&Stop::is_false_alarm);
    let (beyond, expected) = (count(&|stop| stop.limit_exceeded), count(&Stop::is_expected));
    let most = |of: &dyn Fn(&HealthyRun) -> f64| {
        runs.iter().map(|(_, (_, run))| of(run)).fold(0.0, f64::max)
    };
    let (longest, lift, drop) = (
        most(&|r| r.release_time),
        most(&|r| r.release_motion.0) * 1e3,
        most(&|r| r.release_motion.1) * 1e3,
    );
    if json {
        let list: Vec<_> = stops
            .iter()
            .map(|(Stop { course, strategy, cause, limit_exceeded }, cranes)| {
                json!({
                    "course": course, "strategy": strategy, "cause": cause, "limit_exceeded": limit_exceeded,
                    "cranes": cranes
                })
            })
            .collect();
        return output::json(&json!({
            "courses": runs.len(), "asked": requested, "false_alarms": false_alarms,
            "stops_beyond_limits": beyond, "stops_expected": expected, "stops": list,
            "longest_release_s": longest, "largest_lift_mm": lift, "largest_drop_mm": drop,
        }));
    }
    let mut text = format!(
        "{} courses of healthy virtual cranes: {false_alarms} false alarms, {beyond} stops of a machine outside its \
         limits, {expected} on courses that may stop. Release: {longest:.1} s at most, lifts by {lift:.2} mm and \
         drops by {drop:.2} mm at most",
        of_requested(runs.len(), requested)
    );
    if !stops.is_empty() {
        let header = ["course", "strategy", "stopped by", "count", "cranes", ""];
        let rows: Vec<Vec<String>> = stops.iter().map(row).collect();
        text += &format!("\n{}", output::table(&header, &rows));
    }
    output::text(&text)
}

/// Row of a kind of stop with its cranes.
fn row((stop, cranes): (&Stop, &Vec<u64>)) -> Vec<String> {
    let some: Vec<String> = cranes.iter().take(MOST_CRANES).map(u64::to_string).collect();
    let more = if cranes.len() > MOST_CRANES { ", ..." } else { "" };
    vec![
        stop.course.clone(),
        stop.strategy.into(),
        stop.cause.clone(),
        cranes.len().to_string(),
        format!("{}{more}", some.join(", ")),
        stop.judgement().into(),
    ]
}
