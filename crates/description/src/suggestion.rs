//! Keys that a crane file may have, and the one that a wrong key probably means.

use crate::schema::{Choices, KEYS, Key};

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

/// Text "did you mean ...?" with the most similar key for an unknown path, or how to list all keys.
pub fn suggestion(path: &str) -> String {
    if path == "following" || path.starts_with("following.") {
        return "model following was replaced by the scheduled LQR: its keys are in [estimator] and [scheduled_lqr]".into();
    }
    // the cost of the similarity is the product of both lengths
    if path.len() > LONGEST_PATH {
        return "`hydroboom show` lists all keys".into();
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
        Some((likeness, known)) if likeness > 0.75 => format!("did you mean `{known}`?"),
        _ => "`hydroboom show` lists all keys".into(),
    }
}
