//! Calibrated crane as a file: values, provenance, and the comparison with the published results.

use super::parameter::PARAMETERS;
use super::published::published;
use super::search::Found;
use crate::LabError;
use crate::crane_file_text::{FoundValue, write_value};
use serde::Serialize;
use toml_edit::DocumentMut;

/// The result of the last calibration stands between these lines.
const BEGIN: &str = "# --- calibration: written by `hydroboom calibrate` ---";
const END: &str = "# --- end of calibration ---";

/// Published result of the real crane, compared with the virtual crane's.
#[derive(Clone, Debug, Serialize)]
pub struct Reached {
    /// Name of the quantity with its unit.
    pub name: String,
    /// Number of the table in the paper.
    pub table: &'static str,
    /// Published value, measured on the real crane, in the unit of the name.
    pub published: f64,
    /// Value of the virtual crane, in the unit of the name.
    pub reached: f64,
    /// Difference in percent of the published value.
    pub difference_percent: f64,
    /// Tolerance of the calibration in percent of the published value.
    pub tolerance_percent: f64,
    /// Whether the difference is within the tolerance.
    pub within: bool,
}

/// Calibrated parameter with its uncertainty.
#[derive(Clone, Debug, Serialize)]
pub struct Calibrated {
    /// Path `section.key` in the crane file.
    pub key: &'static str,
    /// Calibrated value in the key's unit.
    pub value: f64,
    /// Smallest and largest plausible value in the key's unit.
    pub range: [f64; 2],
    /// Standard deviation as a share of the range \[-\]; near or above 0.3 the published results do not determine the
    /// parameter.
    pub deviation: f64,
    /// Whether the published results determine the parameter: its standard deviation is below a tenth of its range.
    pub determined: bool,
    /// Parameter of the strongest correlation, as `section.key`.
    pub partner: &'static str,
    /// Correlation coefficient with the most correlated parameter \[-\], −1 to 1.
    pub correlation: f64,
}

impl Found {
    /// All published results, each with the virtual crane's, in the order of the paper's tables.
    pub fn reached(&self) -> Vec<Reached> {
        published()
            .into_iter()
            .zip(self.shown)
            .map(|(p, reached)| {
                let difference = reached / p.value - 1.0;
                Reached {
                    name: p.name,
                    table: p.table,
                    published: p.value,
                    reached,
                    difference_percent: difference * 100.0,
                    tolerance_percent: p.tolerance * 100.0,
                    within: difference.abs() <= p.tolerance,
                }
            })
            .collect()
    }

    /// All calibrated parameters with their uncertainty, in the order of the parameters.
    pub fn calibrated(&self) -> Vec<Calibrated> {
        PARAMETERS
            .iter()
            .enumerate()
            .map(|(k, parameter)| {
                let others = (0..PARAMETERS.len()).filter(|other| *other != k);
                let partner = others
                    .max_by(|i, j| {
                        let size = |other: usize| self.correlation[(k, other)].abs();
                        size(*i).total_cmp(&size(*j))
                    })
                    .unwrap_or(k);
                Calibrated {
                    key: parameter.key,
                    value: rounded(parameter.value(self.shares[k])),
                    range: [parameter.low, parameter.high],
                    deviation: self.deviation[k],
                    determined: self.deviation[k] < 0.1,
                    partner: PARAMETERS[partner].key,
                    correlation: self.correlation[(k, partner)],
                }
            })
            .collect()
    }

    /// Text of a crane file: the template with the calibrated parameters, their provenance, and a table of the
    /// results.
    ///
    /// # Errors
    ///
    /// [`LabError::Input`] if the template is not TOML.
    pub fn crane_file(&self, template: &str) -> Result<String, LabError> {
        let mut document: DocumentMut = template.parse().map_err(|e| LabError::Input {
            file: "template of the virtual crane".into(),
            reason: format!("{e}"),
        })?;
        for found in self.calibrated() {
            let [low, high] = found.range;
            let source = match found.determined {
                true => format!("to Tables 5 to 8, within {low} to {high}"),
                false => format!("within {low} to {high}; Tables 5 to 8 do not determine it"),
            };
            let (path, value) = (found.key, found.value);
            let calibrated = FoundValue { path, value, provenance: "calibrated", source };
            write_value(&mut document, calibrated);
        }
        let text = document.to_string();
        let without = match (text.find(BEGIN), text.find(END)) {
            (Some(from), Some(to)) if from < to => {
                format!("{}{}", &text[..from], text[to + END.len()..].trim_start_matches('\n'))
            }
            _ => text,
        };
        let place = without.find("[crane]").unwrap_or(0);
        let (head, body) = without.split_at(place);
        Ok(format!("{head}{}\n{body}", self.table()))
    }

    fn table(&self) -> String {
        let mut lines = vec![
            BEGIN.to_string(),
            format!(
                "# {:<54} {:>9} {:>9} {:>8}  {}",
                "published, measured on the real crane", "published", "reached", "off", "wanted"
            ),
        ];
        lines.extend(self.reached().iter().map(|r| {
            format!(
                "# {:<54} {:>9.3} {:>9.3} {:>+7.1}%  within {}%{}",
                format!("Table {}: {}", r.table, r.name),
                r.published,
                r.reached,
                r.difference_percent,
                r.tolerance_percent,
                if r.within { "" } else { ": missed" },
            )
        }));
        lines.push(format!(
            "# {:<44} {:>9}  {:<50} {}",
            "parameters, were each", "deviation", "traded most against", "determined"
        ));
        lines.push(format!(
            "# {:<44} {:>9}  {:<50} {}",
            "tolerance a standard deviation", "of range", "(correlation)", "by the data"
        ));
        lines.extend(self.calibrated().iter().map(|c| {
            format!(
                "# {:<44} {:>9}  {:<50} {}",
                c.key,
                // wider than a uniform distribution over the range: not determined
                if c.deviation < 0.3 { format!("{:.2}", c.deviation) } else { "> 0.3".into() },
                format!("{} ({:+.2})", c.partner, c.correlation),
                if c.determined { "yes" } else { "no" },
            )
        }));
        lines.push(END.into());
        lines.join("\n") + "\n"
    }
}

/// Five significant digits, more than the results determine.
fn rounded(value: f64) -> f64 {
    format!("{value:.4e}").parse().unwrap_or(value)
}
