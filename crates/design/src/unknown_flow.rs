//! State estimator of a valve-controlled crane: no motor speed tells the flow, so the flow into the piston side is an
//! unknown input.
//!
//! The reduced model's statics, equivalent mass and boom compliance are those of boom and cylinder and do
//! not depend on the circuit. They are fitted with the boom on the circuit of the paper's crane. The pump
//! of that model is then replaced by an input of zero speed. The filter's unknown flow becomes a random
//! walk with a variance large enough for a spool valve.

use crate::scheduled_lqr::state_estimator;
use crate::{DesignError, reduced_model_fit::reduced_model};
use hydroboom_control::estimation::state_estimator::StateEstimator;
use hydroboom_description::Description;
use hydroboom_description::schema::CircuitChoice;
use std::f64::consts::TAU;

/// Oil of a revolution of the input that stands for the pump \[m³/rev\]: a revolution per second is a litre per
/// second.
const LITRE: f64 = 1e-3;

/// Prior of an unknown flow into the piston side, modelled as a random walk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnknownFlowPrior {
    /// Initial standard deviation \[m³/s\]: flow through the fully open valve. The estimate is limited to twice that.
    pub initial_deviation: f64,
    /// Intensity of the random walk, Q √(2π f) \[m³/s/√s\]: flow Q through the fully open valve \[m³/s\] within the
    /// time constant of a spool of bandwidth f \[Hz\].
    pub random_walk: f64,
}

/// State estimator of a valve-controlled crane, and the prior of its unknown flow.
///
/// The motor speed of its inputs is zero. Its unknown flow has the unit \[rev/s\] and is a flow in \[L/s\].
///
/// # Errors
///
/// As [`reduced_model`].
pub fn unknown_flow_estimator(
    description: &Description,
) -> Result<(StateEstimator<f64>, UnknownFlowPrior), DesignError> {
    let n = &description.numbers;
    let on_pump = on_published_circuit(description)?;
    let mut model = reduced_model(&on_pump)?;
    model.volume = n.dead_volume_a + n.hose_a;
    model.displacement = LITRE;
    model.leakage = 0.0;
    let mut estimator = state_estimator(&on_pump, &model, 0);
    // the compensator's drop over the widest edge
    let largest = n.supply_to_a.max(n.a_to_tank) * n.compensated_drop.sqrt();
    let prior = UnknownFlowPrior {
        initial_deviation: largest,
        random_walk: largest * (TAU * n.spool_bandwidth).sqrt(),
    };
    let filter = &mut estimator.filter;
    filter.initial_deviation.unknown_flow = prior.initial_deviation / LITRE;
    filter.process_noise.unknown_flow = prior.random_walk / LITRE;
    filter.highest.unknown_flow = 2.0 * prior.initial_deviation / LITRE;
    filter.lowest.unknown_flow = -filter.highest.unknown_flow;
    // there is no pump that ripples or whose displacement is not known
    filter.flow_ripple = 0.0;
    filter.considered.displacement = 0.0;
    Ok((estimator, prior))
}

/// Boom, cylinder, friction and oil of a crane on the circuit of the paper's crane.
fn on_published_circuit(description: &Description) -> Result<Description, DesignError> {
    let mut crane = description.clone();
    let of_pump = Description::uia_single_boom().map_err(|e| DesignError::NoFit(e.to_string()))?;
    let (mut numbers, pump) = (description.numbers.to_array(), of_pump.numbers.to_array());
    let keys = hydroboom_description::schema::KEYS.iter();
    for ((key, number), pump) in keys.zip(&mut numbers).zip(pump) {
        let is_excluded = |c: &Description| {
            c.choices.excludes(key.section, key.name, c.segment_shares.len()).is_some()
        };
        if is_excluded(description) && !is_excluded(&of_pump) {
            *number = pump;
        }
    }
    crane.numbers = hydroboom_description::Numbers::from_array(numbers);
    crane.choices.circuit = CircuitChoice::SelfContained;
    Ok(crane)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fitted holding pressure equals that of the valve-controlled crane at rest with its own
    /// payload.
    #[test]
    fn the_load_rests_at_the_pressure_of_the_valve_controlled_crane() {
        let crane = Description::patu_lift().unwrap();
        let (estimator, prior) = unknown_flow_estimator(&crane).unwrap();
        let n = &crane.numbers;
        let valve = crane.valve_crane_over::<f64, 2>(n).unwrap();
        for stroke in [0.1, 0.2, 0.35] {
            let start = crane.valve_start_over(n, stroke);
            let rest = valve.at_rest(&start).unwrap().circuit;
            let load_pressure = rest.a - crane.cylinder().area_ratio() * rest.b;
            let fitted = estimator.filter.model.at(stroke, n.payload).holding_pressure;
            assert!((fitted / load_pressure - 1.0).abs() < 0.01, "{fitted} for {load_pressure}");
        }
        // 62 and 72 l/min at 7 bar over 1.9 V are printed, to 3 V of full travel
        assert!((50.0..150.0).contains(&(prior.initial_deviation * 60e3)), "{prior:?}");
    }
}
