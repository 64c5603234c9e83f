//! Number types over which a model can be simulated, `f64` or dual numbers, and the integration step of each.

use hydroboom_math::{Dual, Real};
use hydroboom_model::stepping::{Implicit, MOST_PARTS, Underlying, has_settled};
use hydroboom_model::{
    Circuit, Crane, CraneState, EquilibriumError, Start, ValveControlled, ValveCraneState,
    ValveStart,
};

/// Number type over which a model can be simulated: `f64`, or dual numbers for forward-mode automatic differentiation.
pub trait Number: Real {
    /// Data that an integration step needs besides the crane.
    type Scheme<const N: usize, C: Circuit<Self>>;

    /// Value without derivatives.
    fn plain(self) -> f64;

    /// Prepares the integration of a crane.
    fn scheme<const N: usize, C: Circuit<Self>>(crane: &Crane<Self, N, C>) -> Self::Scheme<N, C>;

    /// One step \[s\]; returns the residual of its solution, as [`Implicit::step`].
    fn step<const N: usize, C: Circuit<Self>>(
        scheme: &Self::Scheme<N, C>,
        crane: &Crane<Self, N, C>,
        state: &mut CraneState<Self, N, C::State>,
        input: &C::Input,
        step: f64,
    ) -> f64;

    /// State of rest of a self-contained crane.
    ///
    /// # Errors
    ///
    /// [`EquilibriumError`] if there is none.
    fn rest<const N: usize>(
        crane: &Crane<Self, N>,
        start: &Start<Self>,
    ) -> Result<CraneState<Self, N>, EquilibriumError>;

    /// State of rest of a valve-controlled crane.
    ///
    /// # Errors
    ///
    /// [`EquilibriumError`] if there is none.
    fn valve_rest<const N: usize>(
        crane: &Crane<Self, N, ValveControlled<Self>>,
        start: &ValveStart<Self>,
    ) -> Result<ValveCraneState<Self, N>, EquilibriumError>;
}

impl Number for f64 {
    type Scheme<const N: usize, C: Circuit<f64>> = Implicit<f64, C>;

    fn plain(self) -> f64 {
        self
    }

    fn scheme<const N: usize, C: Circuit<f64>>(crane: &Crane<f64, N, C>) -> Implicit<f64, C> {
        Implicit::new(crane)
    }

    fn step<const N: usize, C: Circuit<f64>>(
        scheme: &Implicit<f64, C>,
        crane: &Crane<f64, N, C>,
        state: &mut CraneState<f64, N, C::State>,
        input: &C::Input,
        step: f64,
    ) -> f64 {
        scheme.step(crane, state, input, step)
    }

    fn rest<const N: usize>(
        crane: &Crane<f64, N>,
        start: &Start,
    ) -> Result<CraneState<f64, N>, EquilibriumError> {
        crane.at_rest(start)
    }

    fn valve_rest<const N: usize>(
        crane: &Crane<f64, N, ValveControlled<f64>>,
        start: &ValveStart,
    ) -> Result<ValveCraneState<f64, N>, EquilibriumError> {
        crane.at_rest(start)
    }
}

impl<const P: usize> Number for Dual<f64, P> {
    type Scheme<const N: usize, C: Circuit<Self>> = Underlying<N, P, C>;

    fn plain(self) -> f64 {
        self.value
    }

    fn scheme<const N: usize, C: Circuit<Self>>(crane: &Crane<Self, N, C>) -> Underlying<N, P, C> {
        Underlying::new(crane)
    }

    fn step<const N: usize, C: Circuit<Self>>(
        scheme: &Underlying<N, P, C>,
        crane: &Crane<Self, N, C>,
        state: &mut CraneState<Self, N, C::State>,
        input: &C::Input,
        step: f64,
    ) -> f64 {
        scheme.step(crane, state, input, step)
    }

    fn rest<const N: usize>(
        crane: &Crane<Self, N>,
        start: &Start<Self>,
    ) -> Result<CraneState<Self, N>, EquilibriumError> {
        crane.at_rest_along(start)
    }

    fn valve_rest<const N: usize>(
        crane: &Crane<Self, N, ValveControlled<Self>>,
        start: &ValveStart<Self>,
    ) -> Result<ValveCraneState<Self, N>, EquilibriumError> {
        crane.at_rest_along(start)
    }
}

/// Implicit time integration of a model, over `f64` or dual numbers.
pub struct Stepper<T: Number, const N: usize, C: Circuit<T>> {
    scheme: T::Scheme<N, C>,
}

impl<T: Number, const N: usize, C: Circuit<T>> Stepper<T, N, C> {
    /// Prepares the integration of a crane; the result is valid for that crane only.
    pub fn new(crane: &Crane<T, N, C>) -> Self {
        Self { scheme: T::scheme(crane) }
    }

    /// State after a time \[s\] under a constant input. The number of equal steps begins with `steps`, at least 1, and
    /// is doubled until every step converges; none if [`MOST_PARTS`] steps are not enough. With 0 steps the state does
    /// not move.
    pub fn moved(
        &self,
        crane: &Crane<T, N, C>,
        state: &CraneState<T, N, C::State>,
        input: &C::Input,
        time: f64,
        steps: u32,
    ) -> Option<CraneState<T, N, C::State>> {
        let mut parts = steps;
        while parts <= MOST_PARTS {
            let mut trial = *state;
            let step = time / f64::from(parts);
            let mut settles = || has_settled(T::step(&self.scheme, crane, &mut trial, input, step));
            if (0..parts).all(|_| settles()) {
                return Some(trial);
            }
            parts *= 2;
        }
        None
    }
}
