//! How well a key is known before any log was seen.

use crate::free::Free;
use hydroboom_description::schema::KEYS;
use hydroboom_description::{Description, RangeSource};

/// Deviation of ln θ that a provenance stands for.
pub fn prior(provenance: &str) -> f64 {
    match provenance {
        "measured" => 0.02,
        // much of what papers and data sheets print was fitted by somebody, or holds for another specimen
        "printed" | "derived" | "data sheet" => 0.1,
        "calibrated" | "tuned" => 0.2,
        // an estimate may be wrong by half
        _ => 0.5,
    }
}

/// What a length that is not moved is known to at worst: off a drawing or a tape it is known better than a provenance says, which is of all kinds of numbers.
const LENGTH: f64 = 0.03;

impl Free {
    /// How well it is known of a model while it is not moved: deviation of ln θ, as [`Self::known_to`], and of a length 3 % at most.
    pub fn held_to(self, model: &Description) -> f64 {
        let is_length = KEYS.get(self.place).is_some_and(|key| matches!(key.unit, "mm" | "m"));
        self.known_to(model).min(if is_length { LENGTH } else { f64::INFINITY })
    }

    /// How well it is known of a model: deviation of ln θ, by its provenance, and at least as far as its range goes: what load, oil and
    /// wear may make of it by the time a log is recorded. What was measured is as it was measured. A value that somebody gave without
    /// saying where it is from is known to its default spread where it has one.
    pub fn known_to(self, model: &Description) -> f64 {
        let origin = model.entries().nth(self.place).map(|(_, _, origin)| origin);
        let provenance = origin.map_or("", |origin| origin.provenance.as_str());
        let range = model.range(&self.path());
        let range = range.filter(|range| range.source != RangeSource::Value);
        let value = self.value(model);
        // an even spread over a range
        let spread = range.map(|range| match range.low > 0.0 {
            true => (range.high / range.low).ln() / 12.0_f64.sqrt(),
            false => (range.high - range.low) / value / 12.0_f64.sqrt(),
        });
        match (provenance, spread) {
            ("measured", _) | (_, None) => prior(provenance),
            ("given" | "set", Some(spread)) => spread.max(prior("measured")),
            (_, Some(spread)) => spread.max(prior(provenance)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_given_is_known_to_its_default_spread_and_what_is_printed_to_its_provenance_or_range()
    {
        let known = |text: &str, path: &str| {
            let mut model = Description::uia_single_boom().unwrap();
            if !text.is_empty() {
                model.set(text).unwrap();
            }
            Free::from_path(path).unwrap().known_to(&model)
        };
        // printed, with no range
        assert_eq!(known("", "boom.youngs_modulus_gpa"), 0.1);
        // printed, and from 20 to 45 bar by the air that is in the oil
        let transition = known("", "oil.transition_bar");
        assert!((transition - (45.0_f64 / 20.0).ln() / 12.0_f64.sqrt()).abs() < 1e-12);
        // without a spread nothing is known but that somebody gave it
        assert_eq!(known("boom.youngs_modulus_gpa=210", "boom.youngs_modulus_gpa"), 0.5);
        // new to worn: half to three times
        let leakage = "pump.case_leakage_b_m3_s_sqrtpa";
        let model = Description::uia_virtual().unwrap();
        let range = model.range(leakage).unwrap();
        let spread = (range.high / range.low).ln() / 12.0_f64.sqrt();
        assert!((Free::from_path(leakage).unwrap().known_to(&model) - spread).abs() < 1e-12);
    }
}
