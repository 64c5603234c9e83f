//! `hydroboom log`

use crate::output;
use clap::{Args, Subcommand};
use hydroboom_realtime::log;
use miette::{IntoDiagnostic, Result};
use serde_json::json;
use std::path::PathBuf;

/// Convert logs of `hydroboom run`.
#[derive(Args)]
#[command(after_help = "Example: hydroboom log to-csv run.mcap --out run.csv")]
pub struct Log {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Write a log as CSV.
    ToCsv(ToCsv),
}

#[derive(Args)]
struct ToCsv {
    /// The log (MCAP).
    log: PathBuf,
    /// CSV to write; beside the log when not given.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Log {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let Command::ToCsv(asked) = self.command;
        let (header, rows) = log::read(&asked.log).into_diagnostic()?;
        let out = asked.out.unwrap_or_else(|| asked.log.with_extension("csv"));
        let mut csv = header.join(",") + "\n";
        for row in &rows {
            csv += &row.join(",");
            csv.push('\n');
        }
        output::file(&out, csv.as_bytes())?;
        match asked.json {
            true => output::json(&json!({ "written": out, "rows": rows.len() })),
            false => output::text(&format!("{} rows in {}", rows.len(), out.display())),
        }
    }
}
