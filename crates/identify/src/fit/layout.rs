//! What is moved, and what the model shows there.

use super::residual::Slopes;
use crate::error::IdentifyError;
use crate::experiment::Experiment;
use crate::free::Free;
use crate::prediction::{Direction, Prediction, STARTS, predict_from, slopes_from};
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use rayon::prelude::*;

/// What sensors err by at the start of a log, and so the units in which its starts are moved: stroke \[m\], pressures \[Pa\].
const START_SCALE: [f64; STARTS] = [1e-4, 0.5e5, 0.5e5, 0.5e5, 0.1e5, 0.5e5];

/// What is moved: ln θ of the keys, then for each log its starts.
#[derive(Clone, Copy)]
pub(super) struct Layout<'a> {
    pub(super) model: &'a Description,
    pub(super) experiments: &'a [Experiment],
    pub(super) free: &'a [Free],
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
        self.free.len() + STARTS * log
    }

    pub(super) fn offsets(&self, at: &[f64], log: usize) -> [f64; STARTS] {
        let from = self.starts(log);
        std::array::from_fn(|k| at[from + k] * START_SCALE[k])
    }

    pub(super) fn predictions(&self, at: &[f64]) -> Result<Vec<Prediction>, IdentifyError> {
        let model = self.moved(at);
        let logs = self.experiments.par_iter().enumerate();
        logs.map(|(k, experiment)| predict_from(&model, experiment, &self.offsets(at, k))).collect()
    }

    /// A log's prediction, and its slopes with the places of what they are along. Slopes along its starts are taken
    /// from `kept` where that has them: starts are moved by little, and what they do hardly changes.
    pub(super) fn slopes(
        &self,
        at: &[f64],
        log: usize,
        kept: Option<&Slopes>,
    ) -> Result<(Prediction, Slopes), IdentifyError> {
        let experiment = &self.experiments[log];
        let mut directions: Vec<(usize, Direction)> =
            self.free.iter().map(|key| Direction::Key(*key)).enumerate().collect();
        if kept.is_none() {
            let measured = (0..STARTS).filter(|k| experiment.beginning[*k].is_some());
            directions.extend(measured.map(|k| (self.starts(log) + k, Direction::Start(k))));
        }
        let along: Vec<Direction> = directions.iter().map(|(_, direction)| *direction).collect();
        let offsets = self.offsets(at, log);
        let (prediction, slopes) = slopes_from(&self.moved(at), experiment, &offsets, &along)?;
        let placed = directions.iter().zip(slopes).map(|((place, direction), mut slope)| {
            if let Direction::Start(start) = direction {
                let scale = START_SCALE[*start];
                slope.iter_mut().for_each(|row| *row = row.map(|v| v * scale));
            }
            (*place, slope)
        });
        let mut slopes: Slopes = placed.collect();
        slopes.extend(kept.into_iter().flatten().cloned());
        Ok((prediction, slopes))
    }

    /// The same of several logs at once. What is kept of their starts grows by those that were not known yet.
    pub(super) fn all_slopes(
        &self,
        at: &[f64],
        logs: &[usize],
        kept: &mut [Option<Slopes>],
    ) -> Result<Vec<(Prediction, Slopes)>, IdentifyError> {
        let known: &[Option<Slopes>] = kept;
        let found: Result<Vec<_>, IdentifyError> =
            logs.par_iter().map(|log| self.slopes(at, *log, known[*log].as_ref())).collect();
        let found = found?;
        for (log, (_, slopes)) in logs.iter().zip(&found) {
            kept[*log].get_or_insert_with(|| {
                slopes.iter().filter(|(place, _)| *place >= self.free.len()).cloned().collect()
            });
        }
        Ok(found)
    }

    pub(super) fn size(&self) -> usize {
        self.starts(self.experiments.len())
    }
}
