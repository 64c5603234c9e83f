//! Origin of a report.

use maud::{Markup, html};

/// Origin of a report, with which it can be reproduced.
#[derive(Clone, Debug, Default)]
pub struct Origin {
    /// Version of the program.
    pub version: String,
    /// Command line as entered.
    pub command: String,
    /// Date (UTC) as text.
    pub date: String,
    /// Input files: meaning, name, and SHA-256 in hexadecimal.
    pub read: Vec<(String, String, String)>,
    /// Seed of the random numbers; none without random numbers.
    pub seed: Option<u64>,
}

impl Origin {
    /// Block at the end of a page.
    pub(super) fn block(&self) -> Markup {
        html! {
            footer {
                h2 { "How this was made" }
                dl {
                    dt { "program" } dd { "hydroboom " (self.version) }
                    dt { "command" } dd { code { (self.command) } }
                    dt { "date" } dd { (self.date) }
                    @for (what, name, digest) in &self.read {
                        dt { (what) } dd { (name) ", SHA-256 " code { (digest) } }
                    }
                    @if let Some(seed) = self.seed { dt { "seed" } dd { (seed) } }
                }
            }
        }
    }
}
