//! Where a search is, in a file, to go on after an interruption.

use hydroboom_files::{own_text, write};
use hydroboom_identify::Progress;
use miette::{IntoDiagnostic, Result, miette};
use serde_json::{Value, json};
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The file is not written more often than this.
const RARELY: Duration = Duration::from_secs(1);

/// Longest journal that is read \[B\].
const LONGEST: u64 = 1_000_000;

/// A search's best place, kept in a file.
pub struct Journal {
    path: PathBuf,
    /// What is searched: another search's place is refused.
    search: String,
    written: RefCell<Option<Instant>>,
}

impl Journal {
    /// A journal at a path, and the place it holds already.
    pub fn open(path: &Path, search: String) -> Result<(Self, Option<Vec<f64>>)> {
        let journal = Self { path: path.into(), search, written: RefCell::new(None) };
        if !path.exists() {
            return Ok((journal, None));
        }
        let wrong = |why: &str| {
            miette!(help = "remove it to begin anew, or name another", "{} {why}", path.display())
        };
        let text = own_text(path, "journal", LONGEST).into_diagnostic()?;
        let whole: Value =
            serde_json::from_str(&text).map_err(|_| wrong("is no journal of a search"))?;
        if whole["search"].as_str() != Some(&journal.search) {
            return Err(wrong("is the journal of another search: other keys, logs or crane"));
        }
        let at: Option<Vec<f64>> =
            whole["at"].as_array().and_then(|list| list.iter().map(Value::as_f64).collect());
        Ok((journal, Some(at.ok_or_else(|| wrong("holds no place of a search"))?)))
    }

    /// Keeps the best place of a search, now and then.
    pub fn keep(&self, progress: &Progress<'_>, at_once: bool) -> Result<()> {
        let is_due = self.written.borrow().is_none_or(|at| at.elapsed() > RARELY);
        if progress.best.is_empty() || !(is_due || at_once) {
            return Ok(());
        }
        let text = json!({ "search": self.search, "runs": progress.runs, "at": progress.best });
        write(&self.path, text.to_string().as_bytes()).into_diagnostic()?;
        *self.written.borrow_mut() = Some(Instant::now());
        Ok(())
    }

    /// The search has come to its end.
    pub fn remove(&self) {
        // a journal that stays does no harm: it begins a search where it ended
        let _ = std::fs::remove_file(&self.path);
    }
}
