//! Report page of a run.

use super::course_result::CourseResult;
use super::report::{SENSORS_ONLY, error_text};
use crate::machine_choice::MachineChoice;
use hydroboom_lab::LabError;
use hydroboom_lab::closed_loop::metrics::TrackingError;
use hydroboom_lab::report::{Axes, Figure, Page, Series, document, figure};
use hydroboom_realtime::control_task::Record;
use hydroboom_realtime::executive::RealTime;
use hydroboom_realtime::timing::Timing;
use maud::{Markup, html};

/// Page of one course, available directly after it: result, and figures over time.
///
/// # Errors
///
/// [`LabError`] if a figure cannot be drawn.
pub fn course_page(result: &CourseResult, records: &[Record]) -> Result<Page, LabError> {
    let body = html! {
        (results(std::slice::from_ref(result), None))
        (course(records)?)
    };
    Ok(document(&format!("Hydroboom: {} with {}", result.course, result.strategy), &body))
}

/// Page of a whole run: all courses beside the paper's RMS and largest error \[mm\], figures of the last one,
/// deadlines.
/// `records` are those of the last course, and `computer` is the processor.
///
/// # Errors
///
/// [`LabError`] if a figure cannot be drawn.
pub fn run_page(
    cranes: &MachineChoice,
    list: &[CourseResult],
    paper: Option<[f64; 2]>,
    records: &[Record],
    real_time: Option<&RealTime>,
    computer: &str,
) -> Result<Page, LabError> {
    let body = html! {
        p.soft {
            @if cranes.source.is_attached() {
                "The machine is \"" (cranes.name()) "\", attached: the measurements are those that it sent."
            } @else {
                "The machine is \"" (cranes.name()) "\", simulated, which stands in for a real one: nothing here is a "
                "measurement of a real crane, but for the paper's numbers and the times of the tasks, which were taken on "
                "this computer."
            }
            @if let Some(equality) = cranes.equality() { " " strong { (equality) } "." }
        }
        (results(list, paper))
        (course(records)?)
        @if let Some(real_time) = real_time { (deadlines(real_time, computer)?) }
    };
    Ok(document("Hydroboom: a run", &body))
}

/// Table of the courses \[mm\], beside the paper's RMS and largest error.
fn results(list: &[CourseResult], paper: Option<[f64; 2]>) -> Markup {
    html! {
        h2 { "Tracking error x - x_ref" }
        div.wide { table {
            thead { tr {
                th { "course" } th { "strategy" } th { "begun [s]" }
                @for head in TrackingError::HEADS { th { (head) } } th { "ended" }
            } }
            tbody {
                @for r in list { tr {
                    td { (r.course) }
                    td.text { (r.strategy) @if let Some(then) = r.then { ", then " (then) } }
                    td { (format!("{:.1}", r.begun_s)) }
                    @if let Some(oscillation) = r.sustained_oscillation {
                        td.unstable { "unstable: " (oscillation.to_string()) } @for _ in 1..4 { td.unstable { "-" } }
                    } @else {
                        @for mm in r.error.cells() { td { (error_text(mm)) } }
                    }
                    td.text {
                        @if let Some(fault) = r.fault { strong { (fault) } } @else { "load held" }
                        @if r.may_oscillate { ", oscillating: the rest was too short to judge whether it decays" }
                        @if let Some(cause) = r.fallback_cause { ", benchmark took over: " (cause) }
                    }
                } }
                @if let Some([rms, peak]) = paper { tr {
                    td { "paper, measured on its crane" } td { } td { }
                    td { "-" } td { (error_text(rms)) } td { "-" } td { (error_text(peak)) } td { }
                } }
            }
        } }
        @if list.iter().any(|r| r.fault.is_none() && r.error.rms_true_mm.is_nan()) { p.soft { (SENSORS_ONLY) } }
    }
}

/// Figures of a course over time: position, error, pressures, motor speed. Empty without records.
fn course(records: &[Record]) -> Result<Markup, LabError> {
    let Some(first) = records.first() else { return Ok(html! {}) };
    let over = |of: &dyn Fn(&Record) -> Option<f64>| -> Vec<(f64, f64)> {
        records.iter().filter_map(|r| Some((r.time - first.time, of(r)?))).collect()
    };
    let draw = |y: &str, lines: Vec<(&str, Vec<(f64, f64)>)>| {
        let series = Series::list(lines.into_iter().filter(|(_, points)| !points.is_empty()));
        Figure { x: "time since the start request [s]", y, series, axes: Axes::Linear }.drawn()
    };
    let bar = |of: fn(&Record) -> f64| over(&|r| Some(of(r) * 1e-5));
    let has_error = records.iter().any(|r| r.error().is_some());
    Ok(html! {
        h2 { "The course" }
        (figure("Reference, measured and simulated position of the piston. Before the release the pump takes over the load.", &draw("position [mm]", vec![
            ("reference", over(&|r| Some(r.reference.position * 1e3))),
            ("machine", over(&|r| Some(r.signals().stroke * 1e3))),
            ("simulation", over(&|r| r.simulated.map(|s| s.axis().stroke * 1e3))),
        ])?))
        @if has_error {
            (figure("Measured tracking error of the piston.", &draw("x - x_ref [mm]", vec![
                ("machine", over(&|r| r.error().map(|e| e * 1e3))),
            ])?))
        }
        (figure("Pressures: pump port and piston side carry the load, once they are equal the load is released; rod side and accumulator stay low.", &draw("pressure [bar]", vec![
            ("p_PA", bar(|r| r.signals().pressure_pump_a)),
            ("p_A", bar(|r| r.signals().pressure_a)),
            ("p_B", bar(|r| r.signals().pressure_b)),
            ("p_PB", bar(|r| r.signals().pressure_pump_b)),
            ("p_acc", bar(|r| r.signals().pressure_accumulator)),
        ])?))
        (figure("Commanded and measured motor speed.", &draw("motor speed [rpm]", vec![
            ("asked for", over(&|r| Some(r.decision.command.motor_speed * 60.0))),
            ("read", over(&|r| Some(r.signals().motor_speed * 60.0))),
        ])?))
    })
}

/// Table and distributions of execution times and release delays of both tasks.
fn deadlines(r: &RealTime, computer: &str) -> Result<Markup, LabError> {
    let row = |name: &str, t: &Timing| {
        html! { tr {
            td { (name) } td { (format!("{:.0}", t.period as f64 * 1e-3)) } td { (t.steps) }
            td { (format!("{:.2}", t.execution_us(0.5))) } td { (format!("{:.2}", t.execution_us(0.999))) }
            td { (format!("{:.1} at {:.3} s", t.worst.0 as f64 * 1e-3, t.worst.1 as f64 * 1e-9)) }
            td { (format!("{:.1}", t.lateness_us(0.5))) } td { (format!("{:.1}", t.lateness_us(0.999))) }
            td { (format!("{:.1}", t.lateness_us(1.0))) } td { (t.missed) }
            td { (format!("{:.1}", t.taken as f64 * 1e-6)) }
        } }
    };
    let draw = |x: &str, of: fn(&Timing) -> Vec<(f64, f64)>| {
        let lines = [("simulation", of(&r.simulation)), ("control", of(&r.control))];
        let y = "share of all beyond";
        Figure { x, y, series: Series::list(lines), axes: Axes::Logarithmic }.drawn()
    };
    Ok(html! {
        h2 { "Deadlines" }
        @for failure in &r.failures {
            p { strong { (failure.to_string()) } }
        }
        p.soft { (computer) }
        div.wide { table {
            thead { tr {
                th { "task" } th { "period [us]" } th { "steps" } th { "execution p50 [us]" } th { "p99.9" }
                th { "worst" } th { "late p50 [us]" } th { "p99.9" } th { "worst" } th { "missed" }
                th { "taken by others [ms]" }
            } }
            tbody { (row("simulation", &r.simulation)) (row("control", &r.control)) }
        } }
        p.soft { (super::report::remarks(r)) }
        (figure("Execution time of a step on its processor.", &draw("execution [us]", Timing::longer_than)?))
        (figure("Delay of the release of a step.", &draw("release late by [us]", Timing::later_than)?))
    })
}
