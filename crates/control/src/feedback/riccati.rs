//! Linear-quadratic regulator by the Riccati difference equation, one step a control period.
//!
//! ```text
//! K = (r + bᵀ P b)⁻¹ bᵀ P A
//! P ← (A − b K)ᵀ P (A − b K) + Kᵀ r K + Q
//! ```
//!
//! The recursion (value iteration) has A, b of the present operating point. It converges to the regulator's
//! gain within the closed loop's own settling time, and tracks it as the operating point moves. Joseph's
//! form keeps P symmetric and positive semi-definite under rounding.
//!
//! Source: D. Bertsekas, *Dynamic Programming and Optimal Control*, vol. 1, section 3.1.

use hydroboom_math::Real;

/// Number of states of the regulator: load position \[m\], load velocity \[m/s\], load pressure \[Pa\], motor speed
/// \[rev/s\].
pub const ORDER: usize = 4;
/// A square matrix, rows first.
pub type Matrix<T> = [[T; ORDER]; ORDER];

/// Discrete linear-quadratic problem: plant `z(k+1) = A z + b u` with stage cost `zᵀ Q z + r u²`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearQuadratic<T> {
    /// State matrix A.
    pub transition: Matrix<T>,
    /// Input vector b.
    pub input: [T; ORDER],
    /// Weights of the states, Q.
    pub state_cost: Matrix<T>,
    /// Weight of the input, r, positive.
    pub input_cost: T,
}

/// State of the Riccati recursion: cost-to-go matrix and gain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regulator<T> {
    /// Cost-to-go matrix P.
    pub cost_to_go: Matrix<T>,
    /// Gain K of `u = −K z`, with the motor speed u in \[rev/s\] and the states z in their own units.
    pub gain: [T; ORDER],
}

#[inline(always)]
pub(crate) fn product<T: Real>(a: &Matrix<T>, b: &Matrix<T>) -> Matrix<T> {
    core::array::from_fn(|i| {
        core::array::from_fn(|j| (0..ORDER).fold(T::zero(), |sum, k| a[i][k].mul_add(b[k][j], sum)))
    })
}

/// Scalar product `aᵀ b`.
#[inline(always)]
pub fn dot<T: Real>(a: &[T; ORDER], b: &[T; ORDER]) -> T {
    a.iter().zip(b).fold(T::zero(), |sum, (a, b)| a.mul_add(*b, sum))
}

/// `zᵀ P z`
#[inline(always)]
pub(crate) fn quadratic<T: Real>(p: &Matrix<T>, z: &[T; ORDER]) -> T {
    (0..ORDER).fold(T::zero(), |sum, i| z[i].mul_add(dot(&p[i], z), sum))
}

impl<T: Real> LinearQuadratic<T> {
    /// Zero-order-hold discretisation of `z' = A z + b u` with a sampling period \[s\], by the series of the matrix
    /// exponential up to the fourth order.
    #[inline(always)]
    pub fn sampled(
        a: &Matrix<T>,
        b: &[T; ORDER],
        state_cost: Matrix<T>,
        input_cost: T,
        period: T,
    ) -> Self {
        let scaled = a.map(|row| row.map(|v| v * period));
        let second = product(&scaled, &scaled);
        let third = product(&second, &scaled);
        // ∫ e^{A t} dt over the period, over the period
        let mean: Matrix<T> = core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                let one = if i == j { T::one() } else { T::zero() };
                one + T::lit(0.5) * scaled[i][j]
                    + second[i][j] * T::lit(1.0 / 6.0)
                    + third[i][j] * T::lit(1.0 / 24.0)
            })
        });
        let transition = product(&scaled, &mean);
        let transition = core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                if i == j { transition[i][j] + T::one() } else { transition[i][j] }
            })
        });
        let input = core::array::from_fn(|i| dot(&mean[i], b) * period);
        Self { transition, input, state_cost, input_cost }
    }
}

impl<T: Real> Regulator<T> {
    /// Initial state: the cost of one period, P = Q, and zero gain until the first [`step`](Self::step).
    pub fn start(plant: &LinearQuadratic<T>) -> Self {
        Self { cost_to_go: plant.state_cost, gain: [T::zero(); ORDER] }
    }

    /// One step of the Riccati difference equation.
    #[inline(always)]
    pub fn step(&mut self, plant: &LinearQuadratic<T>) {
        let LinearQuadratic { transition: a, input: b, state_cost, input_cost } = plant;
        let p = &self.cost_to_go;
        let p_b: [T; ORDER] = core::array::from_fn(|i| dot(&p[i], b));
        let scale = T::one() / (*input_cost + dot(&p_b, b));
        let gain: [T; ORDER] = core::array::from_fn(|j| {
            (0..ORDER).fold(T::zero(), |sum, i| p_b[i].mul_add(a[i][j], sum)) * scale
        });
        let closed: Matrix<T> =
            core::array::from_fn(|i| core::array::from_fn(|j| a[i][j] - b[i] * gain[j]));
        let p_closed = product(p, &closed);
        let mut next = *state_cost;
        for i in 0..ORDER {
            for j in 0..=i {
                let carried =
                    (0..ORDER).fold(T::zero(), |sum, k| closed[k][i].mul_add(p_closed[k][j], sum));
                let value = carried + gain[i] * *input_cost * gain[j] + state_cost[i][j];
                next[i][j] = value;
                next[j][i] = value;
            }
        }
        (self.cost_to_go, self.gain) = (next, gain);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An integrator z' = u with stage costs q z² and r u² (per period): the continuous gain is the root of q/r.
    #[test]
    fn a_fast_sampled_integrator_gets_the_continuous_gain() {
        let a: Matrix<f64> = core::array::from_fn(|i| {
            core::array::from_fn(|j| if i == j && i > 0 { -1.0 } else { 0.0 })
        });
        let mut q = [[0.0; ORDER]; ORDER];
        q[0][0] = 4.0;
        let plant = LinearQuadratic::sampled(&a, &[1.0, 0.0, 0.0, 0.0], q, 1.0, 1e-3);
        let mut regulator = Regulator::start(&plant);
        for _ in 0..20_000 {
            regulator.step(&plant);
        }
        assert!((regulator.gain[0] - 2.0).abs() < 5e-3, "{regulator:?}");
    }

    /// The sum of the stage costs along the closed loop equals the cost to go of the initial state.
    #[test]
    fn the_cost_to_go_is_the_sum_of_stage_costs() {
        let a = [
            [0.0, 1.0, 0.0, 0.0],
            [0.0, -0.2, 30.0, 0.0],
            [0.0, -20.0, 0.0, 15.0],
            [0.0, 0.0, 0.0, -100.0],
        ];
        let mut q = [[0.0; ORDER]; ORDER];
        (q[0][0], q[1][1]) = (50.0, 1.0);
        let plant = LinearQuadratic::sampled(&a, &[0.0, 0.0, 0.0, 100.0], q, 0.3, 1e-3);
        let mut regulator = Regulator::start(&plant);
        for _ in 0..20_000 {
            regulator.step(&plant);
        }
        let begin = [1.0, -0.5, 0.3, 0.7];
        let (mut z, mut sum) = (begin, 0.0);
        for _ in 0..20_000 {
            let u = -dot(&regulator.gain, &z);
            sum += quadratic(&q, &z) + 0.3 * u * u;
            z = core::array::from_fn(|i| dot(&plant.transition[i], &z) + plant.input[i] * u);
        }
        let expected: f64 = quadratic(&regulator.cost_to_go, &begin);
        assert!((sum / expected - 1.0).abs() < 1e-9, "{sum} for {expected}");
    }
}
