//! Errors that say where, what was read, what is allowed and what to do.

use miette::{Diagnostic, NamedSource, SourceSpan};
use thiserror::Error;

/// One thing wrong with a crane file or an override.
#[derive(Clone, Debug, Error, Diagnostic)]
#[error("{message}")]
pub struct Problem {
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    #[help]
    pub help: Option<String>,
    /// Where, for files.
    #[label("{label}")]
    pub span: Option<SourceSpan>,
    /// What stands at that place.
    pub label: String,
    /// The file.
    #[source_code]
    pub source_code: Option<NamedSource<String>>,
}

impl Problem {
    /// A problem without a place in a file.
    pub(crate) fn plain(message: String, help: Option<String>) -> Self {
        Self { message, help, span: None, label: String::new(), source_code: None }
    }
}

/// All that is wrong with a crane file.
#[derive(Clone, Debug, Error, Diagnostic)]
#[error("{name}: {} problem{}", problems.len(), if problems.len() == 1 { "" } else { "s" })]
pub struct DescriptionError {
    /// Name of the file.
    pub name: String,
    /// Everything found, in the order of the file.
    #[related]
    pub problems: Vec<Problem>,
}

impl DescriptionError {
    /// A single problem without a place in a file.
    pub(crate) fn of(name: &str, message: String, help: Option<String>) -> Self {
        Self { name: name.into(), problems: vec![Problem::plain(message, help)] }
    }
}
