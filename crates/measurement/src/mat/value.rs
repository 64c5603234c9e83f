//! Content of a MAT file's variables.

/// Largest count of numbers kept from a file: 160 MB.
pub(super) const MOST_NUMBERS: usize = 20_000_000;

/// Largest number of signals kept from a file.
const MOST_SIGNALS: usize = 20_000;

/// Largest number of character rows in a matrix; a longer one is not read as text.
pub(super) const MOST_ROWS: usize = 1_000_000;

/// Reason why a file is not a MAT file or is damaged: a sentence without the file's name.
pub(super) type Damage = String;

/// A variable with its name.
pub(super) struct Variable {
    pub(super) name: String,
    pub(super) value: Value,
}

/// Content of a variable, or of a field of a structure.
pub(super) enum Value {
    Numbers(Matrix),
    /// Rows of characters.
    Text(Vec<String>),
    Structure(Structure),
    /// An unsupported class, by its MATLAB name.
    Unread(String),
}

/// Numbers by columns, as in MATLAB.
pub(super) struct Matrix {
    pub(super) dimensions: Vec<usize>,
    pub(super) values: Vec<f64>,
}

/// A structure or an array of structures: each field has one value for each element.
pub(super) struct Structure {
    pub(super) count: usize,
    pub(super) fields: Vec<(String, Vec<Value>)>,
}

impl Matrix {
    /// Number of rows, and product of all further dimensions.
    pub(super) fn shape(&self) -> (usize, usize) {
        let rows = self.dimensions.first().copied().unwrap_or(0);
        (rows, self.values.len().checked_div(rows).unwrap_or(0))
    }

    /// Whether only one dimension is longer than one.
    pub(super) fn is_vector(&self) -> bool {
        self.values.len() > 1 && self.dimensions.iter().filter(|d| **d != 1).count() == 1
    }

    /// Whether a dimension equals the number of samples, so that the matrix holds signals.
    pub(super) fn has_signals(&self, samples: usize) -> bool {
        let ends = [self.dimensions.first(), self.dimensions.last()];
        samples > 0 && !self.values.is_empty() && ends.contains(&Some(&samples))
    }

    /// The signals whose number of samples is that of the time.
    ///
    /// Samples run along the rows (N x k), or along the last dimension (k x N, and k x l x N of Simulink).
    fn signals(&self, samples: usize) -> Vec<Vec<f64>> {
        let count = self.values.len().checked_div(samples).unwrap_or(0);
        (0..count).map(|k| self.signal(k, samples)).collect()
    }

    /// The signal with index `k`.
    pub(super) fn signal(&self, k: usize, samples: usize) -> Vec<f64> {
        if self.dimensions.first() == Some(&samples) {
            return self.values.iter().skip(k * samples).take(samples).copied().collect();
        }
        let count = self.values.len().checked_div(samples).unwrap_or(1);
        self.values.iter().skip(k).step_by(count.max(1)).copied().collect()
    }
}

/// Remaining capacity for signals of a file, which bounds the memory besides the numbers.
pub(super) struct Room {
    left: usize,
    left_out: usize,
}

impl Room {
    pub(super) fn new() -> Self {
        Self { left: MOST_SIGNALS, left_out: 0 }
    }

    /// Reserves capacity for `count` signals; returns whether there was enough.
    pub(super) fn takes(&mut self, count: usize) -> bool {
        let is_room = count <= self.left;
        match is_room {
            true => self.left -= count,
            false => self.left_out += count,
        }
        is_room
    }

    /// The signals of a matrix with this number of samples. `None` if no dimension has that length, and an empty list
    /// if the capacity is exhausted.
    pub(super) fn signals(&mut self, matrix: &Matrix, samples: usize) -> Option<Vec<Vec<f64>>> {
        if !matrix.has_signals(samples) {
            return None;
        }
        match self.takes(matrix.values.len() / samples) {
            true => Some(matrix.signals(samples)),
            false => Some(Vec::new()),
        }
    }

    /// Sentence about the signals left out, if any.
    pub(super) fn remark(&self) -> Option<String> {
        (self.left_out > 0).then(|| {
            format!(
                "it has more than {MOST_SIGNALS} signals: {} others are left out",
                self.left_out
            )
        })
    }
}

impl Structure {
    /// A field of the first element.
    pub(super) fn field(&self, name: &str) -> Option<&Value> {
        self.field_at(0, name)
    }

    /// A field of an element.
    pub(super) fn field_at(&self, element: usize, name: &str) -> Option<&Value> {
        let (_, values) = self.fields.iter().find(|(field, _)| field == name)?;
        values.get(element)
    }
}

impl Value {
    /// Rows of characters from a matrix stored by columns.
    pub(super) fn of_characters(rows: usize, characters: &[char]) -> Self {
        let rows = if characters.is_empty() { 0 } else { rows };
        if rows > MOST_ROWS {
            return Self::Unread(format!("a text of {rows} rows"));
        }
        let row = |k: usize| characters.iter().skip(k).step_by(rows.max(1)).collect();
        Self::Text((0..rows).map(row).collect())
    }

    pub(super) fn numbers(&self) -> Option<&Matrix> {
        match self {
            Self::Numbers(matrix) => Some(matrix),
            _ => None,
        }
    }

    pub(super) fn structure(&self) -> Option<&Structure> {
        match self {
            Self::Structure(structure) => Some(structure),
            _ => None,
        }
    }

    /// The first row of characters, unless it is blank.
    pub(super) fn text(&self) -> Option<&str> {
        match self {
            Self::Text(rows) => rows.first().map(|r| r.trim()).filter(|r| !r.is_empty()),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_run_along_the_dimension_that_is_as_long_as_the_time() {
        let of = |dimensions: &[usize]| Matrix {
            dimensions: dimensions.to_vec(),
            values: (0..dimensions.iter().product()).map(|k: usize| k as f64).collect(),
        };
        let signals = |dimensions: &[usize], samples| Room::new().signals(&of(dimensions), samples);
        // 3 x 2, by columns: 0 1 2, 3 4 5
        assert_eq!(signals(&[3, 2], 3), Some(vec![vec![0.0, 1.0, 2.0], vec![3.0, 4.0, 5.0]]));
        assert_eq!(signals(&[2, 3], 3), Some(vec![vec![0.0, 2.0, 4.0], vec![1.0, 3.0, 5.0]]));
        assert_eq!(signals(&[1, 2, 3], 3), signals(&[2, 3], 3));
        assert_eq!(signals(&[2, 3], 6), None);
        assert_eq!(signals(&[0, 3], 3), None);
        assert!(of(&[1, 1, 4]).is_vector() && !of(&[2, 4]).is_vector() && !of(&[1, 1]).is_vector());
    }
}
