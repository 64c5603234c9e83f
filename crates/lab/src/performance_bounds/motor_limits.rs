//! Limits of the motor, speed and slew: the least tracking error that the best motor speeds leave, with the whole model and the whole reference known.
//!
//! The crane is linearised along the reference with exact slopes, and the [convex problem](super::optimal_control) of its motor speeds is solved: what is found is
//! the least error of the linearised crane, but for a duality gap that is told. The motor speed itself is optimised: where speed and slew are all that limits
//! it, what lies between command and motor, a known lag or dead time, costs nothing along a known reference. Without a limit on the slew the motor speed is
//! constant in each period, with one it is continuous and piecewise linear.

use super::crane_along_course::CraneAlongCourse;
use super::optimal_control::{LinearPeriod, best_deviation};
use crate::LabError;
use hydroboom_control::actuator_limits::ActuatorLimits;
use hydroboom_control::estimation::reduced_model::{MachineState, ReducedModel};
use hydroboom_math::Dual;
use nalgebra::{SMatrix, SVector};

/// Load position and velocity, load pressure, friction, motor speed.
const STATES: usize = 5;
/// Their units: mm, mm/s, bar, bar, rev/s.
const UNITS: [f64; STATES] = [1e-3, 1e-3, 1e5, 1e5, 1.0];
/// What a change of motor speed by 1 rev/s from one period to the next costs as a tracking error \[mm\]: next to nothing, so that a best is one.
const CHANGE_AS_ERROR: f64 = 1e-5;
/// Errors smaller than this RMS \[mm\] do not count, nor does this share of the sum of squares.
const SMALLEST: f64 = 1e-7;
const SHARE: f64 = 1e-6;
/// Share of the limits that the motion keeps within from which the search begins.
const INSIDE: f64 = 0.9;

type Slopes = Dual<f64, STATES>;

/// Which limits of the motor count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MotorLimits {
    /// Largest speed \[rev/s\]; infinite for none.
    pub speed: f64,
    /// Largest slew \[rev/s²\]; infinite for none.
    pub slew: f64,
}

/// Error of the motion that the best motor speeds make.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LeastError {
    /// RMS of the motion that was found \[mm\].
    pub rms_mm: f64,
    /// No motion of the linearised crane has a smaller one \[mm\], by the duality gap, but for the weight of changes of speed in the cost.
    pub least_mm: f64,
}

/// The crane with its motor speed as a state, linearised along its reference.
struct MotorDriven<'a> {
    crane: &'a CraneAlongCourse,
    model: ReducedModel<Slopes>,
    /// Share of a change of motor speed that the mean of its period has.
    share: f64,
}

impl MotorDriven<'_> {
    /// A state with its slopes by the scaled states.
    fn variables(state: &MachineState<f64>) -> MachineState<Slopes> {
        let mut direction = 0..STATES;
        state.map(|value| {
            let place = direction.next().unwrap_or(STATES);
            let mut dual = Slopes::constant(value);
            if place < STATES - 1 {
                dual.slope[place] = UNITS[place];
            }
            dual
        })
    }

    /// What moves, scaled, with a motor speed.
    fn moving<T>(state: MachineState<T>, motor_speed: T) -> [T; STATES] {
        let MachineState { position, velocity, load_pressure, friction, .. } = state;
        [position, velocity, load_pressure, friction, motor_speed]
    }

    /// The period after time k, in which the motor of the motion changes its speed from `from` to `to` \[rev/s\].
    fn period(&self, k: usize, [from, to]: [f64; 2]) -> LinearPeriod<STATES> {
        let crane = self.crane;
        let constant = Slopes::constant;
        // slopes are those of the flow that keeps the pressure
        let balanced = crane.motor_speeds[k];
        let mut speed = constant(balanced);
        speed.slope[STATES - 1] = 1.0;
        let state = Self::variables(&crane.states[k]);
        let (rod_side_term, time) = (constant(crane.rod_side_term), constant(crane.period));
        let next = Self::moving(self.model.step(&state, speed, rod_side_term, time), constant(to));
        let mut by_state: SMatrix<f64, STATES, STATES> =
            SMatrix::from_fn(|i, j| next[i].slope[j] / UNITS[i]);
        by_state[(STATES - 1, STATES - 1)] = 1.0;
        let by_speed: SVector<f64, STATES> = by_state.column(STATES - 1).into_owned();
        let mut by_change = by_speed * self.share;
        by_change[STATES - 1] = 1.0;
        let after = Self::moving(crane.states[k + 1], to);
        let mean = from + self.share * (to - from);
        let mut defect: SVector<f64, STATES> =
            SVector::from_fn(|i, _| (next[i].value - after[i]) / UNITS[i]);
        defect += by_speed * (mean - balanced);
        defect[STATES - 1] = 0.0;
        let piston = self.model.piston(&Self::variables(&crane.states[k + 1]));
        let error = 1e3 * (piston.value - crane.reference[k + 1].position);
        let error_by_state = SVector::from_fn(|i, _| 1e3 * piston.slope[i]);
        LinearPeriod {
            by_state,
            by_change,
            defect,
            error,
            error_by_state,
            limited: [to - from, to],
        }
    }
}

/// The least error of a crane along its reference; none where `go_on` said no.
///
/// # Errors
///
/// [`LabError::NoBound`] when the search does not end.
pub(super) fn least_error(
    crane: &CraneAlongCourse,
    limits: MotorLimits,
    go_on: &dyn Fn() -> bool,
) -> Result<Option<LeastError>, LabError> {
    let share = if limits.slew.is_finite() { 0.5 } else { 1.0 };
    let plant = MotorDriven { crane, model: crane.model.map(Slopes::constant), share };
    let change = limits.slew * crane.period;
    let inside = ActuatorLimits { speed: INSIDE * limits.speed, slew: INSIDE * change };
    let mut speed = crane.motor_speeds[0].min(inside.speed);
    let period = |k: usize| {
        let next = inside.follow(speed, crane.motor_speeds[k + 1], 1.0);
        let from = std::mem::replace(&mut speed, next);
        plant.period(k, [from, next])
    };
    let periods: Vec<_> = (0..crane.periods()).map(period).collect();
    let samples = crane.reference.len() as f64;
    let tolerance = [SHARE, samples * SMALLEST * SMALLEST];
    let finite = [change, limits.speed].map(|limit| limit.is_finite().then_some(limit));
    let Some(found) = best_deviation(&periods, finite, CHANGE_AS_ERROR, tolerance, go_on)? else {
        return Ok(None);
    };
    let rms = |square: f64| (square.max(0.0) / samples).sqrt();
    // the gap is that of half the sum
    Ok(Some(LeastError {
        rms_mm: rms(found.square),
        least_mm: rms(found.square - 2.0 * found.gap),
    }))
}
