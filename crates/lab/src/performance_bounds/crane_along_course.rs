//! Crane along a course, for the bounds: reduced model of the crane file (load on boom and oil with
//! friction and leakage) and its exact derivatives.

use crate::LabError;
use crate::closed_loop::scenario::{Course, due};
use hydroboom_control::estimation::reduced_model::{MachineState, ReducedModel};
use hydroboom_control::feedback::inverse_dynamics::inverse_dynamics;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::reference::smoothing::SmoothSetPoint;
use hydroboom_description::Description;
use hydroboom_design::operating_points::rod_side_term;
use hydroboom_design::reduced_model_fit::reduced_model;
use hydroboom_math::Dual;

/// Iterations of the fixed point between pressure and deflection of the boom. Each reduces the error by a
/// factor of about 100.
const DEFLECTION_STEPS: usize = 6;
/// Smallest change of the reference's acceleration within a period that counts, as a share of its largest
/// one. It detects the corner of a ramp, not rounding of set points or the curvature of an S-curve.
const CHANGE: f64 = 0.1;

/// Crane with the set point of its piston at the end of each control period.
pub(super) struct CraneAlongCourse {
    /// Reduced model of the crane file.
    pub model: ReducedModel<f64>,
    /// Payload at the start of the course \[kg\]; later values are in the states.
    pub payload: f64,
    /// Transition pressure of the oil \[Pa\].
    pub transition_pressure: f64,
    /// Piston-side pressure minus load pressure \[Pa\].
    pub rod_side_term: f64,
    /// Control period \[s\].
    pub period: f64,
    /// Reference of the piston at the times 0, T, 2 T ..., with the control period T.
    pub reference: Vec<SetPoint<f64>>,
    /// States on the reference at these times, with the friction due to the motion before and the payload
    /// from then on.
    pub states: Vec<MachineState<f64>>,
    /// Motor speeds \[rev/s\] for the motion and the leakage of these states.
    pub motor_speeds: Vec<f64>,
}

impl CraneAlongCourse {
    /// Crane of a description along a course.
    ///
    /// # Errors
    ///
    /// [`LabError::Design`] if the description gives no reduced model.
    pub fn new(crane: &Description, course: &dyn Course) -> Result<Self, LabError> {
        let period = crane.numbers.control_period;
        let periods = (course.duration() / period).round() as usize;
        let mut along = Self {
            model: reduced_model(crane)?,
            payload: crane.numbers.payload,
            transition_pressure: crane.numbers.transition,
            rod_side_term: rod_side_term(crane),
            period,
            reference: (0..=periods).map(|k| course.reference(k as f64 * period)).collect(),
            states: Vec::with_capacity(periods + 1),
            motor_speeds: Vec::with_capacity(periods + 1),
        };
        let model = along.model;
        let mut friction = 0.0;
        let (mut loads, mut payload) = (course.loads(), along.payload);
        for k in 0..=periods {
            payload = due(&mut loads, k as f64 * period).unwrap_or(payload);
            // Dahl's friction law, as in the model
            let bending = model.presliding_stiffness * period * along.reference[k].velocity;
            friction = (friction + bending) / (1.0 + bending.abs() / model.coulomb);
            let state = along.on_reference(k, along.acceleration(k), friction, payload);
            let turning = model.revolutions_per_metre() * state.velocity;
            along.motor_speeds.push(turning + model.leakage(state.load_pressure));
            along.states.push(state);
        }
        Ok(along)
    }

    /// Number of control periods of the course.
    pub fn periods(&self) -> usize {
        self.reference.len() - 1
    }

    /// Acceleration of the reference in the period after time k \[m/s²\].
    fn acceleration(&self, k: usize) -> f64 {
        let next = self.reference[(k + 1).min(self.periods())].velocity;
        (next - self.reference[k].velocity) / self.period
    }

    /// State on the reference at time k for an acceleration a \[m/s²\], a friction f over the piston's area
    /// \[Pa\] and a payload \[kg\]. The load is at y = x − γ p. The pressure balances and accelerates it: p
    /// = p_0(y) + p_0'(y) γ p + a/a_p(y) + p_v x' + f, which is p_0(x) plus the terms of the motion. The
    /// boom's deflection follows the pressure, without a term for its rate.
    fn on_reference(
        &self,
        k: usize,
        acceleration: f64,
        friction: f64,
        payload: f64,
    ) -> MachineState<f64> {
        let SetPoint { position, velocity } = self.reference[k];
        let mut state = MachineState {
            position,
            velocity,
            load_pressure: 0.0,
            friction,
            disturbance: 0.0,
            unknown_flow: 0.0,
            payload,
            transition_pressure: self.transition_pressure,
        };
        for _ in 0..DEFLECTION_STEPS {
            let at = self.model.at(state.position, payload);
            let moving = acceleration / at.acceleration + self.model.viscous * velocity;
            state.load_pressure = (at.holding_pressure + moving + friction)
                / (1.0 - at.holding_slope * at.compliance);
            state.position = position - at.compliance * state.load_pressure;
        }
        state
    }

    /// Indices of the control periods at which the reference's acceleration or the load changes, in increasing order.
    pub fn changes(&self) -> Vec<usize> {
        let accelerations = (0..self.periods()).map(|k| self.acceleration(k).abs());
        let least = CHANGE * accelerations.fold(0.0, f64::max);
        let turns = |k: usize| (self.acceleration(k) - self.acceleration(k - 1)).abs() > least;
        let loads = |k: usize| self.states[k].payload != self.states[k - 1].payload;
        (1..self.periods()).filter(|&k| turns(k) || loads(k)).collect()
    }

    /// State and motor speed \[rev/s\] of a crane exactly on the reference at time index k that does not know of a
    /// change then. They have the acceleration and payload of the previous period.
    pub fn before_change(&self, k: usize) -> (MachineState<f64>, f64) {
        let before = &self.states[k - 1];
        let (acceleration, friction) = (self.acceleration(k - 1), self.states[k].friction);
        let mut state = self.on_reference(k, acceleration, friction, before.payload);
        let SetPoint { position, velocity } = self.reference[k];
        let (pressure, model) = (state.load_pressure, &self.model);
        let at = model.at(position, state.payload);
        let rate = (pressure - before.load_pressure) / self.period;
        let bulk_modulus =
            model.bulk_modulus(pressure, self.transition_pressure, self.rod_side_term);
        state.velocity = velocity - at.compliance * rate;
        let inflow = rate / model.stiffness(&at, bulk_modulus) + model.piston_area * state.velocity;
        (state, inflow / model.displacement + model.leakage(pressure))
    }

    /// Derivative of the motor speed along the reference with respect to the payload \[rev/s/kg\], in the
    /// period after time k, by the approximate inverse of the model.
    pub fn motor_speed_by_payload(&self, k: usize) -> f64 {
        type Slope = Dual<f64, 1>;
        let now = self.acceleration(k);
        let before = if k == 0 { 0.0 } else { self.acceleration(k - 1) };
        let constant = Slope::constant;
        let reference = SmoothSetPoint {
            position: constant(self.reference[k].position),
            velocity: constant(self.reference[k].velocity),
            acceleration: constant(now),
            jerk: constant((now - before) / self.period),
        };
        let mut state = self.states[k].map(Slope::constant);
        state.payload = Slope::variable(self.states[k].payload, 0);
        let model = self.model.map(Slope::constant);
        let turning = constant(0.0);
        let rod_side_term = constant(self.rod_side_term);
        inverse_dynamics(&model, &state, &reference, turning, rod_side_term).motor_speed.slope[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At its state on the reference the model has the reference's acceleration, and its piston the
    /// reference's position. The boom's deflection is counted once.
    #[test]
    fn the_model_is_in_balance_on_the_reference() {
        let mut crane = Description::uia_single_boom().unwrap();
        let n = &mut crane.numbers;
        (n.rest, n.dwell, n.ramp) = (0.2, 0.2, 0.3);
        n.motion_end = n.motion_start + 0.1;
        let along = CraneAlongCourse::new(&crane, &crane.motion(crane.numbers.fast)).unwrap();
        let model = &along.model;
        for (k, state) in along.states.iter().enumerate() {
            let excess = model.acceleration(state) - along.acceleration(k);
            assert!(excess.abs() < 1e-6, "{k}: {excess} m/s²");
            let off = model.piston(state) - along.reference[k].position;
            assert!(off.abs() < 1e-9, "{k}: {off} m");
        }
    }

    /// A trapezoid of velocity has two corners at each of its four ramps. The same motion through a moving average
    /// of 100 ms, which limits its jerk, has none.
    #[test]
    fn corners_of_the_reference_are_found_and_jerk_limited_ones_are_none() {
        let mut crane = Description::uia_single_boom().unwrap();
        let n = &mut crane.numbers;
        (n.rest, n.dwell, n.ramp) = (0.2, 0.2, 0.3);
        n.motion_end = n.motion_start + 0.1;
        let motion = crane.motion(crane.numbers.fast);
        let mut along = CraneAlongCourse::new(&crane, &motion).unwrap();
        let changes = along.changes();
        let distinct = changes.windows(2).filter(|pair| pair[1] > pair[0] + 2).count() + 1;
        assert_eq!(distinct, 8, "{changes:?}");
        let (sharp, half) = (along.reference.clone(), 50);
        for k in half..sharp.len() - half {
            let window = &sharp[k - half..k + half];
            let mean = |of: fn(&SetPoint<f64>) -> f64| {
                window.iter().map(of).sum::<f64>() / window.len() as f64
            };
            along.reference[k] =
                SetPoint { position: mean(|s| s.position), velocity: mean(|s| s.velocity) };
        }
        assert_eq!(along.changes(), [0; 0]);
    }
}
