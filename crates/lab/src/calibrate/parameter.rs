//! Unpublished parameters of the real crane with their plausible ranges.

use crate::LabError;
use hydroboom_description::Description;

/// Parameter of the real crane that the paper does not publish, to be calibrated within a plausible range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Path `section.key` in the crane file.
    pub key: &'static str,
    /// Smallest plausible value, in the key's unit.
    pub low: f64,
    /// Largest plausible value, in the key's unit.
    pub high: f64,
    /// Whether the range is divided logarithmically: then a share of 0.5 is the geometric mean of its ends.
    pub logarithmic: bool,
    /// Reason for the range, or its source.
    pub reason: &'static str,
}

impl Parameter {
    /// Value in the key's unit at a share s of the range, 0 to 1: low + (high − low) s, or low (high/low)^s if
    /// logarithmic. A share outside 0 to 1 extrapolates; NaN gives NaN.
    pub fn value(&self, share: f64) -> f64 {
        match self.logarithmic {
            true => self.low * (self.high / self.low).powf(share),
            false => self.low + (self.high - self.low) * share,
        }
    }

    /// Share of the range at which a value in the key's unit lies: 0 at the smallest, 1 at the largest plausible
    /// value. It is the inverse of [`value`](Self::value) and is not clamped. If logarithmic, zero gives −∞ and a
    /// negative value NaN.
    pub fn share(&self, value: f64) -> f64 {
        match self.logarithmic {
            true => (value / self.low).ln() / (self.high / self.low).ln(),
            false => (value - self.low) / (self.high - self.low),
        }
    }
}

const fn linear(key: &'static str, low: f64, high: f64, reason: &'static str) -> Parameter {
    Parameter { key, low, high, logarithmic: false, reason }
}

const fn factor(key: &'static str, low: f64, high: f64, reason: &'static str) -> Parameter {
    Parameter { key, low, high, logarithmic: true, reason }
}

/// All calibrated parameters with their ranges.
pub const PARAMETERS: [Parameter; 24] = [
    factor("boom.second_moment_cm4", 1000.0, 2500.0, "the section is not published"),
    factor("base.stiffness_knm_per_rad", 3000.0, 100_000.0, "a bolted steel column"),
    linear("payload.mass_kg", 307.0, 322.0, "316 kg printed, 307 kg tuned, and the fixture"),
    linear("cylinder.dead_volume_a_l", 0.4, 2.5, "2 L tuned, equal for all volumes"),
    linear("cylinder.dead_volume_b_l", 0.3, 2.5, "2 L tuned, equal for all volumes"),
    linear("pump.volume_a_l", 0.5, 3.0, "2 L tuned, equal for all volumes"),
    linear("oscillation.rod_side_bar", 3.0, 60.0, "the trapped pressure is not published"),
    linear("pump.flow_gain", 0.88, 0.98, "0.91 printed, from pressures that vary"),
    factor("pump.internal_leakage_m3_s_sqrtpa", 0.15e-9, 1.0e-9, "0.34e-9 tuned"),
    factor("pump.slip_l_min_per_bar", 1e-5, 5e-3, "up to 3 % of the flow at 80 bar"),
    factor("pump.slip_cm3_per_rev_bar", 1e-6, 5e-3, "up to 4 % of the displacement at 80 bar"),
    linear("friction.coulomb_n", 300.0, 1200.0, "550 N tuned"),
    linear("friction.stiction_n", 20.0, 500.0, "50 to 350 N, with a margin"),
    factor("friction.viscous_ns_per_m", 800.0, 10_000.0, "1000 to 6500, with a margin"),
    factor("friction.bristle_stiffness_n_per_mm", 1000.0, 30_000.0, "seals give 0.02 to 0.5 mm"),
    linear("accumulator.working_bar", 2.0, 3.2, "2 to 3 bar, with a margin"),
    linear("accumulator.polytropic_exponent", 1.0, 1.4, "slow to fast"),
    linear(
        "start.rod_side_bar",
        2.5,
        6.0,
        "accumulator pressure and back pressure of the return line",
    ),
    linear("start.preload_percent", 60.0, 100.0, "pump sides pre-loaded, more or less"),
    factor(
        "holding_valve.flow_coefficient_m3_s_sqrtpa",
        0.8e-6,
        3.0e-6,
        "15 to 55 L/min at 1 bar, with the hoses",
    ),
    linear("check_valve.cracking_bar", 0.1, 0.75, "0.2 to 2 bar, below the opening pressure"),
    factor(
        "check_valve.flow_coefficient_m3_s_sqrtpa",
        0.5e-6,
        3.0e-6,
        "10 to 55 L/min at 1 bar, with the line to the accumulator",
    ),
    factor("drive.bandwidth_hz", 8.0, 120.0, "a servo drive with pump and coupling"),
    linear("motion.rest_s", 0.5, 8.0, "the paper does not state the window of its errors"),
];

/// Crane with the calibrated parameters at the given shares of their ranges \[-\], in the order of [`PARAMETERS`].
/// Shares are clamped to 0 to 1. Parameters without a share keep the template's value.
///
/// # Errors
///
/// [`LabError::Description`] if such a machine cannot exist, or a share is NaN.
pub fn crane_at(template: &Description, shares: &[f64]) -> Result<Description, LabError> {
    let mut crane = template.clone();
    for (parameter, share) in PARAMETERS.iter().zip(shares) {
        let value = parameter.value(share.clamp(0.0, 1.0));
        crane.set(&format!("{}={value:e}", parameter.key))?;
    }
    Ok(crane)
}

/// Shares of the ranges at which a crane's calibrated parameters lie \[-\], in the order of [`PARAMETERS`]. They are
/// clamped to 0 to 1; a key that the crane does not have gives 0.5.
pub fn shares_of(crane: &Description) -> [f64; PARAMETERS.len()] {
    PARAMETERS.map(|parameter| {
        crane
            .entries()
            .find(|(key, ..)| key.path() == parameter.key)
            .map_or(0.5, |(_, value, _)| parameter.share(value).clamp(0.0, 1.0))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calibrated_parameters_are_read_back_from_the_crane() {
        let template = Description::uia_single_boom().unwrap();
        let shares = [0.3; PARAMETERS.len()];
        let found = shares_of(&crane_at(&template, &shares).unwrap());
        for (parameter, share) in PARAMETERS.iter().zip(found) {
            assert!((share - 0.3).abs() < 1e-9, "{}: {share}", parameter.key);
        }
    }
}
