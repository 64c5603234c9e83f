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
use std::sync::atomic::{AtomicUsize, Ordering};

/// Number of cycles after which the scenario of a shift is ended.
const SHIFT_CYCLES: f64 = 20.0;
const SHIFT: &str = "shift";

/// Trajectory ended early.
struct Cut {
    path: Arc<dyn Trajectory>,
    duration: f64,
}

impl Trajectory for Cut {
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

/// Course of a crane.
struct Job {
    number: u64,
    course: CourseChoice,
    strategy: Strategy,
}

/// Runs the cranes of a family, given by count and seed, under strategies along every course.
pub fn run(
    model: &Description,
    nominal: &Description,
    (count, seed): (u64, u64),
    strategies: &[Strategy],
    json: bool,
) -> Result<()> {
    let chosen: Vec<Strategy> = match strategies.is_empty() {
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
        for strategy in &chosen {
            jobs.extend(courses.iter().map(|c| Job {
                number,
                course: c.clone(),
                strategy: *strategy,
            }));
        }
    }
    let progress = Interruptible::new(jobs.len() as u64, "courses")?;
    let done = AtomicUsize::new(0);
    let runs = jobs
        .par_iter()
        .map(|job| {
            if !progress.one_more() {
                return Ok(None);
            }
            let run = one(model, nominal, seed, job)?;
            done.fetch_add(1, Ordering::Relaxed);
            Ok(Some((job, run)))
        })
        .collect::<Result<Vec<_>>>()?;
    drop(progress);
    let runs: Vec<(&Job, (String, HealthyRun))> = runs.into_iter().flatten().collect();
    report(&runs, jobs.len(), json)
}

/// Runs one course of one crane; returns its name and result.
fn one(
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
        path = Arc::new(Cut { path, duration: SHIFT_CYCLES * cycle });
    }
    let run = healthy_run(model, &crane, path, &loads, job.strategy).into_diagnostic()?;
    Ok((name, run))
}

/// Courses that may be stopped: the motor is at its limit, or a sudden load change on soft oil exceeds the
/// tracking limit.
fn may_stop(course: &str) -> bool {
    ["saturation", "load-in-motion", "payload-change"].contains(&course)
}

fn report(runs: &[(&Job, (String, HealthyRun))], asked: usize, json: bool) -> Result<()> {
    let stopped = |run: &HealthyRun| run.cause.is_some() || run.broke.is_some();
    let said = |run: &HealthyRun| match (run.broke, run.cause) {
        (Some(error), _) => error.to_string(),
        (None, Some(cause)) => cause.code().to_string(),
        (None, None) => "-".into(),
    };
    let mut stops: BTreeMap<(String, &str, String, bool), Vec<u64>> = BTreeMap::new();
    for (job, (course, run)) in runs.iter().filter(|(_, (_, run))| stopped(run)) {
        let when = if run.stopped_at.is_some() {
            said(run)
        } else {
            format!("{}, before release", said(run))
        };
        let key = (course.clone(), job.strategy.name(), when, run.limit_exceeded);
        stops.entry(key).or_default().push(job.number);
    }
    let false_alarms: usize =
        stops.iter().filter(|(key, _)| !key.3 && !may_stop(&key.0)).map(|(_, c)| c.len()).sum();
    let of = |is: &dyn Fn(bool, bool) -> bool| -> usize {
        stops.iter().filter(|(key, _)| is(key.3, may_stop(&key.0))).map(|(_, c)| c.len()).sum()
    };
    let (beyond, expected) = (of(&|exceeded, _| exceeded), of(&|exceeded, may| !exceeded && may));
    let released = runs.iter().map(|(_, (_, run))| run);
    let most = |of: &dyn Fn(&HealthyRun) -> f64| released.clone().map(of).fold(0.0, f64::max);
    let (longest, lift, sank) = (
        most(&|r| r.release_time),
        most(&|r| r.release_motion.0) * 1e3,
        most(&|r| r.release_motion.1) * 1e3,
    );
    if json {
        let list: Vec<_> = stops
            .iter()
            .map(|((course, strategy, cause, limit_exceeded), cranes)| {
                json!({
                    "course": course, "strategy": strategy, "cause": cause, "limit_exceeded": limit_exceeded,
                    "cranes": cranes
                })
            })
            .collect();
        return output::json(&json!({
            "courses": runs.len(), "asked": asked, "false_alarms": false_alarms,
            "stops_beyond_limits": beyond, "stops_expected": expected, "stops": list,
            "longest_release_s": longest, "largest_lift_mm": lift, "largest_drop_mm": sank,
        }));
    }
    let rows: Vec<Vec<String>> = stops
        .iter()
        .map(|((course, strategy, cause, limit_exceeded), cranes)| {
            let some: Vec<String> = cranes.iter().take(8).map(u64::to_string).collect();
            let more = if cranes.len() > 8 { ", ..." } else { "" };
            let expected = match (may_stop(course), *limit_exceeded) {
                (_, true) => "limit exceeded",
                (true, false) => "may stop",
                (false, false) => "FALSE ALARM",
            };
            vec![
                course.clone(),
                (*strategy).into(),
                cause.clone(),
                cranes.len().to_string(),
                format!("{}{more}", some.join(", ")),
                expected.into(),
            ]
        })
        .collect();
    let mut text = format!(
        "{} courses of healthy virtual cranes: {false_alarms} false alarms, {beyond} stops of a machine outside its \
         limits, {expected} on courses that may stop. Release: {longest:.1} s at most, lifts by {lift:.2} mm and \
         drops by {sank:.2} mm at most",
        of_requested(runs.len(), asked)
    );
    if !rows.is_empty() {
        let header = ["course", "strategy", "stopped by", "count", "cranes", ""];
        text += &format!("\n{}", output::table(&header, &rows));
    }
    output::text(&text)
}
