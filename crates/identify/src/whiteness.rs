//! Whether differences are white noise: their autocorrelations, over what was measured.

/// Autocorrelations are looked at up to this lag \[s\].
const LAGS: f64 = 1.0;

/// Sum of products of differences a lag of samples apart, and how many there are. Where nothing was measured there is none: differences on both sides of a gap
/// are as far apart as their times are.
pub(crate) fn autocovariance(errors: &[Option<f64>], lag: usize) -> (f64, usize) {
    let later = errors.get(lag..).unwrap_or(&[]);
    let pairs = errors.iter().zip(later).filter_map(|(a, b)| Some((*a)? * (*b)?));
    pairs.fold((0.0, 0), |(sum, count), product| (sum + product, count + 1))
}

/// Share of autocorrelations, up to a second, beyond what white noise has in nineteen cases of twenty (Bartlett, On the theoretical specification and sampling
/// properties of autocorrelated time-series, Suppl. J. R. Stat. Soc. 8, 1946, 27-41); samples `interval` apart \[s\].
pub(crate) fn coloured(errors: &[Option<f64>], interval: f64) -> f64 {
    let count = errors.iter().flatten().count();
    let mean = errors.iter().flatten().sum::<f64>() / count.max(1) as f64;
    let centred: Vec<Option<f64>> = errors.iter().map(|e| e.map(|e| e - mean)).collect();
    let (power, _) = autocovariance(&centred, 0);
    let lags = ((LAGS / interval) as usize).min(count / 4);
    if lags == 0 || power <= 0.0 {
        return 0.0;
    }
    let beyond = (1..=lags).filter(|lag| {
        let (sum, pairs) = autocovariance(&centred, *lag);
        // of white noise a sum of so many products has this deviation
        sum.abs() > 1.96 * (pairs as f64).sqrt() * power / count as f64
    });
    beyond.count() as f64 / lags as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn white(k: usize) -> f64 {
        let x = (k as f64 * 12.9898).sin() * 43_758.547;
        2.0 * (x - x.floor()) - 1.0
    }

    #[test]
    fn white_noise_is_white_with_and_without_a_gap() {
        let mut errors: Vec<Option<f64>> = (0..4000).map(|k| Some(white(k))).collect();
        assert!(coloured(&errors, 5e-3) < 0.12, "{}", coloured(&errors, 5e-3));
        errors[1000..3700].fill(None);
        assert!(coloured(&errors, 5e-3) < 0.12, "{}", coloured(&errors, 5e-3));
    }

    /// A swing of five samples; where every other second is missing, and what is left is put end to end, it would fall out of step and seem white.
    #[test]
    fn a_swing_is_not_white_though_half_of_it_is_missing() {
        let swing = |k: usize| (std::f64::consts::TAU * k as f64 / 5.03).sin() + 0.1 * white(k);
        let measured = |k: &usize| (k / 53).is_multiple_of(2);
        let errors: Vec<Option<f64>> =
            (0..4000).map(|k| Some(swing(k)).filter(|_| measured(&k))).collect();
        assert!(coloured(&errors, 5e-3) > 0.6, "{}", coloured(&errors, 5e-3));
    }
}
