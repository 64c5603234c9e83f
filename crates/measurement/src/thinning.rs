//! Rows of a log within bounded memory.

/// Numbers that are kept at most, over all columns: 160 MB. A log that has more is averaged over 2, 4, 8 ...
/// rows.
pub(crate) const MOST: usize = 20_000_000;

/// Columns that are filled row by row, and thinned when they become too long.
pub(crate) struct Columns {
    columns: Vec<Vec<f64>>,
    most_rows: usize,
    /// Rows that make one.
    pub(crate) stride: u64,
    sums: Vec<f64>,
    counts: Vec<u32>,
    pending: u64,
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
        }
    }

    /// Adds a row; what is missing is NaN.
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

    fn flush(&mut self) {
        for (k, column) in self.columns.iter_mut().enumerate() {
            column.push(self.sums[k] / f64::from(self.counts[k]));
            (self.sums[k], self.counts[k]) = (0.0, 0);
        }
        self.pending = 0;
        if self.columns.first().is_some_and(|c| c.len() >= self.most_rows) {
            self.halve();
        }
    }

    /// Averages each two rows, and so those to come.
    pub(crate) fn halve(&mut self) {
        self.stride *= 2;
        for column in &mut self.columns {
            halve(column);
        }
    }

    /// Adds a column; in the rows before nothing is there.
    pub(crate) fn add_column(&mut self) {
        let rows = self.columns.first().map_or(0, Vec::len);
        self.columns.push(vec![f64::NAN; rows]);
        self.sums.push(0.0);
        self.counts.push(0);
    }

    /// How many numbers are kept.
    pub(crate) fn numbers(&self) -> usize {
        self.columns.first().map_or(0, Vec::len) * self.columns.len()
    }

    /// The columns; rows that make no whole one are left out.
    pub(crate) fn finish(self) -> Vec<Vec<f64>> {
        self.columns
    }
}

/// Each two values become their mean, or the one that is there.
fn halve(column: &mut Vec<f64>) {
    let half = column.len() / 2;
    for k in 0..half {
        let (a, b) = (column[2 * k], column[2 * k + 1]);
        column[k] = match (a.is_finite(), b.is_finite()) {
            (true, false) => a,
            (false, _) => b,
            _ => 0.5 * (a + b),
        };
    }
    column.truncate(half);
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
        let kept = columns.finish();
        assert!(kept[0].len() <= 1000 && kept[0].len() > 400, "{}", kept[0].len());
        assert!(stride >= 100_000 / 1000);
        let step = kept[0][1] - kept[0][0];
        assert!((step - stride as f64).abs() < 1e-9);
        assert!(kept[1].iter().all(|v| (v - 5.0).abs() < 1e-12));
    }
}
