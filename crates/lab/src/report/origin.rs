//! What a report says of its making.

use maud::{Markup, html};

/// What a report says of its making, so that it can be made again.
#[derive(Clone, Debug, Default)]
pub struct Origin {
    /// Version of the program.
    pub version: String,
    /// The command, as it was given.
    pub command: String,
    /// When (UTC).
    pub date: String,
    /// What was read: what it is, its name, and its SHA-256.
    pub read: Vec<(String, String, String)>,
    /// Seed of what was drawn at random, where something was.
    pub seed: Option<u64>,
}

impl Origin {
    /// The block at the end of a page.
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
