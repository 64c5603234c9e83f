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
const START_SCALE: [f64; STARTS] = [1e-4, 0.5e5, 0.5e5, 0.5e5, 0.1e5];

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

    /// A log's prediction, and its slopes with the places of what they are along.
    pub(super) fn slopes(
        &self,
        at: &[f64],
        log: usize,
    ) -> Result<(Prediction, Slopes), IdentifyError> {
        let mut directions: Vec<Direction> = self.free.iter().map(|k| Direction::Key(*k)).collect();
        directions.extend((0..STARTS).map(Direction::Start));
        let offsets = self.offsets(at, log);
        let (prediction, slopes) =
            slopes_from(&self.moved(at), &self.experiments[log], &offsets, &directions)?;
        let keys = self.free.len();
        let placed =
            slopes.into_iter().enumerate().map(|(k, mut slope)| match k.checked_sub(keys) {
                None => (k, slope),
                Some(start) => {
                    let scale = START_SCALE[start];
                    slope.iter_mut().for_each(|row| *row = row.map(|v| v * scale));
                    (self.starts(log) + start, slope)
                }
            });
        Ok((prediction, placed.collect()))
    }

    pub(super) fn size(&self) -> usize {
        self.starts(self.experiments.len())
    }
}
