//! Off-model plant: a crane that differs from the model in a few parameters.

use crate::LabError;
use hydroboom_description::{Description, OFF_MODEL};

/// Crane that differs from the model by the same ratios as the off-model plant from the paper's crane, with
/// the differences as overrides.
pub(crate) fn off_model(model: &Description) -> Result<(Description, Vec<String>), LabError> {
    let own = Description::uia_single_boom()?;
    let (off, _) = own.overridden("cranes/off-model.toml", OFF_MODEL)?;
    let mut overrides = Vec::new();
    for changed in own.differences(&off) {
        let entry = model.own_entries().find(|(key, ..)| key.path() == changed.key);
        let shares = (changed.there.parse::<f64>(), changed.here.parse::<f64>());
        if let (Some((key, value, _)), (Ok(there), Ok(here))) = (entry, shares) {
            // without rounding noise
            overrides.push(format!("{}={}", key.path(), short(value * there / here)));
        }
    }
    let mut plant = model.clone();
    plant.set_together(overrides.iter().map(String::as_str))?;
    Ok((plant, overrides.iter().map(|assignment| assignment.replace('=', " = ")).collect()))
}

/// Number with eleven digits; very small ones with an exponent.
fn short(value: f64) -> String {
    let value: f64 = format!("{value:.10e}").parse().unwrap_or(value);
    if value != 0.0 && value.abs() < 1e-3 { format!("{value:e}") } else { value.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_off_model_plant_differs_by_the_same_shares_from_any_crane() {
        let own = Description::uia_single_boom().unwrap();
        let (off, _) = own.overridden("cranes/off-model.toml", OFF_MODEL).unwrap();
        assert!(off.differences(&off_model(&own).unwrap().0).is_empty());
        let mut light = own.clone();
        light.set("payload.mass_kg=60").unwrap();
        let payload = off_model(&light).unwrap().0.numbers.payload;
        assert!((payload / (60.0 * 316.0 / 307.0) - 1.0).abs() < 1e-9, "{payload} kg");
    }
}
