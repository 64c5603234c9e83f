//! State of a search in a file, to continue after an interruption.

use hydroboom_files::{own_text, write};
use hydroboom_identify::Progress;
use miette::{IntoDiagnostic, Result, miette};
use serde_json::{Value, json};
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Shortest interval between two writes of the file.
const WRITE_INTERVAL: Duration = Duration::from_secs(1);

/// Longest journal that is read \[B\].
const LONGEST_FILE: u64 = 1_000_000;

/// File with the best point of a search.
pub struct Journal {
    path: PathBuf,
    /// Identification of the search: the journal of another one is refused.
    search: String,
    /// Parameter vector of an interrupted search.
    start: Option<Vec<f64>>,
    written: RefCell<Option<Instant>>,
}

impl Journal {
    /// Opens a journal at a path, and reads the point of an interrupted search where it exists.
    ///
    /// # Errors
    ///
    /// If the file cannot be read, is no journal, or that of another search.
    pub fn open(path: &Path, search: String) -> Result<Self> {
        let journal = Self { path: path.into(), search, start: None, written: RefCell::new(None) };
        if !path.exists() {
            return Ok(journal);
        }
        let wrong = |why: &str| {
            miette!(help = "remove it to begin anew, or name another", "{} {why}", path.display())
        };
        let text = own_text(path, "journal", LONGEST_FILE).into_diagnostic()?;
        let whole: Value =
            serde_json::from_str(&text).map_err(|_| wrong("is no journal of a search"))?;
        if whole["search"].as_str() != Some(&journal.search) {
            return Err(wrong("is the journal of another search: other keys, logs or crane"));
        }
        let point: Option<Vec<f64>> =
            whole["at"].as_array().and_then(|list| list.iter().map(Value::as_f64).collect());
        let start = Some(point.ok_or_else(|| wrong("holds no place of a search"))?);
        Ok(Self { start, ..journal })
    }

    /// Parameter vector from which an interrupted search continues; none for a new search.
    pub fn start(&self) -> Option<&[f64]> {
        self.start.as_deref()
    }

    /// Writes the best point of a search, at most once a second unless `at_once`.
    ///
    /// # Errors
    ///
    /// If the file cannot be written.
    pub fn keep(&self, progress: &Progress<'_>, at_once: bool) -> Result<()> {
        let is_due = self.written.borrow().is_none_or(|at| at.elapsed() > WRITE_INTERVAL);
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
