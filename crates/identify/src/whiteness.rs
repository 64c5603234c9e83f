//! Whiteness test of residuals by their autocorrelations.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Largest lag of the autocorrelations \[s\].
const LAGS: f64 = 1.0;

/// Sum and number of products of residuals that are `lag` samples apart. Missing samples contribute none
/// and keep their place in time.
pub(crate) fn autocovariance(errors: &[Option<f64>], lag: usize) -> (f64, usize) {
    let later = errors.get(lag..).unwrap_or(&[]);
    let pairs = errors.iter().zip(later).filter_map(|(a, b)| Some((*a)? * (*b)?));
    pairs.fold((0.0, 0), |(sum, count), product| (sum + product, count + 1))
}

/// Result of the whiteness test over lags up to one second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Whiteness {
    /// Effect size: share of autocorrelations beyond the 95 % bound of white noise (Bartlett, On the
    /// theoretical specification and sampling properties of autocorrelated time-series, Suppl. J. R. Stat.
    /// Soc. 8, 1946, 27-41).
    pub(crate) coloured: f64,
    /// Whether the portmanteau test over all lags accepts white noise at a level of 5 %.
    pub(crate) is_white: bool,
}

/// Significance level: probability that white noise is rejected.
const LEVEL: f64 = 0.05;

/// Whiteness test of residuals sampled at `interval` \[s\]. Fewer than four samples, or constant ones,
/// count as white.
///
/// The squared autocorrelations over their variances sum to a χ² with as many degrees of freedom as lags.
/// Source: Ljung and Box, On a measure of lack of fit in time series models, Biometrika 65, 1978, 297-303.
/// With missing samples the existing pairs count (Stoffer and Toloi, A note on the Ljung-Box-Pierce
/// portmanteau statistic with missing data, Stat. Prob. Lett. 13, 1992, 391-396).
pub(crate) fn whiteness(errors: &[Option<f64>], interval: f64) -> Whiteness {
    let count = errors.iter().flatten().count();
    let mean = errors.iter().flatten().sum::<f64>() / count.max(1) as f64;
    let centred: Vec<Option<f64>> = errors.iter().map(|e| e.map(|e| e - mean)).collect();
    let (power, _) = autocovariance(&centred, 0);
    let lags = ((LAGS / interval) as usize).min(count / 4);
    if lags == 0 || power <= 0.0 {
        return Whiteness { coloured: 0.0, is_white: true };
    }
    let count = count as f64;
    let squares = (1..=lags).filter_map(|lag| {
        let (sum, pairs) = autocovariance(&centred, lag);
        let variance = pairs as f64 / (count * (count + 2.0));
        (pairs > 0).then(|| (sum / power).powi(2) / variance)
    });
    let squares: Vec<f64> = squares.collect();
    let beyond = squares.iter().filter(|square| **square > 1.96 * 1.96).count();
    let limit = ChiSquared::new(squares.len() as f64).map(|chi| chi.inverse_cdf(1.0 - LEVEL));
    let is_white = limit.is_ok_and(|limit| squares.iter().sum::<f64>() <= limit);
    Whiteness { coloured: beyond as f64 / squares.len().max(1) as f64, is_white }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn white(k: usize) -> f64 {
        let x = (k as f64 * 12.9898).sin() * 43_758.547;
        2.0 * (x - x.floor()) - 1.0
    }

    /// White noise, with and without a gap, is rejected as often as the level states. A first-order
    /// autoregressive process with a coefficient of 0.1 is mostly detected with few lags.
    #[test]
    fn white_noise_is_called_coloured_in_one_case_of_twenty() {
        let draws = 400;
        for (gap, keep, least, most) in
            [(0..0, 0.0, 0.02, 0.08), (300..900, 0.0, 0.02, 0.08), (0..0, 0.1, 0.6, 1.0)]
        {
            let is_coloured = |draw: &usize| {
                let mut last = 0.0;
                let mut errors: Vec<Option<f64>> = (0..1200)
                    .map(|k| {
                        last = keep * last + white(draw * 1200 + k);
                        Some(last)
                    })
                    .collect();
                errors[gap.clone()].fill(None);
                !whiteness(&errors, 0.2).is_white
            };
            let share = (0..draws).filter(is_coloured).count() as f64 / draws as f64;
            assert!((least..=most).contains(&share), "{share} with {gap:?} and {keep}");
        }
    }

    /// A period of five samples. With every other second missing and the rest joined, its phase would jump
    /// and it would seem white.
    #[test]
    fn an_oscillation_is_not_white_though_half_of_it_is_missing() {
        let swing = |k: usize| (std::f64::consts::TAU * k as f64 / 5.03).sin() + 0.1 * white(k);
        let measured = |k: &usize| (k / 53).is_multiple_of(2);
        let errors: Vec<Option<f64>> =
            (0..4000).map(|k| Some(swing(k)).filter(|_| measured(&k))).collect();
        let found = whiteness(&errors, 5e-3);
        assert!(found.coloured > 0.6 && !found.is_white, "{found:?}");
    }
}
