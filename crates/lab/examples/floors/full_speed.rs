//! What the motor alone leaves of the error where a reference is faster than it: of a piston without mass, on oil that gives nowhere, that moves no
//! faster than the crane's motor can. Oil that gives lends a piston some millimetres of travel
//! while its pressure changes, so that one on soft oil may have less.

use super::{Case, Failure, Left};
use hydroboom_control::ModelFollowing;
use hydroboom_design::schedule;

/// Duration of a step \[s\].
const STEP: f64 = 1e-3;

/// How fast the piston can move in and out, at a position \[m\] and the motor's limit \[m/s\]. The law is the model's; `delivers` is the crane's pump
/// flow over the model's.
fn fastest(law: &ModelFollowing<f64>, delivers: f64, position: f64) -> [f64; 2] {
    let at = law.station(position);
    let spring = at.spring(law.stiffness_at(at.rest.load_pressure));
    let speed_per_velocity =
        (at.rest.load_pressure_slope - spring.pressure_by_velocity) / spring.pressure_by_speed;
    [-law.limits.speed, law.limits.speed]
        .map(|speed| (delivers * speed - at.rest.holding_speed) / speed_per_velocity)
}

/// What a piston is behind that nothing but its largest speed hinders.
pub fn left(case: &Case) -> Result<Left, Failure> {
    let Case { model, crane, course, .. } = case;
    let law = schedule(model)?.at(crane.numbers.payload);
    let delivers = crane.numbers.flow_gain / model.numbers.flow_gain;
    let steps = (course.duration() / STEP).round() as u64;
    let mut position = course.reference(0.0).position;
    let [mut square, mut farthest] = [0.0, 0.0_f64];
    for k in 1..=steps {
        let wanted = course.reference(k as f64 * STEP).position;
        let [inwards, outwards] = fastest(&law, delivers, position);
        position += (wanted - position).clamp(STEP * inwards, STEP * outwards);
        square += (wanted - position).powi(2);
        farthest = farthest.max((wanted - position).abs());
    }
    Ok(Left { rms: (square / steps as f64).sqrt(), farthest })
}
