//! The crane along a course, for bounds: the reduced model of the crane file, load on boom and oil with friction and leakage, and its exact slopes.

use crate::LabError;
use crate::closed_loop::scenario::Course;
use hydroboom_control::estimation::reduced_model::{MachineState, ReducedModel};
use hydroboom_control::feedback::inverse_dynamics::inverse_dynamics;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::reference::smoothing::SmoothSetPoint;
use hydroboom_description::Description;
use hydroboom_design::operating_points::rod_side_term;
use hydroboom_design::reduced_model_fit::reduced_model;
use hydroboom_math::Dual;

/// A crane and where its piston shall be at the end of each control period.
pub(super) struct CraneAlongCourse {
    pub model: ReducedModel<f64>,
    /// Payload \[kg\].
    pub payload: f64,
    /// Transition pressure of the oil \[Pa\].
    pub transition_pressure: f64,
    /// Piston-side pressure beyond the load pressure \[Pa\].
    pub rod_side_term: f64,
    /// Control period \[s\].
    pub period: f64,
    /// Set points at the times 0, T, 2 T ...
    pub reference: Vec<SetPoint<f64>>,
    /// States on the reference at these times, with the friction that the way there has left.
    pub states: Vec<MachineState<f64>>,
    /// Motor speeds \[rev/s\] that keep the load pressure of these states: for travel and leakage.
    pub motor_speeds: Vec<f64>,
}

impl CraneAlongCourse {
    /// Of the crane of a description.
    ///
    /// # Errors
    ///
    /// [`LabError`] when it has no reduced model.
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
        for k in 0..=periods {
            // Dahl's law, as the model has it
            let bending = model.presliding_stiffness * period * along.reference[k].velocity;
            friction = (friction + bending) / (1.0 + bending.abs() / model.coulomb);
            let state = along.on_reference(k, friction);
            let turning = model.revolutions_per_metre() * state.velocity;
            along.motor_speeds.push(turning + model.leakage(state.load_pressure));
            along.states.push(state);
        }
        Ok(along)
    }

    /// Control periods.
    pub fn periods(&self) -> usize {
        self.reference.len() - 1
    }

    /// Acceleration of the reference in the period after time k \[m/s²\].
    fn acceleration(&self, k: usize) -> f64 {
        let next = self.reference[(k + 1).min(self.periods())].velocity;
        (next - self.reference[k].velocity) / self.period
    }

    /// State on the reference at time k, with a friction over the piston's area \[Pa\]. The boom bends with the pressure, and not with its rate.
    fn on_reference(&self, k: usize, friction: f64) -> MachineState<f64> {
        let SetPoint { position, velocity } = self.reference[k];
        let at = self.model.at(position, self.payload);
        let moving = self.acceleration(k) / at.acceleration + self.model.viscous * velocity;
        // the load is where the boom lets it be: p = p_0 + p_0' γ p + ...
        let load_pressure =
            (at.holding_pressure + moving + friction) / (1.0 - at.holding_slope * at.compliance);
        MachineState {
            position: position - at.compliance * load_pressure,
            velocity,
            load_pressure,
            friction,
            disturbance: 0.0,
            unknown_flow: 0.0,
            payload: self.payload,
            transition_pressure: self.transition_pressure,
        }
    }

    /// Change of the motor speed along the reference with the payload \[rev/s/kg\], in the period after time k, by the approximate inverse of the model.
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
        state.payload = Slope::variable(self.payload, 0);
        let model = self.model.map(Slope::constant);
        let turning = constant(0.0);
        let rod_side_term = constant(self.rod_side_term);
        inverse_dynamics(&model, &state, &reference, turning, rod_side_term).motor_speed.slope[0]
    }
}
