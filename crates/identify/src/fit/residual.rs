//! What is left between log and model, and what it is held against.

use crate::differences::noise;
use crate::experiment::{COMPARED, CRANE, Experiment};
use crate::prediction::Prediction;

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
            let values: Vec<f64> =
                experiment.samples.iter().filter_map(|s| s.values[signal]).collect();
            let errors = residuals(experiment, prediction, signal);
            let square = errors.iter().map(|e| e.1 * e.1).sum::<f64>();
            let left = (square / errors.len().max(1) as f64).sqrt();
            let alike = match leaves {
                Leaves::Unknown => 1.0,
                Leaves::AsNow => correlation_time(errors.iter().map(|e| e.1).collect()),
            };
            noise(&values).max(finest(signal)).max(left) * alike.sqrt()
        })
    };
    experiments.iter().zip(predictions).map(of).collect()
}

/// Whether what is left of a log is more than its sensors scatter, and correlated for longer than a tenth of a second: the model cannot show it. The motor's
/// speed does not count: no key of the crane depends on it.
pub(super) fn has_lack_of_fit(experiment: &Experiment, prediction: &Prediction) -> bool {
    (0..CRANE).any(|signal| {
        let values: Vec<f64> = experiment.samples.iter().filter_map(|s| s.values[signal]).collect();
        let errors: Vec<f64> =
            residuals(experiment, prediction, signal).into_iter().map(|(_, e)| e).collect();
        let square = errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64;
        let scatter = noise(&values).max(finest(signal));
        square > 2.0 * scatter * scatter && correlation_time(errors) * experiment.interval() > 0.1
    })
}

/// How many samples tell as much as one that is independent: the sum of all autocorrelations, up to where pairs of them are no longer positive
/// (initial positive sequence: Geyer, Practical Markov chain Monte Carlo, Stat. Sci. 7, 1992, 473-483). One for white noise.
fn correlation_time(errors: Vec<f64>) -> f64 {
    let at = |lag: usize| errors.iter().zip(&errors[lag..]).map(|(a, b)| a * b).sum::<f64>();
    let power = at(0);
    if power <= 0.0 {
        return 1.0;
    }
    let pairs = (0..errors.len() / 2).map(|k| (at(2 * k) + at(2 * k + 1)) / power);
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
