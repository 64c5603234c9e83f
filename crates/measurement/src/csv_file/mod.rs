//! Delimited text of any origin, including exports of TwinCAT Scope and Simulink.
//!
//! ```text
//! lines -separator, decimal sign, head-> columns -names, units, content-> times -rows-> channels
//! ```
//!
//! Each time column begins a group of columns that were sampled together, so that an export with a time column for each
//! channel keeps its times. Unreadable parts are counted and reported; a log without any usable part is refused.

mod cell;
mod clock;
mod columns;
mod lines;
mod rows;
mod style;
mod times;

use crate::channel::{Channel, Measurement};
use crate::error::MeasurementError;
use crate::recording::Recording;
use crate::time_column::TimeColumn;
use columns::{Column, Kind};
use lines::{Lines, text};
use rows::Rows;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use style::Style;
use times::{Source, Times};

/// Largest number of lines from which the format is detected.
const FIRST_LINES: usize = 2_000;
const FIRST_BYTES: usize = 32 << 20;
/// Largest number of columns.
const MOST_COLUMNS: usize = 20_000;
/// Largest number of omitted columns that a message names.
const MOST_LISTED: usize = 5;

pub(crate) fn read(path: &Path, time: &TimeColumn) -> Result<Measurement, MeasurementError> {
    let file = path.display().to_string();
    let failed = |error| MeasurementError::File { file: file.clone(), error };
    let format = |reason: String| MeasurementError::Format { file: file.clone(), reason };
    let empty = |found: String| MeasurementError::Empty { file: file.clone(), found };
    let source = File::open(path).map_err(failed)?;
    let Some(mut lines) = Lines::of(source).map_err(failed)? else {
        let reason = "it is no text: CSV, MAT, MDF 4 and MCAP files are read";
        return Err(format(reason.into()));
    };
    let first = first_lines(&mut lines).map_err(failed)?;
    if first.iter().all(|line| line.trim().is_empty()) {
        return Err(empty("it is empty".into()));
    }
    let Some(style) = Style::find(&first) else {
        return Err(empty(
            "no row in it has two numbers or more beside each other (separated by tab, semicolon, comma, colon, blanks or |)".into(),
        ));
    };
    if style.width > MOST_COLUMNS {
        return Err(format(format!("it has {} columns; {MOST_COLUMNS} are read", style.width)));
    }
    let mut remarks = Vec::new();
    if lines.is_utf_16 {
        remarks.push("it is in UTF-16".into());
    }
    let columns = columns::columns(&style, &mut remarks);
    remarks.extend(remark_on_text(&columns));
    let bases = Times { file: &file, style: &style, columns: &columns, wanted: time }
        .bases(&mut remarks)?;
    let found = found(&columns, &bases);
    let is_counted = bases.iter().any(|b| matches!(b.source, Source::Counted { .. }));
    let mut rows = Rows::new(&style, &columns, bases);
    let count = first.len();
    for (k, line) in first.iter().enumerate().skip(style.first) {
        rows.add(k as u64 + 1, line, lines.is_cut && k + 1 == count);
    }
    drop(first);
    while !rows.is_ended {
        let number = lines.number + 1;
        let Some(line) = lines.next().map_err(failed)? else { break };
        let line = text(line).into_owned();
        rows.add(number, &line, lines.is_cut);
    }
    remarks.dedup();
    let is_relative = rows.origin.zero.is_some();
    remarks.extend(rows.remarks());
    let (count, bases) = rows.finish();
    let channels = channels(&file, &columns, bases, &mut remarks)?;
    if channels.is_empty() {
        return Err(empty(match count {
            0 => "there are no rows of numbers".to_string(),
            1 => "there is 1 row of numbers".to_string(),
            _ if is_counted => "no column of numbers is left".to_string(),
            _ => format!(
                "{count} rows were read, and no column of numbers beside the time with two times is left"
            ),
        }));
    }
    if is_relative {
        remarks.push("time is counted from the first sample".into());
    }
    Ok(Measurement { name: file, channels, remarks, time: found })
}

/// The lines from which the format is detected.
fn first_lines(lines: &mut Lines) -> std::io::Result<Vec<String>> {
    let mut first: Vec<String> = Vec::new();
    let mut bytes = 0;
    while first.len() < FIRST_LINES && bytes < FIRST_BYTES {
        let Some(line) = lines.next()? else { break };
        bytes += line.len();
        first.push(text(line).into_owned());
    }
    Ok(first)
}

/// Remark on columns of text, if there are any.
fn remark_on_text(columns: &[Column]) -> Option<String> {
    let words: Vec<&str> =
        columns.iter().filter(|c| c.kind == Kind::Text).map(|c| c.heading.as_str()).collect();
    if words.is_empty() {
        return None;
    }
    let more = words.len().saturating_sub(MOST_LISTED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let named: Vec<String> = words.iter().take(MOST_LISTED).map(|w| format!("\"{w}\"")).collect();
    Some(format!("columns of text are left out: {}{more}", named.join(", ")))
}

/// Channels of numbers of each time base with two times or more.
fn channels(
    file: &str,
    columns: &[Column],
    bases: Vec<(Vec<usize>, Recording)>,
    remarks: &mut Vec<String>,
) -> Result<Vec<Channel>, MeasurementError> {
    let mut channels = Vec::new();
    for (members, recording) in bases {
        let recorded = recording.finish(file, "line")?;
        remarks.extend(recorded.remarks);
        if recorded.time.len() < 2 {
            continue;
        }
        let (time, breaks): (Arc<[f64]>, Arc<[usize]>) =
            (recorded.time.into(), recorded.breaks.into());
        for (column, values) in members.iter().map(|c| &columns[*c]).zip(recorded.columns) {
            if column.kind == Kind::Number {
                let channel =
                    Channel::of(column.read.clone(), &column.heading, Arc::clone(&time), values);
                channels.push(channel.broken_at(Arc::clone(&breaks)));
            }
        }
    }
    Ok(channels)
}

/// The time column, if all columns share one.
fn found(columns: &[Column], bases: &[times::Base]) -> Option<TimeColumn> {
    let [base] = bases else { return None };
    match base.source {
        Source::Number { column, factor, .. } => {
            Some(TimeColumn::found(&columns[column].heading, Some(factor)))
        }
        Source::Stamp { column, .. } => Some(TimeColumn::found(&columns[column].heading, None)),
        Source::Counted { .. } => None,
    }
}
