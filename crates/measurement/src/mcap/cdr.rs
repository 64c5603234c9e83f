//! Numbers of a ROS 2 message in CDR, with their paths. Supported is plain CDR (XCDR1) in either byte order, after OMG
//! DDS-XTypes section 7.4.

use super::definition::{Count, Definition, Field, Kind};
use super::json::LONGEST_ARRAY;
use std::fmt::Write;

/// Deepest nesting of messages.
const DEEPEST: usize = 16;
/// Largest number of array elements in a message; arrays of messages without fields take no bytes.
const MOST_ELEMENTS: usize = 10_000_000;

/// Calls `each` with every number and its path. Positions, velocities and efforts of a JointState are `position[name]`.
///
/// # Errors
///
/// The part of the data that does not fit the definition.
pub(super) fn numbers(
    definition: &Definition,
    data: &[u8],
    mut each: impl FnMut(&str, f64),
) -> Result<(), String> {
    let (head, data) = data.split_at_checked(4).ok_or("it is shorter than its head")?;
    let is_little = match head[1] {
        0 if head[0] == 0 => false,
        1 if head[0] == 0 => true,
        _ => {
            return Err(format!(
                "of representation {:02x}{:02x}: plain CDR is read",
                head[0], head[1]
            ));
        }
    };
    let mut reader = Reader { data, at: 0, is_little, elements: 0, path: String::new() };
    reader.message(definition, &definition.name, 0, &mut each)
}

struct Reader<'a> {
    data: &'a [u8],
    at: usize,
    is_little: bool,
    elements: usize,
    path: String,
}

impl Reader<'_> {
    fn message(
        &mut self,
        definition: &Definition,
        name: &str,
        depth: usize,
        each: &mut dyn FnMut(&str, f64),
    ) -> Result<(), String> {
        let fields = definition.messages.get(name);
        let fields = fields.ok_or_else(|| format!("its schema does not say what {name} is"))?;
        if depth > DEEPEST {
            return Err(format!("messages within messages are more than {DEEPEST} deep"));
        }
        let is_joints = name == "sensor_msgs/JointState";
        let mut joints: Vec<String> = Vec::new();
        // a message without fields still has one byte
        if fields.is_empty() {
            self.bytes(1)?;
        }
        for field in fields {
            let length = self.path.len();
            if length > 0 {
                self.path.push('.');
            }
            self.path.push_str(&field.name);
            let texts = self.field(definition, field, depth, &joints, each)?;
            self.path.truncate(length);
            if is_joints && field.name == "name" {
                joints = texts;
            }
        }
        Ok(())
    }

    /// Reads a field's numbers; returns its texts up to a limit.
    fn field(
        &mut self,
        definition: &Definition,
        field: &Field,
        depth: usize,
        joints: &[String],
        each: &mut dyn FnMut(&str, f64),
    ) -> Result<Vec<String>, String> {
        let count = match field.count {
            Count::One => 1,
            Count::Exactly(count) => count,
            Count::Any => self.uint(4)? as usize,
        };
        let mut texts = Vec::new();
        let length = self.path.len();
        self.elements = self.elements.saturating_add(count);
        if self.elements > MOST_ELEMENTS {
            return Err(format!("an array of {count} elements"));
        }
        for k in 0..count {
            if field.count != Count::One {
                // writing to a String cannot fail
                let _ = match joints.get(k).filter(|_| joints.len() == count) {
                    Some(joint) => write!(self.path, "[{joint}]"),
                    None => write!(self.path, "[{k}]"),
                };
            }
            let value = match &field.kind {
                Kind::Bool => self.uint(1)? as f64,
                Kind::Uint(size) => self.uint(*size)? as f64,
                Kind::Int(size) => {
                    let unused = 64 - 8 * *size as u32;
                    ((self.uint(*size)? << unused) as i64 >> unused) as f64
                }
                Kind::Float(4) => f64::from(f32::from_bits(self.uint(4)? as u32)),
                Kind::Float(_) => f64::from_bits(self.uint(8)?),
                Kind::Text => {
                    let size = self.uint(4)? as usize;
                    let text = self.bytes(size)?;
                    if k < LONGEST_ARRAY {
                        let text = text.strip_suffix(&[0]).unwrap_or(text);
                        texts.push(String::from_utf8_lossy(text).into_owned());
                    }
                    self.path.truncate(length);
                    continue;
                }
                Kind::WideText => {
                    let size = self.uint(4)? as usize;
                    self.bytes(size.saturating_mul(4))?;
                    self.path.truncate(length);
                    continue;
                }
                Kind::Message(part) => {
                    let part = part.clone();
                    if k < LONGEST_ARRAY {
                        self.message(definition, &part, depth + 1, each)?;
                    } else {
                        self.message(definition, &part, depth + 1, &mut |_, _| {})?;
                    }
                    self.path.truncate(length);
                    continue;
                }
            };
            if k < LONGEST_ARRAY {
                each(&self.path, value);
            }
            self.path.truncate(length);
        }
        self.path.truncate(length);
        Ok(texts)
    }

    fn bytes(&mut self, count: usize) -> Result<&[u8], String> {
        let end = self.at.checked_add(count).filter(|end| *end <= self.data.len());
        let end = end.ok_or("it is shorter than its schema says")?;
        let bytes = &self.data[self.at..end];
        self.at = end;
        Ok(bytes)
    }

    /// An unsigned integer of `size` bytes, aligned to a multiple of `size`.
    fn uint(&mut self, size: usize) -> Result<u64, String> {
        self.at = self.at.next_multiple_of(size);
        let is_little = self.is_little;
        let bytes = self.bytes(size)?;
        let mut all = [0; 8];
        match is_little {
            true => all[..size].copy_from_slice(bytes),
            false => bytes.iter().rev().zip(&mut all).for_each(|(b, place)| *place = *b),
        }
        Ok(u64::from_le_bytes(all))
    }
}
