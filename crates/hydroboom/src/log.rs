//! `hydroboom log`

use crate::crane_file::CraneFile;
use crate::log_mapping::LogMapping;
use crate::output;
use crate::paths::{InputFile, OutputFile};
use clap::{Args, Subcommand};
use hydroboom_measurement::{Channel, Gap, Segment, Signals, TimeBase, sparkline};
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
    /// Say what a log has (CSV, TwinCAT Scope, Simulink, MAT, MDF, MCAP), and propose which column is what.
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

/// Gaps that are shown, at most.
const MOST_GAPS: usize = 5;
/// Segments that are shown of a clock, at most.
const MOST_SEGMENTS: usize = 20;

/// The segments of each clock that has several, with the columns that have it.
fn segments(channels: &[Channel]) -> Vec<(String, Vec<Segment>)> {
    let mut found: Vec<(Vec<&str>, Vec<Segment>)> = Vec::new();
    for channel in channels.iter().filter(|c| !c.breaks.is_empty()) {
        let segments = channel.segments();
        match found.iter_mut().find(|(_, other)| *other == segments) {
            Some((columns, _)) => columns.push(&channel.heading),
            None => found.push((vec![&channel.heading], segments)),
        }
    }
    let named = |columns: Vec<&str>| match columns.as_slice() {
        _ if columns.len() == channels.len() => "all columns".to_string(),
        [first, second, _, ..] => format!("{first}, {second} and {} more", columns.len() - 2),
        few => few.join(", "),
    };
    found.into_iter().map(|(columns, segments)| (named(columns), segments)).collect()
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
            let is_it =
                |column: &str| log.channel(column).is_some_and(|c| std::ptr::eq(c, channel));
            let entry = mapping.entries.iter().find(|(_, e)| is_it(&e.column));
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
                        "column": log.address(c), "unit": c.unit.map(|u| u.name).or(c.unknown_unit.as_deref()), "samples": c.values.len(),
                        "missing": range.map_or(c.values.len(), |r| r.missing),
                        "low": range.map(|r| r.low), "mean": range.map(|r| r.mean),
                        "high": range.map(|r| r.high),
                        "begin_s": base.as_ref().map(|b| b.begin), "end_s": base.as_ref().map(|b| b.end),
                        "interval_ms": base.as_ref().map(|b| b.interval * 1e3),
                        "jitter_ms": base.as_ref().map(|b| b.jitter * 1e3),
                        "gaps_s": base.as_ref().map(|b| b.gaps.iter().map(|g| [g.from, g.to]).collect::<Vec<_>>()),
                        "segments_s": c.segments().iter().map(|s| [s.begin, s.end]).collect::<Vec<_>>(),
                        "signal": taken_for(c).map(|(s, _)| s.key()),
                        "taken_in": taken_for(c).map(|(_, e)| e.unit.map(|u| u.name)),
                        "is_unit_guessed": taken_for(c).map(|(_, e)| e.is_unit_guessed),
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
                    let unit = entry.unit.map_or("-", |u| u.name);
                    format!("{} in {unit}{guess}", signal.symbol())
                });
                vec![
                    log.address(c),
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
        for (columns, segments) in segments(&log.channels) {
            for (k, segment) in segments.iter().enumerate().take(MOST_SEGMENTS) {
                said += &format!(
                    "\nsegment {} of {}: {:.3} to {:.3} s, {} samples ({columns})",
                    k + 1,
                    segments.len(),
                    segment.begin,
                    segment.end,
                    segment.samples
                );
            }
        }
        let mut gaps: Vec<Gap> = Vec::new();
        for base in log.channels.iter().filter_map(|c| TimeBase::of(&c.time)) {
            gaps.extend(
                base.gaps.into_iter().filter(|gap| !gaps.contains(gap)).collect::<Vec<_>>(),
            );
        }
        for gap in gaps.iter().take(MOST_GAPS) {
            said += &format!("\ngap from {:.3} to {:.3} s", gap.from, gap.to);
        }
        if gaps.len() > MOST_GAPS {
            said += &format!("\n{} more gaps", gaps.len() - MOST_GAPS);
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
