//! MAT files of level 4: each matrix has five integers, its name, and its numbers by columns.

use super::numbers::{ByteOrder, Storage};
use super::value::{Damage, MOST_NUMBERS, Matrix, Value, Variable};
use std::io::Read;

const NO_MAT_FILE: &str = "neither a MAT file of level 4 nor of level 5 to 7";

/// Reads all variables; a truncated file is read up to its end, with a remark.
///
/// # Errors
///
/// Description of the damage in the first variable, or of a limit that it exceeds.
pub(super) fn read(
    mut source: impl Read,
    remarks: &mut Vec<String>,
) -> Result<Vec<Variable>, Damage> {
    let mut variables = Vec::new();
    let mut kept = 0_usize;
    loop {
        let head = bytes(&mut source, 20)?;
        if head.is_empty() {
            return Ok(variables);
        }
        let Some(header) = Header::of(&head) else {
            if variables.is_empty() {
                return Err(NO_MAT_FILE.into());
            }
            remarks.push(damaged_after(&variables));
            return Ok(variables);
        };
        let name = bytes(&mut source, header.name)?;
        let text = String::from_utf8_lossy(&name).trim_end_matches('\0').to_string();
        let parts = 1 + usize::from(header.is_complex);
        kept = kept.saturating_add(header.count.saturating_mul(parts));
        if kept > MOST_NUMBERS {
            return Err(format!(
                "{text} is {} x {}: MAT files are read whole, up to {} million numbers; export it as CSV, \
                 which is read in parts",
                header.rows,
                header.columns,
                MOST_NUMBERS / 1_000_000
            ));
        }
        let size = header.count * parts * header.storage.size();
        let data = bytes(&mut source, size)?;
        if name.len() < header.name || data.len() < size {
            if variables.is_empty() {
                return Err(format!("{NO_MAT_FILE}, or cut off within its first variable"));
            }
            remarks.push(damaged_after(&variables));
            return Ok(variables);
        }
        if header.is_complex {
            remarks.push(format!("{text} is complex: its real part is read"));
        }
        let mut values = header.storage.numbers(&data, header.order);
        values.truncate(header.count);
        variables.push(Variable { name: text, value: header.value(values) });
    }
}

fn damaged_after(variables: &[Variable]) -> String {
    let name = variables.last().map_or("", |v| v.name.as_str());
    format!("the file is cut off or damaged after {name}: it is read up to there")
}

/// Reads bytes; fewer at the end of the file. Allocates no more than the file's size.
fn bytes(source: &mut impl Read, count: usize) -> Result<Vec<u8>, Damage> {
    let mut read = Vec::new();
    source.take(count as u64).read_to_end(&mut read).map_err(|e| e.to_string())?;
    Ok(read)
}

/// Header of a matrix.
struct Header {
    order: ByteOrder,
    storage: Storage,
    kind: Kind,
    rows: usize,
    columns: usize,
    count: usize,
    is_complex: bool,
    /// Length of the name, including its final zero byte.
    name: usize,
}

#[derive(Clone, Copy)]
enum Kind {
    Numbers,
    Text,
    Sparse,
}

impl Header {
    fn of(head: &[u8]) -> Option<Self> {
        // the type code is below 5000 in the file's byte order
        let order = [ByteOrder::Little, ByteOrder::Big]
            .into_iter()
            .find(|order| head.len() == 20 && order.integer(head) < 5000)?;
        let integer = |k: usize| order.integer(&head[4 * k..]) as usize;
        let (code, rows, columns, imaginary, name) =
            (integer(0), integer(1), integer(2), integer(3), integer(4));
        // thousands digit: 0 little endian, 1 big endian, above: VAX and Cray formats
        let is_ieee = code / 1000 == usize::from(order == ByteOrder::Big);
        let storage = match code / 10 % 10 {
            0 => Storage::Double,
            1 => Storage::Single,
            2 => Storage::Int32,
            3 => Storage::Int16,
            4 => Storage::Uint16,
            5 => Storage::Uint8,
            _ => return None,
        };
        let kind = match code % 10 {
            0 => Kind::Numbers,
            1 => Kind::Text,
            2 => Kind::Sparse,
            _ => return None,
        };
        let is_sound =
            is_ieee && code / 100 % 10 == 0 && imaginary <= 1 && (1..=1000).contains(&name);
        let count = rows.checked_mul(columns)?;
        let is_complex = imaginary == 1;
        let header = Self { order, storage, kind, rows, columns, count, is_complex, name };
        is_sound.then_some(header)
    }

    fn value(&self, values: Vec<f64>) -> Value {
        let character = |v: &f64| char::from_u32(*v as u32).filter(|c| *c != '\0').unwrap_or(' ');
        match self.kind {
            Kind::Numbers => {
                Value::Numbers(Matrix { dimensions: vec![self.rows, self.columns], values })
            }
            Kind::Text => {
                let characters: Vec<char> = values.iter().map(character).collect();
                Value::of_characters(self.rows, &characters)
            }
            Kind::Sparse => Value::Unread("a sparse matrix".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A matrix as MATLAB writes it with -v4.
    fn matrix(code: u32, rows: u32, columns: u32, name: &str, data: &[u8]) -> Vec<u8> {
        let integer = |v: u32| if code >= 1000 { v.to_be_bytes() } else { v.to_le_bytes() };
        let head = [code, rows, columns, 0, name.len() as u32 + 1];
        let mut bytes: Vec<u8> = head.into_iter().flat_map(integer).collect();
        bytes.extend(name.as_bytes());
        bytes.push(0);
        bytes.extend(data);
        bytes
    }

    fn numbers(bytes: &[u8]) -> Vec<f64> {
        let variables = read(bytes, &mut Vec::new()).unwrap();
        variables[0].value.numbers().unwrap().values.clone()
    }

    #[test]
    fn every_type_is_read_in_either_byte_order() {
        let wanted = [3.0, 258.0];
        let both = |code: u32, little: Vec<u8>, big: Vec<u8>| {
            assert_eq!(numbers(&matrix(code, 2, 1, "x", &little)), wanted, "{code}");
            assert_eq!(numbers(&matrix(1000 + code, 2, 1, "x", &big)), wanted, "{code}");
        };
        macro_rules! of {
            ($code:expr, $number:ty) => {
                let all = wanted.map(|v: f64| v as $number);
                both(
                    $code,
                    all.iter().flat_map(|v| v.to_le_bytes()).collect(),
                    all.iter().flat_map(|v| v.to_be_bytes()).collect(),
                )
            };
        }
        of!(0, f64);
        of!(10, f32);
        of!(20, i32);
        of!(30, i16);
        of!(40, u16);
        assert_eq!(numbers(&matrix(50, 2, 1, "x", &[3, 255])), [3.0, 255.0]);
        assert_eq!(numbers(&matrix(30, 1, 1, "x", &(-7_i16).to_le_bytes())), [-7.0]);
    }

    #[test]
    fn an_oversized_matrix_takes_no_memory_and_complete_ones_are_kept() {
        let whole = matrix(0, 1, 1, "t", &1.5_f64.to_le_bytes());
        let mut cut = whole.clone();
        cut.extend(matrix(0, 4000, 4000, "x", &[1; 100]));
        let mut remarks = Vec::new();
        let variables = read(&cut[..], &mut remarks).unwrap();
        assert_eq!(variables.len(), 1);
        assert!(remarks[0].contains("after t"), "{remarks:?}");
        let tall = matrix(51, 1 << 30, 0, "x", &[]);
        assert!(
            matches!(&read(&tall[..], &mut remarks).unwrap()[0].value, Value::Text(rows) if rows.is_empty())
        );
        let large = matrix(0, 40_000, 50_000, "x", &[]);
        let message = read(&large[..], &mut remarks).err().unwrap();
        assert!(message.contains("20 million"), "{message}");
    }
}
