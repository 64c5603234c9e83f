//! A crane in motion: parameters, state, scheme and clock, with every step checked.

use crate::crane::{Crane, CraneState, Input};
use crate::stepping::{Implicit, MOST_PARTS, StepBound, StepLimit, published, runge_kutta_4};
use crate::validity::Invalid;
use core::fmt;

/// How a simulation moves in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// The paper's, of first order; takes substeps above its step limit.
    Published,
    /// Implicit, of second order; no step limit. Steps that do not settle are divided.
    Implicit,
    /// Classical Runge-Kutta, of fourth order; takes substeps above its step limit.
    RungeKutta4,
}

/// More substeps than this are refused: the requested step does not suit the scheme.
const MOST_SUBSTEPS: f64 = 1000.0;

/// Error of a simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SimulationError {
    /// The state after a step is not one the model holds for; the simulation stays at the last
    /// good state.
    Invalid {
        /// Time of the last good state \[s\].
        time: f64,
        /// What was violated.
        reason: Invalid,
    },
    /// An implicit step could not be solved, not even in the smallest parts.
    Unsettled {
        /// Time of the last good state \[s\].
        time: f64,
    },
    /// An input is not a finite number.
    Input {
        /// Time of the last good state \[s\].
        time: f64,
    },
    /// The step is far above the scheme's limit, or not a positive number.
    Step {
        /// Time of the last good state \[s\].
        time: f64,
        /// Requested step \[s\].
        step: f64,
        /// Largest step without substeps \[s\].
        limit: f64,
        /// Which limit it is.
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

/// A crane in motion.
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
    /// A simulation at `state`, to be moved in steps of `step` \[s\].
    ///
    /// # Errors
    ///
    /// [`SimulationError`] when the step does not suit the scheme or the state is not valid.
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

    /// Moves on by `count` steps under a constant input.
    ///
    /// # Errors
    ///
    /// [`SimulationError`] when the input or the new state is not valid; the state is then the
    /// last good one.
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

    /// Moves a state on by `count` steps of an explicit scheme, each divided as its limits ask for; the most substeps of a step.
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

    /// The step \[s\].
    pub fn step(&self) -> f64 {
        self.step
    }

    /// The most substeps that a step was divided into so far, to stay below the scheme's limit.
    pub fn substeps(&self) -> u32 {
        self.substeps
    }

    /// The crane.
    pub fn crane(&self) -> &Crane<f64, N> {
        &self.crane
    }

    /// Its state now.
    pub fn state(&self) -> &CraneState<f64, N> {
        &self.state
    }

    /// Puts the crane into another state, at the same time.
    ///
    /// # Errors
    ///
    /// [`SimulationError`] when the state is not valid; the simulation then stays as it was.
    pub fn set_state(&mut self, state: CraneState<f64, N>) -> Result<(), SimulationError> {
        self.crane
            .validity(&state)
            .check()
            .map_err(|reason| SimulationError::Invalid { time: self.time(), reason })?;
        self.state = state;
        Ok(())
    }

    /// Continues with other parameters, such as those of warmed oil. Step and substeps stay.
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
