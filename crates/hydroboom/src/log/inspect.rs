//! `hydroboom log inspect`: contents of a log, and the assignment of columns to signals.

use crate::crane_file::CraneFile;
use crate::log_mapping::{LogMapping, suspicions};
use crate::output;
use crate::paths::{InputFile, OutputFile};
use clap::Args;
use hydroboom_measurement::{
    Channel, Entry, Gap, Mapping, Measurement, Range, Segment, Signal, Suspicion, TimeBase,
    sparkline,
};
use miette::Result;
use serde_json::{Value, json};
use std::collections::HashMap;

/// Largest number of gaps shown.
const MOST_GAPS: usize = 5;
/// Largest number of segments shown per clock.
const MOST_SEGMENTS: usize = 20;

#[derive(Args)]
pub struct Inspect {
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

/// Column of a log.
struct Column<'a> {
    channel: &'a Channel,
    /// Name of the column in a mapping.
    address: String,
    /// Sampling times; none without samples.
    base: Option<TimeBase>,
    /// Range of the values; none if all are missing.
    range: Option<Range>,
    /// Signal assigned to the column.
    signal: Option<(Signal, &'a Entry)>,
}

impl Inspect {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, or the log cannot be read.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read_any()?;
        let (log, mapping, refused) = self.mapping.read_where_known(&self.log, &crane)?;
        let suspicions = suspicions(&log, &mapping, &crane);
        if let Some(path) = &self.mapping_out {
            output::file(path, mapping.to_toml().as_bytes());
        }
        let columns = columns(&log, &mapping);
        if self.json {
            let columns: Vec<Value> = columns.iter().map(Column::json).collect();
            let suspicions: Vec<&str> = suspicions.iter().map(|s| s.text.as_str()).collect();
            return output::json(&json!({
                "log": self.log, "channels": columns, "remarks": log.remarks, "refused": refused,
                "suspicions": suspicions,
            }));
        }
        let mut text = format!("{}: {}", self.log.display(), overview(&columns));
        for line in segment_lines(&log.channels).into_iter().chain(gap_lines(&columns)) {
            text += &format!("\n{line}");
        }
        text += &remarks(&log, &mapping, &refused, &suspicions);
        if let Some(path) = &self.mapping_out {
            text += &output::named("mapping", path);
        }
        output::text(&text)
    }
}

/// Columns of a log in their order.
fn columns<'a>(log: &'a Measurement, mapping: &'a Mapping) -> Vec<Column<'a>> {
    let of_entry = |(signal, entry): (&Signal, &'a Entry)| {
        let channel = log.channel(&entry.column)?;
        Some((std::ptr::from_ref(channel), (*signal, entry)))
    };
    let signals: HashMap<*const Channel, (Signal, &Entry)> =
        mapping.entries.iter().filter_map(of_entry).collect();
    log.channels
        .iter()
        .zip(log.addresses())
        .map(|(channel, address)| Column {
            channel,
            address,
            base: TimeBase::of(&channel.time),
            range: channel.range(),
            signal: signals.get(&std::ptr::from_ref(channel)).copied(),
        })
        .collect()
}

impl Column<'_> {
    /// Number of missing values.
    fn missing(&self) -> usize {
        self.range.map_or(self.channel.values.len(), |r| r.missing)
    }

    /// Smallest and largest value. With an assigned signal they are mapped values in the signal's unit.
    fn limits(&self) -> Option<(f64, f64)> {
        let range = self.range?;
        let Some((_, e)) = self.signal else { return Some((range.low, range.high)) };
        let [a, b] = [range.low, range.high].map(|v| e.sign * (e.scale * v + e.offset));
        Some((a.min(b), a.max(b)))
    }

    /// Column as JSON: values in its own unit, times \[s\].
    fn json(&self) -> Value {
        let Self { channel, base, range, signal, .. } = self;
        let base = base.as_ref();
        let gaps = |b: &TimeBase| b.gaps.iter().map(|g| [g.from, g.to]).collect::<Vec<_>>();
        json!({
            "column": self.address,
            "unit": channel.unit.map(|u| u.name).or(channel.unknown_unit.as_deref()),
            "samples": channel.values.len(),
            "missing": self.missing(),
            "low": range.map(|r| r.low), "mean": range.map(|r| r.mean), "high": range.map(|r| r.high),
            "begin_s": base.map(|b| b.begin), "end_s": base.map(|b| b.end),
            "interval_ms": base.map(|b| b.interval * 1e3),
            "jitter_ms": base.map(|b| b.jitter * 1e3),
            "gaps_s": base.map(gaps),
            "segments_s": channel.segments().iter().map(|s| [s.begin, s.end]).collect::<Vec<_>>(),
            "signal": signal.map(|(s, _)| s.key()),
            "signal_unit": signal.map(|(_, e)| e.unit.map(|u| u.name)),
            "is_unit_guessed": signal.map(|(_, e)| e.is_unit_guessed),
        })
    }

    /// Row of the table of columns.
    fn row(&self) -> Vec<String> {
        let number = |v: f64| match v.abs() {
            size if size != 0.0 && !(1e-3..1e6).contains(&size) => format!("{v:.4e}"),
            _ => format!("{v:.3}"),
        };
        let signal = self.signal.map(|(signal, entry)| {
            let guess = if entry.is_unit_guessed { "?" } else { "" };
            let unit = entry.unit.map_or("-", |u| u.name);
            format!("{} in {unit}{guess}", signal.symbol())
        });
        let of_base = |text: &dyn Fn(&TimeBase) -> String| {
            self.base.as_ref().map_or_else(|| "-".into(), text)
        };
        vec![
            excerpt(&self.address),
            signal.unwrap_or_default(),
            self.limits().map_or("-".into(), |(low, _)| number(low)),
            self.limits().map_or("-".into(), |(_, high)| number(high)),
            self.range.map_or("all".into(), |r| r.missing.to_string()),
            of_base(&|b| format!("{:.3}", b.interval * 1e3)),
            of_base(&|b| format!("{:.3}", b.jitter * 1e3)),
            of_base(&|b| b.gaps.len().to_string()),
            sparkline(&self.channel.values, 24),
        ]
    }
}

/// Largest number of letters of a column's name in a table.
const MOST_LETTERS: usize = 60;

/// Name for a table: one line of limited length.
fn excerpt(name: &str) -> String {
    let plain: String = name.chars().map(|c| if c.is_whitespace() { ' ' } else { c }).collect();
    match plain.chars().count() <= MOST_LETTERS {
        true => plain,
        false => plain.chars().take(MOST_LETTERS).collect::<String>() + "...",
    }
}

/// Number of columns, time range, and a table of them.
fn overview(columns: &[Column<'_>]) -> String {
    let bases = columns.iter().filter_map(|c| c.base.as_ref());
    let (begin, end) = bases.fold((f64::INFINITY, f64::NEG_INFINITY), |(begin, end), base| {
        (begin.min(base.begin), end.max(base.end))
    });
    let header = [
        "column",
        "signal",
        "min",
        "max",
        "missing",
        "interval [ms]",
        "jitter [ms]",
        "gaps",
        "trend",
    ];
    let rows: Vec<Vec<String>> = columns.iter().map(Column::row).collect();
    let table = output::table(&header, &rows);
    format!("{} columns, {begin:.3} to {end:.3} s\n{table}", columns.len())
}

/// Segments of each clock that has several, with its columns.
fn segments(channels: &[Channel]) -> Vec<(String, Vec<Segment>)> {
    let mut clocks: Vec<(Vec<&str>, Vec<Segment>)> = Vec::new();
    for channel in channels.iter().filter(|c| !c.breaks.is_empty()) {
        let segments = channel.segments();
        match clocks.iter_mut().find(|(_, other)| *other == segments) {
            Some((columns, _)) => columns.push(&channel.heading),
            None => clocks.push((vec![&channel.heading], segments)),
        }
    }
    let named = |columns: Vec<&str>| match columns.as_slice() {
        _ if columns.len() == channels.len() => "all columns".to_string(),
        [first, second, _, ..] => format!("{first}, {second} and {} more", columns.len() - 2),
        few => few.join(", "),
    };
    clocks.into_iter().map(|(columns, segments)| (named(columns), segments)).collect()
}

/// Segments of each clock, a line each.
fn segment_lines(channels: &[Channel]) -> Vec<String> {
    let mut lines = Vec::new();
    for (columns, segments) in segments(channels) {
        for (k, Segment { begin, end, samples }) in segments.iter().enumerate().take(MOST_SEGMENTS)
        {
            lines.push(format!(
                "segment {} of {}: {begin:.3} to {end:.3} s, {samples} samples ({columns})",
                k + 1,
                segments.len(),
            ));
        }
    }
    lines
}

/// All gaps, each once with its columns.
fn gap_lines(columns: &[Column<'_>]) -> Vec<String> {
    let mut gaps: Vec<Gap> = Vec::new();
    let mut bases: Vec<&TimeBase> = Vec::new();
    for base in columns.iter().filter_map(|c| c.base.as_ref()) {
        if !bases.contains(&base) {
            bases.push(base);
            let new: Vec<Gap> = base.gaps.iter().filter(|g| !gaps.contains(g)).copied().collect();
            gaps.extend(new);
        }
    }
    let shown = gaps.iter().take(MOST_GAPS);
    let mut lines: Vec<String> =
        shown.map(|gap| format!("gap from {:.3} to {:.3} s", gap.from, gap.to)).collect();
    if gaps.len() > MOST_GAPS {
        lines.push(format!("{} more gaps", gaps.len() - MOST_GAPS));
    }
    lines
}

/// Remarks on the reading of the log, suspicious values, and missing signals.
fn remarks(
    log: &Measurement,
    mapping: &Mapping,
    refused: &[String],
    suspicions: &[Suspicion],
) -> String {
    let mut text = String::new();
    for remark in &log.remarks {
        text += &format!("\nnote: {remark}");
    }
    for reason in refused {
        text += &format!("\nnot usable: {reason}");
    }
    for suspicion in suspicions {
        text += &format!("\nsuspicious: {}", suspicion.text);
    }
    let missing: Vec<&str> = Signal::COMPARED
        .into_iter()
        .chain([Signal::MotorSpeed])
        .filter(|signal| !mapping.entries.contains_key(signal))
        .map(Signal::symbol)
        .collect();
    if !missing.is_empty() {
        text += &format!("\nno column is taken for {}", missing.join(", "));
    }
    text
}
