//! Which keys would take a complaint away: a signal, a frequency or a damping that is beyond its limit.

use crate::differences::{differences, free};
use crate::error::IdentifyError;
use crate::experiment::{COMPARED, Experiment};
use crate::free::Free;
use crate::prediction::{Prediction, predict, sensitivities};
use crate::ringing::{Ringing, ringing};
use crate::verdict::{Aspect, Judgement, complaints};
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_measurement::Signal;
use rayon::prelude::*;

/// A change of one key, and what it does to what is complained of.
#[derive(Clone, Debug, PartialEq)]
pub struct Remedy {
    /// What is complained of.
    pub aspect: Aspect,
    /// The key.
    pub path: String,
    /// Share by which it is changed: 0.1 is a tenth more, 2 is three times as much.
    pub change: f64,
    /// Whether it is changed as far as its key allows, or by as much as any key is changed by: more would be better.
    pub at_limit: bool,
    /// RMS difference of the signal \[SI\], the model's frequency \[Hz\] or its damping ratio, before and after, as the model shows it.
    pub found: (f64, f64),
}

/// Remedies of each signal that is complained of.
pub type Remedies = Vec<(Signal, Vec<Remedy>)>;

/// No key is changed by more than this factor.
const MOST: f64 = 10.0;
/// A remedy takes away at least this share of the difference.
const WORTHWHILE: f64 = 0.05;
/// So many keys are looked at for a complaint.
const LOOKED_AT: usize = 4;
/// And told.
const TOLD: usize = 3;
/// How far along the straight step the model is run: a key far off moves a signal by no straight line.
const TRIED: [f64; 5] = [0.4, 0.7, 1.0, 1.5, 2.2];
/// Share of ln θ by which a prediction is moved along its slope, to see how its oscillation changes.
const NUDGE: f64 = 0.003;

/// A complaint, with what was measured of it.
struct Complaint<'a> {
    experiment: &'a Experiment,
    model: &'a Description,
    of: Judgement,
    /// Place of the signal among the compared ones.
    place: usize,
    /// How the log rings.
    log: Option<Ringing>,
    is_free: &'a [bool],
}

/// For each compared signal of which something is beyond its limit, the keys that would take most of that away, each on its own: found by
/// exact slopes, and tried by running the model with the key changed. What a late signal or a drifting clock explains asks for no key.
///
/// # Errors
///
/// [`IdentifyError`] when the model cannot be run.
pub fn remedies(
    model: &Description,
    experiment: &Experiment,
) -> Result<(Prediction, Remedies), IdentifyError> {
    let prediction = predict(model, experiment)?;
    let found = differences(experiment, &prediction);
    let is_free = free(experiment, experiment.interval());
    let mut asked = Vec::new();
    for of in complaints(&found) {
        let place = COMPARED.iter().position(|signal| *signal == of.signal);
        let difference = found.iter().find(|d| d.signal == of.signal);
        let (Some(place), Some(d)) = (place, difference) else { continue };
        let of_time = matches!(of.aspect, Aspect::Position | Aspect::Pressures)
            && (d.is_late() || d.is_of_clock());
        if !of_time {
            let (log, is_free) = (d.ringing, is_free.as_slice());
            asked.push(Complaint { experiment, model, of, place, log, is_free });
        }
    }
    if asked.is_empty() {
        return Ok((prediction, Vec::new()));
    }
    let keys = Free::usual(model);
    let (_, slopes) = sensitivities(model, experiment, &keys)?;
    let mut all: Remedies = Vec::new();
    for complaint in &asked {
        let list = complaint.remedies(&prediction, &keys, &slopes);
        match all.iter_mut().find(|(signal, _)| *signal == complaint.of.signal) {
            Some((_, known)) => known.extend(list),
            None => all.push((complaint.of.signal, list)),
        }
    }
    Ok((prediction, all))
}

impl Complaint<'_> {
    /// What is complained of, as a prediction has it; none where it does not ring.
    fn found(&self, prediction: &Prediction) -> Option<f64> {
        let rings = || {
            let values: Vec<f64> = prediction.iter().map(|row| row[self.place]).collect();
            ringing(&values, self.experiment.interval(), self.is_free)
        };
        match self.of.aspect {
            Aspect::Position | Aspect::Pressures => {
                let pairs = self.experiment.samples.iter().zip(prediction);
                let errors = pairs.filter_map(|(s, p)| Some(s.values[self.place]? - p[self.place]));
                let (count, sum) = errors.fold((0.0, 0.0), |(n, sum), e| (n + 1.0, sum + e * e));
                (count > 0.0).then(|| f64::sqrt(sum / count))
            }
            Aspect::Frequency => rings().filter(|r| r.damping.is_some()).map(|r| r.frequency),
            Aspect::Damping => rings()?.damping,
        }
    }

    /// How far a value is from what the log has.
    fn off(&self, found: f64) -> Option<f64> {
        match self.of.aspect {
            Aspect::Position | Aspect::Pressures => Some(found),
            Aspect::Frequency => Some((found / self.log?.frequency).ln().abs()),
            Aspect::Damping => Some((found - self.log?.damping?).abs()),
        }
    }

    /// Step of ln θ along a straight line, and how much of the complaint it is good for.
    fn step(&self, prediction: &Prediction, slope: &Prediction) -> Option<(f64, f64)> {
        match self.of.aspect {
            Aspect::Position | Aspect::Pressures => {
                let pairs = self.experiment.samples.iter().zip(prediction).zip(slope);
                let (along, square) = pairs.fold((0.0, 0.0), |(along, square), ((s, p), slope)| {
                    let Some(value) = s.values[self.place] else { return (along, square) };
                    let slope = slope[self.place];
                    (along + (value - p[self.place]) * slope, square + slope * slope)
                });
                let step = along / square;
                (square > 0.0 && step.is_finite()).then_some((along * step, step))
            }
            Aspect::Frequency | Aspect::Damping => {
                let moved = |by: f64| {
                    let mut there = prediction.clone();
                    for (row, slope) in there.iter_mut().zip(slope) {
                        row[self.place] += by * slope[self.place];
                    }
                    self.found(&there)
                };
                let change = (moved(NUDGE)? - moved(-NUDGE)?) / (2.0 * NUDGE);
                let log = self.log?;
                let wanted = match self.of.aspect {
                    Aspect::Frequency => log.frequency - self.found(prediction)?,
                    _ => log.damping? - self.found(prediction)?,
                };
                let step = wanted / change;
                // the shorter the step, the more it is that key's
                step.is_finite().then_some((1.0 / step.abs().max(1e-9), step))
            }
        }
    }

    fn remedies(
        &self,
        prediction: &Prediction,
        keys: &[Free],
        slopes: &[Prediction],
    ) -> Vec<Remedy> {
        let Some(before) = self.found(prediction) else { return Vec::new() };
        let steps = keys.iter().zip(slopes).filter_map(|(key, slope)| {
            let (worth, step) = self.step(prediction, slope)?;
            Some((worth, step, *key))
        });
        let mut straight: Vec<(f64, f64, Free)> = steps.collect();
        straight.sort_by(|a, b| b.0.total_cmp(&a.0));
        straight.truncate(LOOKED_AT);
        let tried = |(_, step, key): &(f64, f64, Free)| self.tried(before, *step, *key);
        let mut list: Vec<(f64, Remedy)> = straight.par_iter().filter_map(tried).collect();
        // a key at the end of what is tried is told where nothing else helps
        if list.iter().any(|(_, remedy)| !remedy.at_limit) {
            list.retain(|(_, remedy)| !remedy.at_limit);
        }
        list.sort_by(|a, b| a.0.total_cmp(&b.0));
        list.truncate(TOLD);
        list.into_iter().map(|(_, remedy)| remedy).collect()
    }

    /// A key moved along its step as far as that helps; with how far off it is then. None where that is not worth while.
    fn tried(&self, before: f64, step: f64, key: Free) -> Option<(f64, Remedy)> {
        let value = key.value(self.model);
        let (low, high) = key.bounds();
        let limits = [(low / value).max(1.0 / MOST).ln(), (high / value).min(MOST).ln()];
        let at = |by: f64| {
            let mut numbers = self.model.numbers.to_array();
            numbers[key.place] = value * by.exp();
            let mut there = self.model.clone();
            there.numbers = Numbers::from_array(numbers);
            let found = self.found(&predict(&there, self.experiment).ok()?)?;
            Some((self.off(found)?, by, found))
        };
        let clamped = |by: f64| by.max(limits[0]).min(limits[1]);
        let better = |a: (f64, f64, f64), b: (f64, f64, f64)| if b.0 < a.0 { b } else { a };
        let runs = TRIED.par_iter().filter_map(|share| at(clamped(share * step)));
        let mut best = runs.reduce_with(better)?;
        // on as long as it helps, then half-way back to both sides
        let mut last = TRIED[TRIED.len() - 1] * step;
        while best.1 == clamped(last) && clamped(2.0 * last) != clamped(last) {
            last *= 2.0;
            best = at(clamped(last)).map_or(best, |next| better(best, next));
        }
        for part in [0.75, 1.25, 0.9, 1.1] {
            best = at(clamped(part * best.1)).map_or(best, |next| better(best, next));
        }
        let (off, by, after) = best;
        let is_worthwhile = off < (1.0 - WORTHWHILE) * self.off(before)?;
        let at_limit = by <= limits[0] || limits[1] <= by;
        is_worthwhile.then(|| {
            let (aspect, path, change) = (self.of.aspect, key.path(), by.exp() - 1.0);
            (off, Remedy { aspect, path, change, at_limit, found: (before, after) })
        })
    }
}
