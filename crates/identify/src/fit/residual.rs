//! What is left between log and model, and what it is held against.

use crate::experiment::{COMPARED, CRANE, Experiment};
use crate::prediction::Prediction;
use crate::whiteness::autocovariance;

/// Smallest deviation that a difference of a compared signal is held against: position \[m\], motor speed \[rev/s\], pressures \[Pa\].
fn finest(signal: usize) -> f64 {
    match signal {
        0 => 5e-6,
        CRANE => 1e-3,
        _ => 1e3,
    }
}
/// Differences beyond so many deviations count less (Huber).
const ROBUST: f64 = 3.0;

/// Slopes, each with the place of what it is along.
pub(super) type Slopes = Vec<(usize, Prediction)>;

/// Deviations that the differences of a log's signals are held against.
pub(super) type Deviations = [f64; COMPARED.len()];

/// Log less model of a signal, with the sample.
pub(super) fn residuals(
    experiment: &Experiment,
    prediction: &Prediction,
    signal: usize,
) -> Vec<(usize, f64)> {
    let pairs = experiment.samples.iter().zip(prediction).enumerate();
    pairs.filter_map(|(i, (s, p))| Some((i, s.values[signal]? - p[signal]))).collect()
}

/// What a search knows of what it will leave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Leaves {
    /// Nothing yet: what is left now is what it is to take away.
    Unknown,
    /// About what is left now.
    AsNow,
}

/// What the differences of each log are held against: what its sensors scatter, or what is left of a difference where that
/// is more. Where that is what the search will leave, samples that are correlated count as so many fewer: with each as one of its own, what
/// the model cannot show would outweigh all that is known of keys and channels (a likelihood adjusted in its magnitude: Pauli, Racugno and
/// Ventura, Bayesian composite marginal likelihoods, Statistica Sinica 21, 2011, 149-164).
pub(super) fn deviations(
    experiments: &[Experiment],
    predictions: &[Prediction],
    leaves: Leaves,
) -> Vec<Deviations> {
    let of = |(experiment, prediction): (&Experiment, &Prediction)| -> Deviations {
        std::array::from_fn(|signal| {
            let errors = residuals(experiment, prediction, signal);
            let square = errors.iter().map(|e| e.1 * e.1).sum::<f64>();
            let left = (square / errors.len().max(1) as f64).sqrt();
            let alike = match leaves {
                Leaves::Unknown => 1.0,
                Leaves::AsNow => correlation_time(&in_time(experiment, &errors)),
            };
            scatter(experiment, signal).max(left) * alike.sqrt()
        })
    };
    experiments.iter().zip(predictions).map(of).collect()
}

/// What a signal's sensor scatters, and no less than what a difference is held against at least.
fn scatter(experiment: &Experiment, signal: usize) -> f64 {
    experiment.noise[signal].max(finest(signal))
}

/// Differences by the samples of their log; none where nothing was measured.
fn in_time(experiment: &Experiment, errors: &[(usize, f64)]) -> Vec<Option<f64>> {
    let mut all = vec![None; experiment.samples.len()];
    errors.iter().for_each(|(sample, e)| all[*sample] = Some(*e));
    all
}

/// Whether what is left of a log is more than its sensors scatter, and correlated for longer than a tenth of a second: the model cannot show it. The motor's
/// speed does not count: no key of the crane depends on it.
pub(super) fn has_lack_of_fit(experiment: &Experiment, prediction: &Prediction) -> bool {
    (0..CRANE).any(|signal| {
        let errors = residuals(experiment, prediction, signal);
        let square = errors.iter().map(|(_, e)| e * e).sum::<f64>() / errors.len().max(1) as f64;
        let errors = in_time(experiment, &errors);
        square > 2.0 * scatter(experiment, signal).powi(2)
            && correlation_time(&errors) * experiment.interval() > 0.1
    })
}

/// How many samples tell as much as one that is independent: the sum of all autocorrelations, up to where pairs of them are no longer positive
/// (initial positive sequence: Geyer, Practical Markov chain Monte Carlo, Stat. Sci. 7, 1992, 473-483). One for white noise. Samples that are missing make no
/// pair: a lag is one of time.
fn correlation_time(errors: &[Option<f64>]) -> f64 {
    let (power, _) = autocovariance(errors, 0);
    if power <= 0.0 {
        return 1.0;
    }
    let at = |lag: usize| autocovariance(errors, lag).0 / power;
    let pairs = (0..errors.len() / 2).map(|k| at(2 * k) + at(2 * k + 1));
    let sum: f64 = pairs.take_while(|pair| *pair > 0.0).sum();
    (2.0 * sum - 1.0).max(1.0)
}

/// A difference whose square is Huber's loss, and its slope.
pub(super) fn huber(e: f64) -> (f64, f64) {
    if e.abs() <= ROBUST {
        return (e, 1.0);
    }
    let root = (2.0 * ROBUST * e.abs() - ROBUST * ROBUST).sqrt();
    (root.copysign(e), ROBUST / root)
}

/// Huber's score of a difference, half the slope of its loss, and the slope of that: what is far out draws no more than what is just not.
pub(super) fn score(e: f64) -> (f64, f64) {
    match e.abs() <= ROBUST {
        true => (e, 1.0),
        false => (ROBUST.copysign(e), 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each number stands for the eight samples from it on: they tell as much as one.
    #[test]
    fn samples_that_repeat_count_once_and_a_gap_makes_no_pairs() {
        let course = |k: usize| {
            let x = ((k / 8) as f64 * 12.9898).sin() * 43_758.547;
            2.0 * (x - x.floor()) - 1.0
        };
        let whole: Vec<Option<f64>> = (0..8000).map(|k| Some(course(k))).collect();
        let alike = correlation_time(&whole);
        assert!((alike / 8.0 - 1.0).abs() < 0.25, "{alike}");
        // as many samples, four fifths of them missing in the middle: their neighbours across the gap are none
        let mut gap = whole.clone();
        gap[800..7200].fill(None);
        assert!((correlation_time(&gap) / alike - 1.0).abs() < 0.25, "{}", correlation_time(&gap));
    }
}
