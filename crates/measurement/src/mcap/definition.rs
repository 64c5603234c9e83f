//! Definitions of ROS 2 messages (`ros2msg`): fields, their types, and the nested message types.

use std::collections::BTreeMap;

/// Type of a field's elements.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    Bool,
    Int(usize),
    Uint(usize),
    Float(usize),
    Text,
    WideText,
    /// A nested message, by its name without `msg/`.
    Message(String),
}

/// Number of a field's elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Count {
    One,
    Exactly(usize),
    /// A sequence, preceded by its length.
    Any,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) count: Count,
}

/// Fields of a message and of all nested messages.
#[derive(Clone, Debug)]
pub(super) struct Definition {
    pub(super) name: String,
    pub(super) messages: BTreeMap<String, Vec<Field>>,
}

impl Definition {
    /// Parses a definition as stored in MCAP files: the message, then each nested one below a line of `=` and `MSG:
    /// name`.
    ///
    /// # Errors
    ///
    /// The line that cannot be parsed.
    pub(super) fn parse(name: &str, text: &str) -> Result<Self, String> {
        let own = short(name);
        let mut messages = BTreeMap::new();
        let mut current = own.clone();
        for line in text.lines() {
            let line = line.trim();
            if let Some(part) = line.strip_prefix("MSG:") {
                current = short(part.trim());
            } else if !line.starts_with("===")
                && let Some(field) = field(line, &current)?
            {
                messages.entry(current.clone()).or_insert_with(Vec::new).push(field);
            }
        }
        messages.entry(own.clone()).or_default();
        for (part, fields) in [
            ("builtin_interfaces/Time", [("sec", Kind::Int(4)), ("nanosec", Kind::Uint(4))]),
            ("builtin_interfaces/Duration", [("sec", Kind::Int(4)), ("nanosec", Kind::Uint(4))]),
        ] {
            let field =
                |(name, kind): (&str, Kind)| Field { name: name.into(), kind, count: Count::One };
            messages.entry(part.into()).or_insert_with(|| fields.map(field).into());
        }
        Ok(Self { name: own, messages })
    }
}

/// Normalised name: `sensor_msgs/msg/JointState` and `sensor_msgs/JointState` are equal.
fn short(name: &str) -> String {
    name.replace("/msg/", "/")
}

/// The field of a line; `None` for a comment or a constant.
fn field(line: &str, within: &str) -> Result<Option<Field>, String> {
    let line = line.split('#').next().unwrap_or("").trim();
    let mut words = line.split_whitespace();
    let (Some(kind), Some(name)) = (words.next(), words.next()) else {
        return match line.is_empty() {
            true => Ok(None),
            false => Err(format!("\"{}\" is no field", excerpt(line))),
        };
    };
    // constants: `uint8 OPEN=1`, `uint8 OPEN = 1`
    if name.contains('=') || words.next().is_some_and(|w| w.starts_with('=')) {
        return Ok(None);
    }
    let (kind, count) = match kind.split_once('[') {
        None => (kind, Count::One),
        Some((kind, "]")) => (kind, Count::Any),
        Some((kind, size)) if size.starts_with("<=") => (kind, Count::Any),
        Some((kind, size)) => {
            let size = size.strip_suffix(']').and_then(|s| s.parse().ok());
            let size = size.ok_or_else(|| format!("\"{}\" has no size", excerpt(line)))?;
            (kind, Count::Exactly(size))
        }
    };
    let kind = match kind.split("<=").next().unwrap_or(kind) {
        "bool" => Kind::Bool,
        "byte" | "char" | "uint8" => Kind::Uint(1),
        "int8" => Kind::Int(1),
        "int16" => Kind::Int(2),
        "uint16" => Kind::Uint(2),
        "int32" => Kind::Int(4),
        "uint32" => Kind::Uint(4),
        "int64" => Kind::Int(8),
        "uint64" => Kind::Uint(8),
        "float32" => Kind::Float(4),
        "float64" => Kind::Float(8),
        "string" => Kind::Text,
        "wstring" => Kind::WideText,
        "Header" => Kind::Message("std_msgs/Header".into()),
        "time" | "duration" => Kind::Message("builtin_interfaces/Time".into()),
        other if other.contains('/') => Kind::Message(short(other)),
        // without a package: a type of the same package
        other => {
            let package = within.split('/').next().unwrap_or("");
            Kind::Message(format!("{package}/{other}"))
        }
    };
    Ok(Some(Field { name: name.into(), kind, count }))
}

fn excerpt(line: &str) -> String {
    line.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_types_constants_and_parts_are_distinguished() {
        let text = "# a state\nstd_msgs/Header header\nuint8 OPEN=1\nuint8 SHUT = 0\nfloat64[] position 1.0\n\
            string<=10 name\nPoint[3] corners # of the base\n\
            ================================================================================\n\
            MSG: crane/Point\nfloat32 x\n===\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\n";
        let definition = Definition::parse("crane/msg/State", text).unwrap();
        let fields = &definition.messages[&definition.name];
        let names: Vec<&str> = fields.iter().map(|f| f.name.as_str()).collect();
        assert_eq!(names, ["header", "position", "name", "corners"]);
        assert_eq!((&fields[1].kind, fields[1].count), (&Kind::Float(8), Count::Any));
        assert_eq!(fields[2].kind, Kind::Text);
        assert_eq!(fields[3].kind, Kind::Message("crane/Point".into()));
        assert_eq!(fields[3].count, Count::Exactly(3));
        assert!(definition.messages.contains_key("builtin_interfaces/Time"));
        assert!(Definition::parse("a/b", "float64[x] y").is_err());
        assert!(Definition::parse("a/b", "float64").is_err());
    }
}
