//! Keys that a crane file may have, and the one that a wrong key probably means.

use crate::schema::{Choices, KEYS, Key};

/// Section of model following, which was replaced.
const REPLACED: &str = "following";

/// Likeness from which a name is suggested \[-\], by Jaro and Winkler.
const ALIKE: f64 = 0.75;

/// Advice where no name is similar.
const ALL_KEYS: &str = "`hydroboom show` lists all keys";

/// Longest path for which a similar key is suggested \[bytes\].
const LONGEST_PATH: usize = 200;

/// Keys that are not plain numbers.
pub(crate) const SEGMENTS: &str = "boom.segments";
pub(crate) const SEGMENT_LENGTHS: &str = "boom.segment_lengths_mm";
pub(crate) const NAME: &str = "crane.name";

/// All paths a file may use, for suggestions.
pub(crate) fn known_paths() -> impl Iterator<Item = String> {
    let others = [NAME, SEGMENTS, SEGMENT_LENGTHS].into_iter().chain(Choices::PATHS);
    KEYS.iter().map(Key::path).chain(others.map(String::from))
}

/// Sections that a file may have.
fn known_sections() -> impl Iterator<Item = String> {
    known_paths().map(|path| path.split('.').next().unwrap_or_default().to_string())
}

/// Whether a file may have a section, or had it before.
pub(crate) fn is_section(name: &str) -> bool {
    name == REPLACED || known_sections().any(|known| known == name)
}

/// Text "did you mean ...?" with the most similar section for an unknown one, or how to list all keys.
pub(crate) fn section_suggestion(name: &str) -> String {
    if name.len() > LONGEST_PATH {
        return ALL_KEYS.into();
    }
    let near = known_sections()
        .map(|known| (strsim::jaro_winkler(name, &known), known))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    match near {
        Some((likeness, known)) if likeness > ALIKE => format!("did you mean `[{known}]`?"),
        _ => ALL_KEYS.into(),
    }
}

/// Text "did you mean ...?" with the most similar key for an unknown path, or how to list all keys.
pub fn suggestion(path: &str) -> String {
    if path.split('.').next() == Some(REPLACED) {
        return "model following was replaced by the scheduled LQR: its keys are in [estimator] and [scheduled_lqr]".into();
    }
    // the cost of the similarity is the product of both lengths
    if path.len() > LONGEST_PATH {
        return ALL_KEYS.into();
    }
    let name = |path: &str| path.rsplit('.').next().unwrap_or_default().to_string();
    let near = known_paths()
        .map(|known| {
            let whole = strsim::jaro_winkler(path, &known);
            // also suggests the right name in the wrong table
            let short = strsim::jaro_winkler(&name(path), &name(&known)) * 0.97;
            (whole.max(short), known)
        })
        .max_by(|a, b| a.0.total_cmp(&b.0));
    match near {
        Some((likeness, known)) if likeness > ALIKE => format!("did you mean `{known}`?"),
        _ => ALL_KEYS.into(),
    }
}
