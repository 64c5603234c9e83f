//! Layout of the parameter vector, and the model's prediction and sensitivities as functions of it.

use super::nuisance::{Effect, Nuisance, all_delayed, delayed};
use super::residual::Sensitivities;
use crate::error::IdentifyError;
use crate::experiment::{COMPARED, CRANE, Experiment};
use crate::free::Free;
use crate::prediction::{Direction, INITIAL_VALUES, Prediction, predict_from, sensitivities_from};
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use rayon::prelude::*;

/// Prior standard deviations of a log's initial values, from the sensors' errors: stroke \[m\], pressures
/// \[Pa\]. The parameters are in these units.
const INITIAL_VALUE_SCALE: [f64; INITIAL_VALUES] = [1e-4, 0.5e5, 0.5e5, 0.5e5, 0.1e5, 0.5e5];

/// Number of parameters of each log.
pub(super) const PARAMETERS_PER_LOG: usize = INITIAL_VALUES + Nuisance::COUNT;

/// Layout of the parameter vector: ln θ of the keys, then the parameters of each log. These are its initial
/// values, then the delays and offsets of its channels, all in units of their prior standard deviations.
#[derive(Clone, Copy)]
pub(super) struct Layout<'a> {
    pub(super) model: &'a Description,
    pub(super) experiments: &'a [Experiment],
    pub(super) free: &'a [Free],
    /// Delays and offsets that are fixed at zero.
    pub(super) fixed: &'a [Nuisance],
}

impl Layout<'_> {
    /// The model with the values of the free keys, within their bounds.
    pub(super) fn description(&self, parameters: &[f64]) -> Description {
        let mut numbers = self.model.numbers.to_array();
        for (key, ln) in self.free.iter().zip(parameters) {
            let (low, high) = key.bounds();
            numbers[key.place] = ln.exp().clamp(low, high);
        }
        let mut description = self.model.clone();
        description.numbers = Numbers::from_array(numbers);
        description
    }

    /// Index of a log's first initial value.
    pub(super) fn first_initial_value(&self, log: usize) -> usize {
        self.free.len() + PARAMETERS_PER_LOG * log
    }

    /// Length of the parameter vector.
    pub(super) fn size(&self) -> usize {
        self.first_initial_value(self.experiments.len())
    }

    /// Free delays and offsets of a log's measured channels, each with the index of its parameter.
    pub(super) fn nuisances(&self, log: usize) -> impl Iterator<Item = (usize, Nuisance)> {
        let from = self.first_initial_value(log) + INITIAL_VALUES;
        let experiment = &self.experiments[log];
        (0..Nuisance::COUNT).map(move |k| (from + k, Nuisance::at_index(k))).filter(
            |(_, nuisance)| {
                !self.fixed.contains(nuisance) && experiment.is_measured(nuisance.signal)
            },
        )
    }

    /// Delays \[s\] and offsets \[SI\] of a log's channels.
    fn delays_and_offsets(&self, parameters: &[f64], log: usize) -> [[f64; COMPARED.len()]; 2] {
        let from = self.first_initial_value(log) + INITIAL_VALUES;
        let of = |index: usize| {
            let allowed = Nuisance::at_index(index).allowed();
            parameters[from + index] * allowed.deviation * allowed.size
        };
        // the motor speed has none
        [0, CRANE].map(|first| std::array::from_fn(|k| if k < CRANE { of(first + k) } else { 0.0 }))
    }

    /// Corrections of a log's initial values \[SI\]: their parameters minus the offsets of the channels they
    /// were taken from.
    fn initial_offsets(&self, parameters: &[f64], log: usize) -> [f64; INITIAL_VALUES] {
        let (from, [_, offsets]) =
            (self.first_initial_value(log), self.delays_and_offsets(parameters, log));
        let channel = self.experiments[log].initial_channels();
        std::array::from_fn(|k| {
            parameters[from + k] * INITIAL_VALUE_SCALE[k] - channel[k].map_or(0.0, |c| offsets[c])
        })
    }

    /// Limits keys to the bounds of a crane file, and delays and offsets to their ranges.
    pub(super) fn clamp_to_bounds(&self, parameters: &mut [f64]) {
        for (z, key) in parameters.iter_mut().zip(self.free) {
            let (low, high) = key.bounds();
            *z = z.clamp(low.max(1e-300).ln(), high.ln());
        }
        for log in 0..self.experiments.len() {
            for (index, nuisance) in self.nuisances(log) {
                let allowed = nuisance.allowed();
                let [low, high] = allowed.range.map(|v| v / allowed.deviation);
                parameters[index] = parameters[index].clamp(low, high);
            }
        }
    }

    /// Prediction with the delays and offsets of a log's channels.
    fn through_channels(
        &self,
        parameters: &[f64],
        log: usize,
        mut prediction: Prediction,
    ) -> Prediction {
        let [delays, offsets] = self.delays_and_offsets(parameters, log);
        all_delayed(&mut prediction, &delays, self.experiments[log].interval());
        for row in &mut prediction {
            row.iter_mut().zip(offsets).for_each(|(v, offset)| *v += offset);
        }
        prediction
    }

    /// Prediction of each log.
    ///
    /// # Errors
    ///
    /// [`IdentifyError`] if a simulation fails.
    pub(super) fn predictions(&self, parameters: &[f64]) -> Result<Vec<Prediction>, IdentifyError> {
        let model = self.description(parameters);
        let logs = self.experiments.par_iter().enumerate();
        logs.map(|(log, experiment)| {
            let prediction =
                predict_from(&model, experiment, &self.initial_offsets(parameters, log))?;
            Ok(self.through_channels(parameters, log, prediction))
        })
        .collect()
    }

    /// Prediction and sensitivities of a log. Sensitivities to its initial values are computed if `cached` is
    /// empty: those values change little, and so do the sensitivities.
    fn sensitivities(
        &self,
        parameters: &[f64],
        log: usize,
        cached: &mut Option<Sensitivities>,
    ) -> Result<(Prediction, Sensitivities), IdentifyError> {
        let experiment = &self.experiments[log];
        let (keys, from) = (self.free.len(), self.first_initial_value(log));
        let mut along: Vec<Direction> = self.free.iter().map(|key| Direction::Key(*key)).collect();
        let measured: Vec<usize> =
            (0..INITIAL_VALUES).filter(|k| experiment.initial_values[*k].is_some()).collect();
        if cached.is_none() {
            along.extend(measured.iter().map(|k| Direction::InitialValue(*k)));
        }
        let (prediction, mut sensitivities) = sensitivities_from(
            &self.description(parameters),
            experiment,
            &self.initial_offsets(parameters, log),
            &along,
        )?;
        let initial = sensitivities.split_off(keys);
        let initial = cached.get_or_insert_with(|| measured.into_iter().zip(initial).collect());
        let mut indexed: Sensitivities = sensitivities.into_iter().enumerate().collect();
        indexed.extend(initial.iter().map(|(k, slope)| {
            let scaled = |row: &[f64; COMPARED.len()]| row.map(|v| v * INITIAL_VALUE_SCALE[*k]);
            (from + k, slope.iter().map(scaled).collect())
        }));
        // a channel's offset shifts the initial value taken from it
        let channels = experiment.initial_channels();
        let nuisances: Vec<(usize, Nuisance)> = self.nuisances(log).collect();
        let offsets = nuisances.iter().filter(|(_, n)| n.effect == Effect::Offset);
        indexed.extend(offsets.map(|(index, nuisance)| {
            let scale = nuisance.allowed().deviation * nuisance.allowed().size;
            let own = COMPARED.iter().position(|s| *s == nuisance.signal);
            let start = initial.iter().find(|(k, _)| channels[*k].is_some() && channels[*k] == own);
            let slope = match start {
                Some((_, slope)) => slope.iter().map(|row| row.map(|v| -v * scale)).collect(),
                None => vec![[0.0; COMPARED.len()]; prediction.len()],
            };
            (*index, slope)
        }));
        let ([delays, _], interval) =
            (self.delays_and_offsets(parameters, log), experiment.interval());
        for (_, slope) in &mut indexed {
            all_delayed(slope, &delays, interval);
        }
        for (index, nuisance) in nuisances {
            let scale = nuisance.allowed().deviation * nuisance.allowed().size;
            let Some(own) = COMPARED.iter().position(|s| *s == nuisance.signal) else { continue };
            match nuisance.effect {
                // the offset's direct effect, without delay
                Effect::Offset => {
                    let found = indexed.iter_mut().find(|(other, _)| *other == index);
                    for row in found.into_iter().flat_map(|(_, slope)| slope) {
                        row[own] += scale;
                    }
                }
                Effect::Delay => {
                    let course: Vec<f64> = prediction.iter().map(|row| row[own]).collect();
                    let along = delayed(&course, delays[own], interval).1.into_iter();
                    let row = |slope: f64| {
                        let mut row = [0.0; COMPARED.len()];
                        row[own] = slope * scale;
                        row
                    };
                    indexed.push((index, along.map(row).collect()));
                }
            }
        }
        Ok((self.through_channels(parameters, log, prediction), indexed))
    }

    /// Sensitivities of a log's channels to fixed keys, indexed by their place among `keys`.
    pub(super) fn key_sensitivities(
        &self,
        parameters: &[f64],
        log: usize,
        keys: &[Free],
    ) -> Result<Sensitivities, IdentifyError> {
        let experiment = &self.experiments[log];
        let along: Vec<Direction> = keys.iter().map(|key| Direction::Key(*key)).collect();
        let (_, mut sensitivities) = sensitivities_from(
            &self.description(parameters),
            experiment,
            &self.initial_offsets(parameters, log),
            &along,
        )?;
        let ([delays, _], interval) =
            (self.delays_and_offsets(parameters, log), experiment.interval());
        for slope in &mut sensitivities {
            all_delayed(slope, &delays, interval);
        }
        Ok(sensitivities.into_iter().enumerate().collect())
    }

    /// Predictions and sensitivities of several logs in parallel. Sensitivities to initial values are added
    /// to `cached`.
    pub(super) fn all_sensitivities(
        &self,
        parameters: &[f64],
        logs: &[usize],
        cached: &mut [Option<Sensitivities>],
    ) -> Result<Vec<(Prediction, Sensitivities)>, IdentifyError> {
        let mut caches: Vec<(usize, Option<Sensitivities>)> =
            logs.iter().map(|log| (*log, cached[*log].take())).collect();
        let found = caches
            .par_iter_mut()
            .map(|(log, cached)| self.sensitivities(parameters, *log, cached))
            .collect();
        for (log, initial) in caches {
            cached[log] = initial;
        }
        found
    }
}
