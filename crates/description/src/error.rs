//! Errors with place, value read, allowed values and remedy.

use miette::{Diagnostic, NamedSource, SourceSpan};
use thiserror::Error;

/// A problem with a crane file or an override.
#[derive(Clone, Debug, Error, Diagnostic)]
#[error("{message}")]
pub struct Problem {
    /// Description of the problem.
    pub message: String,
    /// Remedy.
    #[help]
    pub help: Option<String>,
    /// Position in the file.
    #[label("{label}")]
    pub span: Option<SourceSpan>,
    /// Label of that position in the excerpt.
    pub label: String,
    /// Text of the file.
    #[source_code]
    pub source_code: Option<NamedSource<String>>,
}

impl Problem {
    /// A problem without a place in a file.
    pub(crate) fn plain(message: String, help: Option<String>) -> Self {
        Self { message, help, span: None, label: String::new(), source_code: None }
    }
}

/// All problems with a crane file.
#[derive(Clone, Debug, Error, Diagnostic)]
#[error("{name}: {} problem{}", problems.len(), if problems.len() == 1 { "" } else { "s" })]
pub struct DescriptionError {
    /// Name of the file.
    pub name: String,
    /// Problems, in the order of the file.
    #[related]
    pub problems: Vec<Problem>,
}

impl DescriptionError {
    /// A single problem without a place in a file.
    pub(crate) fn of(name: &str, message: String, help: Option<String>) -> Self {
        Self { name: name.into(), problems: vec![Problem::plain(message, help)] }
    }
}
