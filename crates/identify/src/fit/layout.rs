//! What is moved, and what the model shows there.

use super::nuisance::{Effect, Nuisance, all_delayed, delayed};
use super::residual::Slopes;
use crate::error::IdentifyError;
use crate::experiment::{COMPARED, CRANE, Experiment};
use crate::free::Free;
use crate::prediction::{Direction, INITIAL_VALUES, Prediction, predict_from, sensitivities_from};
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use rayon::prelude::*;

/// What sensors err by at the start of a log, and so the units in which its starts are moved: stroke \[m\], pressures \[Pa\].
const START_SCALE: [f64; INITIAL_VALUES] = [1e-4, 0.5e5, 0.5e5, 0.5e5, 0.1e5, 0.5e5];

/// Numbers of each log that are moved beside the keys.
pub(super) const PER_LOG: usize = INITIAL_VALUES + Nuisance::COUNT;

/// What is moved: ln θ of the keys, then for each log its starts, and delays and offsets of its channels in units of what is known of
/// them.
#[derive(Clone, Copy)]
pub(super) struct Layout<'a> {
    pub(super) model: &'a Description,
    pub(super) experiments: &'a [Experiment],
    pub(super) free: &'a [Free],
    /// Delays and offsets that stay zero.
    pub(super) fixed: &'a [Nuisance],
}

impl Layout<'_> {
    /// The model with its keys moved.
    pub(super) fn moved(&self, at: &[f64]) -> Description {
        let mut numbers = self.model.numbers.to_array();
        for (key, ln) in self.free.iter().zip(at) {
            let (low, high) = key.bounds();
            numbers[key.place] = ln.exp().clamp(low, high);
        }
        let mut moved = self.model.clone();
        moved.numbers = Numbers::from_array(numbers);
        moved
    }

    /// Place of a log's first start.
    pub(super) fn starts(&self, log: usize) -> usize {
        self.free.len() + PER_LOG * log
    }

    pub(super) fn size(&self) -> usize {
        self.starts(self.experiments.len())
    }

    /// Delays and offsets of a log's channels that are moved, each with its place: of those that were measured.
    pub(super) fn nuisances(&self, log: usize) -> impl Iterator<Item = (usize, Nuisance)> {
        let from = self.starts(log) + INITIAL_VALUES;
        let experiment = &self.experiments[log];
        (0..Nuisance::COUNT).map(move |k| (from + k, Nuisance::at(k))).filter(|(_, nuisance)| {
            !self.fixed.contains(nuisance) && experiment.is_measured(nuisance.signal)
        })
    }

    /// Delays \[s\] and offsets \[SI\] of a log's channels.
    fn channels(&self, at: &[f64], log: usize) -> [[f64; COMPARED.len()]; 2] {
        let from = self.starts(log) + INITIAL_VALUES;
        let of = |place: usize| {
            let allowed = Nuisance::at(place).allowed();
            at[from + place] * allowed.deviation * allowed.size
        };
        // the motor's speed has none
        [0, CRANE].map(|first| std::array::from_fn(|k| if k < CRANE { of(first + k) } else { 0.0 }))
    }

    /// What is added to a log's starts: what they are moved by, less what the reading they were taken from is off by.
    fn offsets(&self, at: &[f64], log: usize) -> [f64; INITIAL_VALUES] {
        let (from, [_, offsets]) = (self.starts(log), self.channels(at, log));
        let channel = self.experiments[log].initial_channels();
        std::array::from_fn(|k| {
            at[from + k] * START_SCALE[k] - channel[k].map_or(0.0, |c| offsets[c])
        })
    }

    /// Keeps keys within what a crane file allows, delays and offsets within what is allowed of them.
    pub(super) fn within_bounds(&self, at: &mut [f64]) {
        for (z, key) in at.iter_mut().zip(self.free) {
            let (low, high) = key.bounds();
            *z = z.clamp(low.max(1e-300).ln(), high.ln());
        }
        for log in 0..self.experiments.len() {
            for (place, nuisance) in self.nuisances(log) {
                let allowed = nuisance.allowed();
                let [low, high] = allowed.range.map(|v| v / allowed.deviation);
                at[place] = at[place].clamp(low, high);
            }
        }
    }

    /// A prediction as the channels of a log show it: late, and off.
    fn shown(&self, at: &[f64], log: usize, mut prediction: Prediction) -> Prediction {
        let [delays, offsets] = self.channels(at, log);
        all_delayed(&mut prediction, &delays, self.experiments[log].interval());
        for row in &mut prediction {
            row.iter_mut().zip(offsets).for_each(|(v, offset)| *v += offset);
        }
        prediction
    }

    pub(super) fn predictions(&self, at: &[f64]) -> Result<Vec<Prediction>, IdentifyError> {
        let model = self.moved(at);
        let logs = self.experiments.par_iter().enumerate();
        logs.map(|(log, experiment)| {
            let prediction = predict_from(&model, experiment, &self.offsets(at, log))?;
            Ok(self.shown(at, log, prediction))
        })
        .collect()
    }

    /// A log's prediction, and its slopes with the places of what they are along. Slopes along its starts are taken
    /// from `kept` where that has them: starts are moved by little, and what they do hardly changes.
    fn slopes(
        &self,
        at: &[f64],
        log: usize,
        kept: &mut Option<Slopes>,
    ) -> Result<(Prediction, Slopes), IdentifyError> {
        let experiment = &self.experiments[log];
        let (keys, from) = (self.free.len(), self.starts(log));
        let mut along: Vec<Direction> = self.free.iter().map(|key| Direction::Key(*key)).collect();
        let measured: Vec<usize> =
            (0..INITIAL_VALUES).filter(|k| experiment.initial_values[*k].is_some()).collect();
        if kept.is_none() {
            along.extend(measured.iter().map(|k| Direction::InitialValue(*k)));
        }
        let (prediction, mut slopes) =
            sensitivities_from(&self.moved(at), experiment, &self.offsets(at, log), &along)?;
        let starts = slopes.split_off(keys);
        let starts = kept.get_or_insert_with(|| measured.into_iter().zip(starts).collect());
        let mut placed: Slopes = slopes.into_iter().enumerate().collect();
        placed.extend(starts.iter().map(|(k, slope)| {
            let scaled = |row: &[f64; COMPARED.len()]| row.map(|v| v * START_SCALE[*k]);
            (from + k, slope.iter().map(scaled).collect())
        }));
        // what a reading is off by, its start is off by too
        let channels = experiment.initial_channels();
        let nuisances: Vec<(usize, Nuisance)> = self.nuisances(log).collect();
        let offsets = nuisances.iter().filter(|(_, n)| n.effect == Effect::Offset);
        placed.extend(offsets.map(|(place, nuisance)| {
            let scale = nuisance.allowed().deviation * nuisance.allowed().size;
            let own = COMPARED.iter().position(|s| *s == nuisance.signal);
            let start = starts.iter().find(|(k, _)| channels[*k].is_some() && channels[*k] == own);
            let slope = match start {
                Some((_, slope)) => slope.iter().map(|row| row.map(|v| -v * scale)).collect(),
                None => vec![[0.0; COMPARED.len()]; prediction.len()],
            };
            (*place, slope)
        }));
        let ([delays, _], interval) = (self.channels(at, log), experiment.interval());
        for (_, slope) in &mut placed {
            all_delayed(slope, &delays, interval);
        }
        for (place, nuisance) in nuisances {
            let scale = nuisance.allowed().deviation * nuisance.allowed().size;
            let Some(own) = COMPARED.iter().position(|s| *s == nuisance.signal) else { continue };
            match nuisance.effect {
                // the reading itself is off at once
                Effect::Offset => {
                    let found = placed.iter_mut().find(|(other, _)| *other == place);
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
                    placed.push((place, along.map(row).collect()));
                }
            }
        }
        Ok((self.shown(at, log, prediction), placed))
    }

    /// Slopes of a log's channels along keys that are not moved.
    pub(super) fn slopes_along(
        &self,
        at: &[f64],
        log: usize,
        keys: &[Free],
    ) -> Result<Slopes, IdentifyError> {
        let experiment = &self.experiments[log];
        let along: Vec<Direction> = keys.iter().map(|key| Direction::Key(*key)).collect();
        let (_, mut slopes) =
            sensitivities_from(&self.moved(at), experiment, &self.offsets(at, log), &along)?;
        let ([delays, _], interval) = (self.channels(at, log), experiment.interval());
        for slope in &mut slopes {
            all_delayed(slope, &delays, interval);
        }
        Ok(slopes.into_iter().enumerate().collect())
    }

    /// Predictions and slopes of several logs at once. What is kept of their starts grows by those that were not known yet.
    pub(super) fn all_slopes(
        &self,
        at: &[f64],
        logs: &[usize],
        kept: &mut [Option<Slopes>],
    ) -> Result<Vec<(Prediction, Slopes)>, IdentifyError> {
        let mut known: Vec<(usize, Option<Slopes>)> =
            logs.iter().map(|log| (*log, kept[*log].take())).collect();
        let found = known.par_iter_mut().map(|(log, kept)| self.slopes(at, *log, kept)).collect();
        for (log, starts) in known {
            kept[log] = starts;
        }
        found
    }
}
