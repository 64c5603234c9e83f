//! How a table is written: what separates its cells, its decimal sign, where its numbers begin. Found from the first lines.

use super::MOST_COLUMNS;
use super::cell::Cell;
use super::lines::{Cells, Separator};

/// Rows of numbers that are looked at.
const SAMPLE: usize = 400;

/// Cells that are looked at, at most.
const MOST_CELLS: usize = 2_000_000;

/// How a table is written.
pub(super) struct Style {
    pub(super) separator: Separator,
    pub(super) decimal_comma: bool,
    /// Rows before the numbers.
    pub(super) head: Vec<Vec<String>>,
    /// How many of the first lines come before the numbers.
    pub(super) first: usize,
    /// Cells of a row of numbers.
    pub(super) width: usize,
    /// The first rows of numbers.
    pub(super) sample: Vec<Vec<Cell>>,
}

/// Ways to write, those first that are preferred where several read as much.
const WAYS: [(Separator, bool); 10] = [
    (Separator::Sign(b'\t'), false),
    (Separator::Sign(b'\t'), true),
    (Separator::Sign(b';'), false),
    (Separator::Sign(b';'), true),
    (Separator::Sign(b'|'), false),
    (Separator::Sign(b','), false),
    (Separator::Sign(b','), true),
    (Separator::Blanks, false),
    (Separator::Blanks, true),
    (Separator::Sign(b':'), false),
];

/// The lines, as one way reads them.
struct Reading {
    rows: Vec<Vec<Cell>>,
    /// Numbers and times of a usual row.
    usual: usize,
    width: usize,
    score: f64,
}

impl Reading {
    /// None where no row has two numbers beside each other.
    fn new(lines: &[String], (separator, decimal_comma): (Separator, bool)) -> Option<Self> {
        let mut cells = Cells::default();
        let mut rows: Vec<Vec<Cell>> = Vec::new();
        let mut count = 0;
        for line in lines {
            cells.split(line, separator);
            let read = cells.iter().take(MOST_COLUMNS + 1);
            rows.push(read.map(|text| Cell::read(text, decimal_comma)).collect());
            count += cells.len();
            if count > MOST_CELLS {
                break;
            }
        }
        // rows of labels with a number behind each stand above tables, too
        let is_table = |row: &Vec<Cell>| data(row) > texts(row);
        let has_table = rows.iter().any(|row| is_table(row) && data(row) >= 2);
        let counted = |row: &Vec<Cell>| if has_table && !is_table(row) { 0 } else { data(row) };
        let counts: Vec<usize> = rows.iter().map(counted).collect();
        let often = |value: usize, list: &mut dyn Iterator<Item = usize>| {
            value * list.filter(|v| *v == value).count()
        };
        let usual = counts
            .iter()
            .copied()
            .filter(|c| *c >= 2)
            .max_by_key(|c| often(*c, &mut counts.iter().copied()))?;
        let is_data = |row: &&Vec<Cell>| counted(row) >= 2 && counted(row) * 10 >= usual * 6;
        let widths: Vec<usize> = rows.iter().filter(is_data).map(Vec::len).collect();
        let width = widths
            .iter()
            .copied()
            .max_by_key(|w| (widths.iter().filter(|v| *v == w).count(), *w))?;
        let share =
            |row: &Vec<Cell>| (data(row) * data(row)) as f64 / (data(row) + texts(row)) as f64;
        let score = rows.iter().filter(is_data).filter(|r| r.len() == width).map(share).sum();
        Some(Self { rows, usual, width, score })
    }

    /// Columns that have numbers, or times.
    fn mask(&self) -> Vec<bool> {
        let rows = || self.rows.iter().filter(|row| data(row) * 10 >= self.usual * 6);
        let of = |k: usize| rows().filter_map(move |row| row.get(k));
        (0..self.width)
            .map(|k| {
                let numbers = of(k).filter(|cell| cell.is_data()).count();
                let texts = of(k).filter(|cell| matches!(cell, Cell::Text)).count();
                numbers > texts
            })
            .collect()
    }

    /// The first line of numbers.
    fn first(&self) -> Option<usize> {
        let mask = self.mask();
        self.rows.iter().position(|row| {
            let is_label = |(k, cell): (usize, &Cell)| {
                matches!(cell, Cell::Text) && mask.get(k).copied().unwrap_or(false)
            };
            let is_whole = row.len() == self.width || data(row) * 10 >= self.usual * 6;
            is_whole && data(row) >= 2 && !row.iter().enumerate().any(is_label)
        })
    }
}

fn data(row: &[Cell]) -> usize {
    row.iter().filter(|cell| cell.is_data()).count()
}

fn texts(row: &[Cell]) -> usize {
    row.iter().filter(|cell| matches!(cell, Cell::Text)).count()
}

impl Style {
    /// How the first lines of a table are written; none where no row has two numbers beside each other.
    pub(super) fn find(lines: &[String]) -> Option<Self> {
        let mut best: Option<(f64, (Separator, bool), Reading)> = None;
        for way in WAYS {
            let Some(reading) = Reading::new(lines, way) else { continue };
            if best.as_ref().is_none_or(|(most, ..)| reading.score > *most) {
                best = Some((reading.score, way, reading));
            }
        }
        let (_, (separator, decimal_comma), reading) = best?;
        let first = reading.first()?;
        let mut cells = Cells::default();
        let head = lines[..first].iter().filter(|line| !line.trim().is_empty()).map(|line| {
            cells.split(line, separator);
            cells.iter().map(|text| text.trim().trim_matches('"').trim().to_string()).collect()
        });
        let head = head.collect();
        let width = reading.width;
        let sample = reading.rows.into_iter().skip(first).take(SAMPLE).collect();
        Some(Self { separator, decimal_comma, head, first, width, sample })
    }
}
