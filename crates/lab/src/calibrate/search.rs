//! The search: first everywhere, then downhill.

use super::journal::Journal;
use super::parameter::{PARAMETERS, crane_at, shares_of};
use super::published::{RESULTS, Tests, published, shown, tests};
use crate::LabError;
use cmaes::{CMAESOptions, DVector as Point};
use hydroboom_description::Description;
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, storage::Owned};
use std::cell::RefCell;

const SIZE: usize = PARAMETERS.len();
/// Results against what is published, each parameter against where it started and against the ends
/// of its range.
const RESIDUALS: usize = RESULTS + 2 * SIZE;

/// How strongly a parameter is drawn to where it started: a tolerance for the whole range. Weak, so
/// that it decides only what the data leave open.
const PRIOR: f64 = 0.3;
/// How strongly it is kept within its range.
const WALL: f64 = 30.0;
/// A crane that cannot be simulated is this bad.
const FAILED: f64 = 1e4;
/// Step for derivatives, as a share of the range. Results are smooth on this scale only: a peak may
/// change its place.
const DIFFERENCE: f64 = 0.02;

/// What a search may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Generations of the global search.
    pub generations: usize,
    /// Cranes in each.
    pub population: usize,
    /// Iterations of the local search.
    pub iterations: usize,
}

/// Where a search is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Evaluations so far.
    pub evaluations: usize,
    /// Loss of the best crane so far.
    pub best: f64,
}

/// The result of a search.
#[derive(Clone, Debug)]
pub struct Found {
    /// Shares of the parameters' ranges.
    pub shares: Vec<f64>,
    /// What the crane there shows.
    pub shown: [f64; RESULTS],
    /// Standard deviation of each share, were every tolerance a standard deviation.
    pub deviation: Vec<f64>,
    /// Correlation of the parameters.
    pub correlation: DMatrix<f64>,
    /// Evaluations made.
    pub evaluations: usize,
}

/// Step of the virtual crane in the global search \[s\]: a control period, four times faster than
/// its own and good to a percent of the results.
const COARSE_STEP: f64 = 1e-3;

/// What every evaluation needs.
struct Case<'a> {
    model: &'a Description,
    template: Description,
    /// Told apart in the journal: 0 with the coarse step, 1 with the template's own.
    stage: f64,
    /// Where the parameters started.
    start: [f64; SIZE],
    journal: RefCell<&'a mut Journal>,
    progress: &'a dyn Fn(Progress),
    best: RefCell<(f64, Vec<f64>)>,
    /// A journal that cannot be written stops the search.
    failure: RefCell<Option<LabError>>,
}

impl Case<'_> {
    fn shown(&self, shares: &[f64]) -> Option<[f64; RESULTS]> {
        let make = || {
            let crane = crane_at(&self.template, shares).ok()?;
            let tests: Tests = tests(self.model, &crane).ok()?;
            let values = shown(&tests).ok()?;
            Some(values.to_vec())
        };
        let point: Vec<f64> = std::iter::once(self.stage).chain(shares.iter().copied()).collect();
        match self.journal.borrow_mut().evaluate(&point, make) {
            Ok(values) => values?.try_into().ok(),
            Err(error) => {
                *self.failure.borrow_mut() = Some(error);
                None
            }
        }
    }

    fn residuals(&self, shares: &[f64]) -> [f64; RESIDUALS] {
        let mut residuals = [FAILED; RESIDUALS];
        let Some(values) = self.shown(shares) else { return residuals };
        for (k, (published, value)) in published().iter().zip(values).enumerate() {
            let off = (value / published.value - 1.0) / published.tolerance;
            // Cauchy's loss ln(1 + off²): results that cannot be met together with the others are
            // given up one by one, in place of all being missed a little
            residuals[k] = off.signum() * off.powi(2).ln_1p().sqrt();
        }
        for k in 0..SIZE {
            residuals[RESULTS + k] = PRIOR * (shares[k] - self.start[k]);
            residuals[RESULTS + SIZE + k] = WALL * (shares[k] - shares[k].clamp(0.0, 1.0));
        }
        let sum: f64 = residuals.iter().map(|r| r * r).sum();
        let mut best = self.best.borrow_mut();
        if sum < best.0 {
            *best = (sum, shares.to_vec());
        }
        let evaluations = self.journal.borrow().len();
        (self.progress)(Progress { evaluations, best: best.0 });
        residuals
    }

    fn jacobian(&self, shares: &[f64]) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(RESIDUALS, SIZE);
        let here = self.residuals(shares);
        for column in 0..SIZE {
            // inwards, where there is a crane
            let step = if shares[column] < 0.5 { DIFFERENCE } else { -DIFFERENCE };
            let mut moved = shares.to_vec();
            moved[column] += step;
            let there = self.residuals(&moved);
            for row in 0..RESIDUALS {
                jacobian[(row, column)] = (there[row] - here[row]) / step;
            }
        }
        jacobian
    }
}

/// The case at one point, for the local search.
struct Downhill<'a, 'b> {
    case: &'a Case<'b>,
    at: DVector<f64>,
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Downhill<'_, '_> {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.at.copy_from(x);
    }
    fn params(&self) -> DVector<f64> {
        self.at.clone()
    }
    fn residuals(&self) -> Option<DVector<f64>> {
        Some(DVector::from_column_slice(&self.case.residuals(self.at.as_slice())))
    }
    fn jacobian(&self) -> Option<DMatrix<f64>> {
        Some(self.case.jacobian(self.at.as_slice()))
    }
}

/// Searches for the parameters with which the template shows what is published, first by covariance
/// matrix adaptation (global), then by Levenberg and Marquardt's method (local). The same template,
/// effort and seed give the same crane.
///
/// # Errors
///
/// [`LabError`] when the model cannot be simulated, no crane could, or the journal fails.
pub fn search(
    model: &Description,
    template: &Description,
    effort: &Effort,
    journal: &mut Journal,
    progress: &dyn Fn(Progress),
) -> Result<Found, LabError> {
    let start = shares_of(template);
    let mut coarse = template.clone();
    coarse.numbers.virtual_step = COARSE_STEP;
    // the coarse step cannot resolve it, and it moves none of the results
    coarse.numbers.ripple = 0.0;
    let mut case = Case {
        model,
        template: coarse,
        stage: 0.0,
        start,
        journal: RefCell::new(journal),
        progress,
        best: RefCell::new((f64::INFINITY, start.to_vec())),
        failure: RefCell::new(None),
    };
    let impossible = |reason: String| LabError::Input { file: "calibration".into(), reason };
    let objective =
        |x: &Point<f64>| case.residuals(x.as_slice()).iter().map(|r| r * r).sum::<f64>();
    if effort.generations > 0 {
        let mut global = CMAESOptions::new(start.to_vec(), 0.2)
            .population_size(effort.population)
            .seed(1)
            .build(objective)
            .map_err(|e| impossible(format!("{e:?}")))?;
        for _ in 0..effort.generations {
            if case.failure.borrow().is_some() || global.next().is_some() {
                break;
            }
        }
    }
    let from: Vec<f64> = case.best.borrow().1.iter().map(|u| u.clamp(0.0, 1.0)).collect();
    case.template = template.clone();
    case.stage = 1.0;
    case.best = RefCell::new((f64::INFINITY, from.clone()));
    if effort.iterations > 0 {
        let downhill = Downhill { case: &case, at: DVector::from_vec(from) };
        LevenbergMarquardt::new().with_patience(effort.iterations).minimize(downhill);
    }
    if let Some(error) = case.failure.borrow_mut().take() {
        return Err(error);
    }
    let shares: Vec<f64> = case.best.borrow().1.iter().map(|u| u.clamp(0.0, 1.0)).collect();
    let values = case
        .shown(&shares)
        .ok_or_else(|| impossible("no crane within the ranges can be simulated".into()))?;
    let (deviation, correlation) = determined(&case.jacobian(&shares));
    let evaluations = case.journal.borrow().len();
    Ok(Found { shares, shown: values, deviation, correlation, evaluations })
}

/// Standard deviations and correlations of the parameters around a minimum, from (JᵀJ)⁻¹.
fn determined(jacobian: &DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
    // walls do not inform; the prior keeps what the data leave open finite
    let informative = jacobian.rows(0, RESULTS + SIZE);
    let information = informative.transpose() * informative;
    let covariance = information.try_inverse().unwrap_or_else(|| DMatrix::identity(SIZE, SIZE));
    let deviation: Vec<f64> = (0..SIZE).map(|k| covariance[(k, k)].max(0.0).sqrt()).collect();
    let correlation = DMatrix::from_fn(SIZE, SIZE, |i, j| {
        covariance[(i, j)] / (deviation[i] * deviation[j]).max(f64::MIN_POSITIVE)
    });
    (deviation, correlation)
}
