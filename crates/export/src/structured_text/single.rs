//! Units in single precision, for PLCs without `LREAL`.

use super::unit::{Kind, Unit};
use crate::error::ExportError;

/// The units with `REAL` in place of `LREAL`.
///
/// The test bench and its task are left out: the rounding of single precision exceeds its tolerance.
///
/// # Errors
///
/// [`ExportError::Constant`] if a constant is outside the range of `REAL`.
pub fn in_single_precision(units: Vec<Unit>) -> Result<Vec<Unit>, ExportError> {
    let is_bench = |name: &str| [super::bench::PROGRAM, super::bench::COMPARISON].contains(&name);
    let kept = units.into_iter().filter(|unit| !is_bench(&unit.name));
    kept.map(|mut unit| {
        unit.tasks.retain(|task| !is_bench(&task.program));
        for variable in &mut unit.variables {
            variable.kind = shorter(&variable.kind);
        }
        unit.body = shorter(&unit.body);
        match too_large(&unit.body) {
            Some(value) if unit.kind != Kind::Globals => {
                Err(ExportError::Constant { block: unit.name, value })
            }
            _ => Ok(unit),
        }
    })
    .collect()
}

/// Replaces types, and the conversion functions in their names.
fn shorter(text: &str) -> String {
    text.replace("LREAL", "REAL")
}

/// A literal outside the range of `REAL`.
fn too_large(body: &str) -> Option<f64> {
    let is_inner = |c: char| c.is_ascii_alphanumeric() || "._+-".contains(c);
    let literals = body.split(|c| !is_inner(c)).filter_map(|word| word.parse::<f64>().ok());
    let mut large = literals.filter(|value| value.abs() > f64::from(f32::MAX));
    large.next()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::structured_text::units;
    use hydroboom_description::Description;

    #[test]
    fn single_precision_text_has_no_lreal_and_no_test_bench() {
        let crane = Description::uia_single_boom().unwrap();
        let all = in_single_precision(units(&crane).unwrap()).unwrap();
        let text: String = all.iter().map(Unit::text).collect();
        for gone in ["LREAL", "TestBench", "WorstDifference"] {
            assert!(!text.contains(gone), "{gone}");
        }
        for there in [" : REAL", "REAL_TO_DINT(", "DINT_TO_REAL(", "OF REAL", "ControlTask"] {
            assert!(text.contains(there), "{there}");
        }
    }

    #[test]
    fn a_constant_beyond_single_precision_is_detected() {
        assert_eq!(too_large("a := 1.0E3 * b - 1.5E39;"), Some(1.5e39));
        assert_eq!(too_large("a := 1.0E3 * E39 + 1.0E-300;"), None);
    }
}
