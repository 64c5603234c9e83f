//! Search for the values of the keys that reproduce the logs, with its progress and journal.

use super::journal::Journal;
use hydroboom_description::Description;
use hydroboom_identify::{Experiment, Fit, Free, IdentifyError, Nuisance, Task, fit};
use indicatif::ProgressBar;
use miette::{IntoDiagnostic, Result, miette};
use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Parameters of the searches: the same for all logs, and for parts of them.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    /// Initial model, whose values are the prior means.
    pub crane: &'a Description,
    /// Keys to be estimated.
    pub free: &'a [Free],
    /// Delays and offsets of channels that are fixed at zero.
    pub fixed: &'a [Nuisance],
    /// Generations of the global search before the local one; zero leaves it out.
    pub generations: usize,
}

impl<'a> Problem<'a> {
    /// Task of a fit to experiments, from the parameter vector `resume` of an interrupted search or from the model.
    pub fn task(self, experiments: &'a [Experiment], resume: Option<&'a [f64]>) -> Task<'a> {
        let Self { crane: model, free, fixed, generations } = self;
        Task { model, experiments, free, fixed, resume, generations }
    }

    /// Runs one search until it ends or `stop` is set, and shows its progress; `heading` comes before that. The best
    /// point so far is written into the journal, from which the search also continues.
    ///
    /// # Errors
    ///
    /// If the initial model cannot be simulated, the journal cannot be written, or the search was stopped.
    pub fn search(
        self,
        experiments: &'a [Experiment],
        stop: &AtomicBool,
        journal: Option<&'a Journal>,
        heading: &str,
    ) -> Result<Fit> {
        let bar = ProgressBar::new_spinner();
        let resume = journal.and_then(Journal::start);
        if resume.is_some() {
            bar.println("an interrupted search is continued");
        }
        let task = self.task(experiments, resume);
        let failed = RefCell::new(None);
        let found = fit(&task, &|progress| {
            bar.set_message(format!("{heading}{} runs, {:.0} left", progress.runs, progress.cost));
            bar.tick();
            let is_stopped = stop.load(Ordering::Relaxed);
            if let Some(journal) = journal
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
        match (found, journal) {
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
}

/// Flag that Ctrl-C sets from now on, to stop a search.
///
/// # Errors
///
/// If the signal handler cannot be installed.
pub fn stop_at_ctrl_c() -> Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).into_diagnostic()?;
    Ok(stop)
}
