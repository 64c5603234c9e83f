//! Problems of a table: file, line, key, value that was read, allowed values.

use std::fmt::{self, Display, Formatter};
use toml::de::{DeTable, DeValue};

/// All problems of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TableError {
    /// One sentence each, with its place.
    pub problems: Vec<String>,
}

impl Display for TableError {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.problems.join("\n"))
    }
}

impl std::error::Error for TableError {}

/// A part of a key: a name, or a place in a list.
#[derive(Clone, Copy, Debug)]
pub(super) enum Part {
    /// Name of a key.
    Name(&'static str),
    /// Place in a list, from 0.
    Index(usize),
}

impl From<&'static str> for Part {
    fn from(name: &'static str) -> Self {
        Self::Name(name)
    }
}

impl From<usize> for Part {
    fn from(at: usize) -> Self {
        Self::Index(at)
    }
}

/// Collects problems of a file.
pub(super) struct Problems<'a> {
    /// Name of the file, for messages.
    file: &'a str,
    /// Text of the file, in which lines are looked up.
    text: &'a str,
    /// Names around the table in its file.
    prefix: &'static [&'static str],
    /// Problems so far, one sentence each.
    sentences: Vec<String>,
}

impl<'a> Problems<'a> {
    /// No problems of a file with this name and text; `prefix` are the tables around its keys.
    pub(super) fn new(file: &'a str, text: &'a str, prefix: &'static [&'static str]) -> Self {
        Self { file, text, prefix, sentences: Vec::new() }
    }

    /// A syntax error of TOML, whose message contains the line.
    pub(super) fn syntax(&self, error: &toml::de::Error) -> TableError {
        TableError { problems: vec![format!("{}: {error}", self.file)] }
    }

    /// A problem of a key.
    pub(super) fn add(&mut self, key: &[Part], message: &str) {
        let prefix = self.prefix.iter().map(|name| Part::Name(name));
        let key: Vec<Part> = prefix.chain(key.iter().copied()).collect();
        let line = line(self.text, &key).map_or_else(String::new, |line| format!(":{line}"));
        self.sentences.push(format!("{}{line}: {}: {message}", self.file, path(&key)));
    }

    /// A value of a key that is out of range.
    pub(super) fn refuse(&mut self, key: &[Part], read: impl Display, allowed: &str) {
        self.add(key, &format!("{read} was read; allowed is {allowed}"));
    }

    /// `value` without problems, else all of them.
    pub(super) fn into_result<T>(self, value: T) -> Result<T, TableError> {
        if self.sentences.is_empty() {
            Ok(value)
        } else {
            Err(TableError { problems: self.sentences })
        }
    }
}

/// Key as messages have it: `device[2].sdo[1].value`, places from 1.
fn path(key: &[Part]) -> String {
    let mut path = String::new();
    for part in key {
        match part {
            Part::Name(name) if path.is_empty() => path += name,
            Part::Name(name) => path += &format!(".{name}"),
            // people count from one
            Part::Index(at) => path += &format!("[{}]", at + 1),
        }
    }
    path
}

/// The line of a key, or of the nearest table around it, from 1.
fn line(text: &str, key: &[Part]) -> Option<usize> {
    let root = DeTable::parse(text).ok()?;
    let mut table = root.get_ref().clone();
    let mut start = None;
    let mut value: Option<DeValue<'_>> = None;
    for part in key {
        let next = match (part, &value) {
            (Part::Name(name), None) => table.get(*name).cloned(),
            (Part::Name(name), Some(DeValue::Table(inside))) => inside.get(*name).cloned(),
            (Part::Index(at), Some(DeValue::Array(list))) => list.get(*at).cloned(),
            _ => None,
        };
        let Some(next) = next else { break };
        start = Some(next.span().start);
        let inner = next.into_inner();
        if let DeValue::Table(inside) = &inner {
            table = inside.clone();
        }
        value = Some(inner);
    }
    let start = start?;
    Some(1 + text.get(..start)?.bytes().filter(|byte| *byte == b'\n').count())
}
