//! Keys that would bring a model closer to a log, judged over all signals together. A change that improves
//! one signal and worsens another is not proposed.

use crate::differences::{Differences, differences, free};
use crate::error::IdentifyError;
use crate::experiment::{COMPARED, Experiment};
use crate::free::Free;
use crate::limits::LIMITS;
use crate::prediction::{Prediction, predict, sensitivities};
use crate::ringing::{Ringing, ringing};
use crate::verdict::{Aspect, Judgement, judged};
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_measurement::Signal;
use rayon::prelude::*;

/// Proposed change of one key, and its effect on position, pressures, frequency and damping.
#[derive(Clone, Debug, PartialEq)]
pub struct Remedy {
    /// Path `section.name` of the changed key.
    pub path: String,
    /// Relative change of the key \[-\]: 0.1 is an increase by 10 %.
    pub change: f64,
    /// Whether the change is limited by the key's bounds or by the largest factor tried, so that more would
    /// improve further.
    pub at_limit: bool,
    /// Geometric mean of √(1 + (found/limit)²) of all judged quantities, before and after \[-\]: 1 without
    /// differences, √2 with all at their limits.
    pub misfit: (f64, f64),
    /// Effect on each quantity that is beyond its limit before or after the change.
    pub moved: Vec<Moved>,
}

/// Effect of a changed key on one judged quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moved {
    /// Judged quantity.
    pub aspect: Aspect,
    /// Signal in which it is judged.
    pub signal: Signal,
    /// RMS difference in the signal's SI unit, or the model's frequency \[Hz\] or damping ratio \[-\], before and
    /// after.
    pub found: (f64, f64),
    /// Frequency \[Hz\] or damping ratio \[-\] of the log; zero for an RMS difference.
    pub wanted: f64,
}

/// Proposed changes, best first.
pub type Remedies = Vec<Remedy>;

/// Number of candidate keys for the differences, and for each frequency and damping.
const CANDIDATES: usize = 5;
const CANDIDATES_FOR_OSCILLATION: usize = 2;
/// Largest number of proposals.
const MOST_PROPOSALS: usize = 3;
/// Multiples of the linear step at which the model is run, because a large change is nonlinear.
const STEP_FACTORS: [f64; 5] = [0.4, 0.7, 1.0, 1.5, 2.2];
/// Factors of the refinement about the best of them.
const REFINEMENT_FACTORS: [f64; 4] = [0.75, 1.25, 0.9, 1.1];
/// Change of ln θ for the numerical derivative of an oscillation's frequency and damping.
const DIFFERENCE_STEP: f64 = 0.003;

/// Keys that would most decrease the sum of ½ ln(1 + (found/limit)²) over all judged quantities, each
/// changed alone. Candidates follow from exact derivatives and are tested by model runs. Delayed signals
/// and clock drifts are not used; sensor faults are removed from the log before, by
/// [`isolate`](crate::isolate).
///
/// # Errors
///
/// As [`predict`](crate::predict), if the model cannot be run.
pub fn remedies(
    model: &Description,
    experiment: &Experiment,
) -> Result<(Prediction, Remedies), IdentifyError> {
    let prediction = predict(model, experiment)?;
    let found = differences(experiment, &prediction);
    let is_free = free(experiment, experiment.interval());
    let quantities = judged_quantities(&found);
    let all = JudgedQuantities { experiment, model, is_free: &is_free, quantities };
    if all.quantities.iter().all(|quantity| quantity.judgement.is_right()) {
        return Ok((prediction, Vec::new()));
    }
    let keys = Free::usual(model);
    let (_, slopes) = sensitivities(model, experiment, &keys)?;
    let list = all.remedies(&prediction, &keys, &slopes);
    Ok((prediction, list))
}

/// Judged quantity that keys may affect.
struct JudgedQuantity {
    judgement: Judgement,
    /// Index of the signal among the compared ones.
    place: usize,
    /// Oscillation of the log.
    log: Option<Ringing>,
}

/// Judged quantities except those that no key can explain.
fn judged_quantities(found: &Differences) -> Vec<JudgedQuantity> {
    let of = |judgement: Judgement| {
        let place = COMPARED.iter().position(|signal| *signal == judgement.signal)?;
        let d = found.iter().find(|d| d.signal == judgement.signal)?;
        let is_size = matches!(judgement.aspect, Aspect::Position | Aspect::Pressures);
        let is_other = d.is_late() || d.is_of_clock();
        (!(is_size && is_other)).then_some(JudgedQuantity { judgement, place, log: d.ringing })
    };
    judged(found).into_iter().filter_map(of).collect()
}

/// All judged quantities of one log.
struct JudgedQuantities<'a> {
    experiment: &'a Experiment,
    model: &'a Description,
    is_free: &'a [bool],
    quantities: Vec<JudgedQuantity>,
}

/// Value of each quantity for a prediction, with its deviation over its limit.
type Values = Vec<Option<(f64, f64)>>;

/// Tested change of a key: sum over all quantities, step of ln θ, values.
type Trial = (f64, f64, Values);

impl JudgedQuantities<'_> {
    fn values(&self, prediction: &Prediction) -> Values {
        self.quantities.iter().map(|quantity| self.value_over_limit(quantity, prediction)).collect()
    }

    fn value_over_limit(
        &self,
        quantity: &JudgedQuantity,
        prediction: &Prediction,
    ) -> Option<(f64, f64)> {
        let value = self.value(quantity, prediction)?;
        let off = match quantity.judgement.aspect {
            Aspect::Position | Aspect::Pressures => value,
            Aspect::Frequency => value / quantity.log?.frequency - 1.0,
            Aspect::Damping => {
                let own = quantity.log?.damping?;
                (value - own) / own.abs().max(1e-9)
            }
        };
        Some((value, off.abs() / quantity.judgement.limit))
    }

    /// RMS difference, or the model's frequency or damping ratio; none if its oscillation is not
    /// identifiable.
    fn value(&self, quantity: &JudgedQuantity, prediction: &Prediction) -> Option<f64> {
        let rings = || {
            let values: Vec<f64> = prediction.iter().map(|row| row[quantity.place]).collect();
            ringing(&values, self.experiment.interval(), self.is_free)
        };
        match quantity.judgement.aspect {
            Aspect::Position | Aspect::Pressures => {
                let pairs = self.experiment.samples.iter().zip(prediction);
                let errors =
                    pairs.filter_map(|(s, p)| Some(s.values[quantity.place]? - p[quantity.place]));
                let (count, sum) = errors.fold((0.0, 0.0), |(n, sum), e| (n + 1.0, sum + e * e));
                (count > 0.0).then(|| f64::sqrt(sum / count))
            }
            Aspect::Frequency => {
                rings().filter(Ringing::has_reliable_frequency).map(|r| r.frequency)
            }
            Aspect::Damping => rings()?.damping,
        }
    }

    /// Sum of ln(1 + square)/2 over all judged quantities, where the square is that of the deviation over
    /// its limit. It is logarithmic for large deviations, so that all have equal weight, and quadratic for
    /// small ones. A quantity that is no longer identifiable counts as before.
    fn cost(&self, found: &Values, before: &Values) -> f64 {
        let of = found.iter().zip(before).filter_map(|(found, before)| found.or(*before));
        of.map(|(_, over)| 0.5 * (1.0 + over * over).ln()).sum()
    }

    /// The sum as a factor: geometric mean over all quantities.
    fn misfit(&self, sum: f64) -> f64 {
        (sum / self.quantities.len().max(1) as f64).exp()
    }

    /// Linear step of ln θ that minimises the scaled differences of all signals, and the share of them that
    /// it removes.
    fn step(
        &self,
        prediction: &Prediction,
        slope: &Prediction,
        found: &Values,
    ) -> Option<(f64, f64)> {
        let (mut along, mut square) = (0.0, 0.0);
        for (quantity, found) in self.quantities.iter().zip(found) {
            let Some((rms, _)) = found else { continue };
            let is_size = matches!(quantity.judgement.aspect, Aspect::Position | Aspect::Pressures);
            if !is_size || quantity.judgement.is_right() {
                continue;
            }
            let weight = 1.0 / (rms * rms).max(f64::MIN_POSITIVE);
            let place = quantity.place;
            for ((s, p), slope) in self.experiment.samples.iter().zip(prediction).zip(slope) {
                let Some(value) = s.values[place] else { continue };
                along += weight * (value - p[place]) * slope[place];
                square += weight * slope[place] * slope[place];
            }
        }
        let step = along / square;
        (square > 0.0 && step.is_finite()).then_some((along * step, step))
    }

    /// The same for a frequency or damping; a shorter step indicates a more specific key.
    fn step_of_ringing(
        &self,
        quantity: &JudgedQuantity,
        prediction: &Prediction,
        slope: &Prediction,
    ) -> Option<(f64, f64)> {
        let moved = |by: f64| {
            let mut there = prediction.clone();
            for (row, slope) in there.iter_mut().zip(slope) {
                row[quantity.place] += by * slope[quantity.place];
            }
            self.value(quantity, &there)
        };
        let change = (moved(DIFFERENCE_STEP)? - moved(-DIFFERENCE_STEP)?) / (2.0 * DIFFERENCE_STEP);
        let wanted = match quantity.judgement.aspect {
            Aspect::Frequency => quantity.log?.frequency,
            _ => quantity.log?.damping?,
        };
        let step = (wanted - self.value(quantity, prediction)?) / change;
        step.is_finite().then_some((1.0 / step.abs().max(1e-9), step))
    }

    fn remedies(&self, prediction: &Prediction, keys: &[Free], slopes: &[Prediction]) -> Remedies {
        let before = self.values(prediction);
        let best_of = |step: &(dyn Fn(&Prediction) -> Option<(f64, f64)> + '_), count: usize| {
            let steps = keys.iter().zip(slopes).filter_map(|(key, slope)| {
                let (rank, step) = step(slope)?;
                Some((rank, step, *key))
            });
            let mut linear: Vec<(f64, f64, Free)> = steps.collect();
            linear.sort_by(|a, b| b.0.total_cmp(&a.0));
            linear.truncate(count);
            linear
        };
        let mut linear = best_of(&|slope| self.step(prediction, slope, &before), CANDIDATES);
        for quantity in &self.quantities {
            let is_size = matches!(quantity.judgement.aspect, Aspect::Position | Aspect::Pressures);
            if !is_size && !quantity.judgement.is_right() {
                let step = |slope: &Prediction| self.step_of_ringing(quantity, prediction, slope);
                linear.extend(best_of(&step, CANDIDATES_FOR_OSCILLATION));
            }
        }
        let tried = |(_, step, key): &(f64, f64, Free)| self.tried(&before, *step, *key);
        let mut list: Vec<(f64, Remedy)> = linear.par_iter().filter_map(tried).collect();
        list.sort_by(|a, b| a.0.total_cmp(&b.0));
        // one change per key: the better one
        let mut named: Vec<String> = Vec::new();
        list.retain(|(_, remedy)| {
            let is_new = !named.contains(&remedy.path);
            named.push(remedy.path.clone());
            is_new
        });
        // a change at its limit is proposed only if no other one helps
        if list.iter().any(|(_, remedy)| !remedy.at_limit) {
            list.retain(|(_, remedy)| !remedy.at_limit);
        }
        list.truncate(MOST_PROPOSALS);
        list.into_iter().map(|(_, remedy)| remedy).collect()
    }

    /// Best change of a key along its step, with the remaining deviations; none if the improvement is too
    /// small.
    fn tried(&self, before: &Values, step: f64, key: Free) -> Option<(f64, Remedy)> {
        let value = key.value(self.model);
        let (low, high) = key.bounds();
        let most = LIMITS.most_change;
        let limits = [(low / value).max(1.0 / most).ln(), (high / value).min(most).ln()];
        let at = |by: f64| -> Option<Trial> {
            let mut numbers = self.model.numbers.to_array();
            numbers[key.place] = value * by.exp();
            let mut there = self.model.clone();
            there.numbers = Numbers::from_array(numbers);
            let found = self.values(&predict(&there, self.experiment).ok()?);
            Some((self.cost(&found, before), by, found))
        };
        let clamped = |by: f64| by.max(limits[0]).min(limits[1]);
        let better = |a: Trial, b: Trial| if b.0 < a.0 { b } else { a };
        let runs = STEP_FACTORS.par_iter().filter_map(|factor| at(clamped(factor * step)));
        let mut best = runs.reduce_with(better)?;
        // doubled while it improves, then refined by a quarter and a tenth to both sides
        let mut last = STEP_FACTORS[STEP_FACTORS.len() - 1] * step;
        while best.1 == clamped(last) && clamped(2.0 * last) != clamped(last) {
            last *= 2.0;
            if let Some(next) = at(clamped(last)) {
                best = better(best, next);
            }
        }
        for part in REFINEMENT_FACTORS {
            if let Some(next) = at(clamped(part * best.1)) {
                best = better(best, next);
            }
        }
        let (after, by, found) = best;
        let all = self.cost(before, before);
        if after >= (1.0 - LIMITS.worthwhile) * all {
            return None;
        }
        let at_limit = by <= limits[0] || limits[1] <= by;
        let both = self.quantities.iter().zip(before).zip(&found);
        let moved = both.filter_map(|((quantity, before), after)| {
            let ((before, over_before), (after, over_after)) = ((*before)?, (*after)?);
            let wanted = match quantity.judgement.aspect {
                Aspect::Position | Aspect::Pressures => 0.0,
                Aspect::Frequency => quantity.log?.frequency,
                Aspect::Damping => quantity.log?.damping?,
            };
            let (aspect, signal) = (quantity.judgement.aspect, quantity.judgement.signal);
            let is_reported = over_before > 1.0 || over_after > 1.0;
            is_reported.then_some(Moved { aspect, signal, found: (before, after), wanted })
        });
        let misfit = (self.misfit(all), self.misfit(after));
        let (path, change) = (key.path(), by.exp() - 1.0);
        Some((after, Remedy { path, change, at_limit, misfit, moved: moved.collect() }))
    }
}
