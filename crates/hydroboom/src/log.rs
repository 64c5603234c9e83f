//! `hydroboom log`

use crate::crane_file::CraneFile;
use crate::log_mapping::LogMapping;
use crate::output;
use crate::paths::{InputFile, OutputFile};
use clap::{Args, Subcommand};
use hydroboom_measurement::{Channel, Signals, TimeBase, sparkline};
use hydroboom_realtime::log;
use miette::{IntoDiagnostic, Result};
use serde_json::json;
use std::path::Path;

/// Look at logs of machines, and convert those of `hydroboom run`.
#[derive(Args)]
#[command(after_help = "Examples:\n  hydroboom log inspect lift.csv --mapping-out lift.toml\n  \
    hydroboom log to-csv run.mcap --out run.csv")]
pub struct Log {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Say what a log has (CSV, TwinCAT Scope, Simulink, MAT, MCAP), and propose which column is what.
    Inspect(Inspect),
    /// Write a log of `hydroboom run` as CSV.
    ToCsv(ToCsv),
}

#[derive(Args)]
struct Inspect {
    /// The log.
    log: InputFile,
    #[command(flatten)]
    mapping: LogMapping,
    /// Write the proposed mapping, to be changed and given to `validate` and `tune`.
    #[arg(long, value_name = "FILE")]
    mapping_out: Option<OutputFile>,
    #[command(flatten)]
    crane: CraneFile,
    /// Print JSON.
    #[arg(long)]
    json: bool,
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
    pub fn run(self) -> Result<()> {
        match self.command {
            Command::Inspect(asked) => asked.run(),
            Command::ToCsv(asked) => asked.run(),
        }
    }
}

impl ToCsv {
    fn run(self) -> Result<()> {
        let asked = self;
        let (header, rows) = log::read(&asked.log).into_diagnostic()?;
        let beside = || asked.log.with_extension("csv");
        let out = asked.out.as_deref().map_or_else(beside, Path::to_path_buf);
        let mut csv = header.join(",") + "\n";
        for row in &rows {
            csv += &row.join(",");
            csv.push('\n');
        }
        output::file(&out, csv.as_bytes());
        match asked.json {
            true => output::json(&json!({ "written": out, "rows": rows.len() })),
            false => output::text(&format!("{} rows in {}", rows.len(), out.display())),
        }
    }
}

impl Inspect {
    fn run(self) -> Result<()> {
        let crane = self.crane.read_any()?;
        let (log, mapping) = self.mapping.read(&self.log)?;
        let n = &crane.numbers;
        let suspicions = mapping.suspicions(&log, n.stroke, n.motor_speed);
        let signals = Signals::of(&log, &mapping).into_diagnostic()?;
        if let Some(path) = &self.mapping_out {
            output::file(path, mapping.to_toml().as_bytes());
        }
        let taken_for = |channel: &Channel| {
            let entry = mapping.entries.iter().find(|(_, e)| e.column == channel.heading);
            entry.map(|(signal, e)| (*signal, e))
        };
        if self.json {
            let channels: Vec<_> = log
                .channels
                .iter()
                .map(|c| {
                    let base = TimeBase::of(&c.time);
                    let range = c.range();
                    json!({
                        "column": c.heading, "unit": c.unit.map(|u| u.name), "samples": c.values.len(),
                        "missing": range.map_or(c.values.len(), |r| r.missing),
                        "low": range.map(|r| r.low), "mean": range.map(|r| r.mean),
                        "high": range.map(|r| r.high),
                        "begin_s": base.as_ref().map(|b| b.begin), "end_s": base.as_ref().map(|b| b.end),
                        "interval_ms": base.as_ref().map(|b| b.interval * 1e3),
                        "jitter_ms": base.as_ref().map(|b| b.jitter * 1e3),
                        "gaps_s": base.as_ref().map(|b| b.gaps.iter().map(|g| [g.from, g.to]).collect::<Vec<_>>()),
                        "signal": taken_for(c).map(|(s, _)| s.key()),
                        "taken_in": taken_for(c).map(|(_, e)| e.unit.name),
                    })
                })
                .collect();
            let suspicions: Vec<&str> = suspicions.iter().map(|s| s.text.as_str()).collect();
            return output::json(&json!({
                "log": self.log, "channels": channels, "remarks": log.remarks, "suspicions": suspicions,
            }));
        }
        let number = |v: f64| match v.abs() {
            size if size != 0.0 && !(1e-3..1e6).contains(&size) => format!("{v:.4e}"),
            _ => format!("{v:.3}"),
        };
        let rows: Vec<Vec<String>> = log
            .channels
            .iter()
            .map(|c| {
                let base = TimeBase::of(&c.time);
                let range = c.range();
                let signal = taken_for(c).map(|(signal, entry)| {
                    let guess = if entry.is_unit_guessed { "?" } else { "" };
                    format!("{} in {}{guess}", signal.symbol(), entry.unit.name)
                });
                vec![
                    c.heading.clone(),
                    signal.unwrap_or_default(),
                    range.map_or("-".into(), |r| number(r.low)),
                    range.map_or("-".into(), |r| number(r.high)),
                    range.map_or("all".into(), |r| r.missing.to_string()),
                    base.as_ref().map_or("-".into(), |b| format!("{:.3}", b.interval * 1e3)),
                    base.as_ref().map_or("-".into(), |b| format!("{:.3}", b.jitter * 1e3)),
                    base.as_ref().map_or("-".into(), |b| b.gaps.len().to_string()),
                    sparkline(&c.values, 24),
                ]
            })
            .collect();
        let header = [
            "column",
            "taken for",
            "low",
            "high",
            "missing",
            "interval [ms]",
            "jitter [ms]",
            "gaps",
            "course",
        ];
        let longest = log.channels.iter().filter_map(|c| TimeBase::of(&c.time));
        let (begin, end) = longest.fold((f64::INFINITY, f64::NEG_INFINITY), |(b, e), base| {
            (b.min(base.begin), e.max(base.end))
        });
        let mut said = format!(
            "{}: {} columns, {begin:.3} to {end:.3} s\n{}",
            self.log.display(),
            log.channels.len(),
            output::table(&header, &rows)
        );
        for gap in
            log.channels.iter().filter_map(|c| TimeBase::of(&c.time)).flat_map(|b| b.gaps).take(5)
        {
            said += &format!("\ngap from {:.3} to {:.3} s", gap.from, gap.to);
        }
        for remark in &log.remarks {
            said += &format!("\nnote: {remark}");
        }
        for suspicion in &suspicions {
            said += &format!("\nsuspicious: {}", suspicion.text);
        }
        let missing: Vec<&str> = hydroboom_measurement::Signal::COMPARED
            .into_iter()
            .filter(|s| signals.get(*s).is_none())
            .map(|s| s.symbol())
            .collect();
        if !missing.is_empty() {
            said += &format!("\nno column is taken for {}", missing.join(", "));
        }
        if let Some(path) = &self.mapping_out {
            said += &output::named("mapping", path);
        }
        output::text(&said)
    }
}
