//! Format of a table (separator, decimal mark, first row of numbers), detected from the first lines.

use super::MOST_COLUMNS;
use super::cell::{Cell, Decimal};
use super::lines::{Cells, Separator};

/// Number of rows of numbers from which the format is detected.
const SAMPLE: usize = 400;

/// Largest number of cells that are parsed for that.
const MOST_CELLS: usize = 2_000_000;

/// Format of a table.
pub(super) struct Style {
    pub(super) separator: Separator,
    pub(super) decimal: Decimal,
    /// Rows before the numbers.
    pub(super) head: Vec<Vec<String>>,
    /// Number of lines before the numbers.
    pub(super) first: usize,
    /// Number of cells of a row of numbers.
    pub(super) width: usize,
    /// The first rows of numbers.
    pub(super) sample: Vec<Vec<Cell>>,
}

/// Candidate formats, in order of preference where several parse the same amount of data.
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

/// The first lines, parsed in one candidate format.
struct Reading {
    rows: Vec<Vec<Cell>>,
    /// Number of data cells of a typical row.
    usual: usize,
    width: usize,
    score: f64,
}

impl Reading {
    /// `None` if no row has two adjacent data cells.
    fn new(lines: &[String], (separator, decimal): (Separator, Decimal)) -> Option<Self> {
        let mut cells = Cells::default();
        let mut rows: Vec<Vec<Cell>> = Vec::new();
        let mut count = 0;
        for line in lines {
            cells.split(line, separator);
            let read = cells.iter().take(MOST_COLUMNS + 1);
            rows.push(read.map(|text| Cell::read(text, decimal)).collect());
            count += cells.len();
            if count > MOST_CELLS {
                break;
            }
        }
        // rows with a label and a number may also stand above the table
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

    /// Columns of text: at least half of the data rows have text there.
    fn words(&self) -> Vec<bool> {
        let rows = || self.rows.iter().filter(|row| data(row) * 10 >= self.usual * 6);
        let count = rows().count();
        (0..self.width)
            .map(|k| {
                let of = || rows().filter_map(move |row| row.get(k));
                let numbers = of().filter(|cell| cell.is_data()).count();
                let words = of().filter(|cell| matches!(cell, Cell::Text)).count();
                words > numbers && words * 2 > count
            })
            .collect()
    }

    /// The first data row: it has text only in columns of text.
    fn first(&self) -> Option<usize> {
        let words = self.words();
        let first = self.rows.iter().position(|row| {
            let is_label = |(k, cell): (usize, &Cell)| {
                matches!(cell, Cell::Text) && !words.get(k).copied().unwrap_or(true)
            };
            let is_whole = row.len() == self.width || data(row) * 10 >= self.usual * 6;
            is_whole && data(row) >= 2 && !row.iter().enumerate().any(is_label)
        })?;
        // data rows with missing cells belong to the table, not to its head
        let is_short = |row: &&Vec<Cell>| data(row) >= 2 && texts(row) == 0;
        Some(first - self.rows[..first].iter().rev().take_while(is_short).count())
    }
}

fn data(row: &[Cell]) -> usize {
    row.iter().filter(|cell| cell.is_data()).count()
}

fn texts(row: &[Cell]) -> usize {
    row.iter().filter(|cell| matches!(cell, Cell::Text)).count()
}

/// Number format for a separator and a decimal mark; the first rows determine the meaning of the other mark.
fn judged(lines: &[String], separator: Separator, is_comma: bool) -> Decimal {
    let mut cells = Cells::default();
    let texts: Vec<String> = lines
        .iter()
        .take(SAMPLE)
        .flat_map(|line| {
            cells.split(line, separator);
            let plain = |text: &str| text.trim().trim_matches('"').trim().to_string();
            cells.iter().take(MOST_COLUMNS).map(plain).collect::<Vec<_>>()
        })
        .collect();
    Decimal::mark(is_comma).judged(texts.iter().map(String::as_str))
}

impl Style {
    /// Format of the first lines of a table; `None` if no row has two adjacent data cells.
    pub(super) fn find(lines: &[String]) -> Option<Self> {
        let mut best: Option<(f64, (Separator, Decimal), Reading)> = None;
        for (separator, is_comma) in WAYS {
            let way = (separator, judged(lines, separator, is_comma));
            let Some(reading) = Reading::new(lines, way) else { continue };
            // other separators are unambiguous; blanks and colons also occur within the heads of such tables
            let is_doubtful = matches!(separator, Separator::Blanks | Separator::Sign(b':'));
            let score = if is_doubtful { 0.9 * reading.score } else { reading.score };
            if best.as_ref().is_none_or(|(most, ..)| score > *most) {
                best = Some((score, way, reading));
            }
        }
        let (_, (separator, decimal), reading) = best?;
        let first = reading.first()?;
        let mut cells = Cells::default();
        let head = lines[..first].iter().filter(|line| !line.trim().is_empty()).map(|line| {
            cells.split(line, separator);
            cells.iter().map(|text| text.trim().trim_matches('"').trim().to_string()).collect()
        });
        let head = head.collect();
        let width = reading.width;
        let sample = reading.rows.into_iter().skip(first).take(SAMPLE).collect();
        Some(Self { separator, decimal, head, first, width, sample })
    }
}
