//! Percentiles of a quantity over a family of cranes.

use serde::Serialize;
use statrs::statistics::{Data, OrderStatistics};

/// Percentiles of a quantity over a family of cranes, in the quantity's unit; quantiles by interpolation.
///
/// ```
/// use hydroboom_lab::closed_loop::monte_carlo::Percentiles;
/// let error_mm = Percentiles::of([2.0, 1.0, f64::NAN, 3.0]);
/// assert_eq!((error_mm.least, error_mm.worst), (1.0, 3.0));
/// assert!((error_mm.median - 2.0).abs() < 1e-9);
/// assert!(Percentiles::of([f64::NAN]).median.is_nan());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentiles {
    /// Smallest value, in the quantity's unit.
    pub least: f64,
    /// 5th percentile, in the quantity's unit.
    pub p5: f64,
    /// 25th percentile, in the quantity's unit.
    pub p25: f64,
    /// Median, the 50th percentile, in the quantity's unit.
    pub median: f64,
    /// 75th percentile, in the quantity's unit.
    pub p75: f64,
    /// 95th percentile, in the quantity's unit.
    pub p95: f64,
    /// Largest value, in the quantity's unit.
    pub worst: f64,
}

impl Percentiles {
    /// Percentiles of the given values; values that are not finite are ignored. Without a finite value all are NaN,
    /// which is null in JSON and a dash in [`text`](Self::text).
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let finite: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
        let [least, worst] =
            [f64::min, f64::max].map(|of| finite.iter().copied().fold(f64::NAN, of));
        let is_empty = finite.is_empty();
        let mut data = Data::new(finite);
        let mut share = |tau: f64| if is_empty { f64::NAN } else { data.quantile(tau) };
        Self {
            least,
            p5: share(0.05),
            p25: share(0.25),
            median: share(0.5),
            p75: share(0.75),
            p95: share(0.95),
            worst,
        }
    }

    /// Whether there was no finite value.
    fn is_empty(&self) -> bool {
        self.median.is_nan()
    }

    /// Text with `digits` decimals: median (minimum .. maximum); a dash without values.
    pub fn range_text(&self, digits: usize) -> String {
        if self.is_empty() {
            return "-".into();
        }
        let Self { least, median, worst, .. } = self;
        format!("{median:.digits$} ({least:.digits$} .. {worst:.digits$})")
    }

    /// Text with `digits` decimals: median (5 .. 95 %), maximum; a dash without values.
    pub fn text(&self, digits: usize) -> String {
        if self.is_empty() {
            return "-".into();
        }
        let Self { p5, median, p95, worst, .. } = self;
        format!("{median:.digits$} ({p5:.digits$} .. {p95:.digits$}), {worst:.digits$}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A course without a rest of a second has no ripple at rest: NaN of a single crane is left out, and without any
    /// value there is a dash, and null in JSON.
    #[test]
    fn a_quantity_without_values_is_a_dash_and_null() {
        let none = Percentiles::of([f64::NAN; 3]);
        assert_eq!((none.text(1), none.range_text(2)), ("-".into(), "-".into()));
        let json = serde_json::to_value(none).unwrap();
        for key in ["least", "p5", "p25", "median", "p75", "p95", "worst"] {
            assert!(json[key].is_null(), "{json}");
        }
        assert_eq!(Percentiles::of([]).text(1), "-");
        let some = Percentiles::of([2.0, f64::NAN, 4.0]);
        assert_eq!((some.least, some.worst), (2.0, 4.0));
        assert!(some.text(1).starts_with("3.0 ("), "{}", some.text(1));
    }

    #[test]
    fn percentiles_of_a_uniform_distribution_are_exact() {
        let spread = Percentiles::of((0..=1000).map(f64::from));
        assert!((spread.median - 500.0).abs() < 1.0, "{spread:?}");
        assert!((spread.p5 - 50.0).abs() < 1.0 && (spread.p95 - 950.0).abs() < 1.0, "{spread:?}");
        assert_eq!(spread.worst, 1000.0);
    }
}
