//! Error covariance of the filter with consider parameters (Schmidt-Kalman analysis).
//!
//! The filter's own covariance P gives its gain K; it takes the parameters of the reduced model for exact, and a load
//! for one that hardly changes. The error covariance takes K as given, and follows the errors e of the states together
//! with those of consider parameters c, which are constant and never estimated:
//!
//! ```text
//! e⁻ = F e + G c + w,   e = e⁻ − K (H e⁻ + H_c c + v)
//! ```
//!
//! The estimator reports this covariance. It changes no estimate.
//!
//! Sources: S. Schmidt, *Application of State-Space Methods to Navigation Problems*, 1966 (consider parameters); A.
//! Gelb (ed.), *Applied Optimal Estimation*, 1974, chapter 7 (covariance of a filter whose gain is given).

use super::reduced_model::{MachineState, ReducedModel, STATES};
use hydroboom_math::{Dual, Real, record};

record! {
    /// Standard deviations of the consider parameters: parameters of the reduced model that the filter treats as
    /// exact.
    pub struct ConsideredParameters<T> {
        /// Coulomb friction over the piston's area, p_C
        #[unit = "Pa"]
        pub coulomb: T,
        /// Viscous friction coefficient over the piston's area, p_v
        #[unit = "Pa s/m"]
        pub viscous: T,
        /// Volume delivered per revolution of the pump, D
        #[unit = "m³/rev"]
        pub displacement: T,
        /// Equivalent mass, as a factor on that of the reduced model
        #[unit = "1"]
        pub equivalent_mass: T,
        /// Time constant of the position sensor
        #[unit = "s"]
        pub sensor_lag: T,
    }
}

/// Number of consider parameters.
pub const CONSIDERED: usize = ConsideredParameters::NAMES.len();
/// Number of errors in the error covariance: states, then consider parameters.
pub const ERRORS: usize = STATES + CONSIDERED;

/// Covariance matrix of `N` errors, by rows; the first [`STATES`] of them are those of the states, in the order of
/// [`MachineState`]. Units are products of the states' units.
pub type Covariance<T, const N: usize = STATES> = [[T; N]; N];

/// Reduced model with dual numbers whose derivatives are by states, then by the consider parameters.
pub fn with_considered<T: Real>(model: &ReducedModel<T>) -> ReducedModel<Dual<T, ERRORS>> {
    let variable = |value: T, parameter: usize| Dual::variable(value, STATES + parameter);
    let exact = model.map(Dual::constant);
    let factor = variable(T::one(), 3);
    ReducedModel {
        coulomb: variable(model.coulomb, 0),
        viscous: variable(model.viscous, 1),
        displacement: variable(model.displacement, 2),
        equivalent_mass: exact.equivalent_mass.map(|mass| mass.map(|c| c * factor)),
        // which is a polynomial times the acceleration squared, and stays
        compliance: exact.compliance.map(|compliance| compliance.map(|c| c * factor.square())),
        ..exact
    }
}

/// Reduced model and state as independent variables: dual numbers with derivatives by states, then by the consider
/// parameters.
pub fn as_variables<T: Real>(
    model: &ReducedModel<T>,
    estimate: &MachineState<T>,
) -> (ReducedModel<Dual<T, ERRORS>>, MachineState<Dual<T, ERRORS>>) {
    let mut direction = 0..STATES;
    let z = estimate.map(|value| Dual::variable(value, direction.next().unwrap_or(0)));
    (with_considered(model), z)
}

/// Standard deviation σ of a scalar function h of the states by first-order propagation, σ² = ∇h P ∇hᵀ, in the unit of
/// h. `slopes` is ∇h. A variance that rounding makes negative counts as zero.
pub fn output_deviation<T: Real, const N: usize>(p: &Covariance<T, N>, slopes: &[T; N]) -> T {
    let variance = p.iter().zip(slopes).fold(T::zero(), |sum, (row, slope)| {
        let product = row.iter().zip(slopes).fold(T::zero(), |sum, (p, s)| p.mul_add(*s, sum));
        slope.mul_add(product, sum)
    });
    variance.max(T::zero()).sqrt()
}

/// Diagonal covariance matrix of independent errors with these standard deviations, each in its error's unit.
pub fn independent<T: Real, const N: usize>(deviations: &[T; N]) -> Covariance<T, N> {
    core::array::from_fn(|i| {
        core::array::from_fn(|j| if i == j { deviations[i].square() } else { T::zero() })
    })
}

/// Covariance one control period later, `J P Jᵀ`. `rows` are the rows of the Jacobian J for the states; its remaining
/// rows are those of the identity.
#[inline(always)]
pub fn propagated<T: Real, const N: usize>(
    p: &Covariance<T, N>,
    rows: &[[T; N]; STATES],
) -> Covariance<T, N> {
    // J P, then J P Jᵀ
    let (_, left) = T::repeat(rows, [], |_, row, []| {
        let product = (0..N).fold([T::zero(); N], |sum, k| {
            core::array::from_fn(|j| row[k].mul_add(p[k][j], sum[j]))
        });
        ([], product)
    });
    let left: Covariance<T, N> = core::array::from_fn(|i| left.get(i).copied().unwrap_or(p[i]));
    let (_, product) = T::repeat(&left, [], |_, row, []| {
        let by = |j: usize| match rows.get(j) {
            Some(state) => (0..N).fold(T::zero(), |sum, k| row[k].mul_add(state[k], sum)),
            None => row[j],
        };
        ([], core::array::from_fn(by))
    });
    product
}

/// Measurement update of a covariance by one scalar measurement in Joseph's form, valid for any gain K.
///
/// Computes `P − K (H P) − (P Hᵀ) Kᵀ + K S Kᵀ`. `gain` is K, `shared` is `P Hᵀ`, and `s` is the variance S of the
/// innovation.
#[inline(always)]
pub fn corrected<T: Real, const N: usize>(
    p: &mut Covariance<T, N>,
    gain: &[T; N],
    shared: &[T; N],
    s: T,
) {
    for i in 0..N {
        for j in 0..=i {
            let joseph =
                p[i][j] - gain[i] * shared[j] - shared[i] * gain[j] + gain[i] * gain[j] * s;
            p[i][j] = joseph;
            p[j][i] = joseph;
        }
    }
}

/// Limits variances: scales rows and columns so that no variance exceeds its limit, and correlations stay.
///
/// `most` has pairs of index, below `N`, and largest variance in the error's unit squared.
#[inline(always)]
pub fn limit<T: Real, const N: usize>(p: &mut Covariance<T, N>, most: &[(usize, T)]) {
    for (place, most) in most {
        let scale = (*most / p[*place][*place]).min(T::one()).sqrt();
        for other in 0..N {
            p[*place][other] = p[*place][other] * scale;
            p[other][*place] = p[other][*place] * scale;
        }
    }
}
