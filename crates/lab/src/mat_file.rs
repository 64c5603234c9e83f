//! Matrices in a MAT file of level 4, which MATLAB, Octave and SciPy read.
//!
//! Each matrix consists of five 32-bit integers (type, rows, columns, imaginary, length of the name), the
//! zero-terminated name, and the entries column by column. This is less code than the use of a crate for
//! the later formats.

/// Real matrix to be written as a variable of a MAT file.
#[derive(Clone, Debug)]
pub struct Matrix<'a> {
    /// Name of the MATLAB variable.
    pub name: &'a str,
    /// Rows of equal length, in any unit.
    pub rows: &'a [Vec<f64>],
}

/// Character matrix of the lines, padded to equal length.
fn text(name: &str, lines: &[String]) -> Vec<u8> {
    let width = lines.iter().map(String::len).max().unwrap_or(0);
    let padded: Vec<Vec<f64>> = lines
        .iter()
        .map(|line| format!("{line:<width$}").bytes().map(f64::from).collect())
        .collect();
    // type 1: the numbers are characters
    variable(name, &padded, 1)
}

fn variable(name: &str, rows: &[Vec<f64>], kind: i32) -> Vec<u8> {
    let columns = rows.first().map_or(0, Vec::len);
    let mut bytes = Vec::new();
    // little-endian double precision is type 0
    for number in [kind, rows.len() as i32, columns as i32, 0, name.len() as i32 + 1] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(name.bytes());
    bytes.push(0);
    for column in 0..columns {
        for row in rows {
            bytes.extend(row.get(column).copied().unwrap_or(0.0).to_le_bytes());
        }
    }
    bytes
}

/// Content of a MAT file of level 4: matrices, and lists of names (variable, lines) as character matrices.
pub fn mat_file(matrices: &[Matrix<'_>], names: &[(&str, &[String])]) -> Vec<u8> {
    let numbers = matrices.iter().flat_map(|matrix| variable(matrix.name, matrix.rows, 0));
    let texts = names.iter().flat_map(|(name, lines)| text(name, lines));
    numbers.chain(texts).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_is_laid_out_column_by_column() {
        let rows = [vec![1.0, 2.0, 3.0], vec![4.0, 5.0, 6.0]];
        let bytes = mat_file(&[Matrix { name: "A", rows: &rows }], &[]);
        let header: Vec<i32> =
            bytes[..20].chunks(4).map(|b| i32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        assert_eq!(header, [0, 2, 3, 0, 2]);
        assert_eq!(&bytes[20..22], b"A\0");
        let entries: Vec<f64> =
            bytes[22..].as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
        assert_eq!(entries, [1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
    }
}
