//! What the motor leaves of the error where a reference changes its acceleration and nobody was told before: of a crane that is a mass on its oil, whose
//! spring and friction are known, and that is exactly where it should be until then; from then on all that follows is known, up to the next
//! change. The best motor speeds that are found have that much error.
//!
//! A trajectory is improved by backward and forward sweeps (iterative linear-quadratic regulation, the motor's limits kept in each of them) until a sweep brings
//! less than a thousandth. Such a best is a best near by. Drive, sensors and the boom's bending are
//! left out: with them nobody has less.

use super::{Case, Failure, Left};
use hydroboom_control::actuator_limits::ActuatorLimits;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_design::HydraulicSpring;
use hydroboom_design::operating_points::{OperatingPoint, OperatingPoints};
use nalgebra::{Matrix4, RowVector4, Vector4};
use std::ops::Range;

/// Duration of a step \[s\].
const STEP: f64 = 1e-3;
/// What a motor that changes its speed by 1 rev/s in a second costs as an error \[m\]: next to nothing, so that a best is one.
const SLEW_AS_ERROR: f64 = 1e-9;
const SWEEPS: usize = 200;
/// Shares of state feedback to begin with, whose poles are a pair of the natural frequency with a damping ratio, and another \[rad/s\].
const STARTS: [f64; 3] = [0.1, 0.4, 1.0];
const DAMPING: f64 = 0.7;
const BANDWIDTH: f64 = 12.6;
/// A change of the reference's acceleration \[m/s²\] that counts.
const CHANGE: f64 = 1e-3;
/// No sweep that brings less than this share of the sum of squares is followed by another.
const WORTH: f64 = 1e-3;

/// The crane at a step, where the reference is.
struct Step {
    reference: SetPoint<f64>,
    point: OperatingPoint,
}

/// A mass on its oil spring: position \[m\], velocity \[m/s\], load pressure \[Pa\] and motor speed \[rev/s\].
struct Spring {
    points: OperatingPoints,
    limits: ActuatorLimits<f64>,
    /// Friction over the piston area \[Pa\], and the velocity at which it is near that \[m/s\].
    friction: f64,
    friction_speed: f64,
    steps: Vec<Step>,
}

/// A state, and how the next follows from it and from the rate of the motor speed.
struct Next {
    state: Vector4<f64>,
    by_state: Matrix4<f64>,
    by_slew: Vector4<f64>,
}

impl Spring {
    /// Of a crane along a course: the model's with its payload, and what its oil, pump and friction are themselves.
    fn new(Case { model, crane, course, .. }: &Case) -> Result<Self, Failure> {
        let (modelled, own) = (&model.numbers, &crane.numbers);
        let mut points = super::operating_points(model, crane)?;
        points.transition[0] = own.transition;
        for point in &mut points.points {
            point.stiff.pressure_by_speed *= own.flow_gain / modelled.flow_gain;
            point.stiff.acceleration_by_velocity *= own.viscous / modelled.viscous;
        }
        let count = (course.duration() / STEP).round() as usize;
        let step = |k: usize| {
            let reference = course.reference(k as f64 * STEP);
            Step { point: points.at(reference.position), reference }
        };
        Ok(Self {
            steps: (0..=count).map(step).collect(),
            points,
            limits: ActuatorLimits { speed: modelled.motor_speed, slew: modelled.motor_slew },
            friction: own.coulomb / model.cylinder().piston_area,
            friction_speed: 1.0 / modelled.steepness,
        })
    }

    /// How fast a motor at a speed \[rev/s\] can change it, down and up \[rev/s²\].
    fn slews(&self, speed: f64) -> [f64; 2] {
        let ActuatorLimits { speed: limit, slew } = self.limits;
        [(-limit - speed) / STEP, (limit - speed) / STEP].map(|rate| rate.clamp(-slew, slew))
    }

    /// Motor speed \[rev/s\] of the reference in even motion.
    fn evenly(&self, at: &Step) -> f64 {
        let rest = &at.point.equilibrium;
        let spring = at.point.spring(self.points.stiffness(rest.load_pressure));
        let rate = rest.load_pressure_slope - spring.pressure_by_velocity;
        rest.holding_speed + rate / spring.pressure_by_speed * at.reference.velocity
    }

    /// Acceleration of the reference from a step to the next \[m/s²\].
    fn acceleration(&self, from: usize) -> f64 {
        let [now, next] = [from, from + 1].map(|k| self.steps[k].reference.velocity);
        (next - now) / STEP
    }

    /// Steps from one change of the reference's acceleration to the next.
    fn parts(&self) -> Vec<Range<usize>> {
        let last = self.steps.len() - 1;
        let changes =
            (1..last).filter(|&k| (self.acceleration(k) - self.acceleration(k - 1)).abs() > CHANGE);
        let ends: Vec<_> = std::iter::once(0).chain(changes).chain([last]).collect();
        ends.windows(2).map(|pair| pair[0]..pair[1]).collect()
    }

    /// Exactly on the reference at a step, at the acceleration that it had.
    fn on_reference(&self, at: usize) -> Vector4<f64> {
        let Step { reference, point } = &self.steps[at];
        let acceleration = if at == 0 { 0.0 } else { self.acceleration(at - 1) };
        let OperatingPoint { equilibrium: rest, stiff, .. } = point;
        let drag = stiff.acceleration_by_velocity * reference.velocity;
        let rubs = (reference.velocity / self.friction_speed).tanh();
        let moving = (acceleration - drag) / stiff.acceleration_by_pressure;
        let pressure = rest.load_pressure + moving + self.friction * rubs;
        let speed = self.evenly(&self.steps[at]);
        Vector4::new(reference.position, reference.velocity, pressure, speed)
    }

    /// `v' = a_v v + a_p (p − p_0 − p_fr(v))`, `p' = s(p) (c_v v + b (n − n_0))`.
    fn next(&self, at: &Step, state: &Vector4<f64>, slew: f64) -> Next {
        let OperatingPoint { equilibrium: rest, stiff, .. } = &at.point;
        let [x, v, p] = [state[0], state[1], state[2]];
        let speed = state[3] + STEP * slew;
        let (a_v, a_p) = (stiff.acceleration_by_velocity, stiff.acceleration_by_pressure);
        let (c_v, b) = (stiff.pressure_by_velocity, stiff.pressure_by_speed);
        let turned = (v / self.friction_speed).tanh();
        let turning = (1.0 - turned * turned) / self.friction_speed;
        let friction = self.friction;
        let held = rest.load_pressure + rest.load_pressure_slope * (x - at.reference.position);
        let acceleration = a_v * v + a_p * (p - held - friction * turned);
        let v_next = v + STEP * acceleration;
        let v_by = RowVector4::new(
            -STEP * a_p * rest.load_pressure_slope,
            1.0 + STEP * (a_v - a_p * friction * turning),
            STEP * a_p,
            0.0,
        );
        let stiffness = self.points.stiffness(p);
        let apart = 1e3;
        let stiffens =
            (self.points.stiffness(p + apart) - self.points.stiffness(p - apart)) / (2.0 * apart);
        let rate = c_v * v_next + b * (speed - rest.holding_speed);
        let x_by = RowVector4::new(1.0, 0.0, 0.0, 0.0) + STEP * v_by;
        let pumped = STEP * stiffness * b;
        let p_by = RowVector4::new(0.0, 0.0, 1.0 + STEP * stiffens * rate, pumped)
            + STEP * stiffness * c_v * v_by;
        let n_by = RowVector4::new(0.0, 0.0, 0.0, 1.0);
        Next {
            state: Vector4::new(x + STEP * v_next, v_next, p + STEP * stiffness * rate, speed),
            by_state: Matrix4::from_rows(&[x_by, v_by, p_by, n_by]),
            by_slew: Vector4::new(0.0, 0.0, STEP * pumped, STEP),
        }
    }

    /// States and slews of a part under feedback of where they differ from others, with the sum of their squares; none where it runs away.
    fn roll(
        &self,
        part: &Range<usize>,
        slew: impl Fn(usize, &Vector4<f64>) -> f64,
    ) -> Option<Tried> {
        let mut state = self.on_reference(part.start);
        let mut tried = Tried { states: vec![state], slews: Vec::new(), cost: 0.0, farthest: 0.0 };
        for (k, at) in self.steps[part.clone()].iter().enumerate() {
            let [down, up] = self.slews(state[3]);
            let rate = slew(k, &state).clamp(down, up);
            state = self.next(at, &state, rate).state;
            let error = state[0] - self.steps[part.start + k + 1].reference.position;
            tried.farthest = tried.farthest.max(error.abs());
            tried.cost += error * error + (SLEW_AS_ERROR * rate).powi(2);
            tried.states.push(state);
            tried.slews.push(rate);
        }
        tried.cost.is_finite().then_some(tried)
    }

    /// To begin with: the reference's own speed, and a share of what state feedback asks for beside it.
    fn begin(&self, part: &Range<usize>, share: f64) -> Option<Tried> {
        self.roll(part, |k, state| {
            let step = &self.steps[part.start + k];
            let pressure = step.point.equilibrium.load_pressure;
            let gains = gains(&step.point.spring(self.points.stiffness(pressure)));
            let off = self.on_reference(part.start + k) - state;
            let back = gains[0] * off[0] + gains[1] * off[1] + gains[2] * off[2];
            (self.evenly(step) + share * back - state[3]) / STEP
        })
    }

    /// A better one near by; none where none is found.
    fn improve(&self, part: &Range<usize>, tried: &Tried, careful: f64) -> Option<Tried> {
        let (count, at) = (tried.slews.len(), &self.steps[part.start..]);
        let mut gradient = Vector4::zeros();
        let mut curvature = Matrix4::zeros();
        let mut answers = vec![(0.0, RowVector4::zeros()); count];
        for k in (0..count).rev() {
            let rate = tried.slews[k];
            // the error at the end of the step
            gradient[0] += 2.0 * (tried.states[k + 1][0] - at[k + 1].reference.position);
            curvature[(0, 0)] += 2.0;
            let Next { by_state, by_slew, .. } = self.next(&at[k], &tried.states[k], rate);
            let dear = 2.0 * SLEW_AS_ERROR * SLEW_AS_ERROR;
            let slope = by_slew.dot(&gradient) + dear * rate;
            let bent = by_slew.dot(&(curvature * by_slew)) + dear;
            let crossed = by_slew.transpose() * curvature * by_state;
            let bent_more = bent * (1.0 + careful) + careful * dear;
            let wanted = -slope / bent_more;
            let [down, up] = self.slews(tried.states[k][3]).map(|limit| limit - rate);
            let change = wanted.clamp(down, up);
            let free = down < wanted && wanted < up;
            let feedback = if free { -crossed / bent_more } else { RowVector4::zeros() };
            answers[k] = (change, feedback);
            gradient = by_state.transpose() * gradient
                + feedback.transpose() * (slope + bent * change)
                + crossed.transpose() * change;
            curvature = by_state.transpose() * curvature * by_state
                + feedback.transpose() * bent * feedback
                + feedback.transpose() * crossed
                + crossed.transpose() * feedback;
        }
        [1.0, 0.5, 0.25, 0.1, 0.03, 0.01].into_iter().find_map(|share| {
            let better = self.roll(part, |k, state| {
                let (change, feedback) = answers[k];
                tried.slews[k] + share * change + (feedback * (state - tried.states[k]))[0]
            })?;
            (better.cost < tried.cost).then_some(better)
        })
    }

    /// The best that is found for a part.
    fn best(&self, part: &Range<usize>) -> Option<Tried> {
        let found =
            STARTS.iter().filter_map(|share| Some(self.best_from(self.begin(part, *share)?, part)));
        found.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// The best that is found from one to begin with.
    fn best_from(&self, mut best: Tried, part: &Range<usize>) -> Tried {
        let mut careful = 0.0;
        for _ in 0..SWEEPS {
            match self.improve(part, &best, careful) {
                Some(better) => {
                    let worth = 1.0 - better.cost / best.cost;
                    best = better;
                    careful *= 0.3;
                    if worth < WORTH && careful < 1e-3 {
                        break;
                    }
                }
                None if careful > 1e6 => break,
                None => careful = 10.0 * careful + 1e-3,
            }
        }
        best
    }

    /// What is left over all parts.
    fn left(&self) -> Option<Left> {
        let best: Vec<_> =
            self.parts().iter().map(|part| self.best(part)).collect::<Option<_>>()?;
        let square: f64 = best.iter().map(|tried| tried.cost).sum();
        let rms = (square / self.steps.len() as f64).sqrt();
        Some(Left { rms, farthest: best.iter().map(|tried| tried.farthest).fold(0.0, f64::max) })
    }
}

/// Gains of position, velocity and pressure that place the poles, by comparing coefficients of `(s + b k_p)(s² − a_v s) − a_p c_v s + a_p b (k_x + k_v s)`.
fn gains(spring: &HydraulicSpring) -> [f64; 3] {
    let (a_v, a_p) = (spring.acceleration_by_velocity, spring.acceleration_by_pressure);
    let (c_v, b) = (spring.pressure_by_velocity, spring.pressure_by_speed);
    let frequency = spring.natural_frequency();
    let (square, pair) = (frequency * frequency, 2.0 * DAMPING * frequency);
    let kept = pair + BANDWIDTH + a_v;
    let velocity = (square + pair * BANDWIDTH + a_v * kept + a_p * c_v) / (a_p * b);
    [square * BANDWIDTH / (a_p * b), velocity, kept / b]
}

/// Rates of the motor speed \[rev/s²\] that were tried, the states that they lead through, the sum of squared errors \[m²\] and the farthest \[m\].
struct Tried {
    states: Vec<Vector4<f64>>,
    slews: Vec<f64>,
    cost: f64,
    farthest: f64,
}

/// What the best motor speeds leave.
pub fn left(case: &Case) -> Result<Left, Failure> {
    Spring::new(case)?.left().ok_or_else(|| "the spring runs away whatever is tried first".into())
}
