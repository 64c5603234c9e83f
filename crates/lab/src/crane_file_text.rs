//! Edits the text of a crane file: sets the value of a key and keeps comments and other keys.

use toml_edit::{Array, DocumentMut, InlineTable, Item, Value};

/// Value that was found for a key of a crane file, with its provenance.
#[derive(Clone, Debug)]
pub struct FoundValue<'a> {
    /// Path `section.key` of the key.
    pub path: &'a str,
    /// Value in the key's unit.
    pub value: f64,
    /// How the value was found, in one word, as `tuned` or `calibrated`.
    pub provenance: &'a str,
    /// Data from which the value was found, for the comment.
    pub source: String,
}

/// Writes a value into the text of a crane file; comments and other keys are kept. If the key's range excludes the
/// value, the range is widened to it and the source mentions it, because a value outside its range makes the file
/// invalid. A path without a dot changes nothing; a missing section or key is added.
pub fn write_value(document: &mut DocumentMut, found: FoundValue<'_>) {
    let Some((section, name)) = found.path.split_once('.') else { return };
    let before = document.get(section).and_then(|table| table.get(name));
    let range = before.and_then(|item| item.get("range")).and_then(Item::as_value).and_then(range);
    let mut source = found.source;
    let mut entry = InlineTable::new();
    entry.insert("value", found.value.into());
    if let Some([low, high]) = range {
        let wide = [low.min(found.value), high.max(found.value)];
        if wide != [low, high] {
            source += &format!("; range widened, it was {low:?} to {high:?}");
        }
        entry.insert("range", Value::Array(Array::from_iter(wide)));
    }
    entry.insert("provenance", found.provenance.into());
    entry.insert("source", source.into());
    document[section][name] = Item::Value(Value::InlineTable(entry));
}

fn range(value: &Value) -> Option<[f64; 2]> {
    let number = |value: &Value| value.as_float().or(value.as_integer().map(|whole| whole as f64));
    let bounds: Vec<f64> = value.as_array()?.iter().filter_map(number).collect();
    bounds.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_description::{Description, UIA_SINGLE_BOOM};

    fn with(path: &str, value: f64) -> Description {
        let mut document: DocumentMut = UIA_SINGLE_BOOM.parse().unwrap();
        let source = "a test".into();
        write_value(&mut document, FoundValue { path, value, provenance: "tuned", source });
        Description::parse("written.toml", &document.to_string()).unwrap()
    }

    #[test]
    fn a_value_keeps_its_range_unless_it_lies_outside() {
        let range = |crane: &Description| crane.range("payload.mass_kg").unwrap();
        let inside = with("payload.mass_kg", 250.0);
        assert_eq!((range(&inside).low, range(&inside).high), (0.0, 370.0));
        let outside = with("payload.mass_kg", 412.5);
        assert_eq!((outside.numbers.payload, range(&outside).high), (412.5, 412.5));
        let source = |crane: &Description| {
            crane
                .entries()
                .find(|(key, ..)| key.path() == "payload.mass_kg")
                .unwrap()
                .2
                .source
                .clone()
        };
        assert_eq!(source(&inside), "a test");
        assert!(source(&outside).contains("it was 0.0 to 370.0"), "{}", source(&outside));
        // a key that the file omits, and one without a range
        assert_eq!(with("drive.bandwidth_hz", 30.0).numbers.drive_bandwidth, 30.0);
        assert_eq!(with("boom.length_mm", 3500.0).numbers.boom_length, 3.5);
    }
}
