//! Names that a target language allows.

use std::collections::{HashMap, HashSet};

/// A text as a name of lower-case letters, digits and underscores that begins with a letter.
///
/// Whatever it is made of: quotes, line ends and signs of the language leave as underscores.
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

/// A text that can stand in a comment: one line of printable ASCII, without what ends or begins one.
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

/// Names, each once.
#[derive(Clone, Debug, Default)]
pub(crate) struct Names {
    taken: HashSet<String>,
    counts: HashMap<&'static str, usize>,
}

impl Names {
    /// None but reserved ones taken.
    pub(crate) fn new(reserved: &[&str]) -> Self {
        let taken = reserved.iter().map(|r| r.to_lowercase()).collect();
        Self { taken, counts: HashMap::new() }
    }

    /// A name for what has none: the next number behind a beginning.
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

    /// The wanted name, or that with a number behind it. Case does not tell names apart: it does not in every language.
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
    fn names_are_names_whatever_they_are_made_of() {
        assert_eq!(plain("Crane \"A\"\n; DROP"), "crane_a_drop");
        assert_eq!(plain("3/2 valve"), "x_3_2_valve");
        assert_eq!(plain("\u{202e}*)"), "x");
        assert_eq!(comment("end */ of // it *) ??/\n"), "end x/ of / it x) ?/?");
        let mut names = Names::new(&["if"]);
        assert_eq!([names.numbered("t"), names.numbered("t")], ["t1", "t2"]);
        assert_eq!([names.free("if"), names.free("a"), names.free("A")], ["if_2", "a", "A_2"]);
    }
}
