//! Records of a data group, in one block or in a list of blocks, with or without compression.

use super::block::{Blocks, Damage, number};
use crate::decompress::{self, Packing};
use std::io::{Read, Seek};

/// Largest size of a decompressed block \[bytes\]. Usual writers have 4 MB.
const LARGEST: u64 = 64 << 20;
/// Size of the parts in which an uncompressed block is read \[bytes\].
const PART: u64 = 4 << 20;
/// Largest number of lists.
const MOST_LISTS: usize = 1_000_000;

/// Iterator over the parts of the data, in order.
pub(super) struct Parts {
    /// Positions of the remaining blocks of the list, the next one last.
    blocks: Vec<u64>,
    /// Position of the next list.
    list: u64,
    lists: usize,
    /// Position and size of the rest of an uncompressed block.
    rest: (u64, u64),
    /// Whether the last block may lack its length because its writer was interrupted.
    is_unfinished: bool,
}

/// Whether the data at a link are stored by columns, a feature of MDF 4.2.
///
/// # Errors
///
/// Description of the damage.
pub(super) fn is_by_columns<R: Read + Seek>(
    file: &mut Blocks<R>,
    link: u64,
) -> Result<bool, Damage> {
    if link == 0 {
        return Ok(false);
    }
    let id = match &file.head(link)?.id {
        b"##HL" => match file.block(link, &[b"##HL"])?.link(0) {
            0 => return Ok(false),
            list => file.head(list)?.id,
        },
        other => *other,
    };
    Ok(matches!(&id, b"##LD" | b"##DV"))
}

impl Parts {
    /// Opens the data at a link.
    ///
    /// # Errors
    ///
    /// Kind of an unexpected block.
    pub(super) fn at<R: Read + Seek>(
        file: &mut Blocks<R>,
        link: u64,
        is_unfinished: bool,
    ) -> Result<Self, Damage> {
        let mut parts = Self { blocks: Vec::new(), list: 0, lists: 0, rest: (0, 0), is_unfinished };
        if link == 0 {
            return Ok(parts);
        }
        match &file.head(link)?.id {
            b"##HL" => parts.list = file.next(link, b"##HL")?.link(0),
            b"##DL" => parts.list = link,
            b"##DT" | b"##DZ" => parts.blocks.push(link),
            other => {
                return Err(format!("{} in place of data", String::from_utf8_lossy(other)));
            }
        }
        Ok(parts)
    }

    /// The next part; `None` at the end.
    ///
    /// # Errors
    ///
    /// Description of the damage.
    pub(super) fn next<R: Read + Seek>(
        &mut self,
        file: &mut Blocks<R>,
    ) -> Result<Option<Vec<u8>>, Damage> {
        loop {
            let (at, size) = self.rest;
            if size > 0 {
                let part = file.bytes(at, size.min(PART))?;
                let read = part.len() as u64;
                self.rest = (at + read, size - read);
                if read == 0 {
                    return Err("the file ends within its data".into());
                }
                return Ok(Some(part));
            }
            if let Some(block) = self.blocks.pop() {
                file.visit(block)?;
                let head = file.head(block)?;
                let begin = block.saturating_add(24 + 8 * head.links);
                match &head.id {
                    b"##DT" => {
                        let size = head.length - 24 - 8 * head.links;
                        let is_open = size == 0 && self.is_unfinished && self.blocks.is_empty();
                        let to_end = file.size.saturating_sub(begin);
                        self.rest = (begin, if is_open { to_end } else { size });
                    }
                    b"##DZ" => {
                        let size = head.length - 24 - 8 * head.links;
                        if size > LARGEST {
                            return Err(too_large(size));
                        }
                        let packed = file.bytes(begin, size)?;
                        return unpacked(&packed).map(Some);
                    }
                    other => {
                        return Err(format!(
                            "{} in a list of data",
                            String::from_utf8_lossy(other)
                        ));
                    }
                }
            } else if self.list != 0 {
                self.lists += 1;
                if self.lists > MOST_LISTS {
                    return Err("its lists of data do not end".into());
                }
                let list = file.next(self.list, b"##DL")?;
                self.list = list.link(0);
                let blocks = list.links().get(1..).unwrap_or(&[]);
                self.blocks = blocks.iter().rev().copied().filter(|b| *b != 0).collect();
            } else {
                return Ok(None);
            }
        }
    }
}

fn too_large(size: u64) -> Damage {
    format!(
        "a packed block of {} MB: blocks are read whole, up to {} MB",
        size >> 20,
        LARGEST >> 20
    )
}

/// Decompresses a block with the fields: original kind, compression method, columns of the transposition, sizes, data.
fn unpacked(block: &[u8]) -> Result<Vec<u8>, Damage> {
    let (head, data) = block.split_at_checked(24).ok_or("a packed block without a head")?;
    let (kind, way, columns) = (&head[..2], head[2], number(head, 4, 4));
    let (size, packed_size) = (number(head, 8, 8), number(head, 16, 8));
    if kind != b"DT" {
        return Err(format!("packed {} in place of data", String::from_utf8_lossy(kind)));
    }
    if size > LARGEST {
        return Err(too_large(size));
    }
    let data = data.get(..packed_size as usize).ok_or("the file ends within its data")?;
    let packing = match way {
        0 | 1 => Packing::Deflate,
        2 | 3 => Packing::Zstd,
        4 | 5 => Packing::Lz4,
        other => return Err(format!("a block is packed in way {other}, which is not read")),
    };
    let mut whole = Vec::new();
    decompress::unpack(packing, data, size, &mut whole)?;
    Ok(match way % 2 == 1 {
        true => untransposed(&whole, columns as usize),
        false => whole,
    })
}

/// Reverses the transposition of bytes as a matrix of `columns` columns; bytes after the last whole row stay.
fn untransposed(bytes: &[u8], columns: usize) -> Vec<u8> {
    let rows = bytes.len().checked_div(columns).unwrap_or(0);
    let (matrix, rest) = bytes.split_at(rows * columns);
    let mut plain = Vec::with_capacity(bytes.len());
    for row in 0..rows {
        plain.extend(matrix[row..].iter().step_by(rows));
    }
    plain.extend(rest);
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transposed_bytes_are_restored() {
        // two rows of three bytes, and one more
        assert_eq!(untransposed(&[1, 4, 2, 5, 3, 6, 7], 3), [1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(untransposed(&[1, 2], 3), [1, 2]);
        assert_eq!(untransposed(&[1, 2], 0), [1, 2]);
    }
}
