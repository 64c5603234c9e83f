//! `hydroboom tune`

mod channels;
mod held;
mod journal;
mod page;
mod profiles;

use crate::crane_file::CraneFile;
use crate::log_mapping::{LogMapping, LogWindow, suspicions};
use crate::output;
use crate::paths::{InputFile, OutputFile};
use crate::verdict_text;
use channels::Fixed;
use clap::Args;
use held::{HoldOut, InTurn};
use hydroboom_description::Description;
use hydroboom_description::schema::KEYS;
use hydroboom_identify::Stretch;
use hydroboom_identify::{
    COMPARED, Determination, Experiment, Fit, Free, HeldOut, IdentifyError, Improvement, Judgement,
    Nuisance, Profile, Task, Tuned, differences, experiment_for, fit, held_out, predict, verdict,
};
use hydroboom_lab::crane_file_text::{FoundValue, write_value};
use hydroboom_measurement::{Signals, digest, digest_of};
use indicatif::ProgressBar;
use journal::Journal;
use miette::{IntoDiagnostic, Result, miette};
use profiles::Profiles;
use serde_json::json;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use toml_edit::DocumentMut;

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
    fixed: Fixed,
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

impl Tune {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read_any()?;
        if self.crane.is_overridden() && self.out.is_some() {
            return Err(miette!(
                help = "write the values into the crane file first",
                "--set is not written to --out"
            ));
        }
        let free = match self.free.as_slice() {
            [only] if only == "auto" => Free::usual(&crane),
            named => named
                .iter()
                .map(|path| Free::of_model(path.trim()).into_diagnostic())
                .collect::<Result<Vec<Free>>>()?,
        };
        if let Some((k, twice)) = free.iter().enumerate().find(|(k, key)| free[..*k].contains(key))
        {
            miette::bail!("--free names {} twice (as its {}. key)", twice.path(), k + 1);
        }
        if let Some(zero) = free.iter().find(|key| key.value(&crane) <= 0.0) {
            miette::bail!("{} is zero: keys are changed in proportion to their value", zero.path());
        }
        let (mut experiments, mut digests, mut notes) = (Vec::new(), Vec::new(), Vec::new());
        let mut digests_of = Vec::new();
        for path in &self.log {
            let each = self.experiments(&crane, path, &mut notes)?;
            let digest = digest(path).into_diagnostic()?;
            digests_of.extend(std::iter::repeat_n(digest.clone(), each.len()));
            experiments.extend(each);
            digests.push(digest);
        }
        let tests = self.test_log.iter().map(|path| self.experiments(&crane, path, &mut notes));
        let tests = tests.collect::<Result<Vec<Vec<Experiment>>>>()?.concat();
        self.hold_out.checked(&experiments)?;
        let stop = Arc::new(AtomicBool::new(false));
        let told = Arc::clone(&stop);
        ctrlc::set_handler(move || told.store(true, Ordering::Relaxed)).into_diagnostic()?;

        let fixed = self.fixed.all();
        let asked = Asked { crane: &crane, free: &free, fixed: &fixed };
        let (mut held, mut in_turn) = (Vec::new(), Vec::new());
        if self.hold_out.in_turn {
            for stretch in &self.hold_out.hold_out {
                let rest: Vec<Experiment> =
                    experiments.iter().map(|e| e.without(&[*stretch])).collect();
                let what = format!("without {} to {} s: ", stretch.from, stretch.to);
                let found = self.search(asked, &rest, &stop, None, &what)?;
                held.extend(judged(&experiments, &found, *stretch));
                in_turn.push(InTurn::new(*stretch, &found));
            }
        }
        let rest: Vec<Experiment> = match self.hold_out.in_turn {
            true => experiments.clone(),
            false => experiments.iter().map(|e| e.without(&self.hold_out.hold_out)).collect(),
        };
        let kept = self.journal(&digests, &free)?;
        let found = self.search(asked, &rest, &stop, kept.as_ref(), "")?;
        let mut after = experiments.iter().zip(&found.predictions.1);
        let is_right =
            after.all(|(e, shown)| verdict(&differences(e, shown)).iter().all(Judgement::is_right));
        notes.extend((!is_right && self.generations == 0).then(|| LOCAL_SEARCH.into()));
        notes.extend(channels::at_limit(&found.channels));
        if !self.hold_out.in_turn {
            for stretch in &self.hold_out.hold_out {
                held.extend(judged(&experiments, &found, *stretch));
            }
        }
        let tests = tests
            .iter()
            .map(|e| tested(&crane, &found, e))
            .collect::<Result<Vec<Improvement>, IdentifyError>>()
            .into_diagnostic()?;
        let task = self.task(asked, &rest, None);
        let profiles = self.profiles.of(&task, &found, &stop)?;
        let outcome = Outcome {
            crane: &crane,
            experiments,
            found,
            held,
            in_turn,
            profiles,
            tests,
            digests,
            digests_of,
            notes,
        };
        let is_written = self.told(&outcome)?;
        // if the result could not be written, the journal is kept to find it again at once
        if let Some((journal, _)) = kept.filter(|_| is_written) {
            journal.remove();
        }
        Ok(())
    }

    /// Segments of a log as experiments for a crane; remarks are added to the notes.
    fn experiments(
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

    /// Journal of the search, and the state of an interrupted one.
    fn journal(
        &self,
        digests: &[String],
        free: &[Free],
    ) -> Result<Option<(Journal, Option<Vec<f64>>)>> {
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

    fn task<'a>(
        &self,
        asked: Asked<'a>,
        experiments: &'a [Experiment],
        resume: Option<&'a [f64]>,
    ) -> Task<'a> {
        let Asked { crane: model, free, fixed } = asked;
        Task { model, experiments, free, fixed, resume, generations: self.generations }
    }

    /// Runs one search; reports and stores its progress.
    fn search(
        &self,
        asked: Asked<'_>,
        experiments: &[Experiment],
        stop: &AtomicBool,
        kept: Option<&(Journal, Option<Vec<f64>>)>,
        what: &str,
    ) -> Result<Fit> {
        let bar = ProgressBar::new_spinner();
        let resume = kept.and_then(|(_, at)| at.as_deref());
        if resume.is_some() {
            bar.println("an interrupted search is continued");
        }
        let task = self.task(asked, experiments, resume);
        let failed = RefCell::new(None);
        let found = fit(&task, &|progress| {
            bar.set_message(format!("{what}{} runs, {:.0} left", progress.runs, progress.cost));
            bar.tick();
            let is_stopped = stop.load(Ordering::Relaxed);
            if let Some((journal, _)) = kept
                && let Err(error) = journal.keep(progress, is_stopped)
            {
                *failed.borrow_mut() = Some(error);
            }
            !is_stopped && failed.borrow().is_none()
        });
        bar.finish_and_clear();
        if let Some(error) = failed.into_inner() {
            return Err(error);
        }
        match (found, kept) {
            (Err(IdentifyError::Stopped), Some(_)) => Err(miette!(
                help = "the same command continues there",
                "stopped; the best point so far is kept"
            )),
            (Err(IdentifyError::Stopped), None) => {
                Err(miette!(help = "--out or --journal keep a search", "stopped; nothing is kept"))
            }
            (found, _) => found.into_diagnostic(),
        }
    }

    /// Writes and prints the results; returns whether a requested crane file was written.
    fn told(&self, outcome: &Outcome<'_>) -> Result<bool> {
        let Outcome { crane, found, digests, notes, held, profiles, tests, .. } = outcome;
        let mut is_written = true;
        if let Some(path) = &self.out {
            let text = self.written(found, digests)?;
            is_written = output::file(path, text.as_bytes());
        }
        if let Some(path) = &self.report {
            let page = page::page(outcome).into_diagnostic()?;
            output::page(path, &page, None);
        }
        match self.json {
            true => output::json(&json!({
                "held_out": held::in_json(held),
                "in_turn": outcome.in_turn.iter().map(InTurn::in_json).collect::<Vec<_>>(), "tests": tests.iter().map(improvement).collect::<Vec<_>>(),
                "crane": crane.name, "logs": self.log, "sha256": digests, "notes": notes,
                "runs": found.evaluations, "converged": found.has_converged,
                "keys": found.tuned.iter().map(in_json).collect::<Vec<_>>(),
                "verdicts": outcome.judged().map(|(log, judged)| json!({
                    "log": log, "aspects": verdict_text::in_json(&judged),
                })).collect::<Vec<_>>(),
                "channels": channels::in_json(&found.channels), "correlation": found.correlation,
                "channel_correlation": found.channel_correlation, "profiles": profiles::in_json(profiles),
                "differences": found.improvements.iter().map(improvement).collect::<Vec<_>>(),
            }))?,
            false => output::text(&self.said(outcome))?,
        }
        Ok(is_written)
    }

    /// Crane file with the fitted keys. Everything else is kept, including comments, except ranges that do
    /// not contain their new values.
    fn written(&self, found: &Fit, digests: &[String]) -> Result<String> {
        let mut document: DocumentMut = self.crane.text()?.parse().into_diagnostic()?;
        let logs: Vec<String> = self
            .log
            .iter()
            .zip(digests)
            .map(|(path, digest)| {
                let name =
                    path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into());
                format!("{name} (sha256 {})", &digest[..16])
            })
            .collect();
        for t in &found.tuned {
            let key = &KEYS[t.key.place];
            let (low, high) = t.interval();
            let how = match t.determination {
                Determination::Biased(reason) => format!("of an equivalent model: {reason}"),
                Determination::Determined => {
                    format!("95 %: {:.4e} to {:.4e}", key.to_unit(low), key.to_unit(high))
                }
                other => {
                    format!("the logs do not determine it: {}", other.reason().unwrap_or_default())
                }
            };
            let tuned = FoundValue {
                path: &key.path(),
                value: five_digits(key.to_unit(t.value.1)),
                provenance: "tuned",
                source: format!("to {}; {how}", logs.join(", ")),
            };
            write_value(&mut document, tuned);
        }
        Ok(document.to_string())
    }

    fn said(&self, outcome: &Outcome<'_>) -> String {
        let Outcome { found, notes, held, profiles, tests, .. } = outcome;
        let rows: Vec<Vec<String>> = found
            .tuned
            .iter()
            .map(|t| {
                let key = &KEYS[t.key.place];
                let (low, high) = t.interval();
                let number = |v: f64| format!("{:.5}", Shown(key.to_unit(v)));
                vec![
                    key.path(),
                    number(t.value.0),
                    number(t.value.1),
                    format!("{} to {}", number(low), number(high)),
                    format!("{:.1}", t.prior * 100.0),
                    match t.from_logs.is_finite() {
                        true => output::three_digits(t.from_logs * 100.0),
                        false => "nothing".into(),
                    },
                    determination(t).into(),
                    t.partner.as_ref().map_or(String::new(), |(k, c)| format!("{k} ({c:+.2})")),
                ]
            })
            .collect();
        let mut said = String::new();
        for (log, judged) in outcome.judged() {
            said += &format!("{log}: {}\n", verdict_text::said(&judged));
        }
        let header = [
            "key",
            "before",
            "after",
            "95 %",
            "prior sd [%]",
            "sd from logs [%]",
            "determined",
            "strongest correlation",
        ];
        said += &format!(
            "\n{} {} tuned, {} runs of the model{}\n{}\n",
            found.tuned.len(),
            if found.tuned.len() == 1 { "key" } else { "keys" },
            found.evaluations,
            if found.has_converged {
                ""
            } else {
                "; not converged: tune again from the file that is written"
            },
            output::table(&header, &rows)
        );
        if !found.channels.is_empty() {
            said += &format!("\n{}\n", channels::said(&found.channels));
        }
        for improvement in &found.improvements {
            said += &format!("\n{}, RMS: {}", improvement.log, before_and_after(improvement));
        }
        for improvement in tests {
            said += &format!(
                "\n{}, not used for tuning, RMS: {}",
                improvement.log,
                before_and_after(improvement)
            );
        }
        if let Some(carried) = carried(outcome) {
            said += &format!("\n{carried}");
        }
        if !held.is_empty() {
            said += &format!("\n\n{}\n", held::said(held));
        }
        if !outcome.in_turn.is_empty() {
            said += &format!("\n{}\n", held::keys_said(&outcome.in_turn));
        }
        if !profiles.is_empty() {
            said += &format!("\n\n{}\n", profiles::said(profiles));
        }
        for (t, reason) in found.tuned.iter().filter_map(|t| Some((t, t.biased()?))) {
            said += &format!("\n{} is biased, of an equivalent model: {reason}", t.key.path());
        }
        let mut open = open(found).peekable();
        if open.peek().is_some() {
            said += "\nthe logs do not determine these. Reason, and an experiment that would:";
        }
        for (t, reason) in open {
            let would = experiment_for(t.key);
            said += &format!("\n  {}: {reason}. Experiment: {would}", t.key.path());
        }
        for note in notes {
            said += &format!("\nnote: {note}");
        }
        for path in self.out.iter().chain(&self.report) {
            said += &output::named("written", path);
        }
        said
    }
}

/// Problem of a search.
#[derive(Clone, Copy)]
struct Asked<'a> {
    crane: &'a Description,
    free: &'a [Free],
    fixed: &'a [Nuisance],
}

/// Results of tuning.
struct Outcome<'a> {
    crane: &'a Description,
    experiments: Vec<Experiment>,
    found: Fit,
    held: Vec<HeldOut>,
    /// Results of the searches that held out one stretch after the other.
    in_turn: Vec<InTurn>,
    profiles: Vec<Profile>,
    tests: Vec<Improvement>,
    digests: Vec<String>,
    /// Digest of each experiment's log; a log may have several segments.
    digests_of: Vec<String>,
    notes: Vec<String>,
}

impl Outcome<'_> {
    /// Verdict on the tuned model, log by log.
    fn judged(&self) -> impl Iterator<Item = (&str, Vec<Judgement>)> {
        let pairs = self.experiments.iter().zip(&self.found.predictions.1);
        pairs.map(|(e, shown)| (e.name.as_str(), verdict(&differences(e, shown))))
    }
}

/// Prediction errors of the model on held-out stretches, in each log that contains them.
fn judged<'a>(
    experiments: &'a [Experiment],
    found: &'a Fit,
    stretch: Stretch,
) -> impl Iterator<Item = HeldOut> + 'a {
    let pairs = experiments.iter().zip(&found.predictions.1);
    pairs.filter_map(move |(experiment, prediction)| held_out(experiment, prediction, stretch))
}

/// Test log before and after the fit. The sensors of the same machine keep their delays and offsets.
fn tested(
    before: &Description,
    found: &Fit,
    experiment: &Experiment,
) -> Result<Improvement, IdentifyError> {
    let (a, b) = (predict(before, experiment)?, found.on_another_log(experiment)?);
    Ok(Improvement::new(experiment, &a, &b))
}

/// Sensor parameters applied to test logs; none without test logs.
fn carried(outcome: &Outcome<'_>) -> Option<&'static str> {
    (!outcome.tests.is_empty()).then_some(match outcome.found.sensors().is_empty() {
        true => "On logs that were not used no delay or offset is applied: all are fixed.",
        false => {
            "On logs that were not used the tuned model has the same sensors, with the delays and offsets above."
        }
    })
}

fn before_and_after(improvement: &Improvement) -> String {
    let parts = COMPARED.iter().zip(&improvement.rms).filter_map(|(signal, rms)| {
        let (unit, size) = signal.shown();
        let (a, b) = (*rms)?;
        Some(format!("{} {:.3} to {:.3} {unit}", signal.symbol(), a / size, b / size))
    });
    parts.collect::<Vec<_>>().join(", ")
}

fn improvement(of: &Improvement) -> serde_json::Value {
    let signals = COMPARED.iter().zip(&of.rms).filter_map(|(signal, rms)| {
        let (unit, size) = signal.shown();
        let (before, after) = (*rms)?;
        Some(json!({
            "signal": signal.key(), "unit": unit, "before": before / size, "after": after / size,
        }))
    });
    json!({ "log": of.log, "rms": signals.collect::<Vec<_>>() })
}

/// Determination of a key in a word.
fn determination(t: &Tuned) -> &'static str {
    match t.determination {
        Determination::Biased(_) => "BIASED",
        Determination::Determined => "yes",
        _ => "NO",
    }
}

/// Keys that are neither determined nor biased, with the reasons.
fn open(found: &Fit) -> impl Iterator<Item = (&Tuned, String)> {
    let all = found.tuned.iter().filter(|t| t.biased().is_none());
    all.filter_map(|t| Some((t, t.determination.reason()?)))
}

/// Remark on a search from one set of initial values whose model is not right.
const LOCAL_SEARCH: &str = "the tuned model is not right, and the search was a local one. It may have ended in a \
    local minimum; then the reasons given for keys do not hold. --generations 20 searches wider; --set changes \
    its start, to values that `hydroboom validate` suggests";

/// Number with five significant digits.
struct Shown(f64);

impl std::fmt::Display for Shown {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let size = self.0.abs();
        match size != 0.0 && !(1e-3..1e6).contains(&size) {
            true => write!(f, "{:.4e}", self.0),
            false => {
                let digits = (4 - size.max(1e-3).log10().floor() as i32).clamp(0, 7) as usize;
                write!(f, "{:.digits$}", self.0)
            }
        }
    }
}

fn five_digits(value: f64) -> f64 {
    format!("{value:.4e}").parse().unwrap_or(value)
}

fn in_json(t: &Tuned) -> serde_json::Value {
    let key = &KEYS[t.key.place];
    let (low, high) = t.interval();
    json!({
        "key": key.path(), "before": key.to_unit(t.value.0), "after": key.to_unit(t.value.1),
        "interval_95": [key.to_unit(low), key.to_unit(high)], "known_to_percent": t.prior * 100.0,
        "logs_say_to_percent": t.from_logs.is_finite().then_some(t.from_logs * 100.0),
        "others_exact_percent": t.others_exact.is_finite().then_some(t.others_exact * 100.0),
        "determined": t.is_determined(), "biased": t.biased(), "not_determined": t.determination.reason(),
        "partner": t.partner.as_ref().map(|(k, _)| k), "correlation": t.partner.as_ref().map(|(_, c)| c),
    })
}
