//! `hydroboom show`

use crate::{crane_file::CraneFile, output};
use clap::Args;
use miette::Result;
use serde_json::json;

/// Show every key of a crane with its value, unit and provenance.
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
    pub fn run(self) -> Result<()> {
        let d = self.crane.read_any()?;
        let choices = d.own_choices();
        if self.json {
            let keys: Vec<_> = d
                .own_entries()
                .map(|(key, value, origin)| {
                    json!({
                        "key": key.path(), "value": value, "unit": key.unit,
                        "meaning": key.meaning, "low": key.low, "high": key.high,
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
            .map(|(key, value, origin)| {
                let value = if value != 0.0 && value.abs() < 1e-3 {
                    format!("{value:e}")
                } else {
                    value.to_string()
                };
                let source = origin.source.clone();
                vec![key.path(), value, key.unit.into(), origin.provenance.clone(), source]
            })
            .collect();
        rows.push(vec!["boom.segments".into(), d.segment_shares.len().to_string()]);
        rows.extend(choices.iter().map(|(k, v)| vec![k.to_string(), v.to_string()]));
        output::text(&format!(
            "{}\n{}",
            d.name,
            output::table(&["key", "value", "unit", "provenance", "source"], &rows)
        ))
    }
}
