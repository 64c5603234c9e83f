//! Unpredictable disturbances, and the crane linearised along its reference with them.
//!
//! Unknown force d, unknown flow r and friction f drift as stated in the crane file's section
//! `[estimator]`, as in its Kalman filter. Boom modes and pump ripple, which the filter's reduced model
//! omits and treats as noise, are not counted: the complete model predicts them.

use super::crane_along_course::CraneAlongCourse;
use super::prediction_error::LinearCourse;
use hydroboom_control::estimation::reduced_model::state_index::{
    DISTURBANCE, FRICTION, LOAD_PRESSURE, UNKNOWN_FLOW,
};
use hydroboom_control::estimation::reduced_model::{MachineState, STATES};
use hydroboom_description::Description;
use hydroboom_math::Dual;

/// Random walks: standard deviation of the change in one second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Disturbances {
    /// Rate of the random walk of the unknown force, over the piston's area \[Pa/√s\]; the force decays with
    /// `estimator.disturbance_time_s`.
    pub force: f64,
    /// Rate of the random walk of the friction, over the piston's area \[Pa/√s\].
    pub friction: f64,
    /// Rate of the random walk of the unknown flow, as a motor speed \[rev/s/√s\].
    pub flow: f64,
}

impl Disturbances {
    /// Disturbances as stated in the section `[estimator]` of the crane file.
    pub fn of(crane: &Description) -> Self {
        let tuning = &crane.numbers.tuning;
        Self {
            force: tuning.estimator_disturbance_drift,
            friction: tuning.estimator_friction_drift,
            flow: tuning.estimator_flow_drift,
        }
    }
}

/// Crane linearised along its reference with exact derivatives.
pub(super) fn linearised(
    crane: &CraneAlongCourse,
    disturbances: &Disturbances,
) -> LinearCourse<STATES> {
    let constant = Dual::<f64, STATES>::constant;
    let model = crane.model.map(constant);
    let variables = |state: &MachineState<f64>| {
        let mut direction = 0..STATES;
        state.map(|value| Dual::variable(value, direction.next().unwrap_or(0)))
    };
    let transition = |(state, speed): (&MachineState<f64>, &f64)| {
        let rod_side_term = constant(crane.rod_side_term);
        let period = constant(crane.period);
        let next = model.step(&variables(state), constant(*speed), rod_side_term, period);
        next.to_array().map(|dual| dual.slope)
    };
    let outputs = |state: &MachineState<f64>| {
        let mut pressure = [0.0; STATES];
        pressure[LOAD_PRESSURE] = 1.0;
        [model.piston(&variables(state)).slope, pressure]
    };
    let mut process = [0.0; STATES];
    for (place, drift) in [
        (DISTURBANCE, disturbances.force),
        (FRICTION, disturbances.friction),
        (UNKNOWN_FLOW, disturbances.flow),
    ] {
        process[place] = drift * drift * crane.period;
    }
    let moving = crane.states.iter().zip(&crane.motor_speeds).take(crane.periods());
    LinearCourse {
        transitions: moving.map(transition).collect(),
        outputs: crane.states.iter().map(outputs).collect(),
        process,
    }
}
