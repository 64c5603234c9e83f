//! Numbers of a nested JSON message, with their paths: `cylinder.pressure_a`, `joints[2]`.

use serde::de::{DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};
use std::borrow::Cow;
use std::fmt;

/// Longest array that is read as signals; longer ones are images or point clouds.
pub(super) const LONGEST_ARRAY: usize = 64;

/// Calls `each` with every number and its path; true and false are 1 and 0, null is NaN. Python's NaN and Infinity are
/// accepted.
///
/// # Errors
///
/// The syntax error.
pub(super) fn numbers(data: &[u8], mut each: impl FnMut(&str, f64)) -> Result<(), String> {
    let mut read = |data: &[u8]| {
        let mut path = String::new();
        let mut deserializer = serde_json::Deserializer::from_slice(data);
        let node = Node { path: &mut path, each: &mut each };
        node.deserialize(&mut deserializer).and_then(|()| deserializer.end())
    };
    match read(data) {
        Ok(()) => Ok(()),
        Err(error) => match without_nan(data) {
            Cow::Owned(plain) => read(&plain).map_err(|e| e.to_string()),
            Cow::Borrowed(_) => Err(error.to_string()),
        },
    }
}

/// Replaces Python's NaN and Infinity by null.
fn without_nan(data: &[u8]) -> Cow<'_, [u8]> {
    let mut plain = Vec::new();
    let (mut is_text, mut is_escaped, mut from) = (false, false, 0);
    let mut k = 0;
    while k < data.len() {
        match data[k] {
            _ if is_escaped => is_escaped = false,
            b'\\' if is_text => is_escaped = true,
            b'"' => is_text = !is_text,
            b'N' | b'I' | b'-' if !is_text => {
                let words = [&b"NaN"[..], b"-NaN", b"Infinity", b"-Infinity"];
                if let Some(word) = words.iter().find(|word| data[k..].starts_with(word)) {
                    plain.extend(&data[from..k]);
                    plain.extend(b"null");
                    k += word.len();
                    from = k;
                    continue;
                }
            }
            _ => {}
        }
        k += 1;
    }
    if from == 0 {
        return Cow::Borrowed(data);
    }
    plain.extend(&data[from..]);
    Cow::Owned(plain)
}

/// A value at a path.
struct Node<'a, F> {
    path: &'a mut String,
    each: &'a mut F,
}

impl<'de, F: FnMut(&str, f64)> DeserializeSeed<'de> for Node<'_, F> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de, F: FnMut(&str, f64)> Visitor<'de> for Node<'_, F> {
    type Value = ();

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a JSON value")
    }

    fn visit_bool<E>(self, on: bool) -> Result<(), E> {
        (self.each)(self.path, f64::from(u8::from(on)));
        Ok(())
    }

    fn visit_i64<E>(self, value: i64) -> Result<(), E> {
        (self.each)(self.path, value as f64);
        Ok(())
    }

    fn visit_u64<E>(self, value: u64) -> Result<(), E> {
        (self.each)(self.path, value as f64);
        Ok(())
    }

    fn visit_f64<E>(self, value: f64) -> Result<(), E> {
        (self.each)(self.path, value);
        Ok(())
    }

    fn visit_str<E>(self, _: &str) -> Result<(), E> {
        Ok(())
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        (self.each)(self.path, f64::NAN);
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let length = self.path.len();
        while let Some(key) = map.next_key::<Cow<'_, str>>()? {
            if length > 0 {
                self.path.push('.');
            }
            self.path.push_str(&key);
            map.next_value_seed(Node { path: self.path, each: self.each })?;
            self.path.truncate(length);
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<(), A::Error> {
        use fmt::Write;
        let length = self.path.len();
        for k in 0..LONGEST_ARRAY {
            // writing to a String cannot fail
            let _ = write!(self.path, "[{k}]");
            let next = sequence.next_element_seed(Node { path: self.path, each: self.each })?;
            self.path.truncate(length);
            if next.is_none() {
                return Ok(());
            }
        }
        while sequence.next_element::<serde::de::IgnoredAny>()?.is_some() {}
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &str) -> Result<Vec<(String, f64)>, String> {
        let mut found = Vec::new();
        numbers(text.as_bytes(), |path, value| found.push((path.into(), value))).map(|()| found)
    }

    #[test]
    fn nested_numbers_have_paths() {
        let found =
            all(r#"{"a": {"b": 1, "c": [2.5, {"d": true}]}, "text": "NaN", "e": -3}"#).unwrap();
        let wanted = [("a.b", 1.0), ("a.c[0]", 2.5), ("a.c[1].d", 1.0), ("e", -3.0)];
        assert_eq!(found, wanted.map(|(path, value)| (path.to_string(), value)));
    }

    #[test]
    fn nan_and_infinity_are_missing_and_texts_are_unchanged() {
        let found = all(r#"{"a": NaN, "NaN\"": 1, "b": [-Infinity, Infinity, 2], "c": null}"#);
        let found = found.unwrap();
        // numbers before the first NaN are reported twice: the second pass counts
        let last = |path: &str| found.iter().rfind(|f| f.0 == path).unwrap().1;
        assert!(last("a").is_nan() && last("b[0]").is_nan() && last("c").is_nan());
        assert_eq!((last("NaN\""), last("b[2]")), (1.0, 2.0));
        assert!(all("{\"a\": Nan}").is_err() && all("{\"a\": 1} 2").is_err());
    }

    #[test]
    fn depth_and_length_of_messages_are_bounded() {
        assert!(all(&"[".repeat(100_000)).is_err());
        let long = format!("{{\"a\": [{}0], \"b\": 1}}", "0,".repeat(100_000));
        assert_eq!(all(&long).unwrap().len(), LONGEST_ARRAY + 1);
    }
}
