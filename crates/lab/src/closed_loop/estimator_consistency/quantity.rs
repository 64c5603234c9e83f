//! Quantities that the state estimator estimates and that have a true value.

use hydroboom_control::estimation::error_covariance::{ERRORS, as_variables, output_deviation};
use hydroboom_control::estimation::extended_kalman_filter::{EstimatorState, ExtendedKalmanFilter};
use hydroboom_control::estimation::reduced_model::{MachineState, ReducedModel};
use hydroboom_math::{Dual, Real};
use serde::{Serialize, Serializer};

/// Quantity of the state estimator that has a true value in the virtual crane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Piston position, y + γ p.
    Position,
    /// Piston velocity.
    Velocity,
    /// Load pressure.
    LoadPressure,
    /// Payload.
    Payload,
    /// Friction of the cylinder: pre-sliding and viscous, A (f + p_v w).
    Friction,
    /// Friction minus the unknown force, A (f + p_v w − d): the filter estimates a deviation from the
    /// friction model as an unknown force.
    FrictionAndUnknownForce,
    /// Bulk modulus of the oil on the piston side, at its pressure.
    BulkModulus,
}

impl Quantity {
    /// All quantities, in the order of tables.
    pub const ALL: [Self; 7] = [
        Self::Position,
        Self::Velocity,
        Self::LoadPressure,
        Self::Payload,
        Self::Friction,
        Self::FrictionAndUnknownForce,
        Self::BulkModulus,
    ];

    /// Name in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Position => "piston position",
            Self::Velocity => "piston velocity",
            Self::LoadPressure => "load pressure",
            Self::Payload => "payload",
            Self::Friction => "friction",
            Self::FrictionAndUnknownForce => "friction less unknown force",
            Self::BulkModulus => "bulk modulus",
        }
    }

    /// Whether it is a nonlinear function of parameters, which is judged by its coverage alone. Its first-order
    /// standard deviation vanishes where the function saturates, as the bulk modulus of compressed oil does. NEES has
    /// no meaning there.
    pub fn is_effect_of_parameter(self) -> bool {
        matches!(self, Self::Friction | Self::FrictionAndUnknownForce | Self::BulkModulus)
    }

    /// Display unit of its errors, and the size of that unit in SI units.
    pub fn unit(self) -> (&'static str, f64) {
        match self {
            Self::Position => ("mm", 1e-3),
            Self::Velocity => ("mm/s", 1e-3),
            Self::LoadPressure => ("bar", 1e5),
            Self::Payload => ("kg", 1.0),
            Self::Friction | Self::FrictionAndUnknownForce => ("N", 1.0),
            Self::BulkModulus => ("MPa", 1e6),
        }
    }
}

impl Serialize for Quantity {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.name())
    }
}

/// All quantities of a state at a motor speed \[rev/s\].
fn quantities<T: Real>(
    model: &ReducedModel<T>,
    z: &MachineState<T>,
    motor_speed: T,
    rod_side_term: T,
) -> [T; Quantity::ALL.len()] {
    let friction = model.piston_area * model.viscous.mul_add(z.velocity, z.friction);
    Quantity::ALL.map(|quantity| match quantity {
        Quantity::Position => model.piston(z),
        Quantity::Velocity => model.piston_velocity(z, motor_speed, rod_side_term),
        Quantity::LoadPressure => z.load_pressure,
        Quantity::Payload => z.payload,
        Quantity::Friction => friction,
        Quantity::FrictionAndUnknownForce => friction - model.piston_area * z.disturbance,
        Quantity::BulkModulus => {
            model.bulk_modulus(z.load_pressure, z.transition_pressure, rod_side_term)
        }
    })
}

/// Estimates of all quantities with their standard deviations.
pub(super) fn estimates(
    filter: &ExtendedKalmanFilter<f64>,
    state: &EstimatorState<f64>,
    motor_speed: f64,
    rod_side_term: f64,
) -> [(f64, f64); Quantity::ALL.len()] {
    let constant = Dual::<f64, ERRORS>::constant;
    let (model, z) = as_variables(&filter.model, &state.estimate);
    let mut found = quantities(&model, &z, constant(motor_speed), constant(rod_side_term))
        .map(|h| (h.value, output_deviation(&state.errors, &h.slope)));
    found[Quantity::Payload as usize].1 = filter.payload_deviation(state);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::estimation::extended_kalman_filter::EstimatorInput;
    use hydroboom_control::estimation::reduced_model::STATES;
    use hydroboom_description::Description;
    use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;

    /// Quantities as functions of the states and, after them, the consider parameters.
    fn quantities_of(
        model: &ReducedModel<f64>,
        errors: &[f64; ERRORS],
    ) -> [f64; Quantity::ALL.len()] {
        let mut z = [0.0; STATES];
        z.copy_from_slice(&errors[..STATES]);
        let mut model = *model;
        let mass = errors[STATES + 3];
        (model.coulomb, model.viscous) = (errors[STATES], errors[STATES + 1]);
        model.displacement = errors[STATES + 2];
        model.equivalent_mass = model.equivalent_mass.map(|p| p.map(|c| c * mass));
        model.compliance = model.compliance.map(|p| p.map(|c| c * mass * mass));
        quantities(&model, &MachineState::from_array(z), 3.0, 2e5)
    }

    /// Standard deviations of the outputs compared with central differences of the outputs.
    #[test]
    fn standard_deviations_of_outputs_follow_from_the_state_covariance() {
        let description = Description::uia_single_boom().unwrap();
        let controller = scheduled_lqr_controller(&description).unwrap();
        let filter = controller.estimator().filter;
        let input = EstimatorInput {
            position: 0.25,
            position_is_good: 1.0,
            load_pressure: 60e5,
            load_pressure_is_good: 1.0,
            rod_side_term: 2e5,
            motor_speed: 3.0,
        };
        let mut state = filter.start(&input);
        (0..500).for_each(|_| filter.update(&mut state, &input));
        let found = estimates(&filter, &state, 3.0, 2e5);
        let at = |errors: [f64; ERRORS]| quantities_of(&filter.model, &errors);
        let z = state.estimate.to_array();
        let exact = [
            filter.model.coulomb,
            filter.model.viscous,
            filter.model.displacement,
            1.0,
            filter.sensor_lag,
        ];
        let mean: [f64; ERRORS] =
            std::array::from_fn(|i| if i < STATES { z[i] } else { exact[i - STATES] });
        let slopes: [[f64; Quantity::ALL.len()]; ERRORS] = std::array::from_fn(|i| {
            // step of 0.01 standard deviations: neither curvature nor rounding matters
            let step = 0.01 * state.errors[i][i].sqrt();
            let moved =
                |by: f64| at(std::array::from_fn(|j| mean[j] + if i == j { by } else { 0.0 }));
            let (above, below) = (moved(step), moved(-step));
            std::array::from_fn(|q| (above[q] - below[q]) / (2.0 * step))
        });
        for (q, quantity) in Quantity::ALL.into_iter().enumerate() {
            let mut variance = 0.0;
            for i in 0..ERRORS {
                for j in 0..ERRORS {
                    variance += slopes[i][q] * state.errors[i][j] * slopes[j][q];
                }
            }
            if quantity == Quantity::Payload {
                // plus the uncertainty of the load's moment arm, in proportion to the payload
                variance += (filter.payload_arm * z[6]).powi(2);
            }
            let (value, deviation) = found[q];
            assert!((value / at(mean)[q] - 1.0).abs() < 1e-12, "{}", quantity.name());
            assert!(
                (deviation / variance.sqrt() - 1.0).abs() < 0.01,
                "{}: {deviation}",
                quantity.name()
            );
        }
        let of = |quantity: Quantity| found[quantity as usize].1;
        assert_eq!(of(Quantity::Payload), filter.deviation(&state).payload);
    }
}
