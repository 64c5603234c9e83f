//! Search for the parameters: global by covariance matrix adaptation, then local by Levenberg-Marquardt.

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
/// Number of residuals: results against published values, then each parameter against its start value and
/// against the ends of its range.
const RESIDUALS: usize = RESULTS + 2 * SIZE;

/// Weight of the prior at the start value: a deviation over the whole range counts as this many tolerances.
/// It is weak, so that it decides only parameters that the data do not determine.
const PRIOR: f64 = 0.3;
/// Weight of the penalty outside the range.
const WALL: f64 = 30.0;
/// Loss of a crane that cannot be simulated.
const FAILED: f64 = 1e4;
/// Step of the finite differences, as a share of the range. The results are smooth on this scale only,
/// because the time of a peak may change.
const DIFFERENCE: f64 = 0.02;

/// Number of evaluations that a search may spend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Number of generations of the global search (CMA-ES).
    pub generations: usize,
    /// Number of cranes in each generation.
    pub population: usize,
    /// Number of iterations of the local search (Levenberg-Marquardt).
    pub iterations: usize,
}

/// Progress of a search, after each evaluation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Number of evaluations in the journal.
    pub evaluations: usize,
    /// Smallest loss so far \[-\]: sum of squared residuals, deviations over tolerances under Cauchy's loss, and
    /// prior.
    pub best: f64,
}

/// Calibrated crane as parameters and results, with the uncertainty of the parameters.
#[derive(Clone, Debug)]
pub struct Found {
    /// Shares of the parameters' ranges \[-\], 0 to 1, in the order of the parameters.
    pub shares: Vec<f64>,
    /// Results of the crane with these parameters, in the order and units of the published results.
    pub shown: [f64; RESULTS],
    /// Standard deviation of each share \[-\], with the tolerances as standard deviations of the results.
    pub deviation: Vec<f64>,
    /// Correlation matrix of the parameters \[-\], in their order.
    pub correlation: DMatrix<f64>,
    /// Number of evaluations that the search took.
    pub evaluations: usize,
}

/// Integration step of the virtual crane in the global search \[s\]: a control period, four times its own
/// step and accurate to one percent of the results.
const COARSE_STEP: f64 = 1e-3;

/// Data of every evaluation.
struct Case<'a> {
    model: &'a Description,
    template: Description,
    /// Stage in the journal: 0 with the coarse step, 1 with the template's own.
    stage: f64,
    /// Start values of the parameters.
    start: [f64; SIZE],
    journal: RefCell<&'a mut Journal>,
    progress: &'a dyn Fn(Progress),
    best: RefCell<(f64, Vec<f64>)>,
    /// Error of the journal, which stops the search.
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
            // Cauchy's loss ln(1 + off²): an incompatible result is given up instead of worsening all
            // others
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
            // inwards, so that the crane stays within its ranges
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

/// Least-squares problem of the local search at one point.
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

/// Searches for the parameters with which the template reproduces the published results. The global method
/// is covariance matrix adaptation, the local one Levenberg-Marquardt. The random seed is fixed, so the same template
/// and effort give the same crane.
///
/// The loss is Σ ln(1 + d²) with d each deviation from a published result over its tolerance (Cauchy's loss), plus a
/// weak prior at the template's values and a penalty outside the ranges.
///
/// # Errors
///
/// [`LabError::Input`] if no crane within the ranges can be simulated, or the population size is not allowed.
/// [`LabError::File`] if the journal cannot be written.
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
    // the coarse step cannot resolve the ripple, which affects none of the results
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

/// Standard deviations and correlations of the parameters at a minimum, from (JᵀJ)⁻¹.
fn determined(jacobian: &DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
    // the penalty carries no information; the prior keeps undetermined parameters finite
    let informative = jacobian.rows(0, RESULTS + SIZE);
    let information = informative.transpose() * informative;
    let covariance = information.try_inverse().unwrap_or_else(|| DMatrix::identity(SIZE, SIZE));
    let deviation: Vec<f64> = (0..SIZE).map(|k| covariance[(k, k)].max(0.0).sqrt()).collect();
    let correlation = DMatrix::from_fn(SIZE, SIZE, |i, j| {
        covariance[(i, j)] / (deviation[i] * deviation[j]).max(f64::MIN_POSITIVE)
    });
    (deviation, correlation)
}
