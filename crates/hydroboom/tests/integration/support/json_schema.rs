//! JSON Schemas of the commands' output, docs/reference/json: derived from what is printed, and compared with it.

use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// Environment variable: if set, what the tests print is added to the schemas instead of compared with them.
const WRITES: &str = "HYDROBOOM_WRITE_JSON_SCHEMAS";

/// What writes all schemas anew.
pub const COMMAND: &str = "rm docs/reference/json/*.json; HYDROBOOM_WRITE_JSON_SCHEMAS=1 \
     cargo test -p hydroboom --test integration -- --include-ignored";

/// Units by the end of a key, longer ends before those they contain.
const UNITS: [(&str, &str); 34] = [
    ("_l_min_per_sqrt_s", "L/(min s^0.5)"),
    ("_l_min_per_bar", "L/(min bar)"),
    ("_rpm_per_s", "rpm/s"),
    ("_mm_per_bar", "mm/bar"),
    ("_per_s2", "1/s2"),
    ("_per_s", "1/s"),
    ("_l_min", "L/min"),
    ("_mm_s2", "mm/s2"),
    ("_mm_s", "mm/s"),
    ("_m_s2", "m/s2"),
    ("_m_s", "m/s"),
    ("_kgm2", "kg m2"),
    ("_percent", "%"),
    ("_mrad", "mrad"),
    ("_mpa", "MPa"),
    ("_bar", "bar"),
    ("_rpm", "rpm"),
    ("_deg", "deg"),
    ("_kg", "kg"),
    ("_kj", "kJ"),
    ("_kn", "kN"),
    ("_nm", "N m"),
    ("_hz", "Hz"),
    ("_db", "dB"),
    ("_mm", "mm"),
    ("_ms", "ms"),
    ("_us", "us"),
    ("_ns", "ns"),
    ("_m", "m"),
    ("_s", "s"),
    ("_j", "J"),
    ("_n", "N"),
    ("_l", "L"),
    ("_c", "C"),
];

/// Types, keys and items of the values at one place.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    types: BTreeSet<String>,
    /// Keys of objects.
    keys: BTreeMap<String, Shape>,
    /// Keys that every object has.
    required: BTreeSet<String>,
    /// Items of all arrays; none if all were empty.
    items: Option<Box<Shape>>,
}

impl Shape {
    /// Shape of one value. A number that is no count may be null: JSON has neither infinity nor NaN.
    pub fn of(value: &Value) -> Self {
        let mut shape = Self::default();
        let types: &[&str] = match value {
            Value::Null => &["null"],
            Value::Bool(_) => &["boolean"],
            Value::Number(number) if number.is_f64() => &["null", "number"],
            Value::Number(_) => &["integer"],
            Value::String(_) => &["string"],
            Value::Array(items) => {
                shape.items = items.iter().map(Self::of).reduce(Self::merged).map(Box::new);
                &["array"]
            }
            Value::Object(entries) => {
                shape.keys = entries.iter().map(|(key, v)| (key.clone(), Self::of(v))).collect();
                shape.required = entries.keys().cloned().collect();
                &["object"]
            }
        };
        shape.types = types.iter().map(|name| name.to_string()).collect();
        shape
    }

    /// Shape that allows what either allows.
    pub fn merged(mut self, other: Self) -> Self {
        self.required = match (self.is("object"), other.is("object")) {
            (true, true) => self.required.intersection(&other.required).cloned().collect(),
            (true, false) => self.required,
            (false, _) => other.required,
        };
        for (key, shape) in other.keys {
            let merged = match self.keys.remove(&key) {
                Some(known) => known.merged(shape),
                None => shape,
            };
            self.keys.insert(key, merged);
        }
        self.items = match (self.items, other.items) {
            (Some(known), Some(more)) => Some(Box::new((*known).merged(*more))),
            (known, more) => known.or(more),
        };
        self.types.extend(other.types);
        if self.types.contains("number") {
            self.types.remove("integer");
        }
        self
    }

    /// What a printed value has that this shape does not allow, and what it lacks, each with its place.
    pub fn refuses(&self, printed: &Self, place: &str) -> Vec<String> {
        // where all was null, nothing is known about the type
        if self.is_only_null() {
            return Vec::new();
        }
        let types = printed.types.iter().filter(|name| !self.allows(name));
        let mut found: Vec<String> = types.map(|name| format!("{place} is {name}")).collect();
        if self.is("object") && printed.is("object") {
            let lacks = self.required.difference(&printed.required);
            found.extend(lacks.map(|key| format!("{place} has no {key}")));
        }
        for (key, shape) in &printed.keys {
            match self.keys.get(key) {
                Some(known) => found.extend(known.refuses(shape, &format!("{place}.{key}"))),
                None => found.push(format!("{place} has a new key {key}")),
            }
        }
        if let (Some(known), Some(shape)) = (&self.items, &printed.items) {
            found.extend(known.refuses(shape, &format!("{place}[]")));
        }
        found
    }

    /// JSON Schema of the values, which are those of a key or of an array under that key.
    pub fn schema(&self, key: &str) -> Value {
        if self.is_only_null() {
            return json!({ "$comment": "null wherever it was printed" });
        }
        let mut schema = Map::new();
        let types: Vec<&String> = self.types.iter().collect();
        let types = match types[..] {
            [one] => json!(one),
            _ => json!(types),
        };
        schema.insert("type".into(), types);
        let unit = UNITS.iter().find(|(end, _)| key.ends_with(end));
        if let (true, Some((_, unit))) = (self.is("number") || self.is("integer"), unit) {
            schema.insert("unit".into(), json!(unit));
        }
        if let Some(items) = &self.items {
            schema.insert("items".into(), items.schema(key));
        }
        if self.is("object") {
            let keys: Map<String, Value> =
                self.keys.iter().map(|(key, shape)| (key.clone(), shape.schema(key))).collect();
            schema.insert("properties".into(), Value::Object(keys));
            schema.insert("required".into(), json!(self.required));
        }
        Value::Object(schema)
    }

    /// Shape of a schema that was written by [`schema`](Self::schema).
    pub fn read(schema: &Value) -> Self {
        let names = |value: &Value| -> BTreeSet<String> {
            let all = value.as_array().into_iter().flatten();
            all.filter_map(Value::as_str).map(String::from).collect()
        };
        let types = match &schema["type"] {
            Value::String(one) => BTreeSet::from([one.clone()]),
            Value::Array(_) => names(&schema["type"]),
            _ => BTreeSet::from(["null".to_string()]),
        };
        let keys = schema["properties"].as_object().into_iter().flatten();
        Self {
            types,
            keys: keys.map(|(key, value)| (key.clone(), Self::read(value))).collect(),
            required: names(&schema["required"]),
            items: schema.get("items").map(|items| Box::new(Self::read(items))),
        }
    }

    fn is(&self, name: &str) -> bool {
        self.types.contains(name)
    }

    fn allows(&self, name: &str) -> bool {
        self.is(name) || name == "integer" && self.is("number")
    }

    fn is_only_null(&self) -> bool {
        self.is("null") && self.types.len() == 1
    }
}

/// Whether the schemas are to be written.
pub fn is_writing() -> bool {
    std::env::var_os(WRITES).is_some()
}

/// File with the schema of a command.
pub fn file(command: &str) -> PathBuf {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/reference/json");
    PathBuf::from(folder).join(format!("{}.json", command.replace(' ', "-")))
}

/// Schema of a command's output; none if there is no file.
pub fn known(command: &str) -> Option<Value> {
    let text = std::fs::read(file(command)).ok()?;
    Some(serde_json::from_slice(&text).expect("a schema is JSON"))
}

/// Compares printed JSON with the schema of its command, if there is one, or adds it to the schema.
pub fn check(arguments: &[&str], printed: &Value) {
    let words = match arguments[0] {
        "log" | "export" => 2,
        _ => 1,
    };
    let command = arguments[..words].join(" ");
    let printed = Shape::of(printed);
    if is_writing() {
        return add(&command, printed);
    }
    let Some(schema) = known(&command) else { return };
    let refused = Shape::read(&schema).refuses(&printed, "$");
    assert!(
        refused.is_empty(),
        "the JSON of `hydroboom {}` is not that of docs/reference/json:\n{}\n\
         If it is meant so, it needs a line in CHANGELOG.md, and new schemas:\n{COMMAND}",
        arguments.join(" "),
        refused.join("\n")
    );
}

/// Adds what was printed to the schema of a command.
fn add(command: &str, printed: Shape) {
    // tests run in parallel
    static WRITING: Mutex<()> = Mutex::new(());
    let _one = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
    let shape = match known(command) {
        Some(schema) => Shape::read(&schema).merged(printed),
        None => printed,
    };
    let mut schema = json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": format!("hydroboom {command} --json"),
    });
    for (key, value) in shape.schema("").as_object().into_iter().flatten() {
        schema[key] = value.clone();
    }
    let text = serde_json::to_string_pretty(&schema).expect("JSON") + "\n";
    let path = file(command);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("the folder of the schemas");
    std::fs::write(path, text).expect("a schema");
}
