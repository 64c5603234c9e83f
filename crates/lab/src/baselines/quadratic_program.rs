//! Quadratic program with limits, solved by a primal-dual interior-point method with a fixed number of
//! iterations.
//!
//! ```text
//! minimise ½ xᵀ H x + qᵀ x + Σ price_i · (distance of a_iᵀ x from its limits)
//! subject to  l ≤ x ≤ u,  and l_i ≤ a_iᵀ x ≤ u_i  for rows without a price
//! ```
//!
//! A row with a price acts as a hard limit wherever its multiplier stays below the price (exact penalty; R.
//! Fletcher, *Practical Methods of Optimization*, 1987, section 14.3). An infeasible limit with a price
//! therefore leaves the program with a solution. If the unconstrained minimum keeps all limits, it is
//! returned without an iteration.
//!
//! Sources: S. Mehrotra, *On the implementation of a primal-dual interior point method*, 1992.
//! C. V. Rao, S. J. Wright, J. B. Rawlings, *Application of interior-point methods to model predictive
//! control*, 1998, doi:10.1023/A:1021711402723.
//! E. C. Kerrigan, J. M. Maciejowski, *Soft constraints and exact penalty functions in model predictive
//! control*, 2000.

use nalgebra::{Cholesky, Const, SMatrix, SVector};

/// Step length as a share of the largest step that keeps slacks and multipliers positive.
const STEP: f64 = 0.995;
/// Mean complementarity below which the iteration has converged, for the program scaled to unit curvature.
const SOLVED: f64 = 1e-11;
/// Smallest initial slack.
const LEAST_SLACK: f64 = 1e-2;

/// Quadratic program of N unknowns and M rows.
pub(super) struct QuadraticProgram<const N: usize, const M: usize> {
    /// Hessian H, N × N, symmetric and positive definite.
    pub hessian: SMatrix<f64, N, N>,
    /// Linear term q of the cost.
    pub slope: SVector<f64, N>,
    /// Lower and upper limits of the unknowns, l and u; infinite for none.
    pub bounds: [SVector<f64, N>; 2],
    /// Gradients a_i of the M limited quantities, one per column.
    pub rows: SMatrix<f64, N, M>,
    /// Lower and upper limits l_i and u_i of a_iᵀ x; infinite for none.
    pub limits: [SVector<f64, M>; 2],
    /// Price of the distance of a_iᵀ x from its limits \[cost per unit\]; infinite for a hard limit.
    pub prices: SVector<f64, M>,
    /// Sides of the limits: N bounds and M rows, first the lower, then the upper ones.
    sides: [Vec<Side>; 2],
}

/// One side of a limit, ± a_iᵀ x ≤ h + s with s ≥ 0, with its iterates.
#[derive(Clone, Copy, Default)]
struct Side {
    /// Limit h; infinite if there is none.
    limit: f64,
    /// Price of the excess s over the program's scale; infinite for a hard limit.
    price: f64,
    /// Slack, t = h + s − (± a_iᵀ x).
    slack: f64,
    multiplier: f64,
    /// Excess s. Its constraint s ≥ 0 has the multiplier price − multiplier.
    excess: f64,
    /// Primal residual, and weight of the side in the reduced (normal) equations.
    residual: f64,
    weight: f64,
    /// Step of slack, multiplier and excess.
    step: [f64; 3],
}

impl Side {
    fn is_limit(&self) -> bool {
        self.limit.is_finite()
    }

    fn is_soft(&self) -> bool {
        self.price.is_finite()
    }

    fn excess_multiplier(&self) -> f64 {
        if self.is_soft() { self.price - self.multiplier } else { 1.0 }
    }

    /// Sum and number of the complementarity products after a share of the step.
    fn complementarity(&self, share: f64) -> (f64, f64) {
        let [slack, multiplier, excess] = self.step.map(|step| share * step);
        let of_limit = (self.slack + slack) * (self.multiplier + multiplier);
        match self.is_soft() {
            true => {
                let of_excess = (self.excess + excess) * (self.excess_multiplier() - multiplier);
                (of_limit + of_excess, 2.0)
            }
            false => (of_limit, 1.0),
        }
    }

    /// Complementarity of the predictor, which makes the products zero.
    fn predictor(&self, _centre: f64) -> [f64; 2] {
        [self.slack * self.multiplier, self.excess * self.excess_multiplier()]
    }

    /// Complementarity of the corrector, which makes the products equal to `centre`, with the predictor's second-order
    /// term.
    fn corrector(&self, centre: f64) -> [f64; 2] {
        let [slack, multiplier, excess] = self.step;
        [
            self.slack * self.multiplier + slack * multiplier - centre,
            self.excess * self.excess_multiplier() - excess * multiplier - centre,
        ]
    }

    /// Right-hand side of this side in the reduced equations, for the given complementarity targets.
    fn wanted(&self, [limit, excess]: [f64; 2]) -> f64 {
        let soft = if self.is_soft() { excess / self.excess_multiplier() } else { 0.0 };
        self.residual + soft - limit / self.multiplier
    }

    /// Sets the step for a change of ± a_iᵀ x.
    fn stepped(&mut self, change: f64, complementarity: [f64; 2]) {
        let multiplier = self.weight * (change + self.wanted(complementarity));
        let [limit, excess] = complementarity;
        let slack = (-limit - self.slack * multiplier) / self.multiplier;
        let excess = match self.is_soft() {
            true => (-excess + self.excess * multiplier) / self.excess_multiplier(),
            false => 0.0,
        };
        self.step = [slack, multiplier, excess];
    }

    /// Largest share of the step that keeps slack, multiplier and excess positive.
    fn largest_share(&self) -> f64 {
        let [slack, multiplier, excess] = self.step;
        let share = |value: f64, step: f64| if step < 0.0 { -value / step } else { f64::INFINITY };
        let hard = share(self.slack, slack).min(share(self.multiplier, multiplier));
        match self.is_soft() {
            true => hard
                .min(share(self.excess, excess))
                .min(share(self.excess_multiplier(), -multiplier)),
            false => hard,
        }
    }
}

impl<const N: usize, const M: usize> QuadraticProgram<N, M> {
    /// Program without cost and limits.
    pub(super) fn empty() -> Self {
        let far = f64::INFINITY;
        Self {
            hessian: SMatrix::zeros(),
            slope: SVector::zeros(),
            bounds: [SVector::repeat(-far), SVector::repeat(far)],
            rows: SMatrix::zeros(),
            limits: [SVector::repeat(-far), SVector::repeat(far)],
            prices: SVector::repeat(far),
            sides: [vec![Side::default(); N + M], vec![Side::default(); N + M]],
        }
    }

    /// Minimum after at most `iterations` iterations from x = 0; none if H is not positive definite, or a
    /// number is not finite. Bounds are met exactly.
    pub(super) fn minimum(&mut self, iterations: u32) -> Option<SVector<f64, N>> {
        let unlimited = -self.hessian.cholesky()?.solve(&self.slope);
        if self.keeps(&unlimited) {
            return Some(unlimited);
        }
        let scale = self.hessian.trace() / N as f64;
        let (hessian, slope) = (self.hessian / scale, self.slope / scale);
        self.start(scale, slope.amax().max(1.0));
        let mut x = SVector::<f64, N>::zeros();
        for _ in 0..iterations {
            let complementarity = self.complementarity(0.0);
            if complementarity < SOLVED {
                break;
            }
            let factored = self.normal_matrix(&hessian, &x).cholesky()?;
            let gradient = hessian * x + slope + self.gradient(|side| side.multiplier);
            let (_, share) = self.newton_step(&factored, &gradient, Side::predictor, 0.0);
            let left = self.complementarity(share.min(1.0)) / complementarity;
            let centre = left * left * left * complementarity;
            let (change, share) = self.newton_step(&factored, &gradient, Side::corrector, centre);
            let share = (STEP * share).min(1.0);
            x += change * share;
            for side in self.sides.iter_mut().flatten().filter(|side| side.is_limit()) {
                let [slack, multiplier, excess] = side.step;
                side.slack += share * slack;
                side.multiplier += share * multiplier;
                side.excess += share * excess;
            }
        }
        let [low, high] = &self.bounds;
        let kept = SVector::<f64, N>::from_fn(|k, _| x[k].max(low[k]).min(high[k]));
        kept.iter().all(|value| value.is_finite()).then_some(kept)
    }

    /// Matrix of the reduced (normal) equations at x; sets residual and weight of each side.
    fn normal_matrix(
        &mut self,
        hessian: &SMatrix<f64, N, N>,
        x: &SVector<f64, N>,
    ) -> SMatrix<f64, N, N> {
        let reached = self.rows.tr_mul(x);
        let mut matrix = *hessian;
        for k in 0..N + M {
            let reached = Self::number(x, &reached, k);
            let mut weight = 0.0;
            for (sign, sides) in signed(&mut self.sides) {
                let side = &mut sides[k];
                if side.is_limit() {
                    side.residual = sign * reached - side.excess + side.slack - side.limit;
                    let soft =
                        if side.is_soft() { side.excess / side.excess_multiplier() } else { 0.0 };
                    side.weight = 1.0 / (side.slack / side.multiplier + soft);
                    weight += side.weight;
                }
            }
            self.add_square(&mut matrix, k, weight);
        }
        matrix
    }

    /// Newton step of x towards the complementarity of each side, and the largest share of it that keeps slacks and
    /// multipliers positive; sets the steps of the sides.
    fn newton_step(
        &mut self,
        factored: &Cholesky<f64, Const<N>>,
        gradient: &SVector<f64, N>,
        complementarity: fn(&Side, f64) -> [f64; 2],
        centre: f64,
    ) -> (SVector<f64, N>, f64) {
        let pushed = self.gradient(|side| side.weight * side.wanted(complementarity(side, centre)));
        let change = factored.solve(&-(*gradient + pushed));
        let reached = self.rows.tr_mul(&change);
        for (sign, sides) in signed(&mut self.sides) {
            for (k, side) in sides.iter_mut().enumerate().filter(|(_, side)| side.is_limit()) {
                let complementarity = complementarity(side, centre);
                side.stepped(sign * Self::number(&change, &reached, k), complementarity);
            }
        }
        let share = |sides: &Vec<Side>| {
            sides
                .iter()
                .filter(|side| side.is_limit())
                .map(Side::largest_share)
                .fold(f64::INFINITY, f64::min)
        };
        let [below, above] = self.sides.each_ref().map(share);
        (change, below.min(above))
    }

    /// Initial slacks and multipliers at x = 0, for a program scaled by `scale` and multipliers of
    /// magnitude `size`.
    fn start(&mut self, scale: f64, size: f64) {
        for k in 0..N + M {
            let (low, high, length, price) = match k.checked_sub(N) {
                None => (self.bounds[0][k], self.bounds[1][k], 1.0, f64::INFINITY),
                Some(row) => {
                    let length = self.rows.column(row).norm().max(1.0);
                    (self.limits[0][row], self.limits[1][row], length, self.prices[row])
                }
            };
            let price = price / scale;
            for (limit, sides) in [-low, high].into_iter().zip(&mut self.sides) {
                let excess = if price.is_finite() { LEAST_SLACK.max(-limit) } else { 0.0 };
                sides[k] = Side {
                    limit,
                    price,
                    slack: limit.max(LEAST_SLACK * length),
                    multiplier: (size / length).min(0.5 * price),
                    excess,
                    ..Side::default()
                };
            }
        }
    }

    /// Value of limited quantity k, unknowns first, for given x and row values.
    fn number(x: &SVector<f64, N>, rows: &SVector<f64, M>, k: usize) -> f64 {
        k.checked_sub(N).map_or_else(|| x[k], |row| rows[row])
    }

    /// Sum of all gradients, each times a value of its sides.
    fn gradient(&self, of: impl Fn(&Side) -> f64) -> SVector<f64, N> {
        let [below, above] = &self.sides;
        let value = |side: &Side| if side.is_limit() { of(side) } else { 0.0 };
        let times = |k: usize| value(&above[k]) - value(&below[k]);
        let mut sum = SVector::<f64, N>::from_fn(|k, _| times(k));
        for (i, row) in self.rows.column_iter().enumerate() {
            sum.axpy(times(N + i), &row, 1.0);
        }
        sum
    }

    /// Adds the weighted outer product of gradient k, bounds first, to the matrix.
    fn add_square(&self, matrix: &mut SMatrix<f64, N, N>, k: usize, weight: f64) {
        let Some(row) = k.checked_sub(N) else {
            matrix[(k, k)] += weight;
            return;
        };
        let row = self.rows.column(row);
        for j in (0..N).filter(|j| row[*j] != 0.0) {
            let times = weight * row[j];
            for i in j..N {
                matrix[(i, j)] += times * row[i];
            }
        }
    }

    /// Mean complementarity after a share of the step.
    fn complementarity(&self, share: f64) -> f64 {
        let limits = self.sides.iter().flatten().filter(|side| side.is_limit());
        let (sum, count) = limits
            .map(|side| side.complementarity(share))
            .fold((0.0, 0.0), |(sum, count), (one, number)| (sum + one, count + number));
        sum / count
    }

    /// Whether x keeps all limits.
    fn keeps(&self, x: &SVector<f64, N>) -> bool {
        let [low, high] = &self.bounds;
        let [row_low, row_high] = &self.limits;
        (0..N).all(|k| (low[k]..=high[k]).contains(&x[k]))
            && self.rows.column_iter().enumerate().all(|(i, row)| {
                let reached = row.dot(x);
                (row_low[i]..=row_high[i]).contains(&reached)
            })
    }
}

/// Both sides with their signs.
fn signed(sides: &mut [Vec<Side>; 2]) -> [(f64, &mut Vec<Side>); 2] {
    let [below, above] = sides;
    [(-1.0, below), (1.0, above)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six unknowns and three rows, the last one with a price.
    fn program() -> QuadraticProgram<6, 3> {
        let root = SMatrix::<f64, 6, 6>::from_fn(|i, j| ((3 * i + 5 * j) as f64).sin());
        QuadraticProgram {
            hessian: root.transpose() * root + SMatrix::identity() * 0.3,
            slope: SVector::from_fn(|i, _| 4.0 * (i as f64).cos()),
            bounds: [SVector::repeat(-1.0), SVector::repeat(1.0)],
            rows: SMatrix::from_fn(|i, j| ((1 + i * (j + 2)) as f64).sin()),
            limits: [SVector::repeat(-0.5), SVector::repeat(0.4)],
            prices: [f64::INFINITY, f64::INFINITY, 0.2].into(),
            ..QuadraticProgram::empty()
        }
    }

    /// Karush-Kuhn-Tucker conditions. The minimum is stationary. A multiplier has the right sign at a
    /// limit, is zero within the limits, and equals the price beyond a soft limit.
    #[test]
    fn the_minimum_meets_the_conditions_of_karush_kuhn_and_tucker() {
        let mut program = program();
        let x = program.minimum(30).unwrap();
        let scale = program.hessian.trace() / 6.0;
        let push = |k: usize| {
            let [below, above] = &program.sides;
            scale * (above[k].multiplier - below[k].multiplier)
        };
        let mut residual = program.hessian * x + program.slope;
        for k in 0..6 {
            residual[k] += push(k);
        }
        for i in 0..3 {
            residual += program.rows.column(i) * push(6 + i);
        }
        assert!(residual.norm() < 1e-6, "{residual}");
        let mut active = [0, 0, 0];
        for k in 0..6 {
            let mu = push(k);
            assert!(x[k].abs() <= 1.0 && (mu.abs() < 1e-6 || (x[k] - mu.signum()).abs() < 1e-6));
            active[0] += usize::from(mu.abs() > 1e-3);
        }
        for i in 0..3 {
            let reached = program.rows.column(i).dot(&x);
            let over = (reached - 0.4).max(-0.5 - reached);
            match push(6 + i).abs() {
                none if none < 1e-6 => assert!(over < 1e-6, "row {i}: {reached}"),
                hard if hard < program.prices[i] - 1e-6 => {
                    assert!(over.abs() < 1e-6, "row {i}: {reached}");
                    active[1] += 1;
                }
                price => {
                    assert!(over > 0.0 && (price - program.prices[i]).abs() < 1e-6, "row {i}");
                    active[2] += 1;
                }
            }
        }
        assert!(active.iter().all(|count| *count > 0), "nothing of each kind: {active:?}");
    }

    /// Exact penalty. With a price above the multiplier of the hard limit the minimum is that of the hard
    /// program. With a price below it the limit is exceeded.
    #[test]
    fn a_penalty_above_the_multiplier_acts_as_a_hard_limit() {
        let minimum = |price: f64| {
            let mut program = program();
            program.prices[2] = price;
            (program.minimum(40).unwrap(), program)
        };
        let (hard, solved) = minimum(f64::INFINITY);
        let scale = solved.hessian.trace() / 6.0;
        let [below, above] = &solved.sides;
        let multiplier = scale * (above[8].multiplier - below[8].multiplier).abs();
        let over = |x: &SVector<f64, 6>| {
            let reached = solved.rows.column(2).dot(x);
            (reached - 0.4).max(-0.5 - reached)
        };
        assert!(multiplier > 0.1 && over(&hard).abs() < 1e-7, "{multiplier} {}", over(&hard));
        for times in [1.05, 3.0, 1e3] {
            let x = minimum(times * multiplier).0;
            assert!((x - hard).amax() < 1e-6 && over(&x) < 1e-7, "{times}: {x} {hard}");
        }
        for times in [0.5, 0.95] {
            let x = minimum(times * multiplier).0;
            assert!(over(&x) > 1e-4, "{times}: {}", over(&x));
        }
    }

    #[test]
    fn ten_iterations_are_sufficient() {
        let exact = program().minimum(30).unwrap();
        let found = program().minimum(10).unwrap();
        assert!((found - exact).amax() < 1e-5, "{found} {exact}");
    }

    #[test]
    fn without_active_limits_the_minimum_is_the_unconstrained_one() {
        let mut program = program();
        program.slope *= 1e-2;
        let x = program.minimum(0).unwrap();
        assert!((program.hessian * x + program.slope).norm() < 1e-12);
    }
}
