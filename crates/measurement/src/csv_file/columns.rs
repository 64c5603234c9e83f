//! Columns of a table, from the rows above its numbers.

use super::cell::Cell;
use super::style::Style;
use crate::heading::Heading;
use crate::unit::Unit;

/// Content of a column's cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// Numbers.
    Number,
    /// Dates and times.
    Stamp,
    /// Texts.
    Text,
}

/// A column.
pub(super) struct Column {
    pub(super) heading: String,
    pub(super) read: Heading,
    pub(super) kind: Kind,
    /// Whether it is a time column of TwinCAT Scope, in ms.
    pub(super) is_scope_time: bool,
    /// Sampling interval stated in the head \[s\].
    pub(super) interval: Option<f64>,
}

/// The columns of a table.
pub(super) fn columns(style: &Style, remarks: &mut Vec<String>) -> Vec<Column> {
    let mut columns = match is_scope(style) {
        true => scope_columns(style, remarks),
        false => plain_columns(style, remarks),
    };
    for (k, column) in columns.iter_mut().enumerate() {
        let count = |is: &dyn Fn(&Cell) -> bool| {
            style.sample.iter().filter_map(|row| row.get(k)).filter(|c| is(c)).count()
        };
        let numbers = count(&|c| matches!(c, Cell::Number(_)));
        let stamps = count(&|c| matches!(c, Cell::Stamp(_)));
        let texts = count(&|c| matches!(c, Cell::Text));
        column.kind = match (texts > numbers + stamps, stamps > numbers) {
            (true, _) => Kind::Text,
            (_, true) => Kind::Stamp,
            _ => Kind::Number,
        };
    }
    columns
}

/// A column's heading; its unit comes from the line below, or else from the heading.
fn column(heading: &str, below: &str) -> Column {
    Column {
        heading: heading.into(),
        read: Heading::with_unit(heading, below),
        kind: Kind::Number,
        is_scope_time: false,
        interval: None,
    }
}

/// Removes a comment sign.
fn bare(text: &str) -> &str {
    text.trim_start_matches(['#', '%', '!']).trim_start_matches("//").trim()
}

/// Removes a first cell that contains only a comment sign, so that the names match their columns.
fn without_sign(row: &[String]) -> &[String] {
    match row.first() {
        Some(first) if bare(first).is_empty() && !first.is_empty() => &row[1..],
        _ => row,
    }
}

fn plain_columns(style: &Style, remarks: &mut Vec<String>) -> Vec<Column> {
    let is_number = |text: &String| matches!(Cell::read(text, style.decimal), Cell::Number(_));
    let named =
        |row: &&[String]| row.iter().filter(|c| !bare(c).is_empty() && !is_number(c)).count();
    let is_heading = |row: &&[String]| {
        let most = style.width.max(2);
        row.len() + 1 >= most && row.len() <= most + 1 && named(row) * 2 > style.width
    };
    // LabVIEW ends each head with a marker line, and labels the row of units
    let is_end = |row: &Vec<String>| is_label(row, "***End_of_Header***");
    let from = style.head.iter().rposition(is_end).map_or(0, |k| k + 1);
    let labelled = style.head.iter().find(|row| from > 0 && is_label(row, "Y_Unit_Label"));
    let rows: Vec<&[String]> = style.head[from..].iter().map(|row| without_sign(row)).collect();
    let headings: Vec<usize> = (0..rows.len()).rev().filter(|k| is_heading(&rows[*k])).collect();
    let is_unit = |c: &&String| Unit::find(bare(c)).is_some();
    let are_units = |row: &[String]| {
        let there = row.iter().filter(|c| !bare(c).is_empty());
        row.iter().filter(is_unit).count() * 2 > there.count().max(1)
    };
    // a row with equal cells holds types or the like
    let is_uniform = |row: &[String]| row.len() > 2 && row.iter().skip(1).all(|c| *c == row[1]);
    // names stand above units; without a row of units the lowest row holds the names
    let is_name = |k: &&usize| !is_uniform(rows[**k]) && !are_units(rows[**k]);
    let is_whole = |k: &usize| rows[*k].len() <= style.width + 1 && are_units(rows[*k]);
    let units = (0..rows.len()).rev().find(is_whole);
    let above = headings.iter().filter(|k| Some(**k) < units).find(is_name);
    let lowest = headings.iter().find(is_name);
    let any = headings.iter().find(|k| Some(**k) != units).or_else(|| headings.first());
    let names = above.or(lowest).or(any).copied();
    let units = units.filter(|k| Some(*k) != names).map(|k| rows[k]);
    let Some(names) = names.map(|k| rows[k]) else {
        remarks.push("no row of names stands above the numbers: columns are counted".into());
        let unit = |k: usize| units.and_then(|u| u.get(k)).map_or("", |u| bare(u));
        return (1..=style.width).map(|k| column(&format!("column_{k}"), unit(k - 1))).collect();
    };
    // LabVIEW, if rows have no time of their own
    let steps = style.head.iter().find(|row| is_label(row, "Delta_X"));
    let is_empty =
        |k: usize| style.sample.iter().all(|row| matches!(row.get(k), None | Some(Cell::Missing)));
    let step = steps.filter(|_| is_empty(0)).and_then(|row| row.get(1));
    let step = step.map(|text| Cell::read(text, style.decimal).number());
    let step = step.filter(|step| *step > 0.0);
    (0..style.width)
        .map(|k| {
            let name = names.get(k).map_or("", |name| bare(name));
            let labelled = labelled.filter(|_| k > 0).and_then(|row| row.get(k));
            let unit = units.and_then(|u| u.get(k)).or(labelled);
            let counted = format!("column_{}", k + 1);
            let heading = if name.is_empty() { &counted } else { name };
            Column { interval: step, ..column(heading, unit.map_or("", |u| bare(u))) }
        })
        .collect()
}

fn is_label(row: &[String], label: &str) -> bool {
    row.first().is_some_and(|c| c.eq_ignore_ascii_case(label))
}

/// Detects an export of TwinCAT Scope: each channel has a column of its label, `Name`, and one of its values.
fn is_scope(style: &Style) -> bool {
    let labels =
        ["SampleTime[ms]", "SymbolComment", "Data-Type", "Starttime of export", "SymbolName"];
    let is_said = style.head.iter().any(|row| labels.iter().any(|label| is_label(row, label)));
    let is_in_pairs = style.head.iter().any(|row| {
        row.len() >= 4
            && row.iter().step_by(2).all(|c| c.is_empty() || c.eq_ignore_ascii_case("Name"))
            && is_label(row, "Name")
    });
    // a head of only names above numbers
    let is_bare = style.head.len() == 1
        && is_label(&style.head[0], "Name")
        && style.sample.iter().any(|row| matches!(row.first(), Some(Cell::Number(_))));
    is_in_pairs || is_bare || (is_said && style.head.iter().any(|row| is_label(row, "Name")))
}

/// Columns of TwinCAT Scope: each row of its head begins with a label, repeated above every time column.
fn scope_columns(style: &Style, remarks: &mut Vec<String>) -> Vec<Column> {
    let row = |label: &str| {
        let is_it = |row: &&Vec<String>| is_label(row, label);
        style.head.iter().filter(is_it).max_by_key(|row| row.len())
    };
    let none = Vec::new();
    let names = row("Name").unwrap_or(&none);
    let (samples, units) = (row("SampleTime[ms]"), row("Unit"));
    // an export without time columns has no cell below the labels
    let has_times = style.width + 1 >= names.len();
    let mut columns = Vec::new();
    for (k, name) in names.iter().enumerate() {
        let is_time = name.eq_ignore_ascii_case("Name");
        if (is_time && !has_times) || (name.is_empty() && k + 1 == names.len()) {
            continue;
        }
        let below = units.and_then(|u| u.get(k)).filter(|_| !is_time);
        let mut column = column(name, below.map_or("", String::as_str));
        column.is_scope_time = is_time;
        if is_time {
            column.heading = "time".into();
            column.read = Heading::with_unit("time", "ms");
        } else if !has_times {
            let sample = samples.and_then(|s| s.get(k)).map(|c| Cell::read(c, style.decimal));
            let interval = sample.map(|cell| cell.number() * 1e-3);
            column.interval = interval.filter(|interval| *interval > 0.0);
        }
        columns.push(column);
    }
    remarks.push("an export of TwinCAT Scope".into());
    columns
}
