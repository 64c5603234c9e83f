//! What the logs say of one key, whatever the others are: its profile likelihood.
//!
//! The intervals of a search suppose that the sum rises as a parabola. For a key that the logs say little of, and one that
//! stands in for another, it need not: the key is held at values beside its own, and all else is searched for anew.

use super::layout::Layout;
use super::residual::Deviations;
use super::samples::Samples;
use super::search::{Ends, Search};
use super::watch::{Progress, Watch};
use super::{End, Fit, Task};
use crate::error::IdentifyError;
use crate::experiment::Experiment;
use crate::free::Free;
use hydroboom_description::schema::Numbers;
use nalgebra::DVector;

/// How the sum that a search makes least rises as a key leaves its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// The key.
    pub key: Free,
    /// Values of the key, growing, in SI units, each with the rise of the sum there with all else at its best: in squared
    /// deviations, with what is left as correlated as it is. What was known of the key itself does not count, and keys that are not free stay.
    pub points: Vec<(f64, f64)>,
    /// Where the rise passes [`LIMIT`], in SI units: from here to there the logs do not contradict the key. None where they
    /// do not as far as was looked: three deviations of what was known of it, three times as far as the parabola of the search's
    /// own interval would take to get there, or what a crane file allows.
    pub interval: [Option<f64>; 2],
}

/// Rise at which a value is contradicted: what chance alone passes once in twenty (χ² of one degree of freedom).
pub const LIMIT: f64 = 3.841;
/// How far a profile is looked at, in deviations of what was known of the key.
const FAR: f64 = 3.0;
/// Points on each side, at most.
const POINTS: usize = 6;

/// The profile of one of a task's keys, around where a search of that task ended. `go_on` is told of each run of the model.
///
/// # Errors
///
/// [`IdentifyError`] when the key is none of the task's, the model breaks off where the key is held, or the search was
/// stopped.
pub fn profile(
    task: &Task<'_>,
    found: &Fit,
    key: Free,
    go_on: &dyn Fn(&Progress<'_>) -> bool,
) -> Result<Profile, IdentifyError> {
    let place = task.free.iter().position(|k| *k == key);
    let place = place.ok_or_else(|| IdentifyError::NotFree { key: key.path() })?;
    let End { at, deviations, certainty } = &found.end;
    let known = task.known().deviation[place];
    let alone = certainty.alone(place);
    // samples that are alike tell less than as many that are not
    let inflation = match alone.exact.is_finite() {
        true => (alone.exact / alone.white).powi(2).max(1.0),
        false => 1.0,
    };
    let along = DVector::from_vec(certainty.along(place));
    let (low, high) = key.bounds();
    let (low, high) = (low.max(1e-300).ln(), high.ln());
    // half the way to where a parabola would be at the limit, and no farther than what was known
    let expected = LIMIT.sqrt() * alone.exact;
    let step = (0.5 * expected).min(known);
    let held = Held { task, longer: &task.coarse(), deviations, place, go_on };

    let own = DVector::from_column_slice(at);
    let (own, least) = held.sum_at(own)?;
    let middle = own[place];
    let mut points = vec![(middle, 0.0)];
    let mut interval = [None; 2];
    for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
        let (mut from, mut last) = (own.clone(), (middle, 0.0));
        for _ in 0..POINTS {
            let next = (last.0 + sign * step).clamp(low, high);
            if next == last.0 || (next - middle).abs() > 1.001 * FAR * known {
                break;
            }
            let (there, sum) = held.sum_at(&from + &along * (next - last.0))?;
            // the least sum of a search that ended a little early is no fall
            let point = (next, ((sum - least) / inflation).max(0.0));
            points.push(point);
            if point.1 > LIMIT {
                let share = (LIMIT - last.1) / (point.1 - last.1);
                interval[side] = Some((last.0 + share * (point.0 - last.0)).exp());
                break;
            }
            (from, last) = (there, point);
        }
    }
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let points = points.into_iter().map(|(ln, rise)| (ln.exp(), rise)).collect();
    Ok(Profile { key, points, interval })
}

/// Searches with one key held.
struct Held<'a> {
    task: &'a Task<'a>,
    longer: &'a [Experiment],
    deviations: &'a [Deviations],
    place: usize,
    go_on: &'a dyn Fn(&Progress<'_>) -> bool,
}

impl Held<'_> {
    /// The least sum with the key where it is: not among those that are moved.
    fn sum_at(&self, mut at: DVector<f64>) -> Result<(DVector<f64>, f64), IdentifyError> {
        let (key, ln) = (self.task.free[self.place], at[self.place]);
        let mut numbers = self.task.model.numbers.to_array();
        numbers[key.place] = ln.exp();
        let mut model = self.task.model.clone();
        model.numbers = Numbers::from_array(numbers);
        let free: Vec<Free> = self.task.free.iter().filter(|k| **k != key).copied().collect();
        let task = Task { model: &model, free: &free, ..*self.task };
        let known = task.known();
        let layout = Layout { experiments: self.longer, ..task.layout() };
        let watch = Watch::new(self.go_on);
        let sum = Samples::new(self.longer, self.deviations);
        at = at.remove_row(self.place);
        let search = Search::new(layout, sum, &known, at, &watch);
        let (found, _) = search.minimised(Ends { sum: 1e-6, place: 1e-5, patience: 2 });
        if watch.borrow().is_stopped() {
            return Err(IdentifyError::Stopped);
        }
        let terms = found.terms(&found.at);
        let terms =
            terms.ok_or_else(|| IdentifyError::Unsteady { key: key.path(), value: ln.exp() })?;
        let sum = terms.iter().map(|t| t * t).sum();
        Ok((found.at.insert_row(self.place, ln), sum))
    }
}
