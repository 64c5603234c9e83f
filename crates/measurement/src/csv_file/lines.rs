//! Lines of a text file in any encoding, and the cells of a line.

use csv_core::ReadRecordResult;
use std::borrow::Cow;
use std::fs::File;
use std::io::{BufRead, BufReader, Error, ErrorKind, Read};

/// Longest line \[bytes\].
const LONGEST_LINE: u64 = 16 << 20;
/// Number of bytes from which the encoding is detected.
const BEGINNING: usize = 4096;

/// Line reader of a text file.
pub(super) struct Lines {
    source: Box<dyn BufRead>,
    /// Byte that ends a line.
    end: u8,
    /// Bytes of the current line.
    line: Vec<u8>,
    /// Number of the current line, from 1.
    pub(super) number: u64,
    /// Whether the text is in UTF-16.
    pub(super) is_utf_16: bool,
    /// Whether the current line has no line end: the last line of a file, which may have been truncated.
    pub(super) is_cut: bool,
}

impl Lines {
    /// Opens a text file in UTF-8, UTF-16 or Windows-1252; `None` if it is not text.
    pub(super) fn of(mut file: File) -> std::io::Result<Option<Self>> {
        let mut beginning = Vec::new();
        file.by_ref().take(BEGINNING as u64).read_to_end(&mut beginning)?;
        let utf_16 = utf_16(&beginning);
        if utf_16.is_none() && beginning.contains(&0) {
            return Ok(None);
        }
        // line ends of old Macintosh systems
        let is_carriage_return = !beginning.contains(&b'\n') && beginning.contains(&b'\r');
        let has_mark = beginning.starts_with(&[0xef, 0xbb, 0xbf]);
        let skipped = if has_mark { 3 } else { 0 };
        let whole = std::io::Cursor::new(beginning.split_off(skipped)).chain(file);
        let source: Box<dyn BufRead> = match utf_16 {
            Some(encoding) => {
                let mut decoder = encoding_rs_io::DecodeReaderBytesBuilder::new();
                Box::new(BufReader::new(decoder.encoding(Some(encoding)).build(whole)))
            }
            None => Box::new(BufReader::with_capacity(1 << 16, whole)),
        };
        let end = if is_carriage_return { b'\r' } else { b'\n' };
        Ok(Some(Self {
            source,
            end,
            line: Vec::new(),
            number: 0,
            is_utf_16: utf_16.is_some(),
            is_cut: false,
        }))
    }

    /// The next line without its line end; `None` at the end of the file.
    pub(super) fn next(&mut self) -> std::io::Result<Option<&[u8]>> {
        self.line.clear();
        let mut bounded = self.source.by_ref().take(LONGEST_LINE);
        let count = bounded.read_until(self.end, &mut self.line)?;
        if count == 0 {
            return Ok(None);
        }
        self.number += 1;
        self.is_cut = self.line.last() != Some(&self.end);
        if count as u64 == LONGEST_LINE {
            let reason = format!("line {} is longer than {} MB", self.number, LONGEST_LINE >> 20);
            return Err(Error::new(ErrorKind::InvalidData, reason));
        }
        while self.line.last().is_some_and(|b| matches!(b, b'\n' | b'\r')) {
            self.line.pop();
        }
        Ok(Some(&self.line))
    }
}

/// Decodes a line: as UTF-8, or else byte by byte as Windows-1252 except for rare characters.
pub(super) fn text(line: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(line) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(line.iter().map(|byte| char::from(*byte)).collect()),
    }
}

/// The variant of UTF-16, by its byte-order mark or because every other byte is zero.
fn utf_16(beginning: &[u8]) -> Option<&'static encoding_rs::Encoding> {
    if beginning.starts_with(&[0xff, 0xfe]) {
        return Some(encoding_rs::UTF_16LE);
    }
    if beginning.starts_with(&[0xfe, 0xff]) {
        return Some(encoding_rs::UTF_16BE);
    }
    let zeros = |from: usize| beginning.iter().skip(from).step_by(2).filter(|b| **b == 0).count();
    let (even, odd) = (zeros(0), zeros(1));
    let most = beginning.len() / 2;
    match most > 3 {
        true if even == 0 && odd * 10 > most * 9 => Some(encoding_rs::UTF_16LE),
        true if odd == 0 && even * 10 > most * 9 => Some(encoding_rs::UTF_16BE),
        _ => None,
    }
}

/// Separator between cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Separator {
    /// One character.
    Sign(u8),
    /// Any number of blanks and tabs.
    Blanks,
}

/// The cells of a line.
#[derive(Default)]
pub(super) struct Cells {
    text: String,
    ends: Vec<usize>,
    begins: Vec<usize>,
}

impl Cells {
    /// Splits a line. Separators within quotes do not count; a quote that is not closed in its line is an ordinary
    /// character.
    pub(super) fn split(&mut self, line: &str, separator: Separator) {
        self.text.clear();
        self.begins.clear();
        self.ends.clear();
        let is_quoted = line.contains('"') && line.matches('"').count().is_multiple_of(2);
        match separator {
            Separator::Sign(sign) if is_quoted => self.split_quoted(line, sign),
            Separator::Sign(sign) => {
                self.text.push_str(line);
                let mut begin = 0;
                for (k, _) in line.bytes().enumerate().filter(|(_, b)| *b == sign) {
                    self.begins.push(begin);
                    self.ends.push(k);
                    begin = k + 1;
                }
                self.begins.push(begin);
                self.ends.push(line.len());
            }
            Separator::Blanks => {
                self.text.push_str(line);
                let mut begin = None;
                let mut is_inside = false;
                for (k, byte) in line.bytes().enumerate() {
                    is_inside ^= is_quoted && byte == b'"';
                    match (byte == b' ' || byte == b'\t', begin) {
                        (false, None) => begin = Some(k),
                        (true, Some(from)) if !is_inside => {
                            self.begins.push(from);
                            self.ends.push(k);
                            begin = None;
                        }
                        _ => {}
                    }
                }
                if let Some(from) = begin {
                    self.begins.push(from);
                    self.ends.push(line.len());
                }
            }
        }
    }

    fn split_quoted(&mut self, line: &str, sign: u8) {
        let mut reader = csv_core::ReaderBuilder::new().delimiter(sign).build();
        let mut output = vec![0; line.len() + 2];
        let mut ends = vec![0; line.bytes().filter(|b| *b == sign).count() + 2];
        let (mut read, mut written, mut cells) = (0, 0, 0);
        // once for the line, then for its end
        for _ in 0..4 {
            let input = line.as_bytes().get(read..).unwrap_or_default();
            let (result, nin, nout, nend) =
                reader.read_record(input, &mut output[written..], &mut ends[cells..]);
            (read, written, cells) = (read + nin, written + nout, cells + nend);
            if !matches!(result, ReadRecordResult::InputEmpty) {
                break;
            }
        }
        self.text = String::from_utf8_lossy(&output[..written]).into_owned();
        let mut begin = 0;
        for end in &ends[..cells] {
            self.begins.push(begin);
            self.ends.push(*end);
            begin = *end;
        }
    }

    pub(super) fn len(&self) -> usize {
        self.begins.len()
    }

    /// A cell; empty where the line is shorter.
    pub(super) fn get(&self, k: usize) -> &str {
        let range = self.begins.get(k).zip(self.ends.get(k));
        range.and_then(|(begin, end)| self.text.get(*begin..*end)).unwrap_or("")
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &str> {
        (0..self.len()).map(|k| self.get(k))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_split_at_separators_outside_of_quotes() {
        let mut cells = Cells::default();
        let comma = Separator::Sign(b',');
        for (line, separator, parts) in [
            ("1,2,,4", comma, &["1", "2", "", "4"][..]),
            ("\"0,01\",\"5\"", comma, &["0,01", "5"]),
            ("\"say \"\"so\"\"\",2", comma, &["say \"so\"", "2"]),
            ("2,\"3", comma, &["2", "\"3"]),
            ("  1.0\t 2.0  3 ", Separator::Blanks, &["1.0", "2.0", "3"]),
            ("\"a b\" c", Separator::Blanks, &["\"a b\"", "c"]),
            ("", comma, &[""]),
            ("", Separator::Blanks, &[]),
            ("é;µ", Separator::Sign(b';'), &["é", "µ"]),
        ] {
            cells.split(line, separator);
            assert_eq!(cells.iter().collect::<Vec<_>>(), parts, "{line}");
        }
        assert_eq!(cells.get(9), "");
    }
}
