//! Payload that is unknown when the course begins: its covariance at rest, and the error of feedforward
//! alone until it is estimated.
//!
//! The payload is uniformly distributed between two limits. At rest the load pressure measures it except
//! for the friction of the seals, which may carry any share of the Coulomb friction. Payload, friction,
//! load pressure and the boom's deflection are correlated by the equilibrium.
//!
//! **Feedforward alone.** The motor speeds n(m̂_k) are those of the payload estimated from the usable
//! measurements, without other feedback. With the estimation error m̃_k the motion deviates from that of
//! the known payload by
//!
//! ```text
//! ξ_{k+1} = F_k ξ_k − b_k (∂n/∂m)_k m̃_k
//! ```
//!
//! The errors of an optimal estimate of a constant form a reverse martingale, E m̃_j m̃_k = P_k for j ≤ k.
//! With S_{k+1} = F_k S_k − b_k (∂n/∂m)_k the cross covariance is therefore E ξ_k m̃_k = S_k P_k, and the
//! covariance of ξ follows. This is an estimate of the error of feedforward and no bound: position feedback
//! reduces it.

use super::crane_along_course::CraneAlongCourse;
use super::prediction_error::LinearCourse;
use hydroboom_control::estimation::error_covariance::{Covariance, output_deviation};
use hydroboom_control::estimation::reduced_model::STATES;
use hydroboom_control::estimation::reduced_model::state_index::{
    DISTURBANCE, FRICTION, LOAD_PRESSURE, PAYLOAD, POSITION, UNKNOWN_FLOW,
};
use hydroboom_math::Dual;
use nalgebra::{Matrix2, Vector2};

/// Standard deviation of a payload that is uniformly distributed between two limits \[kg\].
pub(super) fn deviation([low, high]: [f64; 2]) -> f64 {
    (high - low).abs() / 12_f64.sqrt()
}

/// Covariance at rest before the first measurement for a given standard deviation of the payload \[kg\].
pub(super) fn at_rest(crane: &CraneAlongCourse, payload_deviation: f64) -> Covariance<f64, STATES> {
    let model = crane.model.map(Dual::<f64, STATES>::constant);
    let mut direction = 0..STATES;
    let z = crane.states[0].map(|value| Dual::variable(value, direction.next().unwrap_or(0)));
    let (balance, piston) = (model.acceleration(&z).slope, model.piston(&z).slope);
    // load position and pressure that keep the equilibrium and the piston's position
    let solved = |source: usize| {
        let held = Matrix2::new(
            balance[POSITION],
            balance[LOAD_PRESSURE],
            piston[POSITION],
            piston[LOAD_PRESSURE],
        );
        let pushed = -Vector2::new(balance[source], piston[source]);
        let found = held.lu().solve(&pushed).unwrap_or_else(Vector2::zeros);
        let mut column = [0.0; STATES];
        (column[source], column[POSITION], column[LOAD_PRESSURE]) = (1.0, found[0], found[1]);
        column
    };
    // uniform distribution within ± the Coulomb friction
    let friction = crane.model.coulomb / 3_f64.sqrt();
    let sources = [(PAYLOAD, payload_deviation), (FRICTION, friction)];
    let mut p = [[0.0; STATES]; STATES];
    for (source, deviation) in sources {
        let column = solved(source);
        for i in 0..STATES {
            for j in 0..STATES {
                p[i][j] += deviation * deviation * column[i] * column[j];
            }
        }
    }
    p
}

/// RMS position error \[m\] of feedforward alone, from the covariances given the usable measurements.
pub(super) fn feedforward_error(
    crane: &CraneAlongCourse,
    course: &LinearCourse<STATES>,
    known: &[Covariance<f64, STATES>],
) -> f64 {
    // the payload error changes the motion of the load but not the disturbance states
    let moving = 0..DISTURBANCE;
    let row = |output: &[f64; STATES]| -> [f64; DISTURBANCE] { std::array::from_fn(|i| output[i]) };
    let mut covariance = [[0.0; DISTURBANCE]; DISTURBANCE];
    let mut sensitivity = [0.0; DISTURBANCE];
    let mut square = 0.0;
    for (k, transition) in course.transitions.iter().enumerate() {
        square += output_deviation(&covariance, &row(&course.outputs[k][0])).powi(2);
        let speed_by_payload = crane.motor_speed_by_payload(k);
        let variance = known[k][PAYLOAD][PAYLOAD];
        let driven: [f64; DISTURBANCE] =
            std::array::from_fn(|i| -transition[i][UNKNOWN_FLOW] * speed_by_payload);
        let by_state = |i: usize, of: &dyn Fn(usize) -> f64| -> f64 {
            moving.clone().map(|j| transition[i][j] * of(j)).sum()
        };
        let moved: [f64; DISTURBANCE] = std::array::from_fn(|i| by_state(i, &|j| sensitivity[j]));
        let left: [[f64; DISTURBANCE]; DISTURBANCE] =
            std::array::from_fn(|i| std::array::from_fn(|j| by_state(i, &|l| covariance[l][j])));
        covariance = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let cross = moved[i] * driven[j] + driven[i] * moved[j];
                by_state(j, &|l| left[i][l]) + variance * (cross + driven[i] * driven[j])
            })
        });
        sensitivity = std::array::from_fn(|i| moved[i] + driven[i]);
    }
    let last = course
        .outputs
        .last()
        .map_or(0.0, |rows| output_deviation(&covariance, &row(&rows[0])).powi(2));
    ((square + last) / course.outputs.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::disturbances::{Disturbances, linearised};
    use super::*;
    use hydroboom_description::Description;

    fn along() -> (CraneAlongCourse, LinearCourse<STATES>) {
        let mut crane = Description::uia_single_boom().unwrap();
        let n = &mut crane.numbers;
        (n.rest, n.dwell, n.ramp, n.motion_end) = (0.2, 0.2, 0.3, n.motion_start + 0.04);
        let along = CraneAlongCourse::new(&crane, &crane.motion(0.1)).unwrap();
        let course = linearised(&along, &Disturbances::of(&crane));
        (along, course)
    }

    /// A constant payload error produces one motion per kilogram.
    #[test]
    fn a_constant_payload_error_gives_one_motion_per_kilogram() {
        let (crane, course) = along();
        let constant = |deviation: f64| {
            let mut p = [[0.0; STATES]; STATES];
            p[PAYLOAD][PAYLOAD] = deviation * deviation;
            vec![p; course.outputs.len()]
        };
        let mut state = [0.0; DISTURBANCE];
        let mut square = 0.0;
        for (k, rows) in course.outputs.iter().enumerate() {
            let error: f64 = (0..DISTURBANCE).map(|i| rows[0][i] * state[i]).sum();
            square += error * error;
            if let Some(transition) = course.transitions.get(k) {
                let speed = crane.motor_speed_by_payload(k);
                state = std::array::from_fn(|i| {
                    let moved: f64 = (0..DISTURBANCE).map(|j| transition[i][j] * state[j]).sum();
                    moved - transition[i][UNKNOWN_FLOW] * speed
                });
            }
        }
        let per_kg = (square / course.outputs.len() as f64).sqrt();
        for deviation in [1.0, 20.0] {
            let found = feedforward_error(&crane, &course, &constant(deviation));
            assert!((found / (deviation * per_kg) - 1.0).abs() < 1e-6, "{found} {per_kg}");
        }
        // micrometres per kilogram, for a payload of 307 kg
        assert!((1e-7..1e-4).contains(&per_kg), "{per_kg} m/kg");
    }

    /// The load pressure at rest is determined by payload and friction together, and the piston position is
    /// known.
    #[test]
    fn at_rest_the_pressure_measures_payload_and_friction() {
        let (crane, course) = along();
        let p = at_rest(&crane, 30.0);
        let position = crane.reference[0].position;
        let rest = |payload: f64| crane.model.at(position, payload).holding_pressure;
        let per_kg = rest(crane.payload + 0.5) - rest(crane.payload - 0.5);
        let exact = (30.0 * per_kg).hypot(crane.model.coulomb / 3_f64.sqrt());
        let found = p[LOAD_PRESSURE][LOAD_PRESSURE].sqrt();
        assert!((found / exact - 1.0).abs() < 0.02, "{found} {exact} Pa");
        assert!(output_deviation(&p, &course.outputs[0][0]) < 1e-9);
    }
}
