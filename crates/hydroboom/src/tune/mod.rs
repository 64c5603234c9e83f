//! `hydroboom tune`

mod channels;
mod five_digits;
mod hold_out;
mod journal;
mod outcome;
mod outcome_json;
mod outcome_text;
mod page;
mod profiles;
mod search;
mod tuned_crane_file;

use crate::crane_file::CraneFile;
use crate::log_mapping::{LogMapping, LogWindow, suspicions};
use crate::output;
use crate::paths::{InputFile, OutputFile};
use channels::FixedNuisances;
use clap::Args;
use hold_out::{Fold, HoldOut};
use hydroboom_description::Description;
use hydroboom_identify::{Experiment, Free, HeldOut};
use hydroboom_measurement::{Signals, digest, digest_of};
use journal::Journal;
use miette::{IntoDiagnostic, Result, miette};
use outcome::{Outcome, hold_out_validation, is_right, test_log_improvement};
use profiles::Profiles;
use search::{Problem, stop_at_ctrl_c};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Fit keys of a crane file to logs (output-error identification), with confidence intervals.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom tune --log lift.csv --free boom.youngs_modulus_gpa,friction.coulomb_n \
    --out tuned.toml\n  hydroboom tune --crane my-crane.toml --log slow.csv --log fast.csv --free auto --out tuned.toml"
)]
pub struct Tune {
    #[command(flatten)]
    crane: CraneFile,
    /// Log; can be repeated, and all logs are fitted together.
    #[arg(long, value_name = "FILE", required = true)]
    log: Vec<InputFile>,
    #[command(flatten)]
    mapping: LogMapping,
    #[command(flatten)]
    window: LogWindow,
    /// Keys to fit, separated by commas; `auto` for those that logs of position and pressures usually determine.
    #[arg(long, value_name = "KEYS", value_delimiter = ',', required = true)]
    free: Vec<String>,
    /// Crane file to write, with provenance `tuned` and the digests of the logs.
    #[arg(long, value_name = "FILE")]
    out: Option<OutputFile>,
    /// Test log that is not fitted: the model's error on it, before and after the fit; can be repeated.
    #[arg(long, value_name = "FILE")]
    test_log: Vec<InputFile>,
    #[command(flatten)]
    fixed: FixedNuisances,
    #[command(flatten)]
    hold_out: HoldOut,
    #[command(flatten)]
    profiles: Profiles,
    /// Generations of a global search (CMA-ES) before the local one, for a model with large errors.
    #[arg(long, value_name = "COUNT", default_value_t = 0)]
    generations: usize,
    /// Journal of the search, to continue after Ctrl-C. Default: next to the file of --out.
    #[arg(long, value_name = "FILE")]
    journal: Option<OutputFile>,
    /// Report to write (HTML).
    #[arg(long, value_name = "FILE")]
    report: Option<OutputFile>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Logs that are fitted, as experiments.
struct FittedLogs {
    /// Segments of all logs, in the order of the options.
    experiments: Vec<Experiment>,
    /// SHA-256 of each log.
    digests: Vec<String>,
    /// SHA-256 of each experiment's log.
    experiment_digests: Vec<String>,
}

/// Remark on a search from one set of initial values whose model is not right.
const LOCAL_SEARCH: &str = "the tuned model is not right, and the search was a local one. It may have ended in a \
    local minimum; then the reasons given for keys do not hold. --generations 20 searches wider; --set changes \
    its start, to values that `hydroboom validate` suggests";

impl Tune {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, a simulation fails, or a search was stopped.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read_any()?;
        if self.crane.is_overridden() && self.out.is_some() {
            return Err(miette!(
                help = "write the values into the crane file first",
                "--set is not written to --out"
            ));
        }
        let free = self.free_keys(&crane)?;
        let mut notes = Vec::new();
        let logs = self.fitted_logs(&crane, &mut notes)?;
        let tests = self.test_log.iter().map(|path| self.segments(&crane, path, &mut notes));
        let tests = tests.collect::<Result<Vec<Vec<Experiment>>>>()?.concat();
        self.hold_out.check(&logs.experiments)?;
        let stop = stop_at_ctrl_c()?;

        let (fixed, generations) = (self.fixed.all(), self.generations);
        let problem = Problem { crane: &crane, free: &free, fixed: &fixed, generations };
        let (folds, mut held_out) = self.cross_validation(problem, &logs.experiments, &stop)?;
        let fitted = self.hold_out.fitted(&logs.experiments);
        let journal = self.journal(&logs.digests, &free)?;
        let fit = problem.search(&fitted, &stop, journal.as_ref(), "")?;
        let is_local = !is_right(&logs.experiments, &fit) && generations == 0;
        notes.extend(is_local.then(|| LOCAL_SEARCH.into()));
        notes.extend(channels::at_limit(&fit.channels));
        if !self.hold_out.in_turn {
            for stretch in &self.hold_out.hold_out {
                held_out.extend(hold_out_validation(&logs.experiments, &fit, *stretch));
            }
        }
        let tests = tests.iter().map(|test| test_log_improvement(&crane, &fit, test));
        let tests = tests.collect::<Result<Vec<_>, _>>().into_diagnostic()?;
        let profiles = self.profiles.compute(&problem.task(&fitted, None), &fit, &stop)?;
        let FittedLogs { experiments, digests, experiment_digests } = logs;
        let is_written = self.write(&Outcome {
            crane: &crane,
            experiments,
            fit,
            held_out,
            folds,
            profiles,
            tests,
            digests,
            experiment_digests,
            notes,
        })?;
        // if the result could not be written, the journal is kept to find it again at once
        if let Some(journal) = journal.filter(|_| is_written) {
            journal.remove();
        }
        Ok(())
    }

    /// Keys to be estimated.
    ///
    /// # Errors
    ///
    /// If a key is unknown, named twice, zero, or one on which no log depends.
    fn free_keys(&self, crane: &Description) -> Result<Vec<Free>> {
        let free = match self.free.as_slice() {
            [only] if only == "auto" => Free::usual(crane),
            named => named
                .iter()
                .map(|path| Free::of_model(path.trim()).into_diagnostic())
                .collect::<Result<Vec<Free>>>()?,
        };
        if let Some((k, twice)) = free.iter().enumerate().find(|(k, key)| free[..*k].contains(key))
        {
            miette::bail!("--free names {} twice (as its {}. key)", twice.path(), k + 1);
        }
        if let Some(zero) = free.iter().find(|key| key.value(crane) <= 0.0) {
            miette::bail!("{} is zero: keys are changed in proportion to their value", zero.path());
        }
        Ok(free)
    }

    /// Reads the logs that are fitted; remarks are added to the notes.
    ///
    /// # Errors
    ///
    /// If a log cannot be read or lacks a signal.
    fn fitted_logs(&self, crane: &Description, notes: &mut Vec<String>) -> Result<FittedLogs> {
        let (mut experiments, mut digests) = (Vec::new(), Vec::new());
        let mut experiment_digests = Vec::new();
        for path in &self.log {
            let segments = self.segments(crane, path, notes)?;
            let digest = digest(path).into_diagnostic()?;
            experiment_digests.extend(std::iter::repeat_n(digest.clone(), segments.len()));
            experiments.extend(segments);
            digests.push(digest);
        }
        Ok(FittedLogs { experiments, digests, experiment_digests })
    }

    /// Segments of a log as experiments for a crane; remarks are added to the notes.
    ///
    /// # Errors
    ///
    /// If the log cannot be read or lacks a signal.
    fn segments(
        &self,
        crane: &Description,
        path: &Path,
        notes: &mut Vec<String>,
    ) -> Result<Vec<Experiment>> {
        let (log, mapping) = self.mapping.read(path, crane)?;
        notes.extend(log.remarks.iter().map(|r| format!("{}: {r}", path.display())));
        let suspicions = suspicions(&log, &mapping, crane);
        notes.extend(suspicions.into_iter().map(|s| format!("suspicious: {}", s.text)));
        let signals = Signals::of(&log, &mapping).into_diagnostic()?;
        let each = Experiment::each(crane, &log, &signals, self.window.of()).into_diagnostic()?;
        let remarks = each.iter().flat_map(|experiment| &experiment.remarks);
        notes.extend(remarks.map(|r| format!("{}: {r}", path.display())));
        Ok(each)
    }

    /// Searches that hold out one stretch after the other, and the validation of each on its stretch; none unless
    /// `--in-turn` asks for them.
    ///
    /// # Errors
    ///
    /// If a simulation fails, or a search was stopped.
    fn cross_validation(
        &self,
        problem: Problem<'_>,
        experiments: &[Experiment],
        stop: &AtomicBool,
    ) -> Result<(Vec<Fold>, Vec<HeldOut>)> {
        let (mut folds, mut held_out) = (Vec::new(), Vec::new());
        if !self.hold_out.in_turn {
            return Ok((folds, held_out));
        }
        for stretch in &self.hold_out.hold_out {
            let rest: Vec<Experiment> =
                experiments.iter().map(|e| e.without(&[*stretch])).collect();
            let heading = format!("without {} to {} s: ", stretch.from, stretch.to);
            let fit = problem.search(&rest, stop, None, &heading)?;
            held_out.extend(hold_out_validation(experiments, &fit, *stretch));
            folds.push(Fold::new(*stretch, &fit));
        }
        Ok((folds, held_out))
    }

    /// Journal of the search, with the state of an interrupted one; none without a file for it.
    ///
    /// # Errors
    ///
    /// If the journal cannot be read, or is of another search.
    fn journal(&self, digests: &[String], free: &[Free]) -> Result<Option<Journal>> {
        let beside = || {
            let out = self.out.as_ref()?;
            let mut name = out.as_os_str().to_owned();
            name.push(".journal");
            // without a writable folder the search runs without a journal, and the missing output is
            // reported at the end
            Some(PathBuf::from(name)).filter(|path| {
                path.parent().is_none_or(|at| at.as_os_str().is_empty() || at.is_dir())
            })
        };
        let Some(path) = self.journal.as_deref().map(Path::to_path_buf).or_else(beside) else {
            return Ok(None);
        };
        let keys: Vec<String> = free.iter().map(|key| key.path()).collect();
        let windows =
            (&self.hold_out.hold_out, self.hold_out.in_turn, self.window.of(), self.fixed.all());
        let search = format!(
            "{}; {}; {}; {windows:?}",
            digest_of(self.crane.text()?.as_bytes()),
            digests.join(", "),
            keys.join(", ")
        );
        Journal::open(&path, search).map(Some)
    }

    /// Writes and prints the results; returns whether a requested crane file was written.
    ///
    /// # Errors
    ///
    /// If the crane file cannot be read again, or the report cannot be drawn.
    fn write(&self, outcome: &Outcome<'_>) -> Result<bool> {
        let mut is_written = true;
        if let Some(path) = &self.out {
            let text =
                tuned_crane_file::text(&self.crane, &self.log, &outcome.digests, &outcome.fit)?;
            is_written = output::file(path, text.as_bytes());
        }
        if let Some(path) = &self.report {
            let page = page::page(outcome).into_diagnostic()?;
            output::page(path, &page, None);
        }
        if self.json {
            output::json(&outcome_json::outcome_in_json(outcome, &self.log))?;
            return Ok(is_written);
        }
        let mut text = outcome_text::outcome_text(outcome);
        for path in self.out.iter().chain(&self.report) {
            text += &output::named("written", path);
        }
        output::text(&text)?;
        Ok(is_written)
    }
}
