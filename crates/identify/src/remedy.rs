//! Which keys would move a difference.

use crate::error::IdentifyError;
use crate::experiment::{COMPARED, Experiment};
use crate::free::Free;
use crate::prediction::{Prediction, predict, sensitivities};
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_measurement::Signal;
use rayon::prelude::*;

/// A change of one key, and what it does to a signal.
#[derive(Clone, Debug, PartialEq)]
pub struct Remedy {
    /// The key.
    pub path: String,
    /// Share by which it is changed: 0.1 is a tenth more, 2 is three times as much.
    pub change: f64,
    /// RMS difference of the signal before and after \[SI\], as the model shows it.
    pub rms: (f64, f64),
}

/// Remedies of each signal that was measured.
pub type Remedies = Vec<(Signal, Vec<Remedy>)>;

/// No key is changed by more than this factor.
const MOST: f64 = 10.0;
/// A remedy takes away at least this share of the difference.
const WORTHWHILE: f64 = 0.05;
/// So many keys are looked at for a signal.
const LOOKED_AT: usize = 4;
/// And told.
const TOLD: usize = 3;
/// How far along the straight step the model is run: a key far off moves a signal by no straight line.
const TRIED: [f64; 5] = [0.4, 0.7, 1.0, 1.5, 2.2];

/// For each compared signal that was measured, the keys that would take most of its difference away, each on its own: found by
/// exact slopes, and tried by running the model with the key changed.
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
        let count = errors.len() as f64;
        let before = (errors.iter().map(|(_, e)| e * e).sum::<f64>() / count).sqrt();
        // share of the power that the straight step takes away, and the step
        let mut straight: Vec<(f64, f64, Free)> = free
            .iter()
            .zip(&slopes)
            .filter_map(|(key, slope)| {
                let (along, square) = errors.iter().fold((0.0, 0.0), |(a, s), (i, e)| {
                    (a + e * slope[*i][k], s + slope[*i][k].powi(2))
                });
                let step = along / square;
                (square > 0.0 && step.is_finite()).then_some((along * step, step, *key))
            })
            .collect();
        straight.sort_by(|a, b| b.0.total_cmp(&a.0));
        straight.truncate(LOOKED_AT);
        let tried = |(_, step, key): &(f64, f64, Free)| {
            let runs = TRIED.par_iter().filter_map(|share| {
                let value = key.value(model);
                let (low, high) = key.bounds();
                let most = MOST.ln();
                let changed = (value * (share * step).clamp(-most, most).exp()).clamp(low, high);
                let mut numbers = model.numbers.to_array();
                numbers[key.place] = changed;
                let mut there = model.clone();
                there.numbers = Numbers::from_array(numbers);
                let shown = predict(&there, experiment).ok()?;
                let left = |(i, _): &(usize, f64)| {
                    experiment.samples[*i].values[k].map_or(0.0, |v| (v - shown[*i][k]).powi(2))
                };
                let rms = (errors.iter().map(left).sum::<f64>() / count).sqrt();
                Some((rms, changed / value - 1.0))
            });
            let best = runs.min_by(|a, b| a.0.total_cmp(&b.0));
            let (after, change) = best.filter(|(rms, _)| *rms < (1.0 - WORTHWHILE) * before)?;
            Some(Remedy { path: key.path(), change, rms: (before, after) })
        };
        let mut list: Vec<Remedy> = straight.par_iter().filter_map(tried).collect();
        list.sort_by(|a, b| a.rms.1.total_cmp(&b.rms.1));
        list.truncate(TOLD);
        found.push((signal, list));
    }
    Ok((prediction, found))
}
