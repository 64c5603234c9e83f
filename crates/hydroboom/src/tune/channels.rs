//! Delay and offset of the logs' channels: option to fix them, and estimates.

use crate::output;
use clap::Args;
use hydroboom_identify::{Channel, Nuisance};
use serde_json::{Value, json};

/// The option that fixes delays and offsets.
#[derive(Args, Clone)]
pub struct FixedNuisances {
    /// Delays and offsets of channels that are known to be zero (once the mapping says what they are), with commas between
    /// them: `stroke.delay_ms`, `pressure_a.offset_bar`, or `delay`, `offset`, `all`. The others are free.
    #[arg(long = "fix", value_name = "NAMES", value_delimiter = ',', value_parser = selection)]
    selections: Vec<Selection>,
}

/// Delays and offsets selected by one name.
#[derive(Clone)]
struct Selection(Vec<Nuisance>);

/// Parses the name of a delay or offset, or of several.
fn selection(name: &str) -> Result<Selection, String> {
    Nuisance::named(name.trim()).map(Selection).map_err(|error| error.to_string())
}

impl FixedNuisances {
    /// Delays and offsets fixed at zero.
    pub fn all(&self) -> Vec<Nuisance> {
        self.selections.iter().flat_map(|selection| selection.0.iter().copied()).collect()
    }
}

/// Column headings of a table of channels.
pub const HEADER: [&str; 5] =
    ["delay or offset", "found", "95 %", "not zero", "strongest correlation"];

/// Row of that table: estimate and 95 % interval in the unit of the delay (ms) or offset, and whether it is zero.
pub fn row(channel: &Channel) -> Vec<String> {
    let unit = channel.nuisance.allowed().unit;
    let (low, high) = channel.interval();
    let partner = channel.partner.as_ref();
    vec![
        channel.nuisance.path(),
        format!("{:+.2} {unit}", channel.value),
        format!("{low:+.2} to {high:+.2}"),
        match (channel.is_at_limit(), channel.is_off()) {
            (true, _) => "AT ITS LIMIT",
            (false, true) => "YES",
            (false, false) => "no",
        }
        .into(),
        partner.map_or(String::new(), |(key, c)| format!("{key} ({c:+.2})")),
    ]
}

/// Table of the estimates for each log.
pub fn text(channels: &[Channel]) -> String {
    let tables = channels.chunk_by(|a, b| a.log == b.log).map(|of_log| {
        let rows: Vec<Vec<String>> = of_log.iter().map(row).collect();
        format!("{}:\n{}", of_log[0].log, output::table(&HEADER, &rows))
    });
    tables.collect::<Vec<_>>().join("\n")
}

/// Estimates as JSON.
pub fn in_json(channels: &[Channel]) -> Vec<Value> {
    let of = |c: &Channel| {
        let allowed = c.nuisance.allowed();
        let (low, high) = c.interval();
        json!({
            "log": c.log, "key": c.nuisance.path(), "unit": allowed.unit, "value": c.value, "interval_95": [low, high],
            "not_zero": c.is_off(), "at_limit": c.is_at_limit(), "range": allowed.range, "known_to": allowed.deviation, "source": allowed.source,
            "partner": c.partner.as_ref().map(|(key, _)| key), "correlation": c.partner.as_ref().map(|(_, c)| c),
        })
    };
    channels.iter().map(of).collect()
}

/// Remark on each estimate at a limit of its range.
pub fn at_limit(channels: &[Channel]) -> impl Iterator<Item = String> {
    channels.iter().filter(|c| c.is_at_limit()).map(|c| {
        let allowed = c.nuisance.allowed();
        let [low, high] = allowed.range;
        format!(
            "{} of {} ends at its limit ({low:+} to {high:+} {}): a value beyond it would fit better, and the \
             remainder is attributed to the keys. Write a known value into the mapping, or look for another cause",
            c.nuisance.path(),
            c.log,
            allowed.unit
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_at_its_limit_is_marked_in_table_note_and_json() {
        let channel = |value: f64| Channel {
            log: "lift.csv".into(),
            nuisance: Nuisance::named("pressure_a.offset").unwrap()[0],
            value,
            deviation: 0.2,
            partner: None,
        };
        let all = [channel(5.0), channel(0.1), channel(1.0)];
        assert_eq!(all.each_ref().map(|c| row(c)[3].clone()), ["AT ITS LIMIT", "no", "YES"]);
        let json = in_json(&all);
        assert_eq!(json[0]["at_limit"], true);
        assert_eq!(json[2]["at_limit"], false);
        let notes: Vec<String> = at_limit(&all).collect();
        assert_eq!(notes.len(), 1);
        assert!(notes[0].contains("pressure_a.offset_bar of lift.csv"), "{}", notes[0]);
        assert!(notes[0].contains("-5 to +5 bar"), "{}", notes[0]);
    }
}
