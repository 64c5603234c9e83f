//! Whether identified parameters may be used as overrides: reasons why not.

use hydroboom_description::{Description, RangeSource};

/// Reason not to use what was identified if feedforward from it has a larger measured error \[mm\] than from the
/// nominal model; none if one of them could not be run.
pub(super) fn worse_than_nominal(
    fitted_mm: Option<f64>,
    nominal_mm: Option<f64>,
) -> Option<String> {
    let (fitted, nominal) = fitted_mm.zip(nominal_mm)?;
    (fitted.is_nan() || fitted > nominal).then(|| {
        format!(
            "feedforward from it errs by {fitted:.2} mm RMS as measured, from the nominal model by {nominal:.2} mm"
        )
    })
}

/// Reason not to use what was identified if overrides are outside the crane file's ranges, where `--set` refuses them.
pub(super) fn beyond_ranges(outside: &[String]) -> Option<String> {
    let named = outside.join(", ");
    (!outside.is_empty()).then(|| format!("the crane file's ranges exclude {named}"))
}

/// Overrides outside the range stated in the crane file.
pub(super) fn outside_range(model: &Description, identified: &[String]) -> Vec<String> {
    let is_outside = |assignment: &&String| {
        let Some((path, text)) = assignment.split_once('=') else { return false };
        let known = model.own_ranges().find(|(key, ..)| key.path() == path);
        let value: Option<f64> = text.parse().ok();
        known.zip(value).is_some_and(|((_, [low, high], from), value)| {
            from == RangeSource::File && !(low..=high).contains(&value)
        })
    };
    identified.iter().filter(is_outside).cloned().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_worse_than_nominal_or_outside_a_range_is_unusable() {
        let message = worse_than_nominal(Some(3.0), Some(2.0)).unwrap();
        assert!(message.contains("3.00 mm") && message.contains("2.00 mm"), "{message}");
        assert!(worse_than_nominal(Some(f64::NAN), Some(2.0)).is_some());
        assert_eq!(worse_than_nominal(Some(2.0), Some(3.0)), None);
        assert_eq!(worse_than_nominal(Some(2.0), None), None);
        assert_eq!(beyond_ranges(&[]), None);
        let model = Description::uia_single_boom().unwrap();
        let outside = outside_range(&model, &["payload.mass_kg=900".into()]);
        assert!(beyond_ranges(&outside).unwrap().contains("payload.mass_kg=900"));
    }
}
