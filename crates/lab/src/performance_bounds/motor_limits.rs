//! Limits of the motor, speed and slew rate: smallest tracking error for optimal motor speeds, with the
//! complete model and reference known.
//!
//! The crane is linearised along the reference with exact derivatives, and the [convex
//! problem](super::optimal_control) of its motor speeds is solved. The result is the smallest error of the
//! linearised crane up to a reported duality gap. The motor speed itself is optimised. A known lag or dead
//! time between command and motor has no cost along a known reference. Without a slew limit the motor speed
//! is constant in each period; with one it is continuous and piecewise linear.

use super::crane_along_course::CraneAlongCourse;
use super::optimal_control::{LinearPeriod, Solution, best_deviation};
use crate::LabError;
use hydroboom_control::actuator_limits::ActuatorLimits;
use hydroboom_control::estimation::reduced_model::{MachineState, ReducedModel};
use hydroboom_math::Dual;
use nalgebra::{SMatrix, SVector};

/// Number of states: load position and velocity, load pressure, friction, motor speed.
const STATES: usize = 5;
/// Scaling units of the states: mm, mm/s, bar, bar, rev/s.
const UNITS: [f64; STATES] = [1e-3, 1e-3, 1e5, 1e5, 1.0];
/// Cost of a change of motor speed by 1 rev/s between periods, as a tracking error \[mm\]. It is small and
/// makes the optimum unique.
const CHANGE_AS_ERROR: f64 = 1e-5;
/// Convergence tolerances: RMS error \[mm\], and share of the sum of squares.
const SMALLEST: f64 = 1e-7;
const SHARE: f64 = 1e-6;
/// Share of the limits that the initial motion of the search keeps.
const INSIDE: f64 = 0.9;

type Slopes = Dual<f64, STATES>;

/// Active limits of the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MotorLimits {
    /// Largest motor speed \[rev/s\]; infinite for none.
    pub speed: f64,
    /// Largest slew rate \[rev/s²\]; infinite for none.
    pub slew: f64,
}

/// Error of the optimal motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LeastError {
    /// RMS tracking error of the optimised motion \[mm\].
    pub rms_mm: f64,
    /// Lower bound of the RMS error for the linearised crane \[mm\]: duality gap and cost of speed changes
    /// are subtracted.
    pub least_mm: f64,
}

/// Crane with its motor speed as a state, linearised along its reference.
struct MotorDriven<'a> {
    crane: &'a CraneAlongCourse,
    model: ReducedModel<Slopes>,
    /// Share of a change of motor speed that enters the mean of its period.
    share: f64,
}

impl<'a> MotorDriven<'a> {
    /// With a slew limit the motor speed is linear in each period, otherwise constant.
    fn new(crane: &'a CraneAlongCourse, limits: MotorLimits) -> Self {
        let share = if limits.slew.is_finite() { 0.5 } else { 1.0 };
        Self { crane, model: crane.model.map(Slopes::constant), share }
    }

    /// State as dual numbers with derivatives with respect to the scaled states.
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

    /// States of the problem with a motor speed.
    fn moving<T>(state: MachineState<T>, motor_speed: T) -> [T; STATES] {
        let MachineState { position, velocity, load_pressure, friction, .. } = state;
        [position, velocity, load_pressure, friction, motor_speed]
    }

    /// Linearised period after time k, in which the motor speed changes from `from` to `to` \[rev/s\].
    fn period(&self, k: usize, [from, to]: [f64; 2]) -> LinearPeriod<STATES> {
        let crane = self.crane;
        let constant = Slopes::constant;
        // the derivatives are taken at the motor speed that keeps the pressure
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

/// Smallest error of a crane along its reference; none if `go_on` returned false.
///
/// # Errors
///
/// [`LabError::NoBound`] if the search does not converge.
pub(super) fn least_error(
    crane: &CraneAlongCourse,
    limits: MotorLimits,
    go_on: &dyn Fn() -> bool,
) -> Result<Option<LeastError>, LabError> {
    let (plant, inside) = (MotorDriven::new(crane, limits), limits.inside(crane));
    let mut speed = crane.motor_speeds[0].min(inside.speed);
    let period = |k: usize| {
        let next = inside.follow(speed, crane.motor_speeds[k + 1], 1.0);
        let from = std::mem::replace(&mut speed, next);
        plant.period(k, [from, next])
    };
    let periods: Vec<_> = (0..crane.periods()).map(period).collect();
    let Some(found) = limits.best(crane, &periods, go_on)? else { return Ok(None) };
    Ok(Some(LeastError::of(found, crane)))
}

/// Smallest error without preview of changes of the reference's acceleration and of the load. At each
/// change the crane is exactly on the reference and does not know of it. For `blind` further periods the
/// motor continues as before, because commands are delayed. Then it follows the optimum for all that
/// follows up to the next change. None if `go_on` returned false.
///
/// # Errors
///
/// [`LabError::NoBound`] if a search does not converge.
pub(super) fn least_error_without_preview(
    crane: &CraneAlongCourse,
    limits: MotorLimits,
    blind: usize,
    go_on: &dyn Fn() -> bool,
) -> Result<Option<LeastError>, LabError> {
    let (plant, inside) = (MotorDriven::new(crane, limits), limits.inside(crane));
    let changes = crane.changes();
    let ends = changes.iter().skip(1).copied().chain([crane.periods()]);
    let mut all = Solution { square: 0.0, least: 0.0 };
    for (begin, end) in changes.iter().copied().zip(ends) {
        let (state, speed) = crane.before_change(begin);
        let mut speed = speed.clamp(-inside.speed, inside.speed);
        let on = (crane.motor_speeds[begin] - crane.motor_speeds[begin - 1])
            .clamp(-inside.slew, inside.slew);
        let period = |k: usize| {
            let is_blind = k < begin + blind;
            let next = match is_blind {
                true => (speed + on).clamp(-inside.speed, inside.speed),
                false => inside.follow(speed, crane.motor_speeds[k + 1], 1.0),
            };
            let from = std::mem::replace(&mut speed, next);
            let mut period = plant.period(k, [from, next]);
            if is_blind {
                period.by_change.fill(0.0);
            }
            period
        };
        let mut periods: Vec<_> = (begin..end).map(period).collect();
        let [own, reference] =
            [&state, &crane.states[begin]].map(|state| MotorDriven::moving(*state, 0.0));
        let off = SVector::from_fn(|i, _| (own[i] - reference[i]) / UNITS[i]);
        if let Some(first) = periods.first_mut() {
            first.defect += first.by_state * off;
        }
        let Some(found) = limits.best(crane, &periods, go_on)? else { return Ok(None) };
        all.square += found.square;
        all.least += found.least;
    }
    Ok(Some(LeastError::of(all, crane)))
}

impl MotorLimits {
    /// Limits of the initial motion of the search, with the slew rate as a change per period.
    fn inside(self, crane: &CraneAlongCourse) -> ActuatorLimits<f64> {
        ActuatorLimits { speed: INSIDE * self.speed, slew: INSIDE * self.slew * crane.period }
    }

    /// Optimal deviation within these limits.
    fn best(
        self,
        crane: &CraneAlongCourse,
        periods: &[LinearPeriod<STATES>],
        go_on: &dyn Fn() -> bool,
    ) -> Result<Option<Solution>, LabError> {
        let tolerance = [SHARE, crane.reference.len() as f64 * SMALLEST * SMALLEST];
        let finite =
            [self.slew * crane.period, self.speed].map(|limit| limit.is_finite().then_some(limit));
        best_deviation(periods, finite, CHANGE_AS_ERROR, tolerance, go_on)
    }
}

impl LeastError {
    /// Error over all samples of the course.
    fn of(found: Solution, crane: &CraneAlongCourse) -> Self {
        let rms = |square: f64| (square / crane.reference.len() as f64).sqrt();
        Self { rms_mm: rms(found.square), least_mm: rms(found.least) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closed_loop::scenario::{Course, Load};
    use hydroboom_control::reference::profile::SetPoint;
    use hydroboom_control::reference::trajectory::Trajectory;
    use hydroboom_description::Description;

    fn limits(crane: &Description) -> MotorLimits {
        MotorLimits { speed: crane.numbers.motor_speed, slew: crane.numbers.motor_slew }
    }

    fn crane() -> Description {
        let mut crane = Description::uia_single_boom().unwrap();
        let n = &mut crane.numbers;
        (n.rest, n.dwell, n.ramp) = (0.3, 0.3, 0.2);
        n.motion_end = n.motion_start + 0.05;
        crane
    }

    fn unforeseen(crane: &Description, course: &dyn Course, blind: usize) -> f64 {
        let along = CraneAlongCourse::new(crane, course).unwrap();
        let found = least_error_without_preview(&along, limits(crane), blind, &|| true);
        found.unwrap().unwrap().rms_mm
    }

    /// Without limits any motion is possible with a known reference.
    #[test]
    fn without_motor_limits_any_motion_is_followed() {
        let crane = crane();
        let along = CraneAlongCourse::new(&crane, &crane.motion(crane.numbers.fast)).unwrap();
        let none = MotorLimits { speed: f64::INFINITY, slew: f64::INFINITY };
        let found = least_error(&along, none, &|| true).unwrap().unwrap();
        assert!(found.rms_mm < SMALLEST, "{found:?}");
    }

    /// Without preview the error is no smaller than with preview, and it grows with the delay of the
    /// commands.
    #[test]
    fn without_preview_the_error_grows_with_the_command_delay() {
        let crane = crane();
        let course = crane.motion(crane.numbers.fast);
        let along = CraneAlongCourse::new(&crane, &course).unwrap();
        let known = least_error(&along, limits(&crane), &|| true).unwrap().unwrap().rms_mm;
        let [at_once, later, latest] = [0, 3, 10].map(|blind| unforeseen(&crane, &course, blind));
        assert!(
            known < at_once && at_once < later && later < latest,
            "{known} {at_once} {later} {latest}"
        );
        // during the delay the acceleration a alone produces an error of at least ½ a t² after each of
        // eight changes
        let (a, t) = (crane.numbers.fast / crane.numbers.ramp, 10.0 * along.period);
        let square = 8.0 * (500.0 * a * t * t).powi(2) * t / 5.0;
        let least = (square / course.duration()).sqrt();
        assert!(latest > least, "{latest} {least} mm");
    }

    /// Course at rest with a load change.
    struct Loaded {
        duration: f64,
        loads: [Load; 1],
    }
    impl Trajectory for Loaded {
        fn reference(&self, _: f64) -> SetPoint<f64> {
            SetPoint { position: 0.25, velocity: 0.0 }
        }
        fn duration(&self) -> f64 {
            self.duration
        }
        fn speed(&self) -> f64 {
            0.0
        }
    }
    impl Course for Loaded {
        fn name(&self) -> String {
            "loaded".into()
        }
        fn loads(&self) -> &[Load] {
            &self.loads
        }
    }

    /// A load change without preview costs more than one with preview, and a larger one costs more.
    #[test]
    fn an_unknown_load_change_costs_more_than_a_known_one() {
        let crane = crane();
        let errors = [10.0, 40.0].map(|more| {
            let load = Load { time: 0.4, mass: crane.numbers.payload + more };
            let course = Loaded { duration: 1.0, loads: [load] };
            let along = CraneAlongCourse::new(&crane, &course).unwrap();
            let known = least_error(&along, limits(&crane), &|| true).unwrap().unwrap().rms_mm;
            [known, unforeseen(&crane, &course, 2)]
        });
        let [[known, unforeseen], [more_known, more_unforeseen]] = errors;
        assert!(known < unforeseen && more_known < more_unforeseen, "{errors:?}");
        assert!(known < more_known && unforeseen < more_unforeseen, "{errors:?}");
    }
}
