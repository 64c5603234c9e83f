//! Profile likelihood of a key.
//!
//! The intervals of a fit assume a quadratic cost. For a key that the logs hardly determine, or that is
//! correlated with another one, it need not be quadratic. Here the key is fixed at several values, and the
//! cost is minimised over all other parameters (Bates and Watts, *Nonlinear Regression Analysis and Its
//! Applications*, 1988, chapter 6).

use super::layout::Layout;
use super::least_squares::{LeastSquares, Termination};
use super::monitor::{Monitor, Progress};
use super::residual::Deviations;
use super::samples::SampleResiduals;
use super::{Fit, Minimum, Task};
use crate::error::IdentifyError;
use crate::experiment::Experiment;
use crate::free::Free;
use hydroboom_description::schema::Numbers;
use nalgebra::DVector;

/// Profile likelihood of one key: the least cost over all other parameters as a function of the key's value.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Key whose likelihood is profiled.
    pub key: Free,
    /// Increasing values of the key in SI units, each with the increase of the least cost over all other free
    /// parameters \[-\]. The cost includes neither the prior of the key nor a change of the fixed keys. It is
    /// divided by the variance inflation of correlated residuals.
    pub points: Vec<(f64, f64)>,
    /// Values at which the increase exceeds [`LIMIT`], in SI units: the 95 % interval. None if it does not
    /// within the range of the profile. That is three prior standard deviations, three times the interval of
    /// the quadratic cost, or the key's bounds.
    pub interval: [Option<f64>; 2],
}

/// Increase of the cost at the ends of the 95 % interval \[-\]: 0.95 quantile of χ² with one degree of
/// freedom.
pub const LIMIT: f64 = 3.841;
/// Largest distance of a profile's points from the minimum, in prior standard deviations \[-\].
const LARGEST_DISTANCE: f64 = 3.0;
/// Largest number of points on each side.
const POINTS: usize = 6;

/// Profile of one of a task's free keys about the minimum of its fit. `go_on` is called after each cost
/// evaluation, and stops the profile if it returns false.
///
/// # Errors
///
/// [`IdentifyError::NotFree`] if the key is not free, [`IdentifyError::Unsteady`] if a simulation fails at a fixed
/// value, [`IdentifyError::Stopped`] if the profile was stopped.
pub fn profile(
    task: &Task<'_>,
    found: &Fit,
    key: Free,
    go_on: &dyn Fn(&Progress<'_>) -> bool,
) -> Result<Profile, IdentifyError> {
    let index = task.free.iter().position(|k| *k == key);
    let index = index.ok_or_else(|| IdentifyError::NotFree { key: key.path() })?;
    let Minimum { parameters, deviations, uncertainty } = &found.minimum;
    let prior = task.prior().deviation[index];
    let from_logs = uncertainty.by_logs_alone(index);
    // variance inflation by the correlation of the residuals
    let inflation = match from_logs.others_exact.is_finite() {
        true => (from_logs.others_exact / from_logs.white).powi(2).max(1.0),
        false => 1.0,
    };
    let direction = DVector::from_vec(uncertainty.conditional_shift(index));
    let (low, high) = key.bounds();
    let (low, high) = (low.max(1e-300).ln(), high.ln());
    // half the distance at which a quadratic cost reaches the limit, and at most the prior standard deviation
    let expected = LIMIT.sqrt() * from_logs.others_exact;
    let step = (0.5 * expected).min(prior);
    let fixed = KeyFixed { task, coarse: &task.coarse(), deviations, index, go_on };

    let own = DVector::from_column_slice(parameters);
    let (own, smallest) = fixed.minimum_at(own)?;
    let middle = own[index];
    let mut points = vec![(middle, 0.0)];
    let mut interval = [None; 2];
    for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
        let (mut from, mut last) = (own.clone(), (middle, 0.0));
        for _ in 0..POINTS {
            let next = (last.0 + sign * step).clamp(low, high);
            if next == last.0 || (next - middle).abs() > 1.001 * LARGEST_DISTANCE * prior {
                break;
            }
            let (there, cost) = fixed.minimum_at(&from + &direction * (next - last.0))?;
            // a decrease is the tolerance of the first minimum
            let point = (next, ((cost - smallest) / inflation).max(0.0));
            points.push(point);
            if point.1 > LIMIT {
                let fraction = (LIMIT - last.1) / (point.1 - last.1);
                interval[side] = Some((last.0 + fraction * (point.0 - last.0)).exp());
                break;
            }
            (from, last) = (there, point);
        }
    }
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let points = points.into_iter().map(|(ln, rise)| (ln.exp(), rise)).collect();
    Ok(Profile { key, points, interval })
}

/// Fit with one key fixed.
struct KeyFixed<'a> {
    task: &'a Task<'a>,
    coarse: &'a [Experiment],
    deviations: &'a [Deviations],
    index: usize,
    go_on: &'a dyn Fn(&Progress<'_>) -> bool,
}

impl KeyFixed<'_> {
    /// Parameter vector of least cost with the key at its value in `parameters`, and that cost.
    fn minimum_at(
        &self,
        mut parameters: DVector<f64>,
    ) -> Result<(DVector<f64>, f64), IdentifyError> {
        let (key, ln) = (self.task.free[self.index], parameters[self.index]);
        let mut numbers = self.task.model.numbers.to_array();
        numbers[key.place] = ln.exp();
        let mut model = self.task.model.clone();
        model.numbers = Numbers::from_array(numbers);
        let free: Vec<Free> = self.task.free.iter().filter(|k| **k != key).copied().collect();
        let task = Task { model: &model, free: &free, ..*self.task };
        let prior = task.prior();
        let layout = Layout { experiments: self.coarse, ..task.layout() };
        let monitor = Monitor::new(self.go_on);
        let function = SampleResiduals::new(self.coarse, self.deviations);
        parameters = parameters.remove_row(self.index);
        let problem = LeastSquares::new(layout, function, &prior, parameters, &monitor);
        let (found, _) = problem.minimised(Termination { cost: 1e-6, step: 1e-5, evaluations: 2 });
        if monitor.borrow().is_stopped() {
            return Err(IdentifyError::Stopped);
        }
        let residuals = found.residual_vector(&found.parameters);
        let residuals = residuals
            .ok_or_else(|| IdentifyError::Unsteady { key: key.path(), value: ln.exp() })?;
        let cost = residuals.iter().map(|t| t * t).sum();
        Ok((found.parameters.insert_row(self.index, ln), cost))
    }
}
