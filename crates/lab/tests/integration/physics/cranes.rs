//! Cranes and states for the tests.

use hydroboom_description::Description;
use hydroboom_lab::study::IMPLICIT_STEP;
use hydroboom_model::{Crane, CraneState, Input, Nodes};

/// The paper's crane with overrides.
pub fn described(overrides: &[&str]) -> Description {
    let mut crane = Description::uia_single_boom().unwrap();
    for assignment in overrides {
        crane.set(assignment).unwrap();
    }
    crane
}

/// The crane at rest.
pub fn resting<const N: usize>(
    description: &Description,
    stroke: f64,
) -> (Crane<f64, N>, CraneState<f64, N>) {
    let crane = description.crane::<N>().unwrap();
    let state = crane.at_rest(&description.start(stroke)).unwrap();
    (crane, state)
}

/// Number of default implicit steps in a duration \[s\].
pub fn steps(duration: f64) -> u32 {
    (duration / IMPLICIT_STEP).round() as u32
}

/// Reproducible pseudo-random numbers in -1 to 1, for states in property tests.
pub struct Scatter(pub u64);

impl Scatter {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Moving state around rest with valves in any position and low-pressure nodes near their kinks.
pub fn scattered<const N: usize>(
    at_rest: &CraneState<f64, N>,
    random: &mut Scatter,
) -> (CraneState<f64, N>, Input<f64>) {
    let mut state = *at_rest;
    for i in 0..N {
        state.boom.angle[i] += 0.01 * random.next();
        state.boom.angular_velocity[i] = 0.3 * random.next();
    }
    let q = &mut state.circuit.nodes;
    *q = Nodes {
        pump_a: q.a + 2e5 * random.next(),
        a: q.a + 20e5 * random.next(),
        b: q.b + 3e5 * random.next(),
        pump_b: q.b + 3e5 * random.next(),
        accumulator: q.accumulator + 1e5 * random.next(),
    };
    state.bristle = 5e-5 * random.next();
    let valve = f64::from(u8::from(random.next() > 0.0));
    (state, Input { pump_speed: 30.0 * random.next(), holding_valve: valve })
}
