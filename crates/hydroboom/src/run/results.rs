//! Results of a run: printed as text or JSON, written as a report, and with the data before a fault.

use super::Run;
use super::attachment::AttachmentResult;
use super::attendant::RunAttendant;
use super::course_result::CourseResult;
use super::fault_advice::fault_advice;
use super::page;
use super::report::{Report, processor};
use crate::machine_choice::MachineChoice;
use crate::output;
use hydroboom_control::supervision::limits::MachineStatus;
use hydroboom_lab::paper;
use hydroboom_realtime::executive::RealTime;
use hydroboom_realtime::session::FaultData;
use miette::{IntoDiagnostic, Report as Error, Result, miette};
use std::path::Path;

impl Run {
    /// Prints the results, and writes the report and the data before a fault. `simulated` is the result of the first
    /// course in simulated time.
    ///
    /// # Errors
    ///
    /// If the report cannot be drawn, or a fault ended the run without a dashboard and without `--carry-on`.
    pub(super) fn conclude(
        &self,
        cranes: &MachineChoice,
        attendant: &RunAttendant,
        simulated: Option<&CourseResult>,
        (real_time, attachment): (Option<&RealTime>, Option<&AttachmentResult>),
    ) -> Result<()> {
        let results = &attendant.results;
        let report = Report {
            cranes,
            results,
            simulated: simulated.filter(|_| real_time.is_some()),
            paper: self
                .paper_errors(cranes, results)
                .filter(|_| self.crane.is_papers_crane().unwrap_or(false)),
            synchronised: attendant.session().synchronised_in_all(),
            real_time,
            attachment,
        };
        if let Some(path) = &self.report {
            let page = page::run_page(
                cranes,
                results,
                report.paper,
                &attendant.records,
                real_time,
                &processor(),
            );
            output::page(path, &page.into_diagnostic()?, None);
        }
        self.print(&report)?;
        if let (Some(log), Some(frames)) =
            (&self.log, attachment.and_then(AttachmentResult::frames))
        {
            write_frames(log, frames);
        }
        let Some(fault) = attendant.session().fault() else { return Ok(()) };
        if let Some(report) = &self.report {
            write_fault_records(report, fault);
        }
        if self.dashboard.is_some() || self.carry_on {
            return Ok(());
        }
        let is_simulated_here = real_time.is_some() && !cranes.source.is_attached();
        let advice = match attachment.and_then(AttachmentResult::fault) {
            Some(sentence) => sentence.to_string(),
            None => fault_advice(fault.cause, is_simulated_here),
        };
        Err(fault_error(fault, advice))
    }

    fn print(&self, report: &Report<'_>) -> Result<()> {
        if self.json {
            return output::json(&report.json());
        }
        let mut text = report.text();
        for (what, path) in [("log", &self.log), ("report", &self.report)] {
            if let Some(path) = path {
                text += &output::named(what, path);
            }
        }
        output::text(&text)
    }

    /// RMS and largest error \[mm\] that the paper measured in the same test of the first course: same strategy and
    /// speed. None for a scenario, for a change of strategy, and for a test that the paper did not make.
    fn paper_errors(&self, cranes: &MachineChoice, results: &[CourseResult]) -> Option<[f64; 2]> {
        let result = results.first().filter(|r| r.then.is_none() && self.scenario.is_none())?;
        let speed = self.speed_mm_s.unwrap_or(cranes.model.numbers.fast * 1e3);
        let column = paper::SPEEDS_MM_S.iter().position(|v| (v - speed).abs() < 1e-6)?;
        let (rms, peak) = paper::tracking_mm(result.strategy.parse().ok()?)?;
        Some([rms[column], peak[column]])
    }
}

/// Writes the last frames of a bus before its fault (pcapng) beside the log.
fn write_frames(log: &Path, frames: &[u8]) {
    // never the log's own path
    let extension =
        if log.extension().is_some_and(|own| own == "pcapng") { "bus.pcapng" } else { "pcapng" };
    let capture = log.with_extension(extension);
    if output::file(&capture, frames) {
        output::note(&format!("the last frames before the fault: {}", capture.display()));
    }
}

/// Writes the records of the last second before a fault (CSV) beside the report.
fn write_fault_records(report: &Path, fault: &FaultData) {
    let data = report.with_extension("fault.csv");
    if output::file(&data, hydroboom_realtime::log::csv(&fault.records).as_bytes()) {
        output::note(&format!("the last second before the fault: {}", data.display()));
    }
}

/// Error of a run that a fault ended. The advice is the bus's own sentence on its fault, otherwise that on the cause.
fn fault_error(fault: &FaultData, advice: String) -> Error {
    let status = fault.records.last().and_then(|record| record.status);
    let code = match status {
        Some(MachineStatus::Fault { code }) => format!(", the machine's code {code:#06x}"),
        _ => String::new(),
    };
    miette!(
        help = advice,
        "the supervisor stopped it at {:.3} s: {}{code}",
        fault.time,
        fault.cause.code()
    )
}
