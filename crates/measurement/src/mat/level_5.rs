//! MAT files of level 5 to 7: tagged elements, compressed since level 7.
//!
//! Layout after MathWorks, "MAT-File Format" (level 5): a header of 128 bytes, then elements of type, size and data.

use super::numbers::{ByteOrder, Storage};
use super::value::{Damage, MOST_NUMBERS, Matrix, Structure, Value, Variable};
use flate2::read::ZlibDecoder;
use std::io::Read;

/// Largest size of a decompressed element \[bytes\]: all numbers that are kept, as doubles, and some names.
const LARGEST_ELEMENT: u64 = 8 * MOST_NUMBERS as u64 + (1 << 20);
/// Deepest nesting of structures.
const DEEPEST: u32 = 16;

/// Memory of a matrix besides its numbers, counted in numbers; it bounds structures with a million empty fields.
const COST: usize = 16;

const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

/// Reads all variables; a truncated file is read up to its end, with a remark.
///
/// # Errors
///
/// Description of the damage in the first variable, or of a limit that it exceeds.
pub(super) fn read(
    mut source: impl Read,
    remarks: &mut Vec<String>,
) -> Result<Vec<Variable>, Damage> {
    let head = bytes(&mut source, 128)?;
    if head.len() < 128 {
        return Err("not read as a MAT file: cut off within its header of 128 bytes".into());
    }
    let order = match &head[126..128] {
        b"IM" => ByteOrder::Little,
        b"MI" => ByteOrder::Big,
        other => {
            return Err(format!(
                "not read as a MAT file: its byte order is marked {other:02x?}, not IM or MI"
            ));
        }
    };
    let mut variables: Vec<Variable> = Vec::new();
    let mut numbers_left = MOST_NUMBERS;
    loop {
        let tag = bytes(&mut source, 8)?;
        if tag.is_empty() && variables.is_empty() {
            return Err("not read as a MAT file: there is no variable in it".into());
        }
        if tag.is_empty() {
            return Ok(variables);
        }
        if tag.len() < 8 {
            return variables_before_damage(variables, "cut off", remarks);
        }
        let (kind, size) = (order.integer(&tag), u64::from(order.integer(&tag[4..])));
        if size > LARGEST_ELEMENT {
            return Err(too_large());
        }
        let data = bytes(&mut source, size)?;
        let variable = if (data.len() as u64) < size {
            Err("cut off".into())
        } else {
            match kind {
                MATRIX => variable(&data, order, &mut numbers_left, remarks),
                COMPRESSED => {
                    unpacked(&data).and_then(|data| match (order.integer(&data), data.get(8..)) {
                        (MATRIX, Some(data)) => variable(data, order, &mut numbers_left, remarks),
                        _ => Err("a packed element is no matrix".into()),
                    })
                }
                1..=18 => continue,
                _ => Err(format!("an element of type {kind}, which there is not")),
            }
        };
        match variable {
            // data of a subsystem (objects) has no name
            Ok(variable) if variable.name.is_empty() => {}
            Ok(variable) => variables.push(variable),
            Err(damage) if damage == too_large() => return Err(damage),
            Err(damage) => return variables_before_damage(variables, &damage, remarks),
        }
    }
}

/// The variables before the damaged one.
fn variables_before_damage(
    variables: Vec<Variable>,
    damage: &str,
    remarks: &mut Vec<String>,
) -> Result<Vec<Variable>, Damage> {
    let Some(last) = variables.last() else {
        return Err(format!("not read as a MAT file: its first variable: {damage}"));
    };
    remarks
        .push(format!("cut off or damaged after {} ({damage}): it is read up to there", last.name));
    Ok(variables)
}

/// Reads bytes; fewer at the end of the file. Allocates no more than the file's size.
fn bytes(source: &mut impl Read, count: u64) -> Result<Vec<u8>, Damage> {
    let mut read = Vec::new();
    source.take(count).read_to_end(&mut read).map_err(|e| e.to_string())?;
    Ok(read)
}

fn too_large() -> Damage {
    format!(
        "MAT files are read whole, up to {} million numbers; export it as CSV, which is read in parts",
        MOST_NUMBERS / 1_000_000
    )
}

fn unpacked(data: &[u8]) -> Result<Vec<u8>, Damage> {
    let mut whole = Vec::new();
    let result = ZlibDecoder::new(data).take(LARGEST_ELEMENT + 1).read_to_end(&mut whole);
    if whole.len() as u64 > LARGEST_ELEMENT {
        return Err(too_large());
    }
    result.map_err(|e| format!("packed data: {e}"))?;
    Ok(whole)
}

fn variable(
    data: &[u8],
    order: ByteOrder,
    numbers_left: &mut usize,
    remarks: &mut Vec<String>,
) -> Result<Variable, Damage> {
    Elements { rest: data, order, numbers_left, remarks }.matrix(0)
}

/// Iterator over the elements of a matrix.
struct Elements<'a> {
    rest: &'a [u8],
    order: ByteOrder,
    numbers_left: &'a mut usize,
    remarks: &'a mut Vec<String>,
}

impl<'a> Elements<'a> {
    /// The next element's type and data.
    fn element(&mut self) -> Result<(u32, &'a [u8]), Damage> {
        let cut = || "an element is longer than what it is in".to_string();
        let (tag, after) = self.rest.split_at_checked(8).ok_or_else(cut)?;
        let first = self.order.integer(tag);
        // a small element holds up to four bytes in its tag, with their count before the type
        if let small @ 1.. = (first >> 16) as usize {
            self.rest = after;
            return Ok((first & 0xffff, tag.get(4..4 + small).ok_or_else(cut)?));
        }
        let size = self.order.integer(&tag[4..]) as usize;
        let data = after.get(..size).ok_or_else(cut)?;
        // the last element may lack its padding
        self.rest = &after[size.next_multiple_of(8).min(after.len())..];
        Ok((first, data))
    }

    fn numbers(&mut self) -> Result<Vec<f64>, Damage> {
        let (kind, data) = self.element()?;
        let storage =
            storage(kind).ok_or_else(|| format!("numbers of type {kind}, which there is not"))?;
        let count = data.len() / storage.size();
        *self.numbers_left = self.numbers_left.checked_sub(count).ok_or_else(too_large)?;
        Ok(storage.numbers(data, self.order))
    }

    /// A matrix of any class; its tag has been read.
    fn matrix(&mut self, depth: u32) -> Result<Variable, Damage> {
        // an empty field of a structure consists of its tag only
        *self.numbers_left = self.numbers_left.checked_sub(COST).ok_or_else(too_large)?;
        if self.rest.is_empty() {
            let value = Value::Numbers(Matrix { dimensions: Vec::new(), values: Vec::new() });
            return Ok(Variable { name: String::new(), value });
        }
        if depth > DEEPEST {
            return Err(format!("structures are nested more than {DEEPEST} deep"));
        }
        let (_, flags) = self.element()?;
        let flags = self.order.integer(flags);
        let (class, is_complex) = (flags & 0xff, flags & 0x0800 != 0);
        // objects of classes (string, table, timeseries ...) have names in place of dimensions
        if class == 17 {
            let name = text(self.element()?.1);
            let _system = self.element()?;
            let what = text(self.element()?.1);
            return Ok(Variable { name, value: Value::Unread(format!("an object ({what})")) });
        }
        let (_, dimensions) = self.element()?;
        let dimensions: Vec<usize> =
            dimensions.chunks_exact(4).map(|d| self.order.integer(d) as usize).collect();
        let name = text(self.element()?.1);
        let count = dimensions.iter().try_fold(1_usize, |product, d| product.checked_mul(*d));
        let count = count.ok_or("its dimensions are too large")?;
        let value = match class {
            1 => Value::Unread("a cell array".into()),
            2 | 3 => {
                // objects of old classes are structures with a class name
                if class == 3 {
                    self.element()?;
                }
                Value::Structure(self.structure(count, depth)?)
            }
            4 => self.text(&dimensions)?,
            5 => Value::Unread("a sparse matrix".into()),
            6..=15 => {
                let values = self.numbers()?;
                if values.len() != count {
                    return Err(format!("{name} has {} numbers in place of {count}", values.len()));
                }
                if is_complex {
                    self.remarks.push(format!("{name} is complex: its real part is read"));
                }
                Value::Numbers(Matrix { dimensions, values })
            }
            16 => Value::Unread("a function".into()),
            _ => return Err(format!("a matrix of class {class}, which there is not")),
        };
        Ok(Variable { name, value })
    }

    fn structure(&mut self, count: usize, depth: u32) -> Result<Structure, Damage> {
        let (_, length) = self.element()?;
        let length = self.order.integer(length) as usize;
        let (_, names) = self.element()?;
        if length == 0 && !names.is_empty() {
            return Err("names of fields have no length".into());
        }
        let names = names.chunks_exact(length.max(1)).map(text);
        let mut fields: Vec<(String, Vec<Value>)> = names.map(|name| (name, Vec::new())).collect();
        if fields.is_empty() {
            return Ok(Structure { count: 0, fields });
        }
        for _ in 0..count {
            for (_, values) in &mut fields {
                let (kind, data) = self.element()?;
                if kind != MATRIX {
                    return Err(format!("a field of type {kind}, which is no matrix"));
                }
                let (order, numbers_left) = (self.order, &mut *self.numbers_left);
                let remarks = &mut *self.remarks;
                let mut inner = Elements { rest: data, order, numbers_left, remarks };
                values.push(inner.matrix(depth + 1)?.value);
            }
        }
        Ok(Structure { count, fields })
    }

    /// Rows of characters.
    fn text(&mut self, dimensions: &[usize]) -> Result<Value, Damage> {
        let (kind, data) = self.element()?;
        *self.numbers_left = self.numbers_left.checked_sub(data.len()).ok_or_else(too_large)?;
        let characters: Vec<char> = match kind {
            4 | 17 => {
                let codes = Storage::Uint16.numbers(data, self.order);
                codes.into_iter().map(|c| char::from_u32(c as u32).unwrap_or('?')).collect()
            }
            _ => String::from_utf8_lossy(data).chars().collect(),
        };
        Ok(Value::of_characters(dimensions.first().copied().unwrap_or(0), &characters))
    }
}

fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

fn storage(kind: u32) -> Option<Storage> {
    Some(match kind {
        1 => Storage::Int8,
        2 => Storage::Uint8,
        3 => Storage::Int16,
        4 => Storage::Uint16,
        5 => Storage::Int32,
        6 => Storage::Uint32,
        7 => Storage::Single,
        9 => Storage::Double,
        12 => Storage::Int64,
        13 => Storage::Uint64,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file that fails to be read after some bytes.
    struct Failing<'a>(&'a [u8]);

    impl Read for Failing<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            match self.0.is_empty() {
                true => Err(std::io::Error::other("the disk is gone")),
                false => self.0.read(buffer),
            }
        }
    }

    #[test]
    fn a_file_may_end_before_a_tag_only() {
        let mut file = vec![b' '; 124];
        file.extend([0x00, 0x01, b'I', b'M']);
        // t = 1, as a matrix of doubles
        let elements: [&[u8]; 4] = [
            &[6, 0, 0, 0, 8, 0, 0, 0, 6, 0, 0, 0, 0, 0, 0, 0],
            &[5, 0, 0, 0, 8, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0],
            &[1, 0, 1, 0, b't', 0, 0, 0],
            &[9, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f],
        ];
        file.extend([14, 0, 0, 0, 56, 0, 0, 0]);
        file.extend(elements.concat());
        let mut remarks = Vec::new();
        assert_eq!(read(&file[..], &mut remarks).map(|v| v.len()), Ok(1));
        assert!(remarks.is_empty());
        let message = read(Failing(&file), &mut remarks).err();
        assert_eq!(message.as_deref(), Some("the disk is gone"));
        file.extend([14, 0, 0]);
        assert_eq!(read(&file[..], &mut remarks).map(|v| v.len()), Ok(1));
        assert!(remarks[0].contains("cut off or damaged after t (cut off)"), "{remarks:?}");
    }
}
