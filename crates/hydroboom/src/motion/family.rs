//! `hydroboom motion --family`

use crate::interruptible::{Interruptible, of_requested};
use crate::machine_choice::MachineChoice;
use crate::output;
use hydroboom_control::strategy::Strategy;
use hydroboom_lab::closed_loop::controller_choice::ControllerChoice;
use hydroboom_lab::closed_loop::metrics::TrackingError;
use hydroboom_lab::closed_loop::monte_carlo::{
    Member, Outcomes, Row, family as simulate_family, members, rows, variations,
};
use hydroboom_lab::closed_loop::period_time::{PeriodTime, period_times};
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::motion_test::UNSTABLE_MARK;
use hydroboom_lab::report;
use miette::{IntoDiagnostic, Result, bail};
use serde_json::{Value, json};
use std::path::Path;

/// Settings of a family.
pub struct Family {
    /// Number of cranes.
    pub count: u64,
    /// Seed of the random parameters.
    pub seed: u64,
    /// Whether the family is widened: further parameters vary.
    pub is_widened: bool,
    /// Whether the baselines are run too, and the computing times measured.
    pub has_baselines: bool,
}

/// Runs per execution time measurement, of which the minimum of each period counts.
const TIMED_RUNS: u32 = 3;

/// Runs every controller along every course on virtual cranes drawn around the chosen machine, and prints and writes
/// the results.
///
/// # Errors
///
/// If a crane or controller cannot be built, or no crane had completed its courses at an interruption.
pub fn run(
    choice: &MachineChoice,
    family: &Family,
    courses: &[CourseChoice],
    out: Option<&Path>,
    as_json: bool,
) -> Result<()> {
    let results = FamilyResults::new(choice, family, courses)?;
    if let Some(folder) = out {
        let Family { seed, is_widened, .. } = *family;
        let (count, rows) = (results.cranes.len(), &results.rows);
        let page = report::family_page(&choice.name(), count, seed, is_widened, rows);
        output::page_in_folder(folder, "family", &page, Some(seed));
    }
    match as_json {
        true => output::json(&results.in_json()),
        false => output::text(&results.text()),
    }
}

/// Results of a family.
struct FamilyResults<'a> {
    choice: &'a MachineChoice,
    family: &'a Family,
    controllers: Vec<ControllerChoice>,
    /// Names of the courses.
    courses: Vec<String>,
    /// Completed cranes with their outcomes, in the order of controllers and courses.
    cranes: Vec<(Member, Outcomes)>,
    rows: Vec<Row>,
    /// Controllers whose linearised loops are unstable on the machine that the family is drawn around.
    unstable: Vec<ControllerChoice>,
    /// Computing times of a control period along the last course; empty without baselines.
    period_times: Vec<PeriodTime>,
}

impl<'a> FamilyResults<'a> {
    fn new(
        choice: &'a MachineChoice,
        family: &'a Family,
        courses: &[CourseChoice],
    ) -> Result<Self> {
        let (model, nominal) = (&choice.model, &choice.machine);
        let names = courses
            .iter()
            .map(|course| course.of(nominal).map(|course| course.name()))
            .collect::<Result<Vec<_>, _>>()
            .into_diagnostic()?;
        let controllers = match family.has_baselines {
            true => ControllerChoice::all(model).into_diagnostic()?,
            false => ControllerChoice::strategies(),
        };
        let size = (family.count, family.seed);
        let members = members(nominal, size, family.is_widened).into_diagnostic()?;
        let work = Interruptible::new(family.count, "cranes")?;
        let go_on = |share: f64| work.done(share);
        let cranes = simulate_family(model, members, &controllers, courses, &go_on);
        drop(work);
        let cranes = cranes.into_diagnostic()?;
        if cranes.is_empty() {
            bail!("none of {} cranes had gone all the way when it was interrupted", family.count);
        }
        let rows = rows(&controllers, &names, &cranes);
        let unstable: Vec<ControllerChoice> = controllers
            .iter()
            .copied()
            .filter(|controller| controller.has_stable_loops(model, nominal) == Some(false))
            .collect();
        // execution times are measured one after the other, when no simulation runs
        let period_times = match courses.last().filter(|_| family.has_baselines) {
            Some(course) => {
                let course = course.of(nominal).into_diagnostic()?;
                period_times(model, nominal, &controllers, course.as_ref(), TIMED_RUNS)
                    .into_diagnostic()?
            }
            None => Vec::new(),
        };
        let courses = names;
        Ok(Self { choice, family, controllers, courses, cranes, rows, unstable, period_times })
    }

    fn in_json(&self) -> Value {
        let Family { count, seed, is_widened, .. } = *self.family;
        let cranes: Vec<_> = self
            .cranes
            .iter()
            .map(|(member, outcomes)| json!({ "values": member.values, "outcomes": outcomes }))
            .collect();
        let strategies: Vec<_> = self.controllers.iter().map(|c| c.name()).collect();
        json!({
            "asked": count, "family": self.rows, "seed": seed, "variations": variations(is_widened),
            "strategies": strategies, "unstable_around_nominal": self.unstable, "courses": self.courses,
            "cranes": cranes, "period_times": self.period_times, "plant": self.choice.json(),
        })
    }

    fn text(&self) -> String {
        let Family { count, seed, is_widened, has_baselines } = *self.family;
        let beside_lqr = match has_baselines {
            true => format!(
                "\n\nover the scheduled LQR's on the same crane: median (least .. largest)\n{}",
                beside_the_scheduled_lqr(&self.rows)
            ),
            false => String::new(),
        };
        let missing: String = self.rows.iter().filter_map(without_solution).collect();
        format!(
            "{} virtual cranes {}around \"{}\", seed {seed}; median (5 .. 95 %), worst\n{}{}\n\nover the benchmark's on the same crane\n{}{beside_lqr}{missing}{}",
            of_requested(self.cranes.len(), count as usize),
            if is_widened { "of a widened family " } else { "" },
            self.choice.name(),
            table(&self.rows, &self.unstable),
            match self.unstable.is_empty() {
                true => String::new(),
                false => format!("\n{UNSTABLE_AROUND_NOMINAL}"),
            },
            beside_the_benchmark(&self.rows),
            self.period_times_text()
        )
    }

    /// Computing times of a control period; empty without baselines.
    fn period_times_text(&self) -> String {
        if self.period_times.is_empty() {
            return String::new();
        }
        format!(
            "\n\ntime of a control period on this machine, along {} on \"{}\": of each period the least of {TIMED_RUNS} runs\n{}",
            self.courses.last().map_or("", |name| name.trim()),
            self.choice.name(),
            period_time_table(&self.period_times)
        )
    }
}

/// Explanation of the mark in a table of a family.
const UNSTABLE_AROUND_NOMINAL: &str = "(!): its closed loop is unstable around the crane that the family is drawn around, linearised; its errors are no merit. `hydroboom design --family` \
     counts the cranes of the family.";

/// Table of the controllers: percentiles over the family, and numbers of oscillating and unfinished cranes.
fn table(rows: &[Row], unstable: &[ControllerChoice]) -> String {
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|r| {
            let mark = if unstable.contains(&r.controller) { UNSTABLE_MARK } else { "" };
            vec![
                format!("{}{mark}", r.controller.name()),
                r.course.clone(),
                r.rms_true_mm.text(3),
                r.rms_measured_mm.text(3),
                r.peak_true_mm.text(2),
                r.peak_measured_mm.text(2),
                r.motor_ripple_rpm.text(1),
                r.motor_slew_rpm_per_s.text(0),
                r.oscillating.to_string(),
                r.unfinished.to_string(),
            ]
        })
        .collect();
    let [rms_true, rms_measured, peak_true, peak_measured] = TrackingError::HEADS;
    output::table(
        &[
            "strategy",
            "course",
            rms_true,
            rms_measured,
            peak_true,
            peak_measured,
            "motor ripple at rest [rpm]",
            "motor slew, RMS [rpm/s]",
            "oscillating",
            "not finished",
        ],
        &cells,
    )
}

/// Ratios to the scheduled LQR on the same crane, in the order of the courses.
fn beside_the_scheduled_lqr(rows: &[Row]) -> String {
    let courses: Vec<&String> = rows.iter().map(|row| &row.course).collect();
    let place = |row: &Row| courses.iter().position(|course| **course == row.course);
    let mut others: Vec<&Row> =
        rows.iter().filter(|r| r.controller != Strategy::ScheduledLqr.into()).collect();
    others.sort_by_key(|row| place(row));
    let cells: Vec<Vec<String>> = others
        .iter()
        .filter_map(|row| {
            let over = row.over_scheduled_lqr?;
            Some(vec![
                row.course.clone(),
                row.controller.name().into(),
                over.rms_true.range_text(2),
                over.less_on.to_string(),
                over.rms_measured.range_text(2),
                over.motor_slew.range_text(2),
            ])
        })
        .collect();
    let heads = ["course", "strategy", "RMS true", "less on", "RMS measured", "motor slew"];
    output::table(&heads, &cells)
}

/// Remark on a controller with periods without a solution.
fn without_solution(row: &Row) -> Option<String> {
    let (count, name, course) = (row.periods_without_solution, row.controller.name(), &row.course);
    (count > 0).then(|| {
        format!(
            "\n{name} computed no command in {count} control periods along {}: its last plan was held",
            course.trim()
        )
    })
}

/// Table of the median and the 99.9th percentile of the computing times \[us\].
fn period_time_table(times: &[PeriodTime]) -> String {
    let cells: Vec<Vec<String>> = times
        .iter()
        .map(|t| {
            let [median, most] = [t.median_us, t.percentile_99_9_us].map(|us| format!("{us:.1}"));
            vec![t.controller.name().into(), median, most]
        })
        .collect();
    output::table(&["strategy", "median [us]", "99.9 % [us]"], &cells)
}

/// Ratios to the benchmark on the same crane, and to the retuned benchmark if it is one of the controllers.
fn beside_the_benchmark(rows: &[Row]) -> String {
    let others: Vec<&Row> =
        rows.iter().filter(|r| r.controller != Strategy::BenchmarkClosedLoop.into()).collect();
    let mut header = vec![
        "strategy",
        "course",
        "RMS true",
        "RMS measured",
        "less RMS true on [%]",
        "largest motor speed",
        "motor energy",
    ];
    let mut cells: Vec<Vec<String>> = others
        .iter()
        .map(|r| {
            vec![
                r.controller.name().into(),
                r.course.clone(),
                r.rms_true_over_benchmark.text(3),
                r.rms_measured_over_benchmark.text(3),
                format!("{:.0}", r.better_percent),
                r.motor_speed_over_benchmark.text(3),
                r.energy_over_benchmark.text(3),
            ]
        })
        .collect();
    if others.iter().any(|r| r.rms_true_over_retuned_benchmark.is_some()) {
        header.push("RMS true over the retuned");
        for (row, cells) in others.iter().zip(&mut cells) {
            let over = row.rms_true_over_retuned_benchmark;
            cells.push(over.map_or_else(|| "-".into(), |s| s.text(2)));
        }
    }
    output::table(&header, &cells)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As in `motion`, the row itself is marked.
    #[test]
    fn a_row_of_an_unstable_loop_is_marked() {
        let model = hydroboom_description::Description::uia_single_boom().unwrap();
        let mut light = model.clone();
        light.set("payload.mass_kg=100").unwrap();
        let benchmark = ControllerChoice::from(Strategy::BenchmarkClosedLoop);
        assert_eq!(benchmark.has_stable_loops(&model, &light), Some(false));
        assert_eq!(benchmark.has_stable_loops(&model, &model), Some(true));
        let all = [benchmark, Strategy::VelocityFeedforward.into()];
        let rows = rows(&all, &["120 mm/s".into()], &[]);
        let marked = |unstable: &[ControllerChoice]| table(&rows, unstable).matches("(!)").count();
        assert_eq!((marked(&[]), marked(&[benchmark])), (0, 1));
    }
}
