//! Reduction of a log's rows to bounded memory.

/// Largest count of numbers kept over all columns: 160 MB. A longer log is averaged over 2, 4, 8 ... rows.
pub(crate) const MOST: usize = 20_000_000;

/// Columns filled row by row, and averaged when the limit is exceeded. Rows of different segments are never averaged
/// together.
pub(crate) struct Columns {
    columns: Vec<Vec<f64>>,
    most_rows: usize,
    /// Number of rows that are averaged to one.
    pub(crate) stride: u64,
    sums: Vec<f64>,
    counts: Vec<u32>,
    pending: u64,
    /// Rows at which a segment begins, without the first segment.
    breaks: Vec<usize>,
}

impl Columns {
    pub(crate) fn new(columns: usize, most: usize) -> Self {
        Self {
            columns: vec![Vec::new(); columns],
            most_rows: (most / columns.max(1)).max(16),
            stride: 1,
            sums: vec![0.0; columns],
            counts: vec![0; columns],
            pending: 0,
            breaks: Vec::new(),
        }
    }

    /// Adds a row; missing values are NaN.
    pub(crate) fn push(&mut self, row: &[f64]) {
        for (k, value) in row.iter().enumerate().filter(|(_, v)| v.is_finite()) {
            self.sums[k] += value;
            self.counts[k] += 1;
        }
        self.pending += 1;
        if self.pending == self.stride {
            self.flush();
        }
    }

    /// Begins a segment with the next row. An incomplete average of the segment before is left out.
    pub(crate) fn begin_segment(&mut self) {
        self.sums.fill(0.0);
        self.counts.fill(0);
        self.pending = 0;
        let rows = self.rows();
        // no break if the segment before left no row
        if self.breaks.last().copied().unwrap_or(0) < rows {
            self.breaks.push(rows);
        }
    }

    fn rows(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    fn flush(&mut self) {
        for (k, column) in self.columns.iter_mut().enumerate() {
            column.push(self.sums[k] / f64::from(self.counts[k]));
            (self.sums[k], self.counts[k]) = (0.0, 0);
        }
        self.pending = 0;
        if self.rows() >= self.most_rows {
            self.halve();
        }
    }

    /// Adds a column; earlier rows have no value in it.
    pub(crate) fn add_column(&mut self) {
        self.columns.push(vec![f64::NAN; self.rows()]);
        self.sums.push(0.0);
        self.counts.push(0);
    }

    /// Count of numbers kept if `more` columns were added.
    pub(crate) fn numbers_with(&self, more: usize) -> usize {
        self.rows() * (self.columns.len() + more)
    }

    /// Averages pairs of rows within each segment; the last of an odd number is left out.
    pub(crate) fn halve(&mut self) {
        let rows = self.rows();
        let mut begins = vec![0];
        begins.extend(self.breaks.iter().copied().filter(|b| *b < rows));
        let ends: Vec<usize> = begins.iter().skip(1).copied().chain([rows]).collect();
        for column in &mut self.columns {
            let mut kept = 0;
            for (begin, end) in begins.iter().zip(&ends) {
                for k in 0..(end - begin) / 2 {
                    column[kept] = mean(column[begin + 2 * k], column[begin + 2 * k + 1]);
                    kept += 1;
                }
            }
            column.truncate(kept);
        }
        let mut kept = 0;
        self.breaks.clear();
        for (begin, end) in begins.iter().zip(&ends) {
            if kept > 0 && end - begin >= 2 && self.breaks.last() != Some(&kept) {
                self.breaks.push(kept);
            }
            kept += (end - begin) / 2;
        }
        self.stride *= 2;
    }

    /// The columns, and the rows at which a segment begins, without the first segment.
    pub(crate) fn finish(mut self) -> (Vec<Vec<f64>>, Vec<usize>) {
        let rows = self.rows();
        self.breaks.retain(|b| *b < rows);
        (self.columns, self.breaks)
    }
}

/// The mean of two values, or the one that is not missing.
fn mean(a: f64, b: f64) -> f64 {
    match (a.is_finite(), b.is_finite()) {
        (true, false) => a,
        (false, _) => b,
        _ => 0.5 * (a + b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_log_is_averaged_within_its_bound_and_keeps_its_mean() {
        let mut columns = Columns::new(2, 2000);
        for k in 0..100_000_u32 {
            columns.push(&[f64::from(k), if k % 3 == 0 { f64::NAN } else { 5.0 }]);
        }
        let stride = columns.stride;
        let (kept, breaks) = columns.finish();
        assert!(kept[0].len() <= 1000 && kept[0].len() > 400, "{}", kept[0].len());
        assert!(stride >= 100_000 / 1000);
        let step = kept[0][1] - kept[0][0];
        assert!((step - stride as f64).abs() < 1e-9);
        assert!(kept[1].iter().all(|v| (v - 5.0).abs() < 1e-12));
        assert!(breaks.is_empty());
    }

    #[test]
    fn no_average_is_taken_across_segments() {
        // each segment has one constant value, which averaging within segments keeps
        let mut columns = Columns::new(1, 500);
        for k in 0..50_000_u32 {
            if k % 777 == 0 && k > 0 {
                columns.begin_segment();
            }
            columns.push(&[f64::from(k / 777)]);
        }
        assert!(columns.stride >= 64);
        let (kept, breaks) = columns.finish();
        assert!(kept[0].iter().all(|v| v.fract() == 0.0), "{:?}", kept[0]);
        // segments begin exactly where the value changes
        let changes: Vec<usize> =
            (1..kept[0].len()).filter(|k| kept[0][*k] != kept[0][k - 1]).collect();
        assert_eq!(breaks, changes);
        assert!(breaks.len() > 50, "{}", breaks.len());
    }
}
