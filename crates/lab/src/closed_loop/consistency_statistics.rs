//! Consistency statistics of an estimator: whether its errors agree with its covariance.
//!
//! With innovation ν of variance S, and estimation error e of standard deviation σ, both scalar:
//!
//! ```text
//! NIS = ν²/S            mean 1; the mean of N independent ones is chi-square of N degrees of freedom, over N
//! r(l) = ⟨ν̃_k ν̃_k−l⟩/⟨ν̃²⟩     autocorrelation of ν̃ = ν/√S at lag l; 0 where the filter is optimal
//! NEES = e²/σ²          mean 1
//! ```
//!
//! Source: Y. Bar-Shalom, X. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*,
//! 2001, section 5.4.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::VecDeque;
use std::ops::RangeInclusive;

/// Required range of the mean NIS over a window \[-\]; 1 for a consistent filter. An estimate: wider than the χ² band,
/// which holds for white innovations only.
pub const NIS_RANGE: RangeInclusive<f64> = 0.5..=2.0;
/// Smallest share of windows \[%\] with a mean NIS within [`NIS_RANGE`]; an estimate.
pub const NIS_SHARE: f64 = 90.0;
/// Required share of errors \[%\] within two standard deviations; 95.4 for a normal distribution. The range is an
/// estimate.
pub const COVERAGE: RangeInclusive<f64> = 90.0..=99.0;
/// Smallest number of instants for a statement on coverage. Of that many, a normal distribution leaves five
/// outside on average.
pub const FEWEST_INSTANTS: usize = 100;
/// Largest allowed ratio of mean standard deviation to RMS error \[-\]: above it the filter is too pessimistic; an
/// estimate.
pub const LARGEST_DEVIATION: f64 = 2.0;

/// Innovations of one measured signal, sample by sample: means over windows, and autocorrelation.
#[derive(Clone, Debug)]
pub struct Innovations {
    /// Window length \[samples\].
    window: usize,
    /// Lags of the autocorrelation \[samples\].
    lags: RangeInclusive<usize>,
    /// Present window: number of samples, sum of NIS, and whether every sample has an innovation.
    filled: usize,
    sum: f64,
    is_whole: bool,
    /// Mean NIS of each complete window.
    means: Vec<f64>,
    /// Last normalised innovations, newest last; NaN where there is none.
    past: VecDeque<f64>,
    /// Sum and number of products per lag; sum and number of squares.
    products: Vec<(f64, u64)>,
    squares: (f64, u64),
}

impl Innovations {
    /// Empty statistics for windows of `window` samples and an autocorrelation over `lags` \[samples\]. A window of 0
    /// counts as 1; an empty range of lags gives no autocorrelation.
    pub fn new(window: usize, lags: RangeInclusive<usize>) -> Self {
        let count = lags.clone().count();
        Self {
            window: window.max(1),
            filled: 0,
            sum: 0.0,
            is_whole: true,
            means: Vec::new(),
            past: VecDeque::with_capacity(lags.end() + 1),
            lags,
            products: vec![(0.0, 0); count],
            squares: (0.0, 0),
        }
    }

    /// Adds the normalised innovation ν/√S \[-\] of a sample. None excludes the sample and its window, as after a load
    /// change. NaN is not excluded: the mean of its window and the autocorrelation become NaN.
    pub fn add(&mut self, normalised: Option<f64>) {
        match normalised {
            Some(value) => {
                self.sum += value * value;
                self.squares.0 += value * value;
                self.squares.1 += 1;
                for (lag, product) in self.lags.clone().zip(&mut self.products) {
                    let before = self.past.len().checked_sub(lag).map(|at| self.past[at]);
                    if let Some(before) = before.filter(|before| before.is_finite()) {
                        product.0 += value * before;
                        product.1 += 1;
                    }
                }
            }
            None => self.is_whole = false,
        }
        self.past.push_back(normalised.unwrap_or(f64::NAN));
        if self.past.len() > *self.lags.end() {
            self.past.pop_front();
        }
        self.filled += 1;
        if self.filled == self.window {
            if self.is_whole {
                self.means.push(self.sum / self.window as f64);
            }
            (self.filled, self.sum, self.is_whole) = (0, 0.0, true);
        }
    }

    /// Autocorrelation r(l) of largest magnitude \[-\] with its lag l \[samples\]. None without samples, or if no
    /// value is finite.
    pub fn largest_autocorrelation(&self) -> Option<(f64, usize)> {
        let square = self.squares.0 / self.squares.1 as f64;
        self.lags
            .clone()
            .zip(&self.products)
            .filter(|(_, (_, count))| *count > 0)
            .map(|(lag, (sum, count))| (sum / *count as f64 / square, lag))
            .filter(|(value, _)| value.is_finite())
            .max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
    }
}

/// Statistics of the normalised innovations of one measured signal over several runs.
#[derive(Clone, Debug, Serialize)]
pub struct InnovationSummary {
    /// Number of windows without a load change.
    pub windows: usize,
    /// Mean NIS over all windows \[-\]; 1 for a consistent filter.
    pub mean_nis: f64,
    /// Share of windows \[%\] whose mean NIS is within 0.5 to 2.
    pub within_percent: f64,
    /// Share of windows \[%\] whose mean NIS is within the 95 % band of white innovations.
    pub within_chi_square_percent: f64,
    /// Lower and upper limit of the 95 % band of a window's mean NIS \[-\]: quantiles of χ² with the window's number
    /// of samples as degrees of freedom, over that number.
    pub chi_square_band: [f64; 2],
    /// Median over the runs of the largest magnitude of the autocorrelation \[-\]; NaN if no run has one.
    pub median_autocorrelation: f64,
    /// Autocorrelation of largest magnitude in all runs, with its sign \[-\]; NaN if no run has one.
    pub largest_autocorrelation: f64,
    /// Lag of the autocorrelation of largest magnitude \[samples\]; 0 if no run has one.
    pub largest_at_lag: usize,
}

impl InnovationSummary {
    /// Statistics over runs with equal window length; none if no run has a complete window.
    pub fn of<'a>(runs: impl IntoIterator<Item = &'a Innovations>) -> Option<Self> {
        let (mut means, mut largest, mut window) = (Vec::new(), Vec::new(), 1);
        for run in runs {
            means.extend_from_slice(&run.means);
            largest.extend(run.largest_autocorrelation());
            window = run.window;
        }
        if means.is_empty() {
            return None;
        }
        let band = chi_square_band(window);
        let share = |is: &dyn Fn(f64) -> bool| {
            100.0 * means.iter().filter(|mean| is(**mean)).count() as f64 / means.len() as f64
        };
        largest.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        let middle = largest.get(largest.len() / 2).map_or(f64::NAN, |(value, _)| value.abs());
        let (most, lag) = largest.last().copied().unwrap_or((f64::NAN, 0));
        Some(Self {
            windows: means.len(),
            mean_nis: means.iter().sum::<f64>() / means.len() as f64,
            within_percent: share(&|mean| NIS_RANGE.contains(&mean)),
            within_chi_square_percent: share(&|mean| (band[0]..=band[1]).contains(&mean)),
            chi_square_band: band,
            median_autocorrelation: middle,
            largest_autocorrelation: most,
            largest_at_lag: lag,
        })
    }

    /// Whether at least [`NIS_SHARE`] percent of the windows have a mean NIS within [`NIS_RANGE`].
    pub fn is_consistent(&self) -> bool {
        self.within_percent >= NIS_SHARE
    }
}

/// Band that contains the mean of `count` independent normalised innovations squared with a probability of
/// 95 %.
fn chi_square_band(count: usize) -> [f64; 2] {
    let degrees = count.max(1) as f64;
    match ChiSquared::new(degrees) {
        Ok(distribution) => [0.025, 0.975].map(|p| distribution.inverse_cdf(p) / degrees),
        // a positive number of degrees of freedom never fails
        Err(_) => [f64::NAN; 2],
    }
}

/// Estimation errors of one quantity with the filter's standard deviations, as running sums.
#[derive(Clone, Copy, Debug, Default)]
pub struct Errors {
    count: u64,
    nees: f64,
    error: f64,
    square: f64,
    deviation: f64,
    covered: u64,
}

impl Errors {
    /// Adds an error, estimate minus truth, and its standard deviation, both in the quantity's unit. An error of
    /// exactly zero adds nothing to the NEES, even with a standard deviation of zero. NaN makes the means NaN.
    pub fn add(&mut self, error: f64, deviation: f64) {
        self.count += 1;
        // at the largest bulk modulus both error and standard deviation are exactly zero
        self.nees += if error == 0.0 { 0.0 } else { (error / deviation).powi(2) };
        self.error += error;
        self.square += error * error;
        self.deviation += deviation;
        self.covered += u64::from(error.abs() <= 2.0 * deviation);
    }

    /// Adds the errors of another run, which must be in the same unit.
    pub fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.nees += other.nees;
        self.error += other.error;
        self.square += other.square;
        self.deviation += other.deviation;
        self.covered += other.covered;
    }

    /// Statistics with errors divided by `unit`, the size of the display unit in SI units; none without errors.
    pub fn summary(&self, unit: f64) -> Option<ErrorSummary> {
        let count = self.count as f64;
        let (rms, deviation) = ((self.square / count).sqrt(), self.deviation / count);
        (self.count > 0).then(|| ErrorSummary {
            instants: self.count,
            mean_nees: self.nees / count,
            mean_error: self.error / count / unit,
            rms_error: rms / unit,
            mean_deviation: deviation / unit,
            deviation_over_rms: deviation / rms,
            coverage_percent: 100.0 * self.covered as f64 / count,
        })
    }
}

/// Statistics of the estimation errors of one quantity.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ErrorSummary {
    /// Number of instants at which the error was taken.
    pub instants: u64,
    /// Mean normalised estimation error squared (NEES) \[-\]; 1 for a consistent filter.
    pub mean_nees: f64,
    /// Mean error, estimate minus truth, in the display unit.
    pub mean_error: f64,
    /// RMS error, in the display unit.
    pub rms_error: f64,
    /// Mean standard deviation stated by the filter, in the display unit.
    pub mean_deviation: f64,
    /// Mean standard deviation over RMS error \[-\]: below 1 the filter is too optimistic. Infinite or NaN if all
    /// errors are zero.
    pub deviation_over_rms: f64,
    /// Share of errors within two standard deviations \[%\].
    pub coverage_percent: f64,
}

impl ErrorSummary {
    /// Whether the coverage is within [`COVERAGE`] and the standard deviation at most [`LARGEST_DEVIATION`] times the
    /// RMS error; none for fewer than [`FEWEST_INSTANTS`] instants.
    pub fn is_consistent(&self) -> Option<bool> {
        let is_as_wanted = COVERAGE.contains(&self.coverage_percent)
            && self.deviation_over_rms <= LARGEST_DEVIATION;
        (self.instants as usize >= FEWEST_INSTANTS).then_some(is_as_wanted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// Sum of twelve uniform numbers: approximately normal within two standard deviations.
    fn normal(random: &mut Pcg64Mcg) -> f64 {
        (0..12).map(|_| random.random_range(0.0..1.0)).sum::<f64>() - 6.0
    }

    /// White innovations with `size` times the stated standard deviation.
    fn white(size: f64) -> InnovationSummary {
        let mut random = Pcg64Mcg::seed_from_u64(5);
        let runs: Vec<Innovations> = (0..10)
            .map(|_| {
                let mut run = Innovations::new(1000, 20..=200);
                (0..40_000).for_each(|_| run.add(Some(size * normal(&mut random))));
                run
            })
            .collect();
        InnovationSummary::of(&runs).unwrap()
    }

    #[test]
    fn white_innovations_of_the_stated_variance_are_consistent() {
        let summary = white(1.0);
        assert_eq!(summary.windows, 400);
        // four standard deviations of the mean of 400 000 samples
        assert!((summary.mean_nis - 1.0).abs() < 4.0 * (2.0_f64 / 4e5).sqrt(), "{summary:?}");
        assert!(summary.is_consistent() && summary.within_percent == 100.0);
        // 95 %, and four standard deviations of a share of 400 windows
        assert!((summary.within_chi_square_percent - 95.0).abs() < 4.4, "{summary:?}");
        // mean 1 and variance 2/N: normal to three digits at 1000 degrees of freedom
        let [low, high] = summary.chi_square_band;
        assert!((low - 0.9143).abs() < 2e-3 && (high - 1.0895).abs() < 2e-3, "{low} {high}");
        // largest of 181 lags of 40 000 samples
        assert!(summary.largest_autocorrelation.abs() < 5.0 / 40_000_f64.sqrt(), "{summary:?}");
    }

    #[test]
    fn innovations_of_twice_the_stated_deviation_are_not() {
        let summary = white(2.0);
        assert!((summary.mean_nis - 4.0).abs() < 0.05, "{summary:?}");
        assert!(!summary.is_consistent() && summary.within_percent == 0.0);
        assert!(white(0.5).within_percent == 0.0);
    }

    #[test]
    fn an_oscillation_shows_in_the_autocorrelation_and_not_in_the_mean() {
        // half a period is not among the lags
        let mut run = Innovations::new(1000, 100..=200);
        let rate = std::f64::consts::TAU / 150.0;
        (0..30_000).for_each(|k| run.add(Some(2.0_f64.sqrt() * (rate * f64::from(k)).sin())));
        let (value, lag) = run.largest_autocorrelation().unwrap();
        assert!(value > 0.99 && lag.abs_diff(150) <= 1, "{value} at {lag}");
        assert!(InnovationSummary::of([&run]).unwrap().is_consistent());
    }

    #[test]
    fn a_window_with_a_load_change_is_excluded() {
        let mut run = Innovations::new(100, 2..=20);
        for k in 0..1000 {
            // windows 3 and 7 are excluded at any innovations
            let counts = k != 350 && k / 100 != 7;
            run.add(counts.then_some(if k / 100 == 3 { 30.0 } else { 1.0 }));
        }
        let summary = InnovationSummary::of([&run]).unwrap();
        assert_eq!((summary.windows, summary.mean_nis), (8, 1.0));
    }

    #[test]
    fn errors_of_the_stated_deviation_are_covered_and_doubled_ones_are_not() {
        let mut random = Pcg64Mcg::seed_from_u64(6);
        let mut of = |size: f64, stated: f64| {
            let mut errors = Errors::default();
            // standard deviations vary by a factor of three, each with its own error
            for k in 0..20_000 {
                let deviation = 0.01 * (1.0 + f64::from(k % 3));
                errors.add(size * deviation * normal(&mut random), stated * deviation);
            }
            errors.summary(1e-3).unwrap()
        };
        let right = of(1.0, 1.0);
        assert_eq!(right.is_consistent(), Some(true), "{right:?}");
        assert!((right.mean_nees - 1.0).abs() < 0.05, "{right:?}");
        assert!((right.coverage_percent - 95.4).abs() < 0.7, "{right:?}");
        // root mean square of 1, 2 and 3, in thousandths
        assert!((right.rms_error / (14.0_f64 / 3.0).sqrt() / 10.0 - 1.0).abs() < 0.03, "{right:?}");
        let doubled = of(2.0, 1.0);
        assert_eq!(doubled.is_consistent(), Some(false));
        assert!((doubled.mean_nees - 4.0).abs() < 0.2, "{doubled:?}");
        // 68.3 % for a normal distribution
        assert!((doubled.coverage_percent - 68.3).abs() < 1.5, "{doubled:?}");
        // three times the true standard deviation is inconsistent too
        assert_eq!(of(1.0, 3.0).is_consistent(), Some(false));
    }

    #[test]
    fn merged_errors_are_those_of_both() {
        let (mut one, mut other) = (Errors::default(), Errors::default());
        one.add(3.0, 1.0);
        other.add(-4.0, 4.0);
        one.merge(&other);
        let both = one.summary(1.0).unwrap();
        assert_eq!((both.instants, both.mean_nees, both.coverage_percent), (2, 5.0, 50.0));
        assert_eq!((both.mean_error, both.rms_error), (-0.5, 12.5_f64.sqrt()));
        assert!(Errors::default().summary(1.0).is_none());
    }
}
