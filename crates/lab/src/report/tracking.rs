//! Figures 24 to 27: reference, positions and errors of the compared strategies.

use super::document::{Page, document};
use super::drawing_data::figure;
use super::figure::{Axes, Figure, Series};
use super::palette::{NEUTRAL, colour_of};
use super::validation;
use crate::LabError;
use crate::closed_loop::metrics::TrackingError;
use crate::closed_loop::sample::Sample;
use crate::motion_test::{Row, Run, UNSTABLE_MARK, remark_on_mark};
use hydroboom_control::strategy::Strategy;
use hydroboom_design::stability::LoopStability;
use maud::{Markup, html};

/// Strategies compared in the paper's figures, and the own comparison.
const COMPARED: [(&str, [Strategy; 2]); 4] = [
    (
        "Figure 25, test 1: open loop",
        [Strategy::VelocityFeedforward, Strategy::SimulationFeedforwardOpenLoop],
    ),
    (
        "Figure 26, test 2: open-loop simulation feedforward against the benchmark",
        [Strategy::SimulationFeedforwardOpenLoop, Strategy::BenchmarkClosedLoop],
    ),
    (
        "Figure 27, test 3: closed loop",
        [Strategy::BenchmarkClosedLoop, Strategy::SimulationFeedforwardClosedLoop],
    ),
    (
        "Test 4 (ours): scheduled LQR against the benchmark",
        [Strategy::BenchmarkClosedLoop, Strategy::ScheduledLqr],
    ),
];

/// Points (time \[s\], value) of a quantity over all control periods of a run.
pub fn over_time(run: &Run, value: impl Fn(&Sample) -> f64) -> Vec<(f64, f64)> {
    run.samples.iter().map(|s| (s.time, value(s))).collect()
}

/// Figures of one course on the named plant: reference, positions and errors. `find` returns the run of a strategy,
/// `reference` is any run along the course.
///
/// # Errors
///
/// [`LabError::Figure`] if a figure cannot be drawn.
pub fn panels<'a>(
    find: impl Fn(Strategy) -> Option<&'a Run>,
    reference: Option<&'a Run>,
    plant: &str,
) -> Result<Markup, LabError> {
    let Some(reference) = reference else { return Ok(html! {}) };
    let course = &reference.course;
    let wanted = || over_time(reference, |s| s.reference.position * 1e3);
    let position = |series, y| Figure { x: "time [s]", y, series, axes: Axes::Linear }.drawn();
    let alone = vec![Series { name: "reference", points: wanted(), colour: NEUTRAL }];
    let motion = position(alone, "x_ref [mm]")?;
    let mut panels = Vec::new();
    for (title, strategies) in COMPARED {
        let mut positions = vec![Series { name: "reference", points: wanted(), colour: NEUTRAL }];
        let mut errors = Vec::new();
        let mut said = Vec::new();
        for run in strategies.into_iter().filter_map(&find) {
            let (name, colour) = (run.strategy.name(), colour_of(run.strategy));
            said.push(format!("{name} {}", run.tracking()));
            let points = over_time(run, |s| s.signals.stroke * 1e3);
            positions.push(Series { name, points, colour });
            let points = over_time(run, |s| s.error() * 1e3);
            errors.push(Series { name, points, colour });
        }
        panels.push((
            title,
            position(positions, "x_cyl [mm]")?,
            position(errors, "x - x_ref [mm]")?,
            said.join("; "),
        ));
    }
    Ok(html! {
        (figure(&format!("Figure 24: reference position of the piston, {course}."), &motion))
        @for (title, a, b, said) in &panels {
            h3 { (title) ", " (plant) ", " (course) }
            (figure("(a) Measured and reference position of the piston.", a))
            (figure(&format!("(b) Tracking error of the piston: {said}."), b))
        }
    })
}

/// Note on ideal sensors, which replaces the column of measured errors.
pub const IDEAL_SENSORS: &str = "Sensors are ideal: the measured error is the true one.";

/// Content of a page of motion tests (paper, section 5.3).
pub struct MotionTests<'a> {
    /// Name of the model.
    pub crane: &'a str,
    /// Name of the plant.
    pub plant: &'a str,
    /// Runs of all strategies along all courses.
    pub runs: &'a [Run],
    /// Published model along the course of the fastest velocity feedforward run, for figures 18 to 23.
    pub alongside: Option<&'a Run>,
    /// Whether the crane is the paper's; its values are shown for no other.
    pub is_papers_crane: bool,
    /// Stability of the strategies' loops on the plant.
    pub loops: &'a [LoopStability],
    /// Remark on the plant; none for no remark.
    pub remark: Option<&'a str>,
}

/// Page of motion tests with the figures of every course.
///
/// # Errors
///
/// [`LabError::Figure`] if a figure cannot be drawn.
pub fn motion_page(tests: &MotionTests<'_>) -> Result<Page, LabError> {
    let mut courses: Vec<&str> = tests.runs.iter().map(|run| run.course.as_str()).collect();
    courses.dedup();
    courses.sort_unstable();
    courses.dedup();
    let mut sections = Vec::new();
    for course in courses {
        let of = |strategy: Strategy| {
            tests.runs.iter().find(|run| run.strategy == strategy && run.course == course)
        };
        let reference = tests.runs.iter().find(|run| run.course == course);
        let rows: Vec<Row> = Strategy::ALL
            .into_iter()
            .filter_map(of)
            .map(|run| Row::of(tests.plant, run).with_loops(tests.loops))
            .map(|row| if tests.is_papers_crane { row } else { row.without_paper() })
            .collect();
        sections.push((course, table(&rows), panels(of, reference, tests.plant)?));
    }
    let compared = match tests.alongside {
        Some(simulated) => {
            let same = |run: &&Run| {
                run.strategy == Strategy::VelocityFeedforward && run.course == simulated.course
            };
            match tests.runs.iter().find(same) {
                Some(run) => Some(validation::panels(simulated, run, tests.plant)?),
                None => None,
            }
        }
        None => None,
    };
    let body = html! {
        p.soft {
            "Simulated: the controllers know the model, the plant is the " (tests.plant) " with its sensors. "
            @if tests.is_papers_crane { "\"Paper\" is what Hagen et al. measured on their real crane; nothing here is a measurement. " }
            @else { "Nothing here is a measurement. " }
            "The scheduled LQR has a preview of 0.4 s of the reference; the published strategies have none."
            @if let Some(remark) = tests.remark { " " strong { (remark) } "." }
        }
        @for (course, table, figures) in &sections {
            h2 { (course) }
            (table)
            (figures)
        }
        @if let Some(figures) = &compared {
            h2 { "Model and plant, both under velocity feedforward" }
            (figures)
        }
    };
    Ok(document(&format!("Motion tests: {}", tests.crane), &body))
}

/// Cell with an error of a run, or the note that it oscillates or stopped.
pub(super) fn here(row: &Row, mm: f64) -> Markup {
    match (&row.stopped, row.sustained_oscillation) {
        (Some(reason), _) => html! { td.unstable { "stopped: " (reason) } },
        (None, None) if row.has_stable_loops => html! { td { (format!("{mm:.3}")) } },
        (None, None) => html! { td.unstable { (format!("{mm:.3}")) (UNSTABLE_MARK) } },
        (None, Some(oscillation)) => {
            html! { td.unstable { "unstable: " (oscillation.to_string()) } }
        }
    }
}

fn table(rows: &[Row]) -> Markup {
    let optional = |v: Option<f64>| v.map_or_else(|| "-".into(), |v| format!("{v:.2}"));
    let beside_paper = rows.iter().any(|row| row.paper_rms_mm.is_some());
    let ideal = rows.iter().all(|row| row.stopped.is_some() || row.error.is_measured_truly());
    let [rms_true, rms_measured, peak_true, peak_measured] = TrackingError::HEADS;
    html! {
        div.wide { table {
            thead { tr {
                th { "strategy" }
                @if beside_paper { th { "RMS paper [mm]" } }
                th { (rms_true) } @if !ideal { th { (rms_measured) } }
                @if beside_paper { th { "peak paper [mm]" } }
                th { (peak_true) } @if !ideal { th { (peak_measured) } }
            } }
            tbody { @for r in rows { tr {
                td { (r.marked_name()) }
                @if beside_paper { td { (optional(r.paper_rms_mm)) } }
                (here(r, r.error.rms_true_mm)) @if !ideal { (here(r, r.error.rms_measured_mm)) }
                @if beside_paper { td { (optional(r.paper_peak_mm)) } }
                (here(r, r.error.peak_true_mm)) @if !ideal { (here(r, r.error.peak_measured_mm)) }
            } } }
        } }
        @if ideal { p.soft { (IDEAL_SENSORS) } }
        @if let Some(remark) = remark_on_mark(rows) { p.soft { (remark) } }
    }
}
