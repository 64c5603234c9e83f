//! Reader of the rows of numbers; unreadable rows are counted.

use super::cell::Cell;
use super::clock::{Clock, Origin};
use super::columns::{Column, Kind};
use super::lines::Cells;
use super::style::Style;
use super::times::Base;
use crate::recording::Recording;
use crate::thinning::MOST;

/// State of reading the rows.
pub(super) struct Rows<'a> {
    style: &'a Style,
    columns: &'a [Column],
    bases: Vec<(Clock, Vec<usize>, Recording)>,
    /// Origin of times that are far from zero \[s\].
    pub(super) origin: Origin,
    /// Whether the table's end marker has been read.
    pub(super) is_ended: bool,
    count: u64,
    cells: Cells,
    row: Vec<Cell>,
    numbers: Vec<f64>,
    comments: Irregular,
    words: Irregular,
    short: Irregular,
    long: Irregular,
    timeless: Irregular,
    bad: Irregular,
    cut: Irregular,
    /// Line number of a later head with the columns in another order.
    other_head: Option<u64>,
}

/// Count of irregular rows of one kind, with the first line number.
#[derive(Default)]
struct Irregular {
    count: u64,
    line: u64,
    what: String,
}

impl Irregular {
    fn add(&mut self, line: u64, what: &str) {
        self.count += 1;
        if self.count == 1 {
            self.line = line;
            self.what = what.trim().chars().take(40).collect();
        }
    }
}

impl<'a> Rows<'a> {
    pub(super) fn new(style: &'a Style, columns: &'a [Column], bases: Vec<Base>) -> Self {
        let share = MOST / bases.len().max(1);
        let bases = bases.into_iter().map(|Base { source, members }| {
            let recording = Recording::new(members.len(), share);
            (Clock::new(source), members, recording)
        });
        Self {
            style,
            columns,
            bases: bases.collect(),
            origin: Origin::default(),
            is_ended: false,
            count: 0,
            cells: Cells::default(),
            row: Vec::new(),
            numbers: Vec::new(),
            comments: Irregular::default(),
            words: Irregular::default(),
            short: Irregular::default(),
            long: Irregular::default(),
            timeless: Irregular::default(),
            bad: Irregular::default(),
            cut: Irregular::default(),
            other_head: None,
        }
    }

    /// Adds a line. A truncated line that has fewer cells than the others is left out: its last number may be
    /// incomplete.
    pub(super) fn add(&mut self, number: u64, line: &str, is_cut: bool) {
        if line.trim().is_empty() || self.is_ended {
            return;
        }
        self.cells.split(line, self.style.separator);
        if self.cells.len() <= 2 && self.cells.get(0).trim() == "EOF" {
            self.is_ended = true;
            return;
        }
        let width = self.columns.len();
        if is_cut && self.cells.len() < width {
            return self.cut.add(number, line);
        }
        self.row.clear();
        let (mut numbers, mut texts, mut first_text) = (0_u64, 0_u64, None);
        for (k, column) in self.columns.iter().enumerate() {
            if column.kind == Kind::Text {
                self.row.push(Cell::Missing);
                continue;
            }
            let cell = Cell::read(self.cells.get(k), self.style.decimal);
            let fits = !matches!(
                (cell, column.kind),
                (Cell::Text, _) | (Cell::Stamp(_), Kind::Number) | (Cell::Number(_), Kind::Stamp)
            );
            if !fits {
                texts += 1;
                first_text = first_text.or(Some(k));
            }
            numbers += u64::from(cell.is_data() && fits);
            self.row.push(if fits { cell } else { Cell::Missing });
        }
        // a comment or a repeated head
        if texts > 0 && (numbers == 0 || texts > numbers) {
            let is_comment = line.trim_start().starts_with(['#', '%', '!', '*'])
                || line.trim_start().starts_with("//");
            if self.is_other_head() {
                self.other_head = Some(number);
                self.is_ended = true;
                return;
            }
            let odd = if is_comment { &mut self.comments } else { &mut self.words };
            return odd.add(number, line);
        }
        if numbers == 0 {
            return self.words.add(number, line);
        }
        if let Some(k) = first_text {
            let what = format!("\"{}\" in {}", self.cells.get(k).trim(), self.columns[k].heading);
            self.bad.add(number, &what);
            self.bad.count += texts - 1;
        }
        if self.cells.len() < width {
            self.short.add(number, "");
        }
        if (width..self.cells.len()).any(|k| !self.cells.get(k).trim().is_empty()) {
            self.long.add(number, "");
        }
        self.count += 1;
        let is_alone = self.bases.len() == 1;
        for (clock, members, recording) in &mut self.bases {
            // the row has no time for a channel with a lower sampling rate
            let Some(time) = clock.time(&self.row, &mut self.origin) else {
                if is_alone {
                    self.timeless.add(number, line);
                }
                continue;
            };
            self.numbers.clear();
            self.numbers.push(time);
            self.numbers.extend(members.iter().map(|k| self.row[*k].number()));
            recording.push(number, &self.numbers);
        }
    }

    /// Whether the line is a head with the same columns in another order; the rows after it would be assigned wrongly.
    fn is_other_head(&self) -> bool {
        let names = || self.cells.iter().map(|text| text.trim().trim_matches('"').trim());
        let headings = || self.columns.iter().map(|c| c.heading.as_str());
        if self.cells.len() != self.columns.len() || names().eq(headings()) {
            return false;
        }
        let (mut found, mut known): (Vec<&str>, Vec<&str>) =
            (names().collect(), headings().collect());
        found.sort_unstable();
        known.sort_unstable();
        found == known
    }

    /// Sentences about the irregular rows.
    pub(super) fn remarks(&self) -> Vec<String> {
        let mut said = Vec::new();
        if let Some(line) = self.other_head {
            said.push(format!(
                "line {line} is a head with the columns in another order: it and what follows are left out"
            ));
        }
        let mut say = |odd: &Irregular, what: &str, then: &str| {
            if odd.count > 0 {
                let shown =
                    if odd.what.is_empty() { String::new() } else { format!(" ({})", odd.what) };
                said.push(format!("{} {what}, first line {}{shown}: {then}", odd.count, odd.line));
            }
        };
        say(&self.comments, "comments", "left out");
        say(&self.words, "rows that hold words in place of numbers", "left out");
        say(&self.timeless, "rows without a time", "left out");
        say(&self.bad, "cells that are no numbers", "they count as missing");
        say(&self.short, "rows are shorter than the others", "their last cells count as missing");
        say(&self.cut, "rows are cut off by the end of the file", "left out");
        say(&self.long, "rows are longer than the others", "the additional cells are left out");
        said
    }

    /// Number of rows, and the recording of each time base.
    pub(super) fn finish(self) -> (u64, Vec<(Vec<usize>, Recording)>) {
        let bases = self.bases.into_iter().map(|(_, members, recording)| (members, recording));
        (self.count, bases.collect())
    }
}
