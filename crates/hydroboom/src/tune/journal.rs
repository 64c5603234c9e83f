//! State of a search in a file, to continue after an interruption.

use hydroboom_files::{own_text, write};
use hydroboom_identify::Progress;
use miette::{IntoDiagnostic, Result, miette};
use serde_json::{Value, json};
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Shortest interval between two writes of the file.
const RARELY: Duration = Duration::from_secs(1);

/// Longest journal that is read \[B\].
const LONGEST: u64 = 1_000_000;

/// File with the best point of a search.
pub struct Journal {
    path: PathBuf,
    /// Identification of the search: the journal of another one is refused.
    search: String,
    written: RefCell<Option<Instant>>,
}

impl Journal {
    /// Opens a journal at a path, and returns the point that it contains.
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

    /// Writes the best point of a search at intervals.
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

    /// Removes the journal at the end of the search.
    pub fn remove(&self) {
        // a remaining journal does no harm: the next search starts at its point
        let _ = std::fs::remove_file(&self.path);
    }
}
