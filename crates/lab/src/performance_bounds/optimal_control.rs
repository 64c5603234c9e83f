//! Optimal control of a linear time-varying plant whose motor has limits of speed and slew: a convex quadratic program.
//!
//! ```text
//! minimise    ½ Σ (e_k + h_kᵀ z_k)² + ½ ε² Σ (v̄_k + v_k)²
//! subject to  z_{k+1} = A_k z_k + b_k v_k + c_k,   |n̄_{k+1} + n_{k+1}| ≤ n_max,   |v̄_k + v_k| ≤ v_max
//! ```
//!
//! e_k is the tracking error \[mm\]; z_k and v_k are deviations from a motion; the last entry of z_k is the
//! motor speed n_k. The solver is Mehrotra's predictor-corrector method, a primal-dual interior-point
//! method. Each step is a linear-quadratic problem with the curvature of the limits' barriers, factorised
//! by one Riccati recursion. The products of multipliers and slacks sum up to the duality gap: the optimal
//! cost is no smaller than the present cost minus the gap.
//!
//! The smallest error alone, without the cost of changes, follows from convexity. With w = v̄ + v of the
//! solution and any changes u within the limits,
//!
//! ```text
//! Σ e(u)² ≥ Σ e² − 2 gap − 2 ε² (wᵀu − wᵀw),   wᵀu ≤ v_max Σ |w_k|,   wᵀu ≤ n_max (|w_0| + Σ |w_k − w_{k−1}| + |w_N|)
//! ```
//!
//! Sources: S. Mehrotra, *On the implementation of a primal-dual interior point method*, SIAM J. Optim. 2
//! (1992) 575-601;
//! C. V. Rao, S. J. Wright, J. B. Rawlings, *Application of interior-point methods to model predictive
//! control*, J. Optim. Theory Appl. 99 (1998) 723-757.

use crate::LabError;
use nalgebra::{SMatrix, SVector};

/// Period of the plant, linearised along a motion.
pub(super) struct LinearPeriod<const N: usize> {
    /// State transition matrix A, N × N.
    pub by_state: SMatrix<f64, N, N>,
    /// Input vector b: effect of the change of the motor speed in the period.
    pub by_change: SVector<f64, N>,
    /// Affine term c of the linearised motion \[state unit\].
    pub defect: SVector<f64, N>,
    /// Tracking error e of the motion at the end of the period \[mm\].
    pub error: f64,
    /// Gradient h of the tracking error with respect to the state \[mm per state unit\].
    pub error_by_state: SVector<f64, N>,
    /// Limited quantities of the motion: change of the motor speed, and speed at the end of the period
    /// \[rev/s\].
    pub limited: [f64; 2],
}

/// Result of the optimisation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Solution {
    /// Sum of squared errors \[mm²\].
    pub square: f64,
    /// Lower bound of the sum of squared errors \[mm²\]: the duality gap and the possible effect of the
    /// cost of changes are subtracted.
    pub least: f64,
}

/// Largest number of iterations; a quarter is typical.
const MOST_STEPS: usize = 100;
/// Step length as a share of the largest step within the limits.
const BOUNDARY: f64 = 0.995;

/// Values for the lower and the upper limit of each limited quantity of a period.
type Sides = [[f64; 2]; 2];

struct Search<'a, const N: usize> {
    periods: &'a [LinearPeriod<N>],
    limits: [Option<f64>; 2],
    /// ε: cost of a change of 1 rev/s as a tracking error \[mm\].
    change_as_error: f64,
    changes: Vec<f64>,
    states: Vec<SVector<f64, N>>,
    multipliers: Vec<Sides>,
}

/// Factors of the Riccati recursion: curvature of the change and its feedback gain in each period.
type Factors<const N: usize> = Vec<(f64, SVector<f64, N>)>;

impl<const N: usize> Search<'_, N> {
    /// Slacks of period k.
    fn slacks(&self, k: usize) -> Sides {
        let moves = [self.changes[k], self.states[k][N - 1]];
        std::array::from_fn(|place| {
            let value = self.periods[k].limited[place] + moves[place];
            self.limits[place].map_or([1.0; 2], |limit| [limit + value, limit - value])
        })
    }

    /// Index and side of each active limit.
    fn held(&self) -> impl Iterator<Item = (usize, usize)> + use<N> {
        let limits = self.limits;
        (0..2)
            .flat_map(|place| [(place, 0), (place, 1)])
            .filter(move |(place, _)| limits[*place].is_some())
    }

    fn count(&self) -> f64 {
        (self.held().count() * self.periods.len()) as f64
    }

    /// Tracking error at the end of a period \[mm\].
    fn error(&self, k: usize) -> f64 {
        let period = &self.periods[k];
        period.error + period.error_by_state.dot(&self.states[k])
    }

    fn square(&self) -> f64 {
        (0..self.periods.len()).map(|k| self.error(k).powi(2)).sum()
    }

    /// Upper bound of the effect of the cost of changes on the sum of squared errors \[mm²\]: 2 ε² (wᵀu −
    /// wᵀw).
    fn kept_by_changes(&self) -> f64 {
        let w: Vec<f64> = (self.periods.iter().zip(&self.changes))
            .map(|(period, change)| period.limited[0] + change)
            .collect();
        let own: f64 = w.iter().map(|w| w * w).sum();
        let all: f64 = w.iter().map(|w| w.abs()).sum();
        let turned: f64 = w.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum();
        let ends = w.first().map_or(0.0, |w| w.abs()) + w.last().map_or(0.0, |w| w.abs());
        // bound by the limit of changes, and by that of the speed
        let along = [all, ends + turned]
            .into_iter()
            .zip(self.limits)
            .filter_map(|(size, limit)| Some(size * limit?))
            .fold(f64::INFINITY, f64::min);
        2.0 * self.change_as_error.powi(2) * (along - own).max(0.0)
    }

    /// Sum of all products of slacks and multipliers after shares of the steps.
    fn gap(&self, shares: [f64; 2], steps: Option<&[(Sides, Sides)]>) -> f64 {
        let mut gap = 0.0;
        for k in 0..self.periods.len() {
            let (slacks, multipliers) = (self.slacks(k), &self.multipliers[k]);
            for (place, side) in self.held() {
                let (mut slack, mut multiplier) = (slacks[place][side], multipliers[place][side]);
                if let Some(steps) = steps {
                    slack += shares[0] * steps[k].0[place][side];
                    multiplier += shares[1] * steps[k].1[place][side];
                }
                gap += slack * multiplier;
            }
        }
        gap
    }

    /// Riccati recursion.
    fn factors(&self) -> Factors<N> {
        let mut curvature = SMatrix::<f64, N, N>::zeros();
        let mut factors = vec![(0.0, SVector::zeros()); self.periods.len()];
        for (k, period) in self.periods.iter().enumerate().rev() {
            let row = &period.error_by_state;
            curvature += row * row.transpose();
            let mut change_curvature = self.change_as_error.powi(2);
            let slacks = self.slacks(k);
            for (place, side) in self.held() {
                let bent = self.multipliers[k][place][side] / slacks[place][side];
                if place == 0 {
                    change_curvature += bent
                } else {
                    curvature[(N - 1, N - 1)] += bent
                }
            }
            let pulled = curvature * period.by_change;
            let bent = period.by_change.dot(&pulled) + change_curvature;
            let crossed = period.by_state.tr_mul(&pulled);
            factors[k] = (bent, crossed / bent);
            curvature = period.by_state.tr_mul(&(curvature * period.by_state))
                - crossed * crossed.transpose() / bent;
            // rounding breaks the symmetry and the asymmetry grows
            curvature = (curvature + curvature.transpose()) * 0.5;
        }
        factors
    }

    /// Newton step of changes and states for the target products `targets`.
    fn step(
        &self,
        factors: &Factors<N>,
        targets: &dyn Fn(usize) -> Sides,
    ) -> (Vec<f64>, Vec<SVector<f64, N>>) {
        let count = self.periods.len();
        let mut slope = SVector::<f64, N>::zeros();
        let mut wanted = vec![0.0; count];
        for (k, period) in self.periods.iter().enumerate().rev() {
            slope += period.error_by_state * self.error(k);
            let mut change_slope =
                self.change_as_error.powi(2) * (period.limited[0] + self.changes[k]);
            let (slacks, targets) = (self.slacks(k), targets(k));
            for (place, side) in self.held() {
                let by = targets[place][side] / slacks[place][side];
                let by = if side == 0 { -by } else { by };
                if place == 0 { change_slope += by } else { slope[N - 1] += by }
            }
            let (bent, feedback) = &factors[k];
            let along = period.by_change.dot(&slope) + change_slope;
            wanted[k] = -along / bent;
            slope = period.by_state.tr_mul(&slope) - feedback * along;
        }
        let mut state = SVector::<f64, N>::zeros();
        let (mut changes, mut states) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for (k, period) in self.periods.iter().enumerate() {
            let change = wanted[k] - factors[k].1.dot(&state);
            state = period.by_state * state + period.by_change * change;
            changes.push(change);
            states.push(state);
        }
        (changes, states)
    }

    /// Steps of slacks and multipliers.
    fn sides(
        &self,
        (changes, states): &(Vec<f64>, Vec<SVector<f64, N>>),
        targets: &dyn Fn(usize) -> Sides,
    ) -> Vec<(Sides, Sides)> {
        let of = |k: usize| {
            let moves = [changes[k], states[k][N - 1]];
            let (slacks, targets, mut steps) =
                (self.slacks(k), targets(k), ([[0.0; 2]; 2], [[0.0; 2]; 2]));
            for (place, side) in self.held() {
                let by = if side == 0 { moves[place] } else { -moves[place] };
                let multiplier = self.multipliers[k][place][side];
                steps.0[place][side] = by;
                steps.1[place][side] =
                    (targets[place][side] - multiplier * by) / slacks[place][side] - multiplier;
            }
            steps
        };
        (0..self.periods.len()).map(of).collect()
    }

    /// Largest shares of the primal and the dual step that keep slacks and multipliers positive.
    fn shares(&self, steps: &[(Sides, Sides)]) -> [f64; 2] {
        let mut shares = [1.0_f64; 2];
        let within = |value: f64, step: f64| if step < 0.0 { -value / step } else { f64::INFINITY };
        for (k, (slack_steps, multiplier_steps)) in steps.iter().enumerate() {
            let slacks = self.slacks(k);
            for (place, side) in self.held() {
                shares[0] = shares[0].min(within(slacks[place][side], slack_steps[place][side]));
                let multiplier = self.multipliers[k][place][side];
                shares[1] = shares[1].min(within(multiplier, multiplier_steps[place][side]));
            }
        }
        shares
    }

    /// One iteration of the predictor-corrector method; returns the sum of squares by which its full step
    /// changes the errors \[mm²\].
    fn improve(&mut self) -> f64 {
        let factors = self.factors();
        let count = self.count();
        let nothing = |_| [[0.0; 2]; 2];
        let mut step = self.step(&factors, &nothing);
        let mut shares = [1.0; 2];
        let mut sides = self.sides(&step, &nothing);
        if count > 0.0 {
            let mean = self.gap([0.0; 2], None) / count;
            let ahead = self.gap(self.shares(&sides), Some(&sides)) / count;
            let centre = mean * (ahead / mean).powi(3);
            let predicted = sides;
            let corrected = |k: usize| {
                let (slacks, multipliers) = &predicted[k];
                std::array::from_fn(|place| {
                    std::array::from_fn(|side| {
                        centre - slacks[place][side] * multipliers[place][side]
                    })
                })
            };
            step = self.step(&factors, &corrected);
            sides = self.sides(&step, &corrected);
            let largest = self.shares(&sides).map(|share| (BOUNDARY * share).min(1.0));
            // one step length for both: the quadratic cost couples them
            shares = [largest[0].min(largest[1]); 2];
        }
        let (changes, states) = step;
        let moved = |(period, by): (&LinearPeriod<N>, &SVector<f64, N>)| {
            period.error_by_state.dot(by).powi(2)
        };
        let gained: f64 = self.periods.iter().zip(&states).map(moved).sum();
        for (value, by) in self.changes.iter_mut().zip(changes) {
            *value += shares[0] * by;
        }
        for (value, by) in self.states.iter_mut().zip(states) {
            *value += by * shares[0];
        }
        for (value, (_, by)) in self.multipliers.iter_mut().zip(&sides) {
            for place in 0..2 {
                for side in 0..2 {
                    value[place][side] += shares[1] * by[place][side];
                }
            }
        }
        gained
    }
}

/// Optimal deviations from a motion within the limits of change and speed (none if there is no limit). The
/// search ends when its sum of squares is close to the minimum, by a relative and an absolute tolerance
/// \[mm²\]. None if `go_on`, called before each iteration, returned false.
///
/// # Errors
///
/// [`LabError::NoBound`] if the search does not converge.
pub(super) fn best_deviation<const N: usize>(
    periods: &[LinearPeriod<N>],
    limits: [Option<f64>; 2],
    change_as_error: f64,
    [share, smallest]: [f64; 2],
    go_on: &dyn Fn() -> bool,
) -> Result<Option<Solution>, LabError> {
    let mut states = Vec::with_capacity(periods.len());
    let mut state = SVector::<f64, N>::zeros();
    for period in periods {
        state = period.by_state * state + period.defect;
        states.push(state);
    }
    let mut search = Search {
        periods,
        limits,
        change_as_error,
        changes: vec![0.0; periods.len()],
        states,
        multipliers: vec![[[0.0; 2]; 2]; periods.len()],
    };
    // initial products of the size of the cost per period
    let product = (search.square() / periods.len() as f64).max(smallest);
    for k in 0..periods.len() {
        let slacks = search.slacks(k);
        for (place, side) in search.held() {
            search.multipliers[k][place][side] = product / slacks[place][side];
        }
    }
    for _ in 0..MOST_STEPS {
        if !go_on() {
            return Ok(None);
        }
        let moved = search.improve();
        let (square, gap) = (search.square(), search.gap([0.0; 2], None));
        if !(moved.is_finite() && gap.is_finite()) {
            break;
        }
        let enough = smallest + share * square;
        if 2.0 * gap <= enough && moved <= enough {
            let least = (square - 2.0 * gap - search.kept_by_changes()).max(0.0);
            return Ok(Some(Solution { square, least }));
        }
    }
    Err(LabError::NoBound("the search for the optimal motor speeds does not converge".into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix1, Matrix2, Vector1, Vector2};

    const PERIOD: f64 = 1e-3;
    const TIGHT: [f64; 2] = [1e-8, 1e-12];

    fn best<const N: usize>(periods: &[LinearPeriod<N>], limits: [Option<f64>; 2]) -> Solution {
        best_deviation(periods, limits, 1e-6, TIGHT, &|| true).unwrap().unwrap()
    }

    /// Piston \[mm\] driven by its motor speed alone, with references at the ends of the periods.
    fn integrator(reference: &[f64]) -> Vec<LinearPeriod<2>> {
        let period = |reference: &f64| LinearPeriod {
            by_state: Matrix2::new(1.0, PERIOD, 0.0, 1.0),
            by_change: Vector2::new(PERIOD, 1.0),
            defect: Vector2::zeros(),
            error: -reference,
            error_by_state: Vector2::new(1.0, 0.0),
            limited: [0.0; 2],
        };
        reference.iter().map(period).collect()
    }

    /// Ramp of twice the speed limit for a time τ: the optimum begins τ/2 earlier and ends τ/2 later, ∫ e²
    /// dt = v² τ³/6.
    #[test]
    fn with_a_speed_limit_the_optimal_motion_starts_earlier() {
        let (speed, time) = (30.0, 0.2);
        let at = |k: usize| 2.0 * speed * ((k as f64 + 1.0) * PERIOD - 0.3).clamp(0.0, time);
        let reference: Vec<f64> = (0..800).map(at).collect();
        let found = best(&integrator(&reference), [None, Some(speed)]);
        let exact = speed * speed * time.powi(3) / 6.0;
        let square = found.square * PERIOD;
        assert!((square / exact - 1.0).abs() < 1e-3, "{square} {exact}");
        assert!(found.least > (1.0 - 1e-5) * found.square);
        // a limit above twice the speed has no effect
        let free = best(&integrator(&reference), [None, Some(2.1 * speed)]).square;
        let unlimited = best(&integrator(&reference), [None, None]).square;
        assert!(free.max(unlimited) < 1e-6 * found.square, "{free} {unlimited}");
    }

    /// Step of the reference speed by H with slew rate s: the optimum is a ramp centred on the step, ∫ e²
    /// dt = H³/(12 s).
    #[test]
    fn with_a_slew_limit_a_step_becomes_a_centred_ramp() {
        let (leap, slew) = (20.0, 100.0);
        let period = |k: usize| LinearPeriod {
            by_state: Matrix1::new(1.0),
            by_change: Vector1::new(1.0),
            defect: Vector1::zeros(),
            error: if k < 300 { 0.0 } else { -leap },
            error_by_state: Vector1::new(1.0),
            limited: [0.0; 2],
        };
        let periods: Vec<LinearPeriod<1>> = (0..600).map(period).collect();
        let found = best(&periods, [Some(slew * PERIOD), None]);
        let (square, exact) = (found.square * PERIOD, leap.powi(3) / (12.0 * slew));
        assert!((square / exact - 1.0).abs() < 1e-3, "{square} {exact}");
        let both = best(&periods, [Some(slew * PERIOD), Some(0.8 * leap)]).square;
        assert!(both > found.square);
    }

    /// Expensive changes increase the error; the lower bound excludes their effect.
    #[test]
    fn the_cost_of_command_changes_is_not_counted_as_error() {
        let (speed, slew) = (30.0, 200.0);
        let at = |k: usize| 2.0 * speed * ((k as f64 + 1.0) * PERIOD - 0.3).clamp(0.0, 0.2);
        let periods = integrator(&(0..800).map(at).collect::<Vec<_>>());
        let limits = [Some(slew * PERIOD), Some(speed)];
        let with =
            |dear: f64| best_deviation(&periods, limits, dear, TIGHT, &|| true).unwrap().unwrap();
        let cheap = with(1e-4);
        assert!(cheap.least > 0.999 * cheap.square, "{cheap:?}");
        for dear in [10.0, 30.0] {
            let found = with(dear);
            assert!(found.square > 1.01 * cheap.square, "{dear}: {found:?} {cheap:?}");
            assert!(found.least <= cheap.square, "{dear}: {found:?} {cheap:?}");
        }
    }

    #[test]
    fn an_optimisation_can_be_interrupted() {
        let periods = integrator(&[1.0; 10]);
        assert_eq!(best_deviation(&periods, [None; 2], 1e-6, TIGHT, &|| false).unwrap(), None);
    }
}
