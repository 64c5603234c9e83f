//! Journal of evaluations, with which an interrupted search can be continued.
//!
//! The search is deterministic. Restarted with the journal, it requests the same evaluations in the same
//! order, reads them from the journal, and continues where it stopped.

use crate::LabError;
use hydroboom_files::{FileError, own_text, try_place};
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Longest journal that is read \[B\]: about 100 000 evaluations.
const LONGEST: u64 = 100_000_000;

/// Journal of evaluations, each found by the exact bits of its point.
pub struct Journal {
    known: HashMap<Vec<u64>, Option<Vec<f64>>>,
    file: Option<(PathBuf, File)>,
}

fn bits(point: &[f64]) -> Vec<u64> {
    point.iter().map(|x| x.to_bits()).collect()
}

impl Journal {
    /// Empty journal that is not stored in a file.
    pub fn in_memory() -> Self {
        Self { known: HashMap::new(), file: None }
    }

    /// Opens a journal file with its evaluations. `heading` identifies the search; a journal of another
    /// search is refused.
    ///
    /// # Errors
    ///
    /// [`LabError::Files`] if the file cannot be read, is longer than 100 MB or is no UTF-8 text, or its folder cannot
    /// be written. [`LabError::File`] if the file cannot be opened or written; [`LabError::Input`] if it belongs to
    /// another search.
    pub fn open(path: &Path, heading: &str) -> Result<Self, LabError> {
        let name = path.display().to_string();
        let failed = |error| LabError::File { path: name.clone(), error };
        let mut known = HashMap::new();
        let content = match own_text(path, "journal", LONGEST) {
            Ok(content) => content,
            Err(FileError::Read { error, .. }) if error.kind() == std::io::ErrorKind::NotFound => {
                String::new()
            }
            Err(error) => return Err(error.into()),
        };
        try_place(path)?;
        let mut lines = content.lines();
        if let Some(found) = lines.next()
            && found != heading
        {
            let reason = "is the journal of another calibration; remove it to start anew".into();
            return Err(LabError::Input { file: name, reason });
        }
        for line in lines {
            // an interrupted run may leave an incomplete line, whose evaluation is repeated
            if let Some((point, values)) = read(line) {
                known.insert(bits(&point), values);
            }
        }
        let mut file = OpenOptions::new().create(true).append(true).open(path).map_err(failed)?;
        if content.is_empty() {
            writeln!(file, "{heading}").map_err(failed)?;
        } else if !content.ends_with('\n') {
            writeln!(file).map_err(failed)?;
        }
        Ok(Self { known, file: Some((path.into(), file)) })
    }

    /// Evaluation at a point, from the journal if it has it, else computed by `make` and recorded. None if it fails;
    /// a failure is recorded too. Points are equal only bit by bit, so rounding makes another point.
    ///
    /// # Errors
    ///
    /// [`LabError::File`] if it cannot be recorded.
    pub fn evaluate(
        &mut self,
        point: &[f64],
        make: impl FnOnce() -> Option<Vec<f64>>,
    ) -> Result<Option<Vec<f64>>, LabError> {
        if let Some(values) = self.known.get(&bits(point)) {
            return Ok(values.clone());
        }
        let values = make();
        if let Some((path, file)) = &mut self.file {
            writeln!(file, "{}", line(point, values.as_deref()))
                .map_err(|error| LabError::File { path: path.display().to_string(), error })?;
        }
        self.known.insert(bits(point), values.clone());
        Ok(values)
    }

    /// Number of evaluations in the journal, including those read from its file.
    pub fn len(&self) -> usize {
        self.known.len()
    }

    /// Whether the journal has no evaluation.
    pub fn is_empty(&self) -> bool {
        self.known.is_empty()
    }
}

fn line(point: &[f64], values: Option<&[f64]>) -> String {
    let text =
        |numbers: &[f64]| numbers.iter().map(|x| format!("{x:e}")).collect::<Vec<_>>().join(",");
    format!("{};{};", text(point), values.map_or("failed".into(), text))
}

fn read(line: &str) -> Option<(Vec<f64>, Option<Vec<f64>>)> {
    let numbers =
        |text: &str| -> Option<Vec<f64>> { text.split(',').map(|x| x.parse().ok()).collect() };
    let mut parts = line.split(';');
    let (point, values) = (parts.next()?, parts.next()?);
    // the closing separator marks a complete line
    parts.next()?;
    match values {
        "failed" => Some((numbers(point)?, None)),
        _ => Some((numbers(point)?, Some(numbers(values)?))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interrupted_calibration_is_resumed_from_its_journal() {
        let path = std::env::temp_dir().join(format!("journal-{}.csv", std::process::id()));
        let points = [[0.1, 1.0 / 3.0], [2e-9, -7.0]];
        let mut journal = Journal::open(&path, "search 1").unwrap();
        for point in &points {
            journal.evaluate(point, || Some(vec![point[0].sin()])).unwrap();
        }
        journal.evaluate(&[9.0, 9.0], || None).unwrap();
        drop(journal);
        // as if killed while writing a line
        let whole = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, format!("{whole}3e-1,4")).unwrap();

        let mut again = Journal::open(&path, "search 1").unwrap();
        assert_eq!(again.len(), 3);
        for point in &points {
            let known = again.evaluate(point, || unreachable!("known")).unwrap();
            assert_eq!(known, Some(vec![point[0].sin()]));
        }
        assert_eq!(again.evaluate(&[9.0, 9.0], || unreachable!("known")).unwrap(), None);
        again.evaluate(&[0.3, 4.5], || Some(vec![1.0])).unwrap();
        drop(again);
        assert_eq!(Journal::open(&path, "search 1").unwrap().len(), 4);
        assert!(Journal::open(&path, "search 2").is_err());
        std::fs::remove_file(&path).unwrap();
    }
}
