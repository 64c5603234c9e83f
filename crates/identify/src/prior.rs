//! Prior uncertainty of a key, from its provenance and its range.

use crate::free::Free;
use hydroboom_description::schema::KEYS;
use hydroboom_description::{Description, RangeSource};

/// Prior standard deviation of ln θ \[-\] for the provenance of a value: 0.02 if measured; 0.1 if printed, derived or
/// from a data sheet; 0.2 if calibrated or tuned; else 0.5. The figures are estimates.
pub fn prior(provenance: &str) -> f64 {
    match provenance {
        "measured" => 0.02,
        // printed values are often fitted, or belong to another specimen
        "printed" | "derived" | "data sheet" => 0.1,
        "calibrated" | "tuned" => 0.2,
        // an estimate may be wrong by half
        _ => 0.5,
    }
}

/// Largest relative standard deviation of a fixed length. Drawings and tapes are more accurate than the
/// provenance, which covers all kinds of numbers.
const LENGTH_DEVIATION: f64 = 0.03;

impl Free {
    /// Prior standard deviation of ln θ \[-\] of a key that is not estimated, as [`Self::prior_deviation`]; at most
    /// 0.03 for a length, because drawings and tape measures are more accurate than the provenance says.
    pub fn fixed_prior_deviation(self, model: &Description) -> f64 {
        let is_length = KEYS.get(self.place).is_some_and(|key| matches!(key.unit, "mm" | "m"));
        self.prior_deviation(model).min(if is_length { LENGTH_DEVIATION } else { f64::INFINITY })
    }

    /// Prior standard deviation of ln θ \[-\] of a key in a model: that of its provenance, and at least that of a
    /// uniform distribution over its range.
    ///
    /// The range covers changes by load, oil and wear up to the time of the log; it does not apply to a measured
    /// value. A value without provenance has its default spread, if there is one.
    pub fn prior_deviation(self, model: &Description) -> f64 {
        let origin = model.entries().nth(self.place).map(|(_, _, origin)| origin);
        let provenance = origin.map_or("", |origin| origin.provenance.as_str());
        let range = model.range(&self.path());
        let range = range.filter(|range| range.source != RangeSource::Value);
        let value = self.value(model);
        // standard deviation of a uniform distribution over the range
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
    fn the_prior_of_a_key_is_its_default_spread_its_provenance_or_its_range() {
        let known = |text: &str, path: &str| {
            let mut model = Description::uia_single_boom().unwrap();
            if !text.is_empty() {
                model.set(text).unwrap();
            }
            Free::from_path(path).unwrap().prior_deviation(&model)
        };
        // printed, without a range
        assert_eq!(known("", "boom.youngs_modulus_gpa"), 0.1);
        // printed, with a range of 20 to 45 bar that depends on the air in the oil
        let transition = known("", "oil.transition_bar");
        assert!((transition - (45.0_f64 / 20.0).ln() / 12.0_f64.sqrt()).abs() < 1e-12);
        // an override without a spread has no further information
        assert_eq!(known("boom.youngs_modulus_gpa=210", "boom.youngs_modulus_gpa"), 0.5);
        // from new to worn: half to three times
        let leakage = "pump.case_leakage_b_m3_s_sqrtpa";
        let model = Description::uia_virtual().unwrap();
        let range = model.range(leakage).unwrap();
        let spread = (range.high / range.low).ln() / 12.0_f64.sqrt();
        assert!((Free::from_path(leakage).unwrap().prior_deviation(&model) - spread).abs() < 1e-12);
    }
}
