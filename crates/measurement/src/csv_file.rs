//! Delimited text: anybody's, and the exports of TwinCAT Scope and Simulink.
//!
//! A file is looked at first: its delimiter, its decimal sign, where its numbers begin. Each time column
//! begins a group of columns that were sampled together: exports in which every channel has a time column of
//! its own are read as what they are.

use crate::channel::{Channel, Measurement};
use crate::error::MeasurementError;
use crate::heading::{Heading, TIMES};
use crate::thinning::{Columns, MOST};
use crate::unit::Unit;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes of a file that are looked at first.
const HEAD: u64 = 64 * 1024;
/// Bytes of a row, at most.
const LONGEST_ROW: u64 = 4 << 20;
/// Cells that mean that nothing is there.
const MISSING: [&str; 7] = ["", "nan", "na", "n/a", "null", "-", "#nv"];
/// Ticks of Windows' file time in a second.
const FILE_TIME: f64 = 1e-7;
/// Times that are larger are counted from something far away, and are shown from the first one on \[s\].
const FAR: f64 = 1e7;

/// How a file is written.
struct Style {
    delimiter: u8,
    decimal_comma: bool,
    /// Rows before the numbers.
    head: Vec<Vec<String>>,
    /// Cells of the first row of numbers.
    width: usize,
}

/// A column of numbers.
struct Column {
    heading: String,
    read: Heading,
    is_time: bool,
    /// Interval that the head promises \[s\].
    interval: Option<f64>,
}

impl Column {
    /// Whether its heading says that it is a time, or promises an interval.
    fn is_named_as_time(&self) -> bool {
        self.interval.is_some() || self.read.is_named_as_time()
    }
}

pub(crate) fn read(path: &Path, time: Option<&str>) -> Result<Measurement, MeasurementError> {
    let file = path.display().to_string();
    let failed = |error| MeasurementError::File { file: file.clone(), error };
    let mut source = File::open(path).map_err(failed)?;
    let mut head = Vec::new();
    source.by_ref().take(HEAD).read_to_end(&mut head).map_err(failed)?;
    source.seek(SeekFrom::Start(0)).map_err(failed)?;
    let style = look(&file, &head)?;
    let mut remarks = Vec::new();
    let columns = columns(&file, &style, time, &mut remarks)?;
    let mut groups = Groups::new(&columns);
    let rows = Rows { file: &file, style: &style, columns: &columns };
    let has_named_time = time.is_some() || columns.iter().any(Column::is_named_as_time);
    rows.read(BufReader::new(source), &mut groups, &mut remarks).map_err(|error| match error {
        MeasurementError::Time { file, line, column, .. } if !has_named_time => {
            let units = match columns.iter().all(|c| c.read.unit.is_none()) {
                true => ", and no column has a unit",
                false => "",
            };
            let reason = format!(
                "no column is named as a time ({}), and the first, \"{column}\", is none: it goes back in line {line}{units}. A log without times is of no use: add a \
                 column of times in s, or name the one that there is ([log] time = \"...\" in a mapping)",
                TIMES[..6].join(", ")
            );
            MeasurementError::Format { file, reason }
        }
        other => other,
    })?;
    groups.finish(file, &columns, remarks)
}

/// A cell as a number; none where it is text, NaN where nothing is there.
fn number(cell: &str, decimal_comma: bool) -> Option<f64> {
    let cell = cell.trim().trim_matches('"').trim();
    if MISSING.iter().any(|m| cell.eq_ignore_ascii_case(m)) {
        return Some(f64::NAN);
    }
    let parsed = match decimal_comma {
        true => cell.replace(',', ".").parse::<f64>(),
        false => cell.parse::<f64>(),
    };
    match parsed {
        Ok(value) => Some(if value.is_finite() { value } else { f64::NAN }),
        Err(_) if cell.eq_ignore_ascii_case("true") => Some(1.0),
        Err(_) if cell.eq_ignore_ascii_case("false") => Some(0.0),
        Err(_) => None,
    }
}

fn cells(line: &str, delimiter: u8) -> Vec<String> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(delimiter)
        .from_reader(line.as_bytes());
    let record = reader.records().next().and_then(Result::ok);
    record.map_or_else(Vec::new, |r| r.iter().map(|c| c.trim().to_string()).collect())
}

/// Finds out how a file is written, from its beginning.
fn look(file: &str, head: &[u8]) -> Result<Style, MeasurementError> {
    let empty = |found: &str| MeasurementError::Empty { file: file.into(), found: found.into() };
    let text = String::from_utf8_lossy(head);
    let text = text.trim_start_matches('\u{feff}');
    if head.contains(&0) {
        let reason = "it is no text: CSV, MAT (level 4 to 7), MDF 4 and MCAP files are read".into();
        return Err(MeasurementError::Format { file: file.into(), reason });
    }
    let lines: Vec<&str> = text.lines().take(400).filter(|l| !l.trim().is_empty()).collect();
    if lines.is_empty() {
        return Err(empty("it is empty"));
    }
    // a row of numbers has no text, and more than one number; the delimiter is the one that gives most
    let mut best: Option<(usize, Style)> = None;
    for (delimiter, decimal_comma) in
        [(b'\t', false), (b'\t', true), (b';', false), (b';', true), (b'|', false), (b',', false)]
    {
        let rows: Vec<Vec<String>> = lines.iter().map(|line| cells(line, delimiter)).collect();
        let is_row = |row: &Vec<String>| {
            let numbers = row.iter().map(|cell| number(cell, decimal_comma));
            let numbers: Option<Vec<f64>> = numbers.collect();
            numbers.is_some_and(|n| n.len() > 1 && n.iter().any(|v| v.is_finite()))
        };
        let Some(first) = rows.iter().position(is_row) else { continue };
        let count = rows[first..].iter().filter(|row| is_row(row)).count();
        let width = rows[first..].iter().map(Vec::len).max().unwrap_or(0);
        let score = count * width;
        if best.as_ref().is_none_or(|(most, _)| score > *most) {
            let head = rows[..first].to_vec();
            best = Some((score, Style { delimiter, decimal_comma, head, width }));
        }
    }
    best.map(|(_, style)| style).ok_or_else(|| {
        empty("no row in it has two numbers or more beside each other (delimited by tab, semicolon, comma or |)")
    })
}

/// The columns, from what stands above them.
fn columns(
    file: &str,
    style: &Style,
    time: Option<&str>,
    remarks: &mut Vec<String>,
) -> Result<Vec<Column>, MeasurementError> {
    let label =
        |row: &Vec<String>, name: &str| row.first().is_some_and(|c| c.eq_ignore_ascii_case(name));
    let scope = style.head.iter().any(|row| label(row, "SampleTime[ms]"));
    let mut columns = match scope {
        true => scope_columns(style, remarks),
        false => plain_columns(style, remarks),
    };
    if let Some(wanted) = time {
        let found = columns.iter().position(|c| c.heading == wanted || c.read.name == wanted);
        let Some(found) = found else {
            let all = columns.iter().map(|c| c.heading.as_str()).collect::<Vec<_>>().join(", ");
            let reason =
                format!("the mapping names \"{wanted}\" as the time; the columns are: {all}");
            return Err(MeasurementError::Mapping { file: file.into(), reason });
        };
        for (k, column) in columns.iter_mut().enumerate() {
            column.is_time = k == found;
        }
    }
    if !columns.iter().any(|c| c.is_time) && columns.iter().all(|c| c.interval.is_none()) {
        let Some(first) = columns.first_mut() else { return Ok(columns) };
        first.is_time = true;
        remarks.push(format!(
            "no column is named as a time: \"{}\" is taken for it, in s",
            first.heading
        ));
    }
    Ok(columns)
}

/// A heading, its unit from a line below it, or from itself.
fn column(heading: &str, below: Option<&str>) -> Column {
    let read = Heading::with_unit(heading, below.unwrap_or(""));
    let is_time = read.is_named_as_time();
    Column { heading: heading.into(), read, is_time, interval: None }
}

fn plain_columns(style: &Style, remarks: &mut Vec<String>) -> Vec<Column> {
    let is_heading = |row: &&Vec<String>| {
        row.len() >= style.width
            && row.iter().all(|c| number(c, style.decimal_comma).is_none_or(f64::is_nan))
    };
    let mut rows = style.head.iter().rev().filter(is_heading);
    let Some(last) = rows.next() else {
        remarks.push("no row of names stands above the numbers: columns are counted".into());
        return (1..=style.width).map(|k| column(&format!("column_{k}"), None)).collect();
    };
    // a row of units stands below the names
    let strip = |text: &str| text.trim_start_matches('#').trim().to_string();
    let units = last.iter().filter(|c| Unit::find(&strip(c)).is_some());
    let (names, units) = match (units.count() * 2 > last.len(), rows.next()) {
        (true, Some(above)) => (above, Some(last)),
        _ => (last, None),
    };
    let below = |k: usize| units.and_then(|u| u.get(k)).map(|u| strip(u));
    (0..style.width)
        .map(|k| column(&strip(names.get(k).map_or("", |c| c)), below(k).as_deref()))
        .collect()
}

/// TwinCAT Scope: a block of rows, each beginning with its label, which stands above every time column too.
fn scope_columns(style: &Style, remarks: &mut Vec<String>) -> Vec<Column> {
    let row = |label: &str| {
        let is_it = |row: &&Vec<String>| row.first().is_some_and(|c| c.eq_ignore_ascii_case(label));
        style.head.iter().filter(is_it).max_by_key(|row| row.len())
    };
    let none = Vec::new();
    let names = row("Name").unwrap_or(&none);
    let (samples, units) = (row("SampleTime[ms]"), row("Unit"));
    // exported without time columns, the numbers have no cell below the labels
    let has_times = style.width >= names.len();
    let mut columns = Vec::new();
    for (k, name) in names.iter().enumerate() {
        let is_label = name.eq_ignore_ascii_case("Name");
        if is_label && !has_times {
            continue;
        }
        let below = units.and_then(|u| u.get(k)).filter(|_| !is_label);
        let mut column = column(name, below.map(String::as_str));
        column.is_time = is_label;
        if is_label {
            column.heading = "time".into();
            column.read = Heading::with_unit("time", "ms");
        } else if !has_times {
            let milliseconds =
                samples.and_then(|s| s.get(k)).and_then(|c| number(c, style.decimal_comma));
            column.interval = milliseconds.map(|ms| ms * 1e-3);
        }
        columns.push(column);
    }
    remarks.push("an export of TwinCAT Scope".into());
    columns
}

/// Rows of numbers.
struct Rows<'a> {
    file: &'a str,
    style: &'a Style,
    columns: &'a [Column],
}

impl Rows<'_> {
    fn read(
        &self,
        source: impl BufRead,
        groups: &mut Groups,
        remarks: &mut Vec<String>,
    ) -> Result<(), MeasurementError> {
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(self.style.delimiter)
            .from_reader(Bounded { source, since: 0 });
        let mut record = csv::ByteRecord::new();
        let mut row = vec![f64::NAN; self.columns.len()];
        let (mut short, mut is_data) = (0_u64, false);
        let failed = |e: csv::Error| {
            let (file, reason) = (self.file.into(), e.to_string());
            MeasurementError::Format { file, reason }
        };
        while reader.read_byte_record(&mut record).map_err(failed)? {
            reader.get_mut().since = 0;
            let line = record.position().map_or(0, csv::Position::line);
            let cell =
                |k: usize| record.get(k).map_or("", |c| std::str::from_utf8(c).unwrap_or("?"));
            if !is_data {
                let numbers = (0..record.len()).map(|k| number(cell(k), self.style.decimal_comma));
                let numbers: Option<Vec<f64>> = numbers.collect();
                is_data = numbers.is_some_and(|n| n.len() > 1 && n.iter().any(|v| v.is_finite()));
                if !is_data {
                    continue;
                }
            }
            if cell(0).trim() == "EOF" {
                break;
            }
            short += u64::from(record.len() < self.columns.len());
            for (k, column) in self.columns.iter().enumerate() {
                row[k] = number(cell(k), self.style.decimal_comma).ok_or_else(|| {
                    MeasurementError::Cell {
                        file: self.file.into(),
                        line,
                        column: column.heading.clone(),
                        text: cell(k).chars().take(40).collect(),
                        advice: "leave a cell empty, or write NaN, where nothing was measured",
                    }
                })?;
            }
            groups.add(self.file, self.columns, line, &row)?;
        }
        if short > 0 {
            remarks.push(format!(
                "{short} rows are shorter than the others: what is not there is missing"
            ));
        }
        Ok(())
    }
}

/// A file that ends with an error where a row does not end: a quote that nobody closed would make the rest of it one cell,
/// and be kept whole.
struct Bounded<R> {
    source: R,
    /// Bytes since a row ended.
    since: u64,
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.since > LONGEST_ROW {
            let reason = format!(
                "a row is longer than {} MB: is there a quote (\") that nobody closed?",
                LONGEST_ROW >> 20
            );
            return Err(std::io::Error::new(std::io::ErrorKind::InvalidData, reason));
        }
        let count = self.source.read(buffer)?;
        self.since += count as u64;
        Ok(count)
    }
}

/// Columns that share a time column.
struct Group {
    /// The time's column; none where samples are counted.
    time: Option<usize>,
    members: Vec<usize>,
    data: Columns,
    last: f64,
    count: u64,
    row: Vec<f64>,
}

struct Groups(Vec<Group>);

impl Groups {
    fn new(columns: &[Column]) -> Self {
        let mut parts: Vec<(Option<usize>, Vec<usize>)> = Vec::new();
        for (k, column) in columns.iter().enumerate() {
            match (column.is_time, parts.last_mut()) {
                (true, _) => parts.push((Some(k), Vec::new())),
                // a column without a time before it: the first time is for it too
                (false, None) => parts.push((None, vec![k])),
                (false, Some((time, members))) => {
                    let interval = |c: usize| columns[c].interval;
                    match time.is_none()
                        && members.first().is_some_and(|m| interval(*m) != interval(k))
                    {
                        true => parts.push((None, vec![k])),
                        false => members.push(k),
                    }
                }
            }
        }
        if let Some(first) = parts.iter().position(|(time, _)| time.is_some())
            && columns.iter().all(|c| c.interval.is_none())
        {
            let before: Vec<usize> =
                parts.drain(..first).flat_map(|(_, members)| members).collect();
            parts[0].1.splice(0..0, before);
        }
        let groups = parts.len().max(1);
        Self(
            parts
                .into_iter()
                .filter(|(_, members)| !members.is_empty())
                .map(|(time, members)| Group {
                    data: Columns::new(members.len() + 1, MOST / groups),
                    row: vec![f64::NAN; members.len() + 1],
                    time,
                    members,
                    last: f64::NEG_INFINITY,
                    count: 0,
                })
                .collect(),
        )
    }

    fn add(
        &mut self,
        file: &str,
        columns: &[Column],
        line: u64,
        row: &[f64],
    ) -> Result<(), MeasurementError> {
        for group in &mut self.0 {
            let time = match group.time {
                Some(column) => row[column],
                None => group.count as f64 * columns[group.members[0]].interval.unwrap_or(1.0),
            };
            // a channel that was sampled less often has no time in this row
            if time.is_nan() {
                continue;
            }
            if time < group.last {
                return Err(MeasurementError::Time {
                    file: file.into(),
                    line,
                    column: group.time.map_or(String::new(), |c| columns[c].heading.clone()),
                    before: group.last,
                    after: time,
                });
            }
            group.last = time;
            group.count += 1;
            group.row[0] = time;
            for (place, column) in group.members.iter().enumerate() {
                group.row[place + 1] = row[*column];
            }
            group.data.push(&group.row);
        }
        Ok(())
    }

    fn finish(
        self,
        file: String,
        columns: &[Column],
        mut remarks: Vec<String>,
    ) -> Result<Measurement, MeasurementError> {
        let mut channels = Vec::new();
        let mut begin: Option<f64> = None;
        for group in self.0 {
            let (stride, count) = (group.data.stride, group.count);
            let mut data = group.data.finish().into_iter();
            let mut time = data.next().unwrap_or_default();
            if time.len() < 2 {
                let found = match count {
                    0 => "there are no rows of numbers".to_string(),
                    rows => format!("there is {rows} row of numbers"),
                };
                return Err(MeasurementError::Empty { file, found });
            }
            if stride > 1 {
                remarks
                    .push(format!("{count} rows are too many to keep: each {stride} are averaged"));
            }
            let unit = group.time.and_then(|c| columns[c].read.unit).map_or(1.0, |u| u.factor);
            let is_file_time = time[0] > 1e15;
            let unit = if is_file_time { FILE_TIME } else { unit };
            let first = match (is_file_time, time[0] * unit > FAR) {
                (false, false) => 0.0,
                _ => *begin.get_or_insert(time[0]),
            };
            time.iter_mut().for_each(|t| *t = (*t - first) * unit);
            let time: std::sync::Arc<[f64]> = time.into();
            for (column, values) in group.members.iter().map(|c| &columns[*c]).zip(data) {
                let time = std::sync::Arc::clone(&time);
                channels.push(Channel::of(column.read.clone(), &column.heading, time, values));
            }
        }
        if begin.is_some() {
            remarks.push("time is counted from the first sample".into());
        }
        Ok(Measurement { name: file, channels, remarks })
    }
}
