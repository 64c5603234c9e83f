//! Distribution of a quantity over a family of cranes.

use serde::Serialize;
use statrs::statistics::{Data, OrderStatistics};

/// Distribution of a quantity over a family.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentiles {
    /// Minimum.
    pub least: f64,
    /// 5th percentile.
    pub p5: f64,
    /// 25th percentile.
    pub p25: f64,
    /// Median.
    pub median: f64,
    /// 75th percentile.
    pub p75: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Maximum.
    pub worst: f64,
}

impl Percentiles {
    /// Distribution of the given values; non-finite ones are ignored.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let finite: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
        let [least, worst] =
            [f64::min, f64::max].map(|of| finite.iter().copied().fold(f64::NAN, of));
        let mut data = Data::new(finite);
        let mut share = |tau: f64| data.quantile(tau);
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

    /// Text with `digits` decimals: median (minimum .. maximum).
    pub fn range_text(&self, digits: usize) -> String {
        let Self { least, median, worst, .. } = self;
        format!("{median:.digits$} ({least:.digits$} .. {worst:.digits$})")
    }

    /// Text with `digits` decimals: median (5 .. 95 %), maximum.
    pub fn text(&self, digits: usize) -> String {
        let Self { p5, median, p95, worst, .. } = self;
        format!("{median:.digits$} ({p5:.digits$} .. {p95:.digits$}), {worst:.digits$}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_of_even_numbers_is_even() {
        let spread = Percentiles::of((0..=1000).map(f64::from));
        assert!((spread.median - 500.0).abs() < 1.0, "{spread:?}");
        assert!((spread.p5 - 50.0).abs() < 1.0 && (spread.p95 - 950.0).abs() < 1.0, "{spread:?}");
        assert_eq!(spread.worst, 1000.0);
    }
}
