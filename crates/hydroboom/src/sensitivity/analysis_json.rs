//! Sensitivities as JSON.

use super::analysis::Analysis;
use hydroboom_description::Description;
use hydroboom_description::schema::KEYS;
use hydroboom_sensitivity::Index;
use serde_json::{Value, json};

/// Sensitivities as JSON, in the units of the outputs and of the keys.
pub fn analysis_in_json(crane: &Description, analysis: &Analysis) -> Value {
    let index = |i: &Index| json!({ "value": i.value, "low": i.low, "high": i.high });
    let outputs = analysis.outputs.iter().enumerate().map(|(k, output)| {
        let (unit, size) = output.unit();
        let sobol = analysis.indices(k);
        let keys = analysis.local.iter().enumerate().map(|(place, l)| {
            let end = |end| {
                let output = analysis.at_end(place, end, k).map(|v| v / size);
                json!({ "value": analysis.end(place, end), "output": output })
            };
            json!({
                "key": l.key.path(), "unit": KEYS[l.key.place].unit,
                "value": KEYS[l.key.place].to_unit(l.key.value(crane)),
                "percent_per_percent": analysis.slope(place, k), "known_to_percent": l.known * 100.0,
                "less": end(0), "more": end(1),
                "sobol_first": sobol.map(|s| index(&s.first[place])),
                "sobol_total": sobol.map(|s| index(&s.total[place])),
            })
        });
        json!({
            "output": output.name(), "unit": unit, "value": analysis.values[k] / size,
            "keys": keys.collect::<Vec<_>>(),
            "mean": sobol.map(|s| s.mean / size), "deviation": sobol.map(|s| s.deviation / size),
        })
    });
    json!({
        "crane": crane.name, "outputs": outputs.collect::<Vec<_>>(),
        "rows": analysis.global.as_ref().map(|(_, rows)| rows),
    })
}
