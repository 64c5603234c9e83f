//! Parsing and checking of a crane file.

use crate::error::{DescriptionError, Problem};
use crate::excerpt::{Excerpt, excerpt, quoted};
use crate::limit::{number_problem, valid_lengths, whole_segments};
use crate::placeholder::{PLACEHOLDER, is_touched};
use crate::schema::{Choices, KEYS, Key, LINKS, Numbers, StructureChoice};
use crate::suggestion::{
    NAME, SEGMENT_LENGTHS, SEGMENTS, is_section, known_paths, section_suggestion, suggestion,
};
use crate::{Description, Origin};
use hydroboom_model::MAX_SEGMENTS;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Largest size of a crane file \[bytes\].
const LARGEST: usize = 1 << 20;

/// Largest number of problems in an error; other files may have thousands.
const MOST_PROBLEMS: usize = 20;

/// Table of a machine's bus, which is read by whoever attaches the machine.
const BUS: &str = "machine.ethercat";

/// Section of that table.
const MACHINE: &str = "machine";

/// Section of a file of overrides, not allowed in a crane file.
const OVERRIDES: &str = "set";

/// State of the parser.
struct Reading<'a> {
    file: &'a str,
    text: &'a str,
    values: [Option<f64>; KEYS.len()],
    origins: Vec<Origin>,
    /// Ranges in SI units, as `file_ranges` of the description.
    ranges: Vec<Option<[f64; 2]>>,
    texts: Vec<(String, String)>,
    shares: Option<Vec<f64>>,
    problems: Vec<Problem>,
    /// Number of problems found, including those beyond [`MOST_PROBLEMS`].
    count: usize,
}

impl Reading<'_> {
    fn problem(&mut self, span: Range<usize>, message: String, label: &str, help: String) {
        if self.problems.len() < MOST_PROBLEMS {
            self.problems.push(self.problem_at(span, message, label, help));
        }
        self.count += 1;
    }

    /// Creates a problem with its position.
    fn problem_at(
        &self,
        span: Range<usize>,
        message: String,
        label: &str,
        help: String,
    ) -> Problem {
        let Excerpt { source, span, column } = excerpt(self.file, self.text, span);
        let label = match column {
            Some(column) => format!("{label}, column {column}"),
            None => label.into(),
        };
        Problem {
            message,
            help: Some(help),
            span: Some(span.into()),
            label,
            source_code: Some(source),
        }
    }

    fn line(&self, at: usize) -> usize {
        self.text[..at.min(self.text.len())].bytes().filter(|b| *b == b'\n').count() + 1
    }

    /// Reads one `key = value` of a section.
    fn entry(&mut self, path: &str, key_span: Range<usize>, value: &Spanned<DeValue<'_>>) {
        let Stated { value, provenance, source, range } = self.unwrap_origin(value);
        let Some(inner) = value else { return };
        let span = inner.span();
        let place = KEYS.iter().position(|key| key.path() == path);
        if let (Some(range), None) = (range, place)
            && known_paths().any(|known| known == path)
        {
            let help = "leave `range` out here".into();
            let message = format!("`{path}` has no range: it is not a number of the machine");
            self.problem(range.span(), message, "no range here", help);
        }
        if let Some(index) = place {
            let Some(number) = number(inner.get_ref()) else {
                let (read, wanted) = (inner.get_ref().type_str(), KEYS[index].unit);
                let text = inner.get_ref().as_str().and_then(leading_number);
                let remedy = text.map_or_else(String::new, |number| {
                    format!("write {number} without quotes and unit if it is in {wanted}. ")
                });
                self.problem(
                    span,
                    format!("`{path}` is a number [{wanted}], not a {read}"),
                    "not a number",
                    format!("{remedy}{}: {}", path, KEYS[index].meaning),
                );
                return;
            };
            if let Some((message, help)) = number_problem(&KEYS[index], number) {
                self.problem(span, message, "out of range", help);
                return;
            }
            self.values[index] = Some(KEYS[index].to_si(number));
            let line = Some(self.line(span.start));
            self.origins[index] = Origin { provenance, source, line };
            self.ranges[index] = range.and_then(|range| self.range(&KEYS[index], number, range));
        } else if path == SEGMENTS {
            let count = number(inner.get_ref()).unwrap_or(f64::NAN);
            match whole_segments(count) {
                Some(count) => self.shares = Some(vec![1.0; count]),
                None => self.problem(
                    span,
                    format!("`{SEGMENTS}` is a whole number from 1 to {MAX_SEGMENTS}"),
                    "not possible",
                    "3 is the published real-time model, 10 the high-fidelity one".into(),
                ),
            }
        } else if path == SEGMENT_LENGTHS {
            let lengths: Option<Vec<f64>> = inner
                .get_ref()
                .as_array()
                .map(|items| items.iter().filter_map(|item| number(item.get_ref())).collect());
            match lengths {
                Some(lengths) if valid_lengths(&lengths) => self.shares = Some(lengths),
                _ => self.problem(
                    span,
                    format!("`{SEGMENT_LENGTHS}` is a list of 1 to {MAX_SEGMENTS} lengths"),
                    "not possible",
                    "for example [1200, 1200, 1200]; only their proportions count".into(),
                ),
            }
        } else if known_paths().any(|known| known == path) {
            self.text_entry(path, inner);
        } else {
            let message = format!("unknown key `{}`", quoted(path));
            self.problem(key_span, message, "unknown", suggestion(path));
        }
    }

    /// Reads a text: a choice or the crane's name.
    fn text_entry(&mut self, path: &str, inner: &Spanned<DeValue<'_>>) {
        match inner.get_ref().as_str() {
            Some(text) => {
                let text = text.to_string();
                if let Some(allowed) = Choices::allowed(path)
                    && !allowed.contains(&text.as_str())
                {
                    self.problem(
                        inner.span(),
                        format!("`{path}` cannot be \"{}\"", quoted(&text)),
                        "not known",
                        format!("one of: {}", allowed.join(", ")),
                    );
                } else {
                    self.texts.push((path.into(), text));
                }
            }
            None => self.problem(
                inner.span(),
                format!("`{path}` is a text in quotes"),
                "not a text",
                Choices::allowed(path)
                    .map_or_else(String::new, |a| format!("one of: {}", a.join(", "))),
            ),
        }
    }

    /// Reads the value of `{ value = ..., range = ..., provenance = ..., source = ... }`, or a plain value.
    fn unwrap_origin<'v, 'i>(&mut self, value: &'v Spanned<DeValue<'i>>) -> Stated<'v, 'i> {
        let Some(table) = value.get_ref().as_table() else {
            let (provenance, source) = ("given".into(), String::new());
            return Stated { value: Some(value), provenance, source, range: None };
        };
        let text = |name: &str| {
            table.get(name).and_then(|v| v.get_ref().as_str()).unwrap_or_default().to_string()
        };
        for (key, _) in table.iter() {
            if !["value", "range", "provenance", "source"].contains(&key.get_ref().as_ref()) {
                self.problem(
                    key.span(),
                    format!("unknown entry `{}`", quoted(key.get_ref())),
                    "unknown",
                    "a value with an origin is { value = ..., range = [low, high], \
                     provenance = \"...\", source = \"...\" }"
                        .into(),
                );
            }
        }
        let inner = table.get("value");
        if inner.is_none() {
            self.problem(
                value.span(),
                "a table without `value`".into(),
                "no value",
                "write { value = ..., provenance = \"...\", source = \"...\" }".into(),
            );
        }
        let (mut provenance, mut source) = (text("provenance"), text("source"));
        if provenance == PLACEHOLDER
            && is_touched(inner.and_then(|value| number(value.get_ref())), &source)
        {
            (provenance, source) = ("given".into(), String::new());
        }
        Stated { value: inner, provenance, source, range: table.get("range") }
    }

    /// Reads the range of a key with this value, in SI units.
    fn range(&mut self, key: &Key, value: f64, range: &Spanned<DeValue<'_>>) -> Option<[f64; 2]> {
        let (path, unit, span) = (key.path(), key.unit, range.span());
        let bounds: Option<Vec<f64>> = range
            .get_ref()
            .as_array()
            .and_then(|items| items.iter().map(|item| number(item.get_ref())).collect());
        let Some(&[low, high]) = bounds.as_deref() else {
            let read = quoted(&self.text[span.clone()]);
            let message = format!("the range of `{path}` is two numbers [{unit}], not {read}");
            let help = format!(
                "write range = [low, high] within {} to {} {unit}, with {value} {unit} between them",
                key.low, key.high
            );
            self.problem(span, message, "not a range", help);
            return None;
        };
        if let Some((message, help)) = [low, high].iter().find_map(|b| number_problem(key, *b)) {
            self.problem(span, format!("range: {message}"), "out of range", help);
            return None;
        }
        if !(low..=high).contains(&value) {
            let message =
                format!("`{path}` is {value} {unit}, and its range is {low} to {high} {unit}");
            let help = match low > high {
                true => format!("the smaller number comes first: range = [{high}, {low}]"),
                false => "the value lies within its range: correct the one or the other".into(),
            };
            self.problem(span, message, "value outside", help);
            return None;
        }
        Some([low, high].map(|bound| key.to_si(bound)))
    }
}

/// Value, range and origin that a file states for a key.
struct Stated<'v, 'i> {
    value: Option<&'v Spanned<DeValue<'i>>>,
    provenance: String,
    source: String,
    range: Option<&'v Spanned<DeValue<'i>>>,
}

/// Longest number that is looked for at the beginning of a text \[letters\].
const LONGEST_NUMBER: usize = 40;

/// The finite number at the beginning of a text, which may have a unit behind it.
fn leading_number(text: &str) -> Option<&str> {
    let text = text.trim();
    let ends = text.char_indices().take(LONGEST_NUMBER).map(|(at, letter)| at + letter.len_utf8());
    let number = ends
        .filter_map(|end| text.get(..end))
        .filter(|part| part.parse::<f64>().is_ok_and(f64::is_finite))
        .last()?;
    // 80,5 and 1_000 are other numbers than 80 and 1
    let goes_on = text[number.len()..].starts_with(|letter: char| "_,.0123456789".contains(letter));
    (!goes_on).then_some(number)
}

fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(float) => float.as_str().replace('_', "").parse().ok(),
        DeValue::Integer(integer) if integer.radix() == 10 => {
            integer.as_str().replace('_', "").parse().ok()
        }
        _ => None,
    }
}

impl Description {
    /// Parses and checks a crane file. `file` is its name, for messages; `text` is its content.
    ///
    /// # Errors
    ///
    /// [`DescriptionError`] with all problems: syntax, unknown or missing keys, values out of range, and impossible
    /// machines.
    pub fn parse(file: &str, text: &str) -> Result<Self, DescriptionError> {
        if text.len() > LARGEST {
            let message = format!(
                "the file has {} bytes; a crane file may have at most {LARGEST}",
                text.len()
            );
            return Err(DescriptionError::of(file, message, None));
        }
        let mut reading = Reading {
            file,
            text,
            values: [None; KEYS.len()],
            origins: vec![
                Origin { provenance: String::new(), source: String::new(), line: None };
                KEYS.len()
            ],
            ranges: vec![None; KEYS.len()],
            texts: Vec::new(),
            shares: None,
            problems: Vec::new(),
            count: 0,
        };
        let (document, errors) = DeTable::parse_recoverable(text);
        for error in &errors {
            let span = error.span().unwrap_or(0..0);
            let read = text.get(span.clone()).unwrap_or_default().trim();
            let has_unit = |number: &&str| {
                let rest = read[number.len()..].trim_start();
                rest.starts_with(|letter: char| letter.is_alphabetic() || letter == '%')
                    && !rest.contains(['\n', '='])
            };
            match leading_number(read).filter(has_unit) {
                Some(number) => {
                    let message =
                        format!("`{}` is a number with something behind it", quoted(read));
                    let help = format!("write {number} alone: the unit is in the name of the key");
                    reading.problem(span, message, "here", help);
                }
                None => {
                    let help =
                        "crane files are TOML: `key = value` lines under `[section]` headings";
                    reading.problem(span, quoted(error.message().trim()), "here", help.into());
                }
            }
        }
        if errors.is_empty() {
            for (section, body) in document.get_ref().iter() {
                let section_name = section.get_ref();
                if section_name == OVERRIDES {
                    let message = "this file is a list of overrides, and no crane file".into();
                    let help = "hydroboom motion --plant FILE applies it to the plant; elsewhere give its keys by --set section.key=value".into();
                    return Err(DescriptionError::of(file, message, Some(help)));
                }
                match body.get_ref().as_table() {
                    Some(_) if section_name != MACHINE && !is_section(section_name) => {
                        let message = format!("unknown section `[{}]`", quoted(section_name));
                        let help = section_suggestion(section_name);
                        reading.problem(section.span(), message, "unknown", help);
                    }
                    Some(table) => {
                        for (key, value) in table.iter() {
                            let path = format!("{section_name}.{}", key.get_ref());
                            if path != BUS {
                                reading.entry(&path, key.span(), value);
                            }
                        }
                    }
                    None => reading.problem(
                        section.span(),
                        format!("`{}` stands outside of any section", quoted(section_name)),
                        "no section",
                        suggestion(section_name),
                    ),
                }
            }
        }
        reading.finish()
    }
}

impl Reading<'_> {
    fn finish(mut self) -> Result<Description, DescriptionError> {
        let file = self.file;
        let failed = |problems| Err(DescriptionError { name: file.to_string(), problems });
        if !self.problems.is_empty() {
            if let more @ 1.. = self.count - self.problems.len() {
                self.problems.push(Problem::plain(format!("and {more} more"), None));
            }
            return failed(self.problems);
        }
        let text = |path: &str| {
            self.texts.iter().find(|(known, _)| known == path).map(|(_, text)| text.as_str())
        };
        let (choices, mut unmade) = Choices::read(text);
        let segments = self.shares.as_ref().map_or(0, Vec::len);
        let excluded = |path: &str| {
            let (section, name) = path.split_once('.').unwrap_or((path, ""));
            choices.excludes(section, name, segments)
        };
        unmade.retain(|path| excluded(path).is_none());
        let mut missing = Vec::new();
        let mut strangers = Vec::new();
        let mut values = [0.0; KEYS.len()];
        for (index, key) in KEYS.iter().enumerate() {
            let excluded = excluded(&key.path());
            match (self.values[index], excluded) {
                (Some(value), None) => values[index] = value,
                (Some(_), Some(why)) => strangers.push((index, why)),
                (None, _) => {
                    values[index] = key.absent.map_or(0.0, |value| key.to_si(value));
                    match excluded {
                        Some(_) => self.origins[index] = Origin::foreign(),
                        None if key.absent.is_some() => self.origins[index] = Origin::absent(),
                        None => {
                            missing.push(format!("{} [{}]: {}", key.path(), key.unit, key.meaning));
                        }
                    }
                }
            }
        }
        if choices.structure == StructureChoice::Links && segments > LINKS.len() {
            let text =
                format!("boom.segments = {segments}: a boom of links has at most {}", LINKS.len());
            return failed(vec![Problem::plain(text, None)]);
        }
        if !strangers.is_empty() {
            return failed(self.foreign(&strangers));
        }
        let name = text(NAME).map(String::from);
        for (present, path) in [(self.shares.is_some(), SEGMENTS), (name.is_some(), NAME)] {
            if !present {
                missing.push(path.into());
            }
        }
        missing.extend(unmade.into_iter().map(String::from));
        let (Some(segment_shares), Some(name), true) =
            (self.shares.take(), name, missing.is_empty())
        else {
            let count = missing.len();
            let help = "`hydroboom new` writes a complete file to start from".to_string();
            let verb = if count == 1 { " is" } else { "s are" };
            let message = format!("{count} key{verb} missing:\n  {}", missing.join("\n  "));
            return failed(vec![Problem::plain(message, Some(help))]);
        };
        let description = Description {
            name,
            numbers: Numbers::from_array(values),
            choices,
            segment_shares,
            origins: self.origins.clone(),
            file_ranges: self.ranges.clone(),
            is_embedded: false,
        };
        match self.impossibility(&description) {
            Some(problem) => failed(vec![problem]),
            None => Ok(description),
        }
    }

    /// Problems of keys that this kind of crane does not have, each with the reason.
    fn foreign(&self, strangers: &[(usize, &'static str)]) -> Vec<Problem> {
        let of = |(index, why): &(usize, &'static str)| {
            let message = format!("this crane has no `{}`", KEYS[*index].path());
            let help = String::from(*why);
            match self.origins[*index].line.map(|line| line_span(self.text, line)) {
                Some(span) => self.problem_at(span, message, "not of this crane", help),
                None => Problem::plain(message, Some(help)),
            }
        };
        strangers.iter().map(of).collect()
    }

    /// Why the machine is impossible, at the key that says so.
    fn impossibility(&self, description: &Description) -> Option<Problem> {
        let (path, message, help) = description.impossible()?;
        let line = KEYS
            .iter()
            .position(|key| key.path() == path)
            .and_then(|index| description.origins[index].line);
        Some(match line.map(|line| line_span(self.text, line)) {
            Some(span) => self.problem_at(span, message, "this key, among others", help),
            None => Problem::plain(message, Some(help)),
        })
    }
}

/// Position of a line (counted from one) in the text.
fn line_span(text: &str, line: usize) -> Range<usize> {
    let start = text.split_inclusive('\n').take(line - 1).map(str::len).sum();
    let length = text[start..].lines().next().map_or(0, str::len);
    start..start + length
}
