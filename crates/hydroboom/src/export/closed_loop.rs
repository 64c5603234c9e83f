//! `hydroboom export closed-loop`

use crate::crane_file::CraneFile;
use crate::interruptible::{Interruptible, of_requested};
use crate::machine_choice::MachineChoice;
use crate::output;
use crate::paths::OutputFile;
use clap::{Args, ValueEnum};
use hydroboom_control::reference::preview::PERIODS_AHEAD;
use hydroboom_control::supervision::frame::STATUS_FAULT;
use hydroboom_description::Description;
use hydroboom_export::c::Precision;
use hydroboom_export::closed_loop::{
    Case, Compiled, HEADER, Row, RustBenchmark, RustScheduledLqr, RustSimulationFeedforward,
    Target, bounds, cases, csv, moves, run, status_name,
};
use hydroboom_export::{controller, scheduled_lqr_controller, simulation_feedforward};
use miette::{IntoDiagnostic, Result};
use rayon::prelude::*;
use serde_json::json;
use std::path::Path;

/// Target of an exported controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ControllerTarget {
    /// Benchmark in Rust.
    Rust,
    /// Simulation feedforward in Rust.
    RustSimulationFeedforward,
    /// Scheduled LQR in Rust, with the full preview of the reference (at least 0.8 s).
    RustScheduledLqr,
    /// Benchmark in C.
    C,
    /// Simulation feedforward in C.
    CSimulationFeedforward,
    /// Scheduled LQR in C, with the full preview of the reference (at least 0.8 s).
    CScheduledLqr,
    /// Scheduled LQR in C, without a preview of the reference.
    CScheduledLqrWithoutPreview,
    /// Scheduled LQR in C, with the preview, in single precision.
    CScheduledLqrSingle,
    /// Benchmark as an FMU.
    Fmu,
    /// Simulation feedforward as an FMU.
    FmuSimulationFeedforward,
}

/// All targets, in the order of the table.
const ALL: [ControllerTarget; 10] = [
    ControllerTarget::Rust,
    ControllerTarget::RustSimulationFeedforward,
    ControllerTarget::RustScheduledLqr,
    ControllerTarget::C,
    ControllerTarget::CSimulationFeedforward,
    ControllerTarget::CScheduledLqr,
    ControllerTarget::CScheduledLqrWithoutPreview,
    ControllerTarget::CScheduledLqrSingle,
    ControllerTarget::Fmu,
    ControllerTarget::FmuSimulationFeedforward,
];

/// Control periods of preview for the scheduled LQR.
const PREVIEW: usize = PERIODS_AHEAD;

/// Run exported controllers in closed loop with the virtual crane, with holding and release at any position, wrong
/// inputs and changed gains, and compare with computed bounds.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom export closed-loop\n  hydroboom export closed-loop --target c --only stroke --csv table.csv\n  \
    hydroboom export closed-loop --target c --target c-scheduled-lqr --only moved --plant-set oil.transition_bar=10"
)]
pub struct ClosedLoop {
    #[command(flatten)]
    crane: CraneFile,
    /// Only this target; can be repeated.
    #[arg(long, value_enum)]
    target: Vec<ControllerTarget>,
    /// Only trials whose name contains this.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// Override a key of the virtual crane only; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    plant_set: Vec<String>,
    /// Table to write (CSV): every trial.
    #[arg(long, value_name = "FILE")]
    csv: Option<OutputFile>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl ClosedLoop {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, a target cannot be compiled, or a simulation fails.
    pub fn run(self) -> Result<()> {
        let MachineChoice { model, mut machine, .. } = MachineChoice::read(&self.crane, None)?;
        machine.set_together(self.plant_set.iter().map(String::as_str))?;
        let folder = std::env::temp_dir().join(format!("hydroboom-loop-{}", std::process::id()));
        self.check_csv_folder()?;
        let part = self.only.as_deref().unwrap_or("");
        let targets = if self.target.is_empty() { ALL.to_vec() } else { self.target.clone() };
        let mut all = cases(&model);
        all.extend(moves(&model));
        let extent = extent(&all);
        let selected: Vec<&Case> = all.iter().filter(|c| c.name().contains(part)).collect();
        if selected.is_empty() {
            miette::bail!(
                help = "names are those of the table, such as \"stroke NaN for 1 periods at rest\"",
                "no trial's name contains \"{part}\""
            );
        }
        let factories = targets
            .par_iter()
            .map(|controller| controller.factory(&model, &folder))
            .collect::<Result<Vec<_>>>();
        let factories = factories?;
        let jobs: Vec<(usize, &Case)> = (0..factories.len())
            .flat_map(|place| selected.iter().map(move |case| (place, *case)))
            .filter(|(place, case)| targets[*place].has_gains() || case.gain.is_none())
            .collect();
        let progress = Interruptible::new(jobs.len() as u64, "trials")?;
        let is_plain = |c: &&Case| c.moves && c.disturbed.is_none() && c.gain.is_none();
        let undisturbed = factories
            .par_iter()
            .map(|factory| {
                let plain = all.iter().find(is_plain).unwrap_or(&all[0]);
                let mut target = factory.target(&model)?;
                run(&model, &machine, plain, target.as_mut()).into_diagnostic()
            })
            .collect::<Result<Vec<_>>>()?;
        let rows = jobs
            .par_iter()
            .map(|(place, case)| {
                if !progress.one_more() {
                    return Ok(None);
                }
                let mut target = factories[*place].target(&model)?;
                let outcome = run(&model, &machine, case, target.as_mut()).into_diagnostic()?;
                let plain = &undisturbed[*place];
                let bounds = bounds(&model, case, plain, &outcome).into_diagnostic()?;
                Ok(Some(Row::new(target.name(), case, outcome, bounds, plain)))
            })
            .collect::<Result<Vec<_>>>();
        drop(progress);
        // an error of the removal has no consequence
        let _ = std::fs::remove_dir_all(&folder);
        let rows: Vec<Row> = rows?.into_iter().flatten().collect();
        if let Some(path) = &self.csv {
            output::file(path, csv(&rows, true).as_bytes());
        }
        let beyond = rows.iter().filter(|row| !row.beyond.is_empty()).count();
        let period = model.numbers.control_period;
        if self.json {
            return output::json(&json!({
                "trials": rows.len(), "asked": jobs.len(), "beyond_bounds": beyond,
                "targets": target_summaries(&rows).iter().map(TargetSummary::json).collect::<Vec<_>>(),
                "rows": rows.iter().map(|row| in_json(row, period)).collect::<Vec<_>>(),
            }));
        }
        let all: Vec<Vec<String>> =
            target_summaries(&rows).iter().map(TargetSummary::cells).collect();
        let trials = text(&rows, jobs.len(), beyond);
        output::text(&format!("{trials}\n{extent}\n\n{}", output::table(&SUMMARY_HEADER, &all)))
    }

    /// Checks that the folder of the table exists, before the trials.
    ///
    /// # Errors
    ///
    /// If it does not.
    fn check_csv_folder(&self) -> Result<()> {
        let folder = self.csv.as_deref().and_then(Path::parent);
        match folder.filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir()) {
            Some(missing) => miette::bail!(
                help = "create the folder first, because the trials take minutes",
                "--csv: there is no folder {}",
                missing.display()
            ),
            None => Ok(()),
        }
    }
}

/// Factory of a target for each trial.
enum TargetFactory {
    Benchmark,
    SimulationFeedforward,
    ScheduledLqr,
    Program(Compiled),
}

impl ControllerTarget {
    /// Whether its gains can be changed during a run.
    fn has_gains(self) -> bool {
        !matches!(
            self,
            Self::RustScheduledLqr
                | Self::CScheduledLqr
                | Self::CScheduledLqrWithoutPreview
                | Self::CScheduledLqrSingle
        )
    }

    /// Compiles the target once.
    fn factory(self, model: &Description, folder: &Path) -> Result<TargetFactory> {
        let n = &model.numbers;
        let steps = (n.control_period / n.simulation_period).round().max(1.0) as u32;
        let folder = folder.join(format!("{self:?}"));
        let compiled = match self {
            Self::Rust => return Ok(TargetFactory::Benchmark),
            Self::RustSimulationFeedforward => return Ok(TargetFactory::SimulationFeedforward),
            Self::RustScheduledLqr => return Ok(TargetFactory::ScheduledLqr),
            Self::CScheduledLqr | Self::CScheduledLqrWithoutPreview | Self::CScheduledLqrSingle => {
                let (name, length, precision) = match self {
                    Self::CScheduledLqrSingle => {
                        ("C, scheduled LQR in float", PREVIEW, Precision::Single)
                    }
                    Self::CScheduledLqr => ("C, scheduled LQR", PREVIEW, Precision::Double),
                    _ => ("C, scheduled LQR without preview", 0, Precision::Double),
                };
                let block = scheduled_lqr_controller(model).into_diagnostic()?;
                Compiled::in_c_with_preview(name, &block, length, precision, &folder)
            }
            Self::C => {
                let block = controller(model).into_diagnostic()?;
                Compiled::in_c("C, benchmark", &block, 0, "cc", &folder)
            }
            Self::CSimulationFeedforward => {
                let block = simulation_feedforward(model).into_diagnostic()?;
                Compiled::in_c("C, simulation feedforward", &block, steps, "cc", &folder)
            }
            Self::Fmu => {
                let block = controller(model).into_diagnostic()?;
                Compiled::in_fmu("FMU, benchmark", &block, model, &folder)
            }
            Self::FmuSimulationFeedforward => {
                let block = simulation_feedforward(model).into_diagnostic()?;
                Compiled::in_fmu("FMU, simulation feedforward", &block, model, &folder)
            }
        };
        compiled.into_diagnostic().map(TargetFactory::Program)
    }
}

impl TargetFactory {
    /// Target in its initial state, designed for a model.
    fn target(&self, model: &Description) -> Result<Box<dyn Target>> {
        Ok(match self {
            Self::Benchmark => Box::new(RustBenchmark::new(model).into_diagnostic()?),
            Self::SimulationFeedforward => {
                Box::new(RustSimulationFeedforward::new(model).into_diagnostic()?)
            }
            Self::ScheduledLqr => {
                Box::new(RustScheduledLqr::new(model, PREVIEW).into_diagnostic()?)
            }
            Self::Program(compiled) => Box::new(compiled.start().into_diagnostic()?),
        })
    }
}

/// Payloads and initial positions of all test cases of a crane.
fn extent(all: &[Case]) -> String {
    let [least, most] = [f64::min, f64::max].map(|of| {
        let end = |value: fn(&Case) -> f64| all.iter().map(value).reduce(of).unwrap_or_default();
        (end(|case| case.payload), end(|case| case.stroke * 1e3))
    });
    format!(
        "Cases for this crane: payloads of {:.0} to {:.0} kg, piston positions of {:.0} to {:.0} mm.",
        least.0, most.0, least.1, most.1
    )
}

/// All undisturbed engagements; for wrong inputs the worst one of each input and kind.
fn text(rows: &[Row], requested: usize, beyond: usize) -> String {
    let mut cells: Vec<Vec<String>> = Vec::new();
    let plain = rows.iter().filter(|row| row.case.disturbed.is_none());
    cells.extend(plain.map(|row| row.cells().into()));
    let mut groups: Vec<(String, Vec<&Row>)> = Vec::new();
    for row in rows {
        let Some(d) = row.case.disturbed else { continue };
        let name = row.case.name();
        let input = name.split(' ').next().unwrap_or_default();
        let key = format!("{}|{input} {}", row.target, d.bad.name());
        match groups.iter_mut().find(|(known, _)| *known == key) {
            Some((_, group)) => group.push(row),
            None => groups.push((key, vec![row])),
        }
    }
    for (key, group) in groups {
        let moved = |row: &&Row| row.outcome.stopped_in.max(row.outcome.strayed);
        let worst = group.iter().copied().max_by(|a, b| moved(a).total_cmp(&moved(b)));
        let is_beyond = group.iter().copied().find(|row| !row.beyond.is_empty());
        if let Some(row) = is_beyond.or(worst) {
            let mut worst: Vec<String> = row.cells().into();
            worst[1] = match is_beyond {
                Some(row) => row.case.name(),
                None => {
                    format!("{}: worst of {}", key.split('|').nth(1).unwrap_or(""), group.len())
                }
            };
            cells.push(worst);
        }
    }
    format!(
        "{} trials on the virtual crane, {beyond} beyond their computed bounds (in brackets)\n{}",
        of_requested(rows.len(), requested),
        output::table(&HEADER, &cells)
    )
}

/// Results of all trials of a target.
struct TargetSummary {
    target: &'static str,
    trials: usize,
    /// Trials in which the controller moved the load to the end.
    controlled: usize,
    /// Trials that ended in a fault with the load held.
    faults: usize,
    beyond: usize,
    oscillating: usize,
    /// Motions completed by both it and the first target, and those of them with a larger RMS error.
    compared: usize,
    worse: usize,
}

/// Column headings of the comparison of targets.
const SUMMARY_HEADER: [&str; 8] = [
    "target",
    "trials",
    "controlled to the end",
    "fault",
    "beyond bounds",
    "sustained oscillation",
    "moves completed by both",
    "worse RMS than the first target",
];

impl TargetSummary {
    /// Row of the comparison.
    fn cells(&self) -> Vec<String> {
        let counts = [self.trials, self.controlled, self.faults, self.beyond, self.oscillating];
        let counts = counts.into_iter().chain([self.compared, self.worse]);
        std::iter::once(self.target.into()).chain(counts.map(|n| n.to_string())).collect()
    }

    /// Results as JSON.
    fn json(&self) -> serde_json::Value {
        json!({
            "target": self.target, "trials": self.trials, "controlled": self.controlled, "faults": self.faults, "beyond_bounds": self.beyond,
            "oscillating": self.oscillating, "moves_compared": self.compared, "moves_worse": self.worse,
        })
    }
}

/// Results of each target, compared with the first.
fn target_summaries(rows: &[Row]) -> Vec<TargetSummary> {
    let first = rows.first().map_or("", |row| row.target);
    let mut all: Vec<TargetSummary> = Vec::new();
    for group in rows.chunk_by(|a, b| a.target == b.target) {
        let count = |is: &dyn Fn(&Row) -> bool| group.iter().filter(|row| is(row)).count();
        let beside = |row: &Row| {
            let of_first = |r: &&Row| r.target == first && r.case == row.case;
            let other = rows.iter().find(of_first).map(|r| &r.outcome);
            let is_undisturbed = row.case.disturbed.is_none() && row.case.gain.is_none();
            let both = is_undisturbed && row.case.moves && row.outcome.is_controlled();
            other.filter(|o| both && o.is_controlled()).map(|o| row.outcome.rms > o.rms)
        };
        all.push(TargetSummary {
            target: group[0].target,
            trials: group.len(),
            controlled: count(&|row| row.outcome.is_controlled()),
            faults: count(&|row| row.outcome.status >= STATUS_FAULT),
            beyond: count(&|row| !row.beyond.is_empty()),
            oscillating: count(&|row| row.outcome.oscillates()),
            compared: count(&|row| beside(row).is_some()),
            worse: count(&|row| beside(row) == Some(true)),
        });
    }
    all
}

/// A trial as JSON; `period` is the control period \[s\].
fn in_json(row: &Row, period: f64) -> serde_json::Value {
    let (o, b) = (&row.outcome, &row.bounds);
    json!({
        "target": row.target, "trial": row.case.name(), "status": o.status,
        "status_name": status_name(o.status), "release_s": o.release_time,
        "lifted_mm": o.lifted * 1e3, "dropped_mm": o.dropped * 1e3, "dropped_bound_mm": b.dropped * 1e3,
        "engaged_mm": o.engaged * 1e3, "engaged_bound_mm": b.engaged * 1e3,
        "strayed_mm": o.strayed * 1e3, "strayed_bound_mm": b.strayed * 1e3,
        "stop_mm": o.stopped_in * 1e3, "stop_bound_mm": b.stopped * 1e3,
        "rms_error_mm": o.rms * 1e3, "largest_error_mm": o.error * 1e3,
        "swing_mm": o.swing(period) * 1e3, "oscillates": o.oscillates(),
        "stable": !o.oscillates(), "oscillation_amplitude_mm": o.oscillation[0] * 1e3, "oscillation_frequency_hz": o.oscillation[1],
        "off_mm": row.off * 1e3, "off_bound_mm": b.off * 1e3,
        "motor_rpm": o.motor_speed * 60.0, "motor_change_rpm_per_s": o.motor_slew * 60.0,
        "finite": !o.is_not_finite, "beyond": row.beyond,
    })
}
