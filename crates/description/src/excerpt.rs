//! Excerpt of a crane file for an error message: the lines around a position, cut to the width of a screen.

use miette::NamedSource;
use std::ops::Range;

/// Letters that are shown of a line.
const WIDTH: usize = 160;
/// Letters that are shown before the place.
const BEFORE: usize = 60;

/// An excerpt of a text.
pub(crate) struct Excerpt {
    /// The text, with empty lines in place of those that are far from the place, so that lines keep
    /// their numbers.
    pub source: NamedSource<String>,
    /// The place in it.
    pub span: Range<usize>,
    /// Column of the place in the file, from 1, where the line is cut.
    pub column: Option<usize>,
}

/// The lines about a place in a text, control characters shown by their pictures.
pub(crate) fn excerpt(file: &str, text: &str, span: Range<usize>) -> Excerpt {
    let start = floor(text, span.start);
    let end = floor(text, span.end.max(start));
    let mut excerpt = String::new();
    let mut shown = 0..0;
    let mut column = None;
    let place = text[..start].bytes().filter(|b| *b == b'\n').count();
    let mut at = 0;
    for (number, line) in text.split_inclusive('\n').enumerate() {
        let body = line.trim_end_matches(['\n', '\r']);
        match number {
            _ if number == place => {
                let from = start - at;
                let to = (end - at).min(body.len()).max(from.min(body.len()));
                let from = from.min(to);
                let letters = body[..from].chars().count();
                let skipped = match body.chars().count() > WIDTH {
                    true => letters.saturating_sub(BEFORE),
                    false => 0,
                };
                if skipped > 0 {
                    excerpt += "... ";
                    column = Some(letters + 1);
                }
                let base = body.char_indices().nth(skipped).map_or(body.len(), |(i, _)| i);
                let mut last = excerpt.len();
                shown = last..last;
                for (i, letter) in body[base..].char_indices().take(WIDTH) {
                    if base + i <= from {
                        shown.start = excerpt.len();
                    }
                    excerpt.push(picture(letter));
                    if base + i < to {
                        last = excerpt.len();
                    }
                }
                if from == body.len() {
                    shown.start = excerpt.len();
                }
                shown.end = last.max(shown.start);
                if body[base..].chars().nth(WIDTH).is_some() {
                    excerpt += " ...";
                }
            }
            _ if number.abs_diff(place) <= 2 => {
                excerpt.extend(body.chars().take(WIDTH).map(picture));
                if body.chars().nth(WIDTH).is_some() {
                    excerpt += " ...";
                }
            }
            _ if number > place => break,
            _ => {}
        }
        excerpt.push('\n');
        at += line.len();
    }
    // a place at the very end, after the last line
    if at <= start && shown == (0..0) {
        shown = excerpt.len()..excerpt.len();
    }
    Excerpt { source: NamedSource::new(file, excerpt), span: shown, column }
}

/// A text of a file within a message.
pub(crate) fn quoted(text: &str) -> String {
    let mut quoted: String = text.chars().take(WIDTH).map(picture).collect();
    if text.chars().nth(WIDTH).is_some() {
        quoted += " ...";
    }
    quoted
}

/// Printable form of a letter: a control character is replaced by its symbol.
fn picture(letter: char) -> char {
    match u32::from(letter) {
        9 => letter,
        code @ 0..32 => char::from_u32(0x2400 + code).unwrap_or('\u{fffd}'),
        127 => '\u{2421}',
        _ if letter.is_control() => '\u{fffd}',
        _ => letter,
    }
}

/// The start of the letter that a byte belongs to.
fn floor(text: &str, at: usize) -> usize {
    let mut at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marked(text: &str, span: Range<usize>) -> (String, usize, Option<usize>) {
        let found = excerpt("f", text, span);
        let source = found.source.inner();
        let line = source[..found.span.start].matches('\n').count() + 1;
        (source[found.span].to_string(), line, found.column)
    }

    #[test]
    fn the_excerpt_marks_the_original_text_and_line() {
        let text = "a = 1\nlönger = 2 # é\n\nlast = 3\n";
        for word in ["a", "1", "2", "last", "3", "lönger"] {
            let at = text.find(word).unwrap();
            let line = text[..at].matches('\n').count() + 1;
            let expected = (word.to_string(), line, None);
            assert_eq!(marked(text, at..at + word.len()), expected);
        }
        assert_eq!(marked(text, 5..5), (String::new(), 1, None));
        assert_eq!(marked(text, text.len()..text.len()).1, 5);
        assert_eq!(marked("", 0..0), (String::new(), 1, None));
        assert_eq!(marked("no end", 3..6), ("end".into(), 1, None));
    }

    #[test]
    fn a_long_line_is_cut_around_the_marked_text() {
        let text = format!("a = 1\nb = [{}x{}]\n", "9, ".repeat(50_000), "9, ".repeat(50_000));
        let at = text.find('x').unwrap();
        let found = excerpt("f", &text, at..at + 1);
        assert!(found.source.inner().len() < 600);
        assert_eq!(marked(&text, at..at + 1), ("x".into(), 2, Some(at - 6 + 1)));
        // a place that is itself long
        let (shown, ..) = marked(&text, 6..text.len());
        assert!((100..=WIDTH).contains(&shown.len()), "{shown}");
    }

    #[test]
    fn control_characters_are_shown_as_unicode_control_pictures() {
        let text = "a = \"\x1b[2J\u{9b}\x7f\"\n";
        let (shown, ..) = marked(text, 4..text.len() - 1);
        assert_eq!(shown, "\"\u{241b}[2J\u{fffd}\u{2421}\"");
        assert_eq!(quoted("\x07\n"), "\u{2407}\u{240a}");
    }
}
