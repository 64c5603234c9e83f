//! What is left between log and model, and what it is held against.

use crate::differences::noise;
use crate::experiment::{COMPARED, Experiment};
use crate::prediction::Prediction;

/// Smallest deviations that a difference is held against, for position \[m\] and pressures \[Pa\].
const FINEST: [f64; 2] = [5e-6, 1e3];
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

/// What the differences of each log are held against: what its sensors scatter, or what is left of a difference where that
/// is more.
pub(super) fn deviations(
    experiments: &[Experiment],
    predictions: &[Prediction],
) -> Vec<Deviations> {
    let of = |(experiment, prediction): (&Experiment, &Prediction)| -> Deviations {
        std::array::from_fn(|signal| {
            let values: Vec<f64> =
                experiment.samples.iter().filter_map(|s| s.values[signal]).collect();
            let errors = residuals(experiment, prediction, signal);
            let square = errors.iter().map(|e| e.1 * e.1).sum::<f64>();
            let left = (square / errors.len().max(1) as f64).sqrt();
            noise(&values).max(FINEST[usize::from(signal > 0)]).max(left)
        })
    };
    experiments.iter().zip(predictions).map(of).collect()
}

/// A difference whose square is Huber's loss, and its slope.
pub(super) fn huber(e: f64) -> (f64, f64) {
    if e.abs() <= ROBUST {
        return (e, 1.0);
    }
    let root = (2.0 * ROBUST * e.abs() - ROBUST * ROBUST).sqrt();
    (root.copysign(e), ROBUST / root)
}
