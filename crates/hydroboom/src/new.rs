//! `hydroboom new`

use crate::output;
use clap::Args;
use hydroboom_description::UIA_SINGLE_BOOM;
use miette::Result;
use std::path::PathBuf;

/// Write a complete crane file to start from: the paper's crane.
#[derive(Args)]
#[command(after_help = "Example: hydroboom new my-crane.toml")]
pub struct New {
    /// File to write; it must not exist.
    file: PathBuf,
    /// Print what was written as JSON.
    #[arg(long)]
    json: bool,
}

impl New {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        if self.file.exists() {
            miette::bail!(
                help = "choose another name, or remove it first",
                "{} exists already",
                self.file.display()
            );
        }
        output::file(&self.file, UIA_SINGLE_BOOM.as_bytes())?;
        let name = self.file.display().to_string();
        match self.json {
            true => output::json(&serde_json::json!({ "written": name })),
            false => output::text(&format!(
                "wrote {name}; edit it, then: hydroboom check --crane {name}"
            )),
        }
    }
}
