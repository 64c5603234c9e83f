//! `hydroboom log`

mod inspect;

use crate::output;
use crate::paths::{InputFile, OutputFile};
use clap::{Args, Subcommand};
use hydroboom_realtime::log;
use inspect::Inspect;
use miette::{IntoDiagnostic, Result};
use serde_json::json;
use std::path::Path;

/// Inspect logs of machines, and convert those of `hydroboom run`.
#[derive(Args)]
#[command(after_help = "Examples:\n  hydroboom log inspect lift.csv --mapping-out lift.toml\n  \
    hydroboom log to-csv run.mcap --out run.csv")]
pub struct Log {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// List the columns of a log (CSV, TwinCAT Scope, Simulink, MAT, MDF, MCAP), and propose a mapping to signals.
    Inspect(Inspect),
    /// Write a log of `hydroboom run` as CSV.
    ToCsv(ToCsv),
}

#[derive(Args)]
struct ToCsv {
    /// The log (MCAP).
    log: InputFile,
    /// CSV to write; beside the log when not given.
    #[arg(long, value_name = "FILE")]
    out: Option<OutputFile>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Log {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If the log cannot be read.
    pub fn run(self) -> Result<()> {
        match self.command {
            Command::Inspect(command) => command.run(),
            Command::ToCsv(command) => command.run(),
        }
    }
}

impl ToCsv {
    /// Converts the log, and prints the number of its rows.
    fn run(self) -> Result<()> {
        let log::Table { header, rows, remarks } = log::read(&self.log).into_diagnostic()?;
        let beside_log = || self.log.with_extension("csv");
        let out = self.out.as_deref().map_or_else(beside_log, Path::to_path_buf);
        let mut csv = header.join(",") + "\n";
        for row in &rows {
            csv += &row.join(",");
            csv.push('\n');
        }
        output::file(&out, csv.as_bytes());
        if self.json {
            return output::json(
                &json!({ "written": out, "rows": rows.len(), "remarks": remarks }),
            );
        }
        let mut text = format!("{} rows in {}", rows.len(), out.display());
        for remark in &remarks {
            text += &format!("\nnote: {remark}");
        }
        output::text(&text)
    }
}
