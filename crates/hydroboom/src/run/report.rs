//! Report of a run as text and JSON.

use super::attachment::AttachmentResult;
use super::course_result::CourseResult;
use crate::machine_choice::MachineChoice;
use crate::output;
use hydroboom_description::Description;
use hydroboom_lab::closed_loop::metrics::TrackingError;
use hydroboom_realtime::executive::RealTime;
use hydroboom_realtime::timing::Timing;
use serde_json::{Value, json};

/// Results of a run, for its report.
pub struct Report<'a> {
    /// Model and machine.
    pub cranes: &'a MachineChoice,
    /// Courses of the run.
    pub results: &'a [CourseResult],
    /// The first of them in simulated time; none if it was not simulated.
    pub simulated: Option<&'a CourseResult>,
    /// RMS and largest error \[mm\] that the paper measured in the same test; none without one.
    pub paper: Option<[f64; 2]>,
    /// Number of synchronisations of the simulation during courses.
    pub synchronised: u32,
    /// Deadline statistics; none in simulated time.
    pub real_time: Option<&'a RealTime>,
    /// Result of the attachment of a machine; none for a virtual crane.
    pub attachment: Option<&'a AttachmentResult>,
}

/// How a course ended: fault or held load, fallback, oscillation.
fn end_text(r: &CourseResult) -> String {
    let mut end = r.fault.unwrap_or("load held").to_string();
    if let Some(cause) = r.fallback_cause {
        end += &format!(", benchmark took over: {cause}");
    }
    if let Some(oscillation) = r.sustained_oscillation {
        end += &format!(", sustained oscillation of {oscillation}");
    }
    if r.may_oscillate {
        end += ", oscillating: the rest was too short to judge whether it decays";
    }
    end
}

/// Note on an attached machine.
pub const SENSORS_ONLY: &str =
    "The machine is attached, and only its sensors are known: its true errors are not.";

/// Error \[mm\] with three decimals; a dash if unknown.
pub fn error_text(mm: f64) -> String {
    if mm.is_finite() { format!("{mm:.3}") } else { "-".into() }
}

/// Largest number of courses that are listed singly; of more, the first and the last half of it.
const MOST_LISTED: usize = 12;

impl Report<'_> {
    /// Report as JSON.
    pub fn json(&self) -> Value {
        let timing = self.real_time.map(|r| {
            json!({
                "simulation": timing_json(&r.simulation), "control": timing_json(&r.control),
                "stolen_s": r.stolen, "lost": r.lost, "records_dropped": r.dropped,
                "failures": r.failures.iter().map(ToString::to_string).collect::<Vec<_>>(),
            })
        });
        let last = self.results.last();
        json!({
            "courses": self.results, "rms_true_mm": last.map(|r| r.error.rms_true_mm),
            "rms_measured_mm": last.map(|r| r.error.rms_measured_mm), "peak_true_mm": last.map(|r| r.error.peak_true_mm),
            "peak_measured_mm": last.map(|r| r.error.peak_measured_mm),
            "stable": last.map(|r| r.stable), "sustained_oscillation": last.and_then(|r| r.sustained_oscillation),
            "fault": last.and_then(|r| r.fault), "paper": self.paper,
            "simulated_time": self.simulated.map(|s| s.error),
            "synchronised": self.synchronised, "timing": timing, "processor": processor(),
            "plant": self.cranes.json(), "attachment": self.attachment.map(AttachmentResult::json),
        })
    }

    /// Report as text.
    pub fn text(&self) -> String {
        let row = |name: &str, error: TrackingError, end: &str| {
            let errors = error.cells().map(error_text);
            let names = std::iter::once(name.to_string());
            names.chain(errors).chain([end.to_string()]).collect::<Vec<String>>()
        };
        // the error of an oscillating loop is no tracking error
        let of_course = |name: &str, r: &CourseResult| match r.sustained_oscillation {
            None => row(name, r.error, &end_text(r)),
            Some(_) => {
                let errors = vec!["unstable".to_string(); 4];
                [vec![name.to_string()], errors, vec![end_text(r)]].concat()
            }
        };
        let mut rows = Vec::new();
        let skipped = self.results.len().saturating_sub(MOST_LISTED);
        for (k, r) in self.results.iter().enumerate() {
            if skipped > 0 && (MOST_LISTED / 2..MOST_LISTED / 2 + skipped).contains(&k) {
                if k == MOST_LISTED / 2 {
                    rows.push(
                        [vec![format!("... {skipped} more")], vec![String::new(); 5]].concat(),
                    );
                }
                continue;
            }
            let then = r.then.map_or(String::new(), |then| format!(", then {then}"));
            let name = format!("{} with {}{then}", r.course, r.strategy);
            rows.push(of_course(&name, r));
        }
        if let Some(simulated) = self.simulated {
            rows.push(of_course("the first in simulated time", simulated));
        }
        if let Some([rms_measured_mm, peak_measured_mm]) = self.paper {
            let paper =
                TrackingError { rms_measured_mm, peak_measured_mm, ..TrackingError::UNFINISHED };
            rows.push(row("paper, measured on its crane", paper, ""));
        }
        let [rms_true, rms_measured, peak_true, peak_measured] = TrackingError::HEADS;
        let header = ["course", rms_true, rms_measured, peak_true, peak_measured, "ended"];
        let mut text = format!(
            "Tracking error x - x_ref on \"{}\"\n{}",
            self.cranes.name(),
            output::table(&header, &rows)
        );
        if self.real_time.is_some() || self.attachment.is_some() {
            text += &format!("\n{SENSORS_ONLY}");
        }
        if let Some(attachment) = self.attachment {
            text += &format!("\n{}", attachment.text());
        }
        if let Some(equality) = self.cranes.equality() {
            text += &format!("\n{equality}");
        }
        if let Some(drift) = self.drift() {
            text += &format!("\n{drift}");
        }
        if self.synchronised > 0 {
            text += &format!("\nthe simulation was set to the machine {} times", self.synchronised);
        }
        if let Some(real_time) = self.real_time {
            text += &timing_table(&self.cranes.model, real_time);
        }
        text
    }

    /// Remark on RMS error and memory over the completed courses; none for fewer than three.
    fn drift(&self) -> Option<String> {
        let whole: Vec<&CourseResult> = self.results.iter().filter(|r| r.fault.is_none()).collect();
        let (first, last) = (whole.first()?, whole.last()?);
        if whole.len() < 3 {
            return None;
        }
        let rms = |of: fn(f64, f64) -> f64, from: f64| {
            whole.iter().map(|r| r.error.rms_measured_mm).fold(from, of)
        };
        let memory = first.memory_mb.zip(last.memory_mb);
        let memory = memory.map_or(String::new(), |(a, b)| format!("; memory {a:.1} to {b:.1} MB"));
        let faults = self.results.len() - whole.len();
        Some(format!(
            "{} courses whole, {faults} ended by a fault: RMS measured {:.3} to {:.3} mm, the first {:.3}, the last {:.3}{memory}",
            whole.len(),
            rms(f64::min, f64::INFINITY),
            rms(f64::max, 0.0),
            first.error.rms_measured_mm,
            last.error.rms_measured_mm,
        ))
    }
}

/// Remarks on execution times: which cores the tasks have, and the time that a hypervisor took \[ms\].
pub fn remarks(r: &RealTime) -> String {
    let mut text = String::from(
        "Execution is the thread's time on its processor; the time of other threads is separate. The simulation \
         has core 1; the control task shares core 0 with the machine's process, the log and everything else.",
    );
    match r.stolen {
        Some([simulation, control]) => {
            text += &format!(
                " The hypervisor reports that it took {:.0} ms from the simulation's core and {:.0} ms from \
                 control's.",
                simulation * 1e3,
                control * 1e3
            );
        }
        None => text += " The kernel does not report the time taken by a hypervisor.",
    }
    text
}

/// Deadline statistics of a task as JSON.
fn timing_json(t: &Timing) -> serde_json::Value {
    json!({
        "period_us": t.period as f64 * 1e-3, "steps": t.steps, "missed": t.missed,
        "execution_p50_us": t.execution_us(0.5), "execution_p999_us": t.execution_us(0.999),
        "execution_worst_us": t.worst.0 as f64 * 1e-3, "worst_at_s": t.worst.1 as f64 * 1e-9,
        "late_p50_us": t.lateness_us(0.5), "late_p999_us": t.lateness_us(0.999),
        "late_worst_us": t.lateness_us(1.0), "taken_by_others_ms": t.taken as f64 * 1e-6,
    })
}

/// Deadline statistics of both tasks, failures and losses.
fn timing_table(model: &Description, r: &RealTime) -> String {
    let row = |name: &str, t: &Timing| {
        vec![
            name.to_string(),
            format!("{:.0}", t.period as f64 * 1e-3),
            t.steps.to_string(),
            format!("{:.2}", t.execution_us(0.5)),
            format!("{:.2}", t.execution_us(0.999)),
            format!("{:.1} at {:.3} s", t.worst.0 as f64 * 1e-3, t.worst.1 as f64 * 1e-9),
            format!("{:.1}", t.lateness_us(0.5)),
            format!("{:.1}", t.lateness_us(0.999)),
            format!("{:.1}", t.lateness_us(1.0)),
            t.missed.to_string(),
            format!("{:.1}", t.taken as f64 * 1e-6),
        ]
    };
    let header = [
        "task",
        "period [us]",
        "steps",
        "execution p50 [us]",
        "p99.9",
        "worst",
        "late p50 [us]",
        "p99.9",
        "worst",
        "missed",
        "taken by others [ms]",
    ];
    let table =
        output::table(&header, &[row("simulation", &r.simulation), row("control", &r.control)]);
    let mut text = format!(
        "\n\nDeadlines on {}\n{table}\n{} The paper ran both tasks at {:.0} us and {:.0} us on its IPC and \
         prints no execution times.",
        processor(),
        remarks(r),
        model.numbers.simulation_period * 1e6,
        model.numbers.control_period * 1e6,
    );
    for failure in &r.failures {
        text += &format!("\n{failure}");
    }
    for lost in &r.lost {
        text += &format!("\nnot granted: {lost}");
    }
    if r.dropped > 0 {
        text += &format!("\n{} records were lost on their way here", r.dropped);
    }
    text
}

/// Processor, number of its cores, and kernel, as named by the system.
pub fn processor() -> String {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let cpus = read("/proc/cpuinfo");
    let model = cpus.lines().find_map(|line| line.strip_prefix("model name"));
    let model = model.and_then(|rest| rest.split(':').nth(1)).unwrap_or("an unknown processor");
    let cores = cpus.lines().filter(|line| line.starts_with("processor")).count();
    format!("{}, {cores} cores, Linux {}", model.trim(), read("/proc/sys/kernel/osrelease").trim())
}
