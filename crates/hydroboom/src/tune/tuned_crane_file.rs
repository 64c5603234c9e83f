//! Crane file with the estimates of the fitted keys.

use super::five_digits::rounded;
use crate::crane_file::CraneFile;
use crate::paths::InputFile;
use hydroboom_description::schema::KEYS;
use hydroboom_identify::{Determination, Fit, Tuned};
use hydroboom_lab::crane_file_text::{FoundValue, write_value};
use miette::{IntoDiagnostic, Result};
use toml_edit::DocumentMut;

/// Text of the crane file with the fitted keys, with provenance `tuned` and, as their source, names and digests of the
/// logs. Everything else is kept, including comments, except ranges that do not contain their new values.
///
/// # Errors
///
/// If the crane file cannot be read or is no TOML.
pub fn text(
    crane_file: &CraneFile,
    logs: &[InputFile],
    digests: &[String],
    fit: &Fit,
) -> Result<String> {
    let mut document: DocumentMut = crane_file.text()?.parse().into_diagnostic()?;
    let logs: Vec<String> = logs
        .iter()
        .zip(digests)
        .map(|(path, digest)| {
            let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into());
            format!("{name} (sha256 {})", &digest[..16])
        })
        .collect();
    for tuned in &fit.tuned {
        let key = &KEYS[tuned.key.place];
        let value = FoundValue {
            path: &key.path(),
            value: rounded(key.to_unit(tuned.value.1)),
            provenance: "tuned",
            source: format!("to {}; {}", logs.join(", "), uncertainty(tuned)),
        };
        write_value(&mut document, value);
    }
    Ok(document.to_string())
}

/// 95 % interval of a determined key in its unit; otherwise why the logs do not determine it.
fn uncertainty(tuned: &Tuned) -> String {
    let key = &KEYS[tuned.key.place];
    let (low, high) = tuned.interval();
    match tuned.determination {
        Determination::Biased(reason) => format!("of an equivalent model: {reason}"),
        Determination::Determined => {
            format!("95 %: {:.4e} to {:.4e}", key.to_unit(low), key.to_unit(high))
        }
        other => {
            format!("the logs do not determine it: {}", other.reason().unwrap_or_default())
        }
    }
}
