//! A payload that is unknown when the course begins: what is known of it at rest, and what feedforward alone makes of it until it is estimated.
//!
//! The payload is uniform between two ends. At rest the load pressure weighs it, but for the friction of the seals, which may hold any share of the Coulomb
//! friction: payload, friction, load pressure and the boom's deflection are correlated as the equilibrium has them.
//!
//! **Feedforward alone.** Motor speeds n(m̂_k) are those of the payload as it is estimated by what could be acted on, and nothing else is fed back. With the
//! error m̃_k of that estimate the motion differs from that of the known payload by
//!
//! ```text
//! ξ_{k+1} = F_k ξ_k − b_k (∂n/∂m)_k m̃_k
//! ```
//!
//! The errors of an optimal estimate of a constant are a martingale that is run backwards, E m̃_j m̃_k = P_k for j ≤ k. So with S_{k+1} = F_k S_k − b_k (∂n/∂m)_k
//! the cross covariance is E ξ_k m̃_k = S_k P_k, and the covariance of ξ follows from it. That is an estimate of what feedforward leaves, and no bound: feedback of
//! the position leaves less.

use super::crane_along_course::CraneAlongCourse;
use super::prediction_error::LinearCourse;
use hydroboom_control::estimation::error_covariance::{Covariance, output_deviation};
use hydroboom_control::estimation::reduced_model::STATES;
use hydroboom_control::estimation::reduced_model::state_index::{
    DISTURBANCE, FRICTION, LOAD_PRESSURE, PAYLOAD, POSITION, UNKNOWN_FLOW,
};
use hydroboom_math::Dual;
use nalgebra::{Matrix2, Vector2};

/// Standard deviation of a payload that is uniform between two ends \[kg\].
pub(super) fn deviation([low, high]: [f64; 2]) -> f64 {
    (high - low).abs() / 12_f64.sqrt()
}

/// Covariance at rest before anything is measured, where the payload is known with a standard deviation \[kg\].
pub(super) fn at_rest(crane: &CraneAlongCourse, payload_deviation: f64) -> Covariance<f64, STATES> {
    let model = crane.model.map(Dual::<f64, STATES>::constant);
    let mut direction = 0..STATES;
    let z = crane.states[0].map(|value| Dual::variable(value, direction.next().unwrap_or(0)));
    let (balance, piston) = (model.acceleration(&z).slope, model.piston(&z).slope);
    // load and pressure that keep the equilibrium and the piston's position
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
    // uniform within the Coulomb friction to both sides
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

/// RMS of the piston's error \[m\] under feedforward alone, by covariances of the state as it is known when it is acted on.
pub(super) fn feedforward_error(
    crane: &CraneAlongCourse,
    course: &LinearCourse<STATES>,
    known: &[Covariance<f64, STATES>],
) -> f64 {
    // what feedforward does not know changes the motion of the load, and nothing of what disturbs it
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
