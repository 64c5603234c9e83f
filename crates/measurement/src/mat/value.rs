//! What a variable of a MAT file holds.

/// Numbers that are kept of a file at most: 160 MB.
pub(super) const MOST_NUMBERS: usize = 20_000_000;

/// Signals that are kept of a file at most.
const MOST_SIGNALS: usize = 20_000;

/// Rows of characters that are kept of a matrix at most; what has more is no text.
pub(super) const MOST_ROWS: usize = 1_000_000;

/// Why a file is no MAT file, or is damaged: a sentence without the file's name.
pub(super) type Damage = String;

/// A variable with its name.
pub(super) struct Variable {
    pub(super) name: String,
    pub(super) value: Value,
}

/// What a variable, or a field of a structure, holds.
pub(super) enum Value {
    Numbers(Matrix),
    /// Rows of characters.
    Text(Vec<String>),
    Structure(Structure),
    /// Something that is not read; what it is, in MATLAB's words.
    Unread(String),
}

/// Numbers by columns, as MATLAB keeps them.
pub(super) struct Matrix {
    pub(super) dimensions: Vec<usize>,
    pub(super) values: Vec<f64>,
}

/// A structure, or an array of them: each field has as many values as the array has elements.
pub(super) struct Structure {
    pub(super) count: usize,
    pub(super) fields: Vec<(String, Vec<Value>)>,
}

impl Matrix {
    /// Rows, and columns of all further dimensions.
    pub(super) fn shape(&self) -> (usize, usize) {
        let rows = self.dimensions.first().copied().unwrap_or(0);
        (rows, self.values.len().checked_div(rows).unwrap_or(0))
    }

    /// Whether it has one dimension longer than one.
    pub(super) fn is_vector(&self) -> bool {
        self.values.len() > 1 && self.dimensions.iter().filter(|d| **d != 1).count() == 1
    }

    /// Whether it has signals of so many samples.
    pub(super) fn has_signals(&self, samples: usize) -> bool {
        let ends = [self.dimensions.first(), self.dimensions.last()];
        samples > 0 && !self.values.is_empty() && ends.contains(&Some(&samples))
    }

    /// The signals in it that have as many samples as the time, where it has such.
    ///
    /// Samples run along the rows (N x k), or along the last dimension (k x N, and k x l x N of Simulink).
    fn signals(&self, samples: usize) -> Vec<Vec<f64>> {
        let count = self.values.len().checked_div(samples).unwrap_or(0);
        (0..count).map(|k| self.signal(k, samples)).collect()
    }

    /// One of them.
    pub(super) fn signal(&self, k: usize, samples: usize) -> Vec<f64> {
        if self.dimensions.first() == Some(&samples) {
            return self.values.iter().skip(k * samples).take(samples).copied().collect();
        }
        let count = self.values.len().checked_div(samples).unwrap_or(1);
        self.values.iter().skip(k).step_by(count.max(1)).copied().collect()
    }
}

/// Room for the signals of a file: each takes memory beside its numbers.
pub(super) struct Room {
    left: usize,
    left_out: usize,
}

impl Room {
    pub(super) fn new() -> Self {
        Self { left: MOST_SIGNALS, left_out: 0 }
    }

    /// Whether there is room for so many signals more, which is taken then.
    pub(super) fn takes(&mut self, count: usize) -> bool {
        let is_room = count <= self.left;
        match is_room {
            true => self.left -= count,
            false => self.left_out += count,
        }
        is_room
    }

    /// The signals of a matrix that have so many samples; none where no dimension is as long, and an empty list where there is no room.
    pub(super) fn signals(&mut self, matrix: &Matrix, samples: usize) -> Option<Vec<Vec<f64>>> {
        if !matrix.has_signals(samples) {
            return None;
        }
        match self.takes(matrix.values.len() / samples) {
            true => Some(matrix.signals(samples)),
            false => Some(Vec::new()),
        }
    }

    /// What is to be said of what there was no room for.
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
    /// Rows of characters, which are stored by columns.
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

    /// The first row of characters, where there is one that is not blank.
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
