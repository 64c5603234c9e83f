//! Residuals of log and model, their standard deviations, and Huber's loss.

use crate::experiment::{COMPARED, CRANE, Experiment};
use crate::limits::LIMITS;
use crate::prediction::Prediction;
use crate::whiteness::autocovariance;

/// Smallest standard deviation of a compared signal's residuals: position \[m\], motor speed \[rev/s\],
/// pressures \[Pa\].
fn smallest_deviation(signal: usize) -> f64 {
    match signal {
        0 => 5e-6,
        CRANE => 1e-3,
        _ => 1e3,
    }
}
/// Standard deviation of a signal that is known before any residual: the error of a typical transducer.
fn transducer_deviation(signal: usize) -> f64 {
    match signal {
        0 => LIMITS.least_position,
        CRANE => smallest_deviation(signal),
        _ => LIMITS.least_pressure,
    }
}

/// Tuning constant of Huber's loss, in standard deviations \[-\]: larger residuals count linearly (Huber,
/// Robust estimation of a location parameter, Ann. Math. Stat. 35, 1964, 73-101).
const HUBER_CONSTANT: f64 = 3.0;

/// Sensitivities of a log's predicted signals, each with the index of its parameter.
pub(super) type Sensitivities = Vec<(usize, Prediction)>;

/// Standard deviations of the residuals of a log's signals, in SI units.
pub(super) type Deviations = [f64; COMPARED.len()];

/// Residuals of a signal, log minus model, each with the index of its sample.
pub(super) fn residuals(
    experiment: &Experiment,
    prediction: &Prediction,
    signal: usize,
) -> Vec<(usize, f64)> {
    let pairs = experiment.samples.iter().zip(prediction).enumerate();
    pairs.filter_map(|(i, (s, p))| Some((i, s.values[signal]? - p[signal]))).collect()
}

/// Weighting of a log's residuals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Weighting {
    /// Samples count as independent: far from the minimum, the residuals' correlation is not that of the
    /// minimum.
    Independent,
    /// The same, and no signal has a smaller deviation than its transducer's error.
    Transducers,
    /// Correlated samples count as fewer independent ones; for predictions close to the minimum.
    Correlated,
}

/// Standard deviations of each log's residuals: the larger of sensor noise and RMS residual of each signal.
///
/// With [`Weighting::Correlated`] they are scaled by the root of the correlation time. Otherwise correlated
/// residuals, which are model errors, would outweigh the prior of keys and channels. This is a likelihood
/// adjusted in its magnitude (Pauli, Racugno and Ventura, Bayesian composite marginal likelihoods, Statistica
/// Sinica 21, 2011, 149-164).
pub(super) fn deviations(
    experiments: &[Experiment],
    predictions: &[Prediction],
    weighting: Weighting,
) -> Vec<Deviations> {
    let of = |(experiment, prediction): (&Experiment, &Prediction)| -> Deviations {
        std::array::from_fn(|signal| {
            let errors = residuals(experiment, prediction, signal);
            let square = errors.iter().map(|e| e.1 * e.1).sum::<f64>();
            let rms = (square / errors.len().max(1) as f64).sqrt();
            let deviation = noise_deviation(experiment, signal).max(rms);
            match weighting {
                Weighting::Independent => deviation,
                Weighting::Transducers => deviation.max(transducer_deviation(signal)),
                Weighting::Correlated => {
                    deviation * correlation_time(&on_sample_grid(experiment, &errors)).sqrt()
                }
            }
        })
    };
    experiments.iter().zip(predictions).map(of).collect()
}

/// Standard deviation of a signal's sensor noise, bounded from below.
fn noise_deviation(experiment: &Experiment, signal: usize) -> f64 {
    experiment.noise[signal].max(smallest_deviation(signal))
}

/// Residuals on the grid of all samples of their log; none where nothing was measured.
fn on_sample_grid(experiment: &Experiment, errors: &[(usize, f64)]) -> Vec<Option<f64>> {
    let mut all = vec![None; experiment.samples.len()];
    errors.iter().for_each(|(sample, e)| all[*sample] = Some(*e));
    all
}

/// Whether the residuals of a log show a lack of fit: their power is twice that of the sensor noise, and
/// their correlation time exceeds 0.1 s. The motor speed does not count, because no key of the crane depends
/// on it.
pub(super) fn has_lack_of_fit(experiment: &Experiment, prediction: &Prediction) -> bool {
    (0..CRANE).any(|signal| {
        let errors = residuals(experiment, prediction, signal);
        let square = errors.iter().map(|(_, e)| e * e).sum::<f64>() / errors.len().max(1) as f64;
        let errors = on_sample_grid(experiment, &errors);
        square > 2.0 * noise_deviation(experiment, signal).powi(2)
            && correlation_time(&errors) * experiment.interval() > 0.1
    })
}

/// Integrated autocorrelation time in samples: number of samples with the information of one independent
/// sample, one for white noise.
///
/// The autocorrelations are added until the sum of a pair is no longer positive (initial positive sequence:
/// Geyer, Practical Markov chain Monte Carlo, Stat. Sci. 7, 1992, 473-483). Missing samples keep their place
/// in time and give no products.
fn correlation_time(errors: &[Option<f64>]) -> f64 {
    let (power, _) = autocovariance(errors, 0);
    if power <= 0.0 {
        return 1.0;
    }
    let autocorrelation = |lag: usize| autocovariance(errors, lag).0 / power;
    let pairs = (0..errors.len() / 2).map(|k| autocorrelation(2 * k) + autocorrelation(2 * k + 1));
    let sum: f64 = pairs.take_while(|pair| *pair > 0.0).sum();
    (2.0 * sum - 1.0).max(1.0)
}

/// Signed root of Huber's loss of a scaled residual, twice the usual loss, and its derivative.
pub(super) fn root_huber_loss(e: f64) -> (f64, f64) {
    if e.abs() <= HUBER_CONSTANT {
        return (e, 1.0);
    }
    let root = (2.0 * HUBER_CONSTANT * e.abs() - HUBER_CONSTANT * HUBER_CONSTANT).sqrt();
    (root.copysign(e), HUBER_CONSTANT / root)
}

/// Huber's score function ψ of a scaled residual, and its derivative: beyond the tuning constant it is
/// constant.
pub(super) fn huber_score(e: f64) -> (f64, f64) {
    match e.abs() <= HUBER_CONSTANT {
        true => (e, 1.0),
        false => (HUBER_CONSTANT.copysign(e), 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each value is repeated eight times, so the correlation time is eight samples.
    #[test]
    fn repeated_samples_count_once_and_a_gap_gives_no_products() {
        let course = |k: usize| {
            let x = ((k / 8) as f64 * 12.9898).sin() * 43_758.547;
            2.0 * (x - x.floor()) - 1.0
        };
        let whole: Vec<Option<f64>> = (0..8000).map(|k| Some(course(k))).collect();
        let correlation = correlation_time(&whole);
        assert!((correlation / 8.0 - 1.0).abs() < 0.25, "{correlation}");
        // four fifths of the samples are missing in the middle; the ends of the gap are no neighbours
        let mut gap = whole.clone();
        gap[800..7200].fill(None);
        assert!(
            (correlation_time(&gap) / correlation - 1.0).abs() < 0.25,
            "{}",
            correlation_time(&gap)
        );
    }
}
