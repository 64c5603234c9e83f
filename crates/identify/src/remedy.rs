//! Which keys would move a difference.

use crate::error::IdentifyError;
use crate::experiment::{COMPARED, Experiment};
use crate::free::Free;
use crate::prediction::{Prediction, sensitivities};
use hydroboom_description::Description;
use hydroboom_measurement::Signal;

/// A change of one key, and what it would do to a signal.
#[derive(Clone, Debug, PartialEq)]
pub struct Remedy {
    /// The key.
    pub path: String,
    /// Share by which it would be changed: 0.1 is a tenth more.
    pub change: f64,
    /// RMS difference of the signal before and after \[SI\], to first order.
    pub rms: (f64, f64),
}

/// Remedies of each signal that was measured.
pub type Remedies = Vec<(Signal, Vec<Remedy>)>;

/// No key is changed by more than this factor: to first order more means nothing.
const MOST: f64 = 1.5;
/// A remedy takes away at least this share of the difference.
const WORTHWHILE: f64 = 0.05;

/// For each compared signal that was measured, the keys that would take most of its difference away, each on its own;
/// exact slopes, one straight step.
///
/// # Errors
///
/// [`IdentifyError`] when the model cannot be run.
pub fn remedies(
    model: &Description,
    experiment: &Experiment,
) -> Result<(Prediction, Remedies), IdentifyError> {
    let free = Free::usual(model);
    let (prediction, slopes) = sensitivities(model, experiment, &free)?;
    let mut found = Vec::new();
    for (k, signal) in COMPARED.into_iter().enumerate() {
        let errors: Vec<(usize, f64)> = experiment
            .samples
            .iter()
            .zip(&prediction)
            .enumerate()
            .filter_map(|(i, (sample, model))| Some((i, sample.values[k]? - model[k])))
            .collect();
        if errors.len() < 20 {
            continue;
        }
        let rms = |change: f64, slope: &Prediction| {
            let sum: f64 = errors.iter().map(|(i, e)| (e - change * slope[*i][k]).powi(2)).sum();
            (sum / errors.len() as f64).sqrt()
        };
        let mut list: Vec<Remedy> = free
            .iter()
            .zip(&slopes)
            .filter_map(|(key, slope)| {
                let (along, square) = errors.iter().fold((0.0, 0.0), |(a, s), (i, e)| {
                    (a + e * slope[*i][k], s + slope[*i][k].powi(2))
                });
                let change = (along / square).clamp(-MOST.ln(), MOST.ln());
                let after = rms(change, slope);
                let before = rms(0.0, slope);
                let is_worthwhile = square > 0.0 && after < (1.0 - WORTHWHILE) * before;
                is_worthwhile.then(|| Remedy {
                    path: key.path(),
                    change: change.exp() - 1.0,
                    rms: (before, after),
                })
            })
            .collect();
        list.sort_by(|a, b| a.rms.1.total_cmp(&b.rms.1));
        list.truncate(3);
        found.push((signal, list));
    }
    Ok((prediction, found))
}
