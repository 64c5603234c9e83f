//! `hydroboom show`

use crate::{crane_file::CraneFile, output};
use clap::Args;
use hydroboom_description::RangeSource;
use miette::Result;
use serde_json::json;

/// Show every key of a crane with its value, unit, range and provenance.
///
/// A range is that of the crane file, or a default spread about the value (marked); a key without one has its value
/// only.
#[derive(Args)]
#[command(after_help = "Example: hydroboom show --set boom.segments=10")]
pub struct Show {
    #[command(flatten)]
    crane: CraneFile,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Show {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If the crane file is invalid.
    pub fn run(self) -> Result<()> {
        let d = self.crane.read_any()?;
        let choices = d.own_choices();
        if self.json {
            let keys: Vec<_> = d
                .own_entries()
                .zip(d.own_ranges())
                .map(|((key, value, origin), (_, [low, high], from))| {
                    json!({
                        "key": key.path(), "value": value, "unit": key.unit,
                        "meaning": key.meaning, "low": key.low, "high": key.high,
                        "range": { "low": low, "high": high, "from": from.name() },
                        "provenance": origin.provenance, "source": origin.source,
                    })
                })
                .collect();
            let choices: serde_json::Map<_, _> =
                choices.iter().map(|(k, v)| (k.to_string(), json!(v))).collect();
            return output::json(&json!({
                "crane": d.name, "segment_shares": d.segment_shares,
                "choices": choices, "keys": keys,
            }));
        }
        let mut rows: Vec<Vec<String>> = d
            .own_entries()
            .zip(d.own_ranges())
            .map(|((key, value, origin), (_, bounds, from))| {
                let [low, high] = bounds.map(output::number);
                let range = match from {
                    RangeSource::File => format!("{low} to {high}"),
                    RangeSource::Default => format!("{low} to {high} (default)"),
                    RangeSource::Value => String::new(),
                };
                vec![
                    key.path(),
                    output::number(value),
                    key.unit.into(),
                    range,
                    origin.provenance.clone(),
                    origin.source.clone(),
                ]
            })
            .collect();
        rows.push(vec!["boom.segments".into(), d.segment_shares.len().to_string()]);
        rows.extend(choices.iter().map(|(k, v)| vec![k.to_string(), v.to_string()]));
        output::text(&format!(
            "{}\n{}",
            d.name,
            output::table(&["key", "value", "unit", "range", "provenance", "source"], &rows)
        ))
    }
}
