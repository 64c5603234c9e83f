//! Errors with place, value read, allowed values and remedy.

use miette::{Diagnostic, NamedSource, SourceSpan};
use thiserror::Error;

/// Problem with a crane file or an override: what was read, what is allowed, and what to do.
#[derive(Clone, Debug, Error, Diagnostic)]
#[error("{message}")]
pub struct Problem {
    /// What was read, and what is allowed.
    pub message: String,
    /// Remedy; `None` if the message suffices.
    #[help]
    pub help: Option<String>,
    /// Position in [`source_code`](Self::source_code) \[byte\]; `None` for an override.
    #[label("{label}")]
    pub span: Option<SourceSpan>,
    /// Label of that position in the excerpt of the file.
    pub label: String,
    /// Text of the file, for the excerpt.
    #[source_code]
    pub source_code: Option<NamedSource<String>>,
}

impl Problem {
    /// A problem without a place in a file.
    pub(crate) fn plain(message: String, help: Option<String>) -> Self {
        Self { message, help, span: None, label: String::new(), source_code: None }
    }
}

/// Problems with a crane file or an override, all that were found.
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
