//! Valid names of a target language.

use std::collections::{HashMap, HashSet};

/// Converts a text to a name of lower-case letters, digits and underscores that begins with a letter.
///
/// All other characters, such as quotes, line ends and operators, become underscores.
pub(crate) fn plain(text: &str) -> String {
    let mut name = String::new();
    for c in text.chars() {
        match c.is_ascii_alphanumeric() {
            true => name.push(c.to_ascii_lowercase()),
            false if name.ends_with('_') || name.is_empty() => {}
            false => name.push('_'),
        }
    }
    let name = name.trim_end_matches('_');
    match name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        true => name.into(),
        false => format!("x_{name}").trim_end_matches('_').into(),
    }
}

/// Converts a text to one line of printable ASCII without comment delimiters.
pub(crate) fn comment(text: &str) -> String {
    let printable = text.chars().map(|c| match c {
        'β' => 'b',
        'ζ' => 'z',
        'ρ' => 'r',
        'φ' => 'f',
        '·' => ' ',
        '³' => '3',
        '²' => '2',
        '−' | '–' => '-',
        c if c.is_ascii_graphic() || c == ' ' => c,
        _ => '?',
    });
    let text: String = printable.collect();
    text.replace('*', "x")
        .replace("//", "/")
        .replace("??", "?")
        .replace("]]", "] ]")
        .replace('\\', "/")
}

/// Set of names in use, for finding unique ones.
#[derive(Clone, Debug, Default)]
pub(crate) struct Names {
    taken: HashSet<String>,
    counts: HashMap<&'static str, usize>,
}

impl Names {
    /// Names with only the reserved ones in use.
    pub(crate) fn new(reserved: &[&str]) -> Self {
        let taken = reserved.iter().map(|r| r.to_lowercase()).collect();
        Self { taken, counts: HashMap::new() }
    }

    /// A new name from a beginning and the next number.
    pub(crate) fn numbered(&mut self, beginning: &'static str) -> String {
        loop {
            let count = self.counts.entry(beginning).or_default();
            *count += 1;
            let name = format!("{beginning}{count}");
            if self.taken.insert(name.to_lowercase()) {
                return name;
            }
        }
    }

    /// The wanted name, or with a number appended if it is in use. Case is ignored, as some languages do.
    pub(crate) fn free(&mut self, wanted: &str) -> String {
        let mut name = wanted.to_string();
        let mut count = 2;
        while !self.taken.insert(name.to_lowercase()) {
            name = format!("{wanted}_{count}");
            count += 1;
        }
        name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_text_becomes_a_valid_name() {
        assert_eq!(plain("Crane \"A\"\n; DROP"), "crane_a_drop");
        assert_eq!(plain("3/2 valve"), "x_3_2_valve");
        assert_eq!(plain("\u{202e}*)"), "x");
        assert_eq!(comment("end */ of // it *) ??/\n"), "end x/ of / it x) ?/?");
        let mut names = Names::new(&["if"]);
        assert_eq!([names.numbered("t"), names.numbered("t")], ["t1", "t2"]);
        assert_eq!([names.free("if"), names.free("a"), names.free("A")], ["if_2", "a", "A_2"]);
    }
}
