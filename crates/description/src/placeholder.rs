//! Placeholders in a new crane file: values of another machine that the user has not edited yet.

/// Provenance of a placeholder: a value of another machine that the user has not edited yet.
pub const PLACEHOLDER: &str = "placeholder";

/// Marks every number with a provenance in a crane file's text as a placeholder from `whose` machine. The source
/// repeats the number, so that an edited value can be detected.
pub fn as_placeholders(text: &str, whose: &str) -> String {
    let lines = text.lines().map(|line| marked(line, whose).unwrap_or_else(|| line.to_string()));
    lines.map(|line| line + "\n").collect()
}

/// Marks a line with a number and its provenance; `None` for other lines.
fn marked(line: &str, whose: &str) -> Option<String> {
    let (_, value) = line.split_once("{ value = ")?;
    let number = value.split([',', ' ', '}']).next()?;
    number.parse::<f64>().ok()?;
    let (before, after) = line.split_once("provenance = \"")?;
    let (_, after) = after.split_once('"')?;
    let rest = match after.split_once("source = \"") {
        Some((between, source)) => format!("{between}source = \"{number} of {whose}: {source}"),
        None => format!(", source = \"{number} of {whose}\"{after}"),
    };
    Some(format!("{before}provenance = \"{PLACEHOLDER}\"{rest}"))
}

/// Whether a placeholder's value has been edited.
pub(crate) fn is_touched(value: Option<f64>, source: &str) -> bool {
    let filled_in = source.split_whitespace().next().and_then(|number| number.parse::<f64>().ok());
    value.is_some() && value != filled_in
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Description, UIA_SINGLE_BOOM};

    #[test]
    fn a_default_value_is_a_placeholder_until_it_is_edited() {
        let text = as_placeholders(UIA_SINGLE_BOOM, "the paper's crane");
        let provenance = |text: &str| {
            let crane = Description::parse("new.toml", text).unwrap();
            let found = crane.entries().find(|(key, _, _)| key.path() == "payload.mass_kg");
            found.map(|(_, _, origin)| origin.provenance.clone()).unwrap()
        };
        assert_eq!(provenance(&text), PLACEHOLDER);
        let edited = text.replace("{ value = 307.0,", "{ value = 250.0,");
        assert_ne!(edited, text);
        // no provenance of the paper is left
        assert_eq!(provenance(&edited), "given");
        let original = Description::uia_single_boom().unwrap();
        let crane = Description::parse("new.toml", &text).unwrap();
        assert_eq!(crane.numbers, original.numbers);
        let printed = crane.entries().filter(|(_, _, origin)| origin.provenance == "printed");
        assert_eq!(printed.count(), 0);
    }
}
