//! Numbers that a model can be run over, and its steps over them.

use hydroboom_math::{Dual, Real};
use hydroboom_model::stepping::{Implicit, MOST_PARTS, Underlying, has_settled};
use hydroboom_model::{
    Circuit, Crane, CraneState, EquilibriumError, Start, ValveControlled, ValveCraneState,
    ValveStart,
};

/// A number that a model can be run over: plain, or with slopes.
pub trait Number: Real {
    /// What steps over it need beside the crane.
    type Scheme<const N: usize, C: Circuit<Self>>;

    /// Without slopes.
    fn plain(self) -> f64;

    /// Prepares steps of a crane.
    fn scheme<const N: usize, C: Circuit<Self>>(crane: &Crane<Self, N, C>) -> Self::Scheme<N, C>;

    /// One step \[s\]; how well it was solved, as [`Implicit::step`] returns it.
    fn step<const N: usize, C: Circuit<Self>>(
        scheme: &Self::Scheme<N, C>,
        crane: &Crane<Self, N, C>,
        state: &mut CraneState<Self, N, C::State>,
        input: &C::Input,
        step: f64,
    ) -> f64;

    /// The state of rest of a self-contained crane.
    ///
    /// # Errors
    ///
    /// [`EquilibriumError`] where there is none.
    fn rest<const N: usize>(
        crane: &Crane<Self, N>,
        start: &Start<Self>,
    ) -> Result<CraneState<Self, N>, EquilibriumError>;

    /// The state of rest of a valve-controlled crane.
    ///
    /// # Errors
    ///
    /// [`EquilibriumError`] where there is none.
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

/// A model's steps.
pub struct Stepper<T: Number, const N: usize, C: Circuit<T>> {
    scheme: T::Scheme<N, C>,
}

impl<T: Number, const N: usize, C: Circuit<T>> Stepper<T, N, C> {
    /// Prepares steps of a crane; to be used with that crane only.
    pub fn new(crane: &Crane<T, N, C>) -> Self {
        Self { scheme: T::scheme(crane) }
    }

    /// The state a time \[s\] later, under an input that holds, in at least so many steps, and as many as they need to
    /// settle; none where they do not.
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
