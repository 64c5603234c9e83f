//! Text on the cycles of `hydroboom learn`.

use super::assessment::complete_count;
use crate::interruptible::of_requested;
use crate::output;
use hydroboom_lab::closed_loop::monte_carlo::Percentiles;
use hydroboom_lab::cycle_learning::experiment::{CycleReport, Method, MethodError};
use hydroboom_lab::cycle_learning::identified_payload::IdentifiedPayload;
use hydroboom_lab::motion_test::{REMARK_ON_MARK, UNSTABLE_MARK};

/// Number of cycles above which medians are shown.
const MOST_SHOWN: usize = 4;

/// Column headings of the table of methods.
const HEADINGS: [&str; 4] = ["method", "initial state", "RMS true [mm]", "RMS measured [mm]"];

/// Text on all cycles, or their medians if there are many; with their number if not all requested ones are complete.
pub fn reports_text(reports: &[CycleReport], requested: usize) -> String {
    let text = match reports.len() > MOST_SHOWN {
        true => medians_text(reports),
        false => single_reports_text(reports),
    };
    let complete = complete_count(reports);
    match complete == requested {
        true => text,
        false => format!("{text}\n\n{} cycles", of_requested(complete, requested)),
    }
}

/// Each cycle, with its identified parameters behind the last cycle that has the same.
fn single_reports_text(reports: &[CycleReport]) -> String {
    let one = |(k, report): (usize, &CycleReport)| {
        // for one log the identified parameters are the same for every speed
        let follows = reports[k + 1..].iter().any(|next| next.identified == report.identified);
        let same: Vec<&CycleReport> =
            reports.iter().filter(|other| other.identified == report.identified).collect();
        let source = match same.len() == reports.len() {
            true => String::new(),
            false => format!(" from the cycle at {}", report.course.trim()),
        };
        let identified = if follows { String::new() } else { identified_text(&same, &source) };
        format!("{}{identified}", report_text(report))
    };
    reports.iter().enumerate().map(one).collect::<Vec<_>>().join("\n\n")
}

/// Name of a method with its number of learning cycles, and its initial state.
fn method_cells(of: &MethodError) -> [String; 2] {
    let name = match of.cycles {
        None => of.method.name().into(),
        Some(1) => format!("{}, 1 cycle", of.method.name()),
        Some(cycles) => format!("{}, {cycles} cycles", of.method.name()),
    };
    [name, if of.reset { "at rest" } else { "without reset" }.into()]
}

/// Text of one cycle: a table of the methods, convergence of the learning, stability and remarks.
pub fn report_text(report: &CycleReport) -> String {
    let rows = report.methods.iter().map(|of| {
        let [mut name, initial_state] = method_cells(of);
        if of.method == Method::ClosedLoop && report.is_marked() {
            name += UNSTABLE_MARK;
        }
        match (&report.sustained_oscillation, of.method) {
            (Some(oscillation), Method::ClosedLoop) => {
                vec![name, initial_state, "unstable".into(), oscillation.to_string()]
            }
            _ => vec![
                name,
                initial_state,
                output::optional(of.rms_true_mm, 3),
                output::optional(of.rms_measured_mm, 3),
            ],
        }
    });
    let mut text = format!("{}, {}\n", report.crane, report.course.trim());
    text += &output::table(&HEADINGS, &rows.collect::<Vec<_>>());
    if let Some(convergence) = &report.convergence {
        text += &format!(
            "\n\nlearning from the same state: a cycle leaves at most {:.3} of the distance to where it settles on the identified model, {:.3} at {} (below 1 is needed)",
            convergence.model, convergence.worst, convergence.worst_case
        );
    }
    if report.is_marked() {
        text += &format!("\n{REMARK_ON_MARK}");
    }
    if report.stable.is_none() {
        text += "\nstability of the closed loop: not judged";
    }
    report.remarks.iter().for_each(|remark| text += &format!("\n{remark}"));
    if !report.whole {
        text += "\ninterrupted: what is not in the table was not run";
    }
    text
}

/// Identified parameters of cycles that have the same, as options if they may be used; `source` names their cycle, and
/// is empty for one source only.
fn identified_text(same: &[&CycleReport], source: &str) -> String {
    let Some(first) = same.first().filter(|first| !first.identified.is_empty()) else {
        return String::new();
    };
    let payload = first.payload.as_ref().map_or(String::new(), payload_text);
    let refused = same.iter().find_map(|report| Some((report, report.unusable_because.as_ref()?)));
    if let Some((report, reason)) = refused {
        return format!(
            "\n\nidentified{source}, and not to be used as overrides: at {}, {reason} (\"identified\" in --json has the values){payload}",
            report.course.trim()
        );
    }
    let options: Vec<String> =
        first.identified.iter().map(|assignment| format!("--set {assignment}")).collect();
    let lines: Vec<String> = options.chunks(3).map(|three| three.join(" ")).collect();
    format!(
        "\n\nidentified{source}, as overrides of the model for any command:\n  {}{payload}",
        lines.join(" \\\n  ")
    )
}

/// Text on an identified payload \[kg\], with its lever.
fn payload_text(payload: &IdentifiedPayload) -> String {
    let interval = match payload.interval_95_kg {
        Some([low, high]) => format!(", 95 %: {low:.1} to {high:.1} kg"),
        None => String::new(),
    };
    format!(
        "\nthe payload of {:.1} kg{interval} is the load's moment at the model's lever, payload.x_mm = {:.0}: a load at another lever has another mass",
        payload.mass_kg, payload.lever_mm
    )
}

/// RMS tracking errors of a method over many cycles.
struct MethodErrors {
    /// Name and initial state.
    cells: [String; 2],
    /// True errors of the finished cycles \[mm\].
    truth_mm: Vec<f64>,
    /// Measured errors of the finished cycles \[mm\].
    measured_mm: Vec<f64>,
}

/// Errors of each method over all cycles, in the order of their first appearance.
fn method_errors(reports: &[CycleReport]) -> Vec<MethodErrors> {
    let mut methods: Vec<MethodErrors> = Vec::new();
    for error in reports.iter().flat_map(|report| &report.methods) {
        let cells = method_cells(error);
        let place = methods.iter().position(|known| known.cells == cells).unwrap_or_else(|| {
            methods.push(MethodErrors { cells, truth_mm: Vec::new(), measured_mm: Vec::new() });
            methods.len() - 1
        });
        methods[place].truth_mm.extend(error.rms_true_mm);
        methods[place].measured_mm.extend(error.rms_measured_mm);
    }
    methods
}

/// Medians of the RMS tracking errors over many cycles.
fn medians_text(reports: &[CycleReport]) -> String {
    let rows = method_errors(reports).into_iter().map(|method| {
        let MethodErrors { cells: [name, initial_state], truth_mm, measured_mm } = method;
        let below = truth_mm.iter().filter(|mm| **mm < 1.0).count();
        let finished = truth_mm.len();
        let median = |all: Vec<f64>| Some(Percentiles::of(all).median).filter(|mm| mm.is_finite());
        let [truth, measured] = [truth_mm, measured_mm].map(|all| output::optional(median(all), 3));
        let [below, finished] = [below, finished].map(|n| format!("{n} of {}", reports.len()));
        vec![name, initial_state, truth, measured, below, finished]
    });
    let [method, initial_state, ..] = HEADINGS;
    let headings = [
        method,
        initial_state,
        "median RMS true [mm]",
        "median RMS measured [mm]",
        "true below 1 mm",
        "finished",
    ];
    let table = output::table(&headings, &rows.collect::<Vec<_>>());
    let unstable = match reports.iter().filter(|report| report.is_marked()).count() {
        0 => String::new(),
        count => format!(
            "; {count} closed loops are unstable, linearised, or were in sustained oscillation or not finished"
        ),
    };
    let remarks = match reports.iter().map(|report| report.remarks.len()).sum::<usize>() {
        0 => String::new(),
        count => format!("; {count} remarks: \"remarks\" in --json"),
    };
    format!(
        "{} cycles{unstable}{remarks}\n{table}\n\nwhat is identified of each: \"identified\" in --json",
        reports.len()
    )
}
