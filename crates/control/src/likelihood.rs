//! What hypotheses say that stand in a row, one as far from the next as any other, by how likely each is.

use hydroboom_math::Real;

/// A likelihood is sharper than its hypotheses are apart once its standard deviation is less than half their distance: its logarithm
/// curves by as much as this over them,
const SHARP: f64 = 4.0;
/// and no more than this share of it is elsewhere. Where much is likely, and the best only where doubt begins, it is not.
const ELSEWHERE: f64 = 0.05;

/// What each counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Weights<const N: usize> {
    /// Sums up to one.
    pub(crate) weights: [f64; N],
    /// Standard deviation of the place in the row, over the distance from one to the next.
    pub(crate) deviation: f64,
}

/// By the logarithms of how likely they are, of which none is infinite. What was seen may tell a place between two: a likelihood that is sharper
/// than they are apart has its top where a parabola through the logarithms of the best of them and its neighbours has it.
pub(crate) fn weights<const N: usize>(logs: &[f64; N]) -> Weights<N> {
    let best = (0..N).fold(0, |best, k| if logs[k] > logs[best] { k } else { best });
    let likely = logs.map(|log| Real::exp(log - logs[best]));
    let all: f64 = likely.iter().sum();
    between(best, logs, &likely, all).unwrap_or_else(|| spread(&likely.map(|l| l / all)))
}

fn spread<const N: usize>(weights: &[f64; N]) -> Weights<N> {
    let mean = |of: &dyn Fn(f64) -> f64| -> f64 {
        weights.iter().enumerate().map(|(k, weight)| weight * of(k as f64)).sum()
    };
    let middle = mean(&|place| place);
    let variance = mean(&|place| (place - middle).square());
    Weights { weights: *weights, deviation: Real::sqrt(variance) }
}

fn between<const N: usize>(
    best: usize,
    logs: &[f64; N],
    likely: &[f64; N],
    all: f64,
) -> Option<Weights<N>> {
    let [lower, upper] = [best.checked_sub(1)?, best + 1];
    let [below, top, above] = *logs.get(lower..=upper)? else { return None };
    let curvature = 2.0 * top - below - above;
    let near: f64 = likely[lower..=upper].iter().sum();
    if curvature <= SHARP || all - near > ELSEWHERE * all {
        return None;
    }
    let away = 0.5 * (above - below) / curvature;
    let mut weights = [0.0; N];
    weights[best] = 1.0 - away.abs();
    weights[if away > 0.0 { upper } else { lower }] = away.abs();
    Some(Weights { weights, deviation: 1.0 / Real::sqrt(curvature) })
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 11;

    fn place(weights: &[f64; N]) -> f64 {
        weights.iter().enumerate().map(|(k, weight)| weight * k as f64).sum()
    }

    fn normal(middle: f64, deviation: f64) -> Weights<N> {
        weights(&core::array::from_fn(|k| -0.5 * ((k as f64 - middle) / deviation).square()))
    }

    /// However sharp: the mean and the standard deviation of a normal distribution are found, by the sum over those that see it and by the parabola else.
    #[test]
    fn a_normal_distribution_is_found_wherever_it_lies() {
        for deviation in [0.01, 0.1, 0.4, 0.6, 1.0, 1.3] {
            for middle in [4.0, 4.3, 4.5, 5.9, 6.0] {
                let found = normal(middle, deviation);
                // a sum over places that are two deviations apart errs by a hundredth of that
                assert!((place(&found.weights) - middle).abs() < 0.02, "{found:?}");
                assert!((found.deviation / deviation - 1.0).abs() < 0.05, "{found:?}");
            }
        }
    }

    #[test]
    fn where_nothing_was_seen_all_count_alike() {
        let found = weights(&[-3.0; N]);
        assert!((place(&found.weights) - 5.0).abs() < 1e-12);
        assert!((found.deviation - 10.0_f64.sqrt()).abs() < 1e-12, "{found:?}");
    }

    /// All below one place alike, none beyond: the best is anywhere there, and not at its end.
    #[test]
    fn what_speaks_against_one_side_alone_tells_no_place() {
        let found = weights(&core::array::from_fn::<_, N, _>(|k| if k > 5 { -50.0 } else { 0.0 }));
        assert!((place(&found.weights) - 2.5).abs() < 1e-9, "{found:?}");
        // nor where noise makes the last of them the best
        let tilted = |k| if k > 5 { -50.0 } else { 1e-3 * k as f64 };
        let found = weights(&core::array::from_fn::<_, N, _>(tilted));
        assert!((place(&found.weights) - 2.5).abs() < 0.01, "{found:?}");
        let at_the_end = weights(&core::array::from_fn::<_, N, _>(|k| -50.0 * k as f64));
        assert!(place(&at_the_end.weights) < 1e-9);
    }
}
