//! Time simulation of a crane: parameters, state, scheme and clock, with every step checked.

use crate::crane::{Crane, CraneState, Input};
use crate::stepping::{Implicit, MOST_PARTS, StepBound, StepLimit, published, runge_kutta_4};
use crate::validity::Invalid;
use core::fmt;

/// Integration scheme of a simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// First-order scheme of the paper (30) to (32); takes substeps above its [step limit](StepLimit).
    Published,
    /// Implicit second-order Runge-Kutta scheme without step limit; a step that does not converge is divided.
    Implicit,
    /// Classical fourth-order Runge-Kutta scheme; takes substeps above its [step limit](StepLimit).
    RungeKutta4,
}

/// More substeps than this are refused: the requested step does not suit the scheme.
const MOST_SUBSTEPS: f64 = 1000.0;

/// Reason why a simulation cannot continue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SimulationError {
    /// The new state is outside the model's range of validity; the simulation stays at the last valid state.
    Invalid {
        /// Time of the last valid state \[s\].
        time: f64,
        /// Violated condition.
        reason: Invalid,
    },
    /// An implicit step did not converge, even in [`MOST_PARTS`] parts.
    Unsettled {
        /// Time of the last valid state \[s\].
        time: f64,
    },
    /// An input is not a finite number.
    Input {
        /// Time of the last valid state \[s\].
        time: f64,
    },
    /// The step is not positive and finite, or more than 1000 times the scheme's limit.
    Step {
        /// Time of the last valid state \[s\].
        time: f64,
        /// Requested step \[s\].
        step: f64,
        /// Largest step without substeps \[s\].
        limit: f64,
        /// Effect that determines the limit.
        bound: StepBound,
    },
}

impl fmt::Display for SimulationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Invalid { time, reason } => write!(f, "at t = {time:.6} s {reason}"),
            Self::Unsettled { time } => write!(
                f,
                "after t = {time:.6} s the implicit step has no solution, in {MOST_PARTS} parts neither: \
                 the crane does something too violent for the model, or for this step"
            ),
            Self::Input { time } => {
                write!(f, "after t = {time:.6} s an input is not a finite number")
            }
            Self::Step { time, step, limit, bound } => write!(
                f,
                "after t = {time:.6} s a step of {:.3} us is not possible: the scheme's limit {bound} is {:.3} us, \
                 and more than {MOST_SUBSTEPS} substeps are refused",
                step * 1e6,
                limit * 1e6
            ),
        }
    }
}

impl core::error::Error for SimulationError {}

/// Time simulation of a crane: parameters, state, scheme and clock, with every step checked.
#[derive(Clone, Debug)]
pub struct Simulation<const N: usize> {
    crane: Crane<f64, N>,
    state: CraneState<f64, N>,
    stepper: Stepper,
    step: f64,
    /// Substeps of each step, more where bristles of friction slide fast.
    usual_substeps: u32,
    /// The most that a step was divided into.
    substeps: u32,
    /// Steps taken; the time is a product, so that it does not drift over hours.
    count: u64,
}

/// Parts of a step that are no longer than a limit \[s\].
fn parts(step: f64, limit: f64) -> f64 {
    libm::ceil(step / limit * (1.0 - 1e-12)).max(1.0)
}

#[expect(clippy::large_enum_variant, reason = "one per simulation, never moved in the cycle")]
#[derive(Clone, Debug)]
enum Stepper {
    Published,
    Implicit(Implicit<f64>),
    RungeKutta4,
}

impl<const N: usize> Simulation<N> {
    /// Simulation from `state` at t = 0, in steps of `step` \[s\].
    ///
    /// # Errors
    ///
    /// [`SimulationError::Invalid`] if the state is outside the model's range of validity. [`SimulationError::Step`]
    /// if the step is not positive and finite, or more than 1000 times the limit of an explicit scheme at this state.
    pub fn new(
        crane: Crane<f64, N>,
        state: CraneState<f64, N>,
        scheme: Scheme,
        step: f64,
    ) -> Result<Self, SimulationError> {
        crane
            .validity(&state)
            .check()
            .map_err(|reason| SimulationError::Invalid { time: 0.0, reason })?;
        let (limit, bound) = match scheme {
            // the region of stability of Runge-Kutta reaches about twice as far
            Scheme::Published | Scheme::RungeKutta4 => {
                let limits = crane.step_limit(&state);
                (limits.smallest(), limits.bound())
            }
            Scheme::Implicit => (f64::INFINITY, StepBound::Bending),
        };
        let wanted = parts(step, limit);
        if !(step > 0.0 && step.is_finite() && wanted <= MOST_SUBSTEPS) {
            return Err(SimulationError::Step { time: 0.0, step, limit, bound });
        }
        let stepper = match scheme {
            Scheme::Published => Stepper::Published,
            Scheme::Implicit => Stepper::Implicit(Implicit::new(&crane)),
            Scheme::RungeKutta4 => Stepper::RungeKutta4,
        };
        let substeps = wanted as u32;
        Ok(Self { crane, state, stepper, step, usual_substeps: substeps, substeps, count: 0 })
    }

    /// Advances by `count` steps under a constant input.
    ///
    /// # Errors
    ///
    /// In every case the state and the time stay those before the call.
    ///
    /// - [`SimulationError::Input`] if the input is NaN or infinite.
    /// - [`SimulationError::Unsettled`] if an implicit step does not converge.
    /// - [`SimulationError::Step`] if bristles slide so fast that a step of an explicit scheme needs over 1000
    ///   substeps.
    /// - [`SimulationError::Invalid`] if the state after the last step is outside the model's range of validity.
    pub fn advance(&mut self, input: &Input<f64>, count: u32) -> Result<(), SimulationError> {
        if !(input.pump_speed.is_finite() && input.holding_valve.is_finite()) {
            return Err(SimulationError::Input { time: self.time() });
        }
        let mut state = self.state;
        let mut most_substeps = self.substeps;
        match &self.stepper {
            Stepper::Published => {
                let step = |state: &mut _, step| published(&self.crane, state, input, step);
                most_substeps = self.substepped(&mut state, count, step)?;
            }
            Stepper::Implicit(scheme) => {
                let step = self.step / f64::from(self.usual_substeps);
                for _ in 0..u64::from(count) * u64::from(self.usual_substeps) {
                    state = scheme
                        .settled(&self.crane, &state, input, step)
                        .ok_or(SimulationError::Unsettled { time: self.time() })?;
                }
            }
            Stepper::RungeKutta4 => {
                let step = |state: &mut _, step| runge_kutta_4(&self.crane, state, input, step);
                most_substeps = self.substepped(&mut state, count, step)?;
            }
        }
        self.crane
            .validity(&state)
            .check()
            .map_err(|reason| SimulationError::Invalid { time: self.time(), reason })?;
        self.state = state;
        self.substeps = most_substeps;
        self.count += u64::from(count);
        Ok(())
    }

    /// Moves a state on by `count` steps of an explicit scheme, each divided as its limits ask for; the most substeps
    /// of a step.
    #[inline(always)]
    fn substepped(
        &self,
        state: &mut CraneState<f64, N>,
        count: u32,
        scheme: impl Fn(&mut CraneState<f64, N>, f64),
    ) -> Result<u32, SimulationError> {
        let mut most = self.substeps;
        for _ in 0..count {
            let substeps = self.substeps_from(state)?;
            most = most.max(substeps);
            let step = self.step / f64::from(substeps);
            for _ in 0..substeps {
                scheme(state, step);
            }
        }
        Ok(most)
    }

    /// Substeps of the next step: more than usual where the bristles of friction slide fast.
    #[inline(always)]
    fn substeps_from(&self, state: &CraneState<f64, N>) -> Result<u32, SimulationError> {
        let limit = self.crane.bristle_limit_at(state);
        if self.step <= limit {
            return Ok(self.usual_substeps);
        }
        let wanted = parts(self.step, limit);
        if wanted > MOST_SUBSTEPS {
            let (time, step) = (self.time(), self.step);
            return Err(SimulationError::Step { time, step, limit, bound: StepBound::Bristle });
        }
        Ok(self.usual_substeps.max(wanted as u32))
    }

    /// Time since the start \[s\].
    pub fn time(&self) -> f64 {
        self.count as f64 * self.step
    }

    /// Step size \[s\].
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Largest number of substeps per step so far, taken to stay below the scheme's step limit.
    pub fn substeps(&self) -> u32 {
        self.substeps
    }

    /// Parameters of the crane.
    pub fn crane(&self) -> &Crane<f64, N> {
        &self.crane
    }

    /// Present state.
    pub fn state(&self) -> &CraneState<f64, N> {
        &self.state
    }

    /// Replaces the state; the time stays.
    ///
    /// # Errors
    ///
    /// [`SimulationError::Invalid`] if the state is outside the model's range of validity; the simulation then stays
    /// as it was.
    pub fn set_state(&mut self, state: CraneState<f64, N>) -> Result<(), SimulationError> {
        self.crane
            .validity(&state)
            .check()
            .map_err(|reason| SimulationError::Invalid { time: self.time(), reason })?;
        self.state = state;
        Ok(())
    }

    /// Replaces the parameters during the run, for example those of warmer oil. Step size and substeps stay: the limit
    /// of an explicit scheme is not derived anew.
    pub fn set_crane(&mut self, crane: Crane<f64, N>) {
        self.crane = crane;
        if let Stepper::Implicit(scheme) = &mut self.stepper {
            *scheme = Implicit::new(&self.crane);
        }
    }

    /// Step limit of the published scheme at the present state.
    pub fn step_limit(&self) -> StepLimit {
        self.crane.step_limit(&self.state)
    }
}
