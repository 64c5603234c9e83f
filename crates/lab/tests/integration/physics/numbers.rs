//! One model with several number types: lanes, single precision, dual numbers.

use super::cranes::{Scatter, described, resting, scattered};
use hydroboom_math::{Dual, Lanes, Real};
use hydroboom_model::stepping::Implicit;
use hydroboom_model::stepping::published;
use hydroboom_model::{Crane, CraneState, Input};

type D = Dual<f64, 1>;

/// Step of the published scheme. Not inlined, like the next one: the compiler's time grows more than in
/// proportion to the size of a function.
#[inline(never)]
fn explicit<T: Real>(crane: &Crane<T, 3>, state: &mut CraneState<T, 3>, input: &Input<T>) {
    published(crane, state, input, T::lit(2e-5));
}

/// Step of the implicit scheme.
#[inline(never)]
fn implicit<T: Real>(
    scheme: &Implicit<T>,
    crane: &Crane<T, 3>,
    state: &mut CraneState<T, 3>,
    input: &Input<T>,
) {
    scheme.step(crane, state, input, T::lit(1e-4));
}

#[test]
fn lanes_repeat_f64_bit_for_bit() {
    let (crane, at_rest) = resting::<3>(&described(&["friction.law=lugre"]), 0.2);
    let mut random = Scatter(5);
    let cases: [(CraneState<f64, 3>, Input<f64>); 4] =
        std::array::from_fn(|_| scattered(&at_rest, &mut random));
    let wide = crane.map(&mut |v| Lanes([v; 4]));
    // packed by visiting the fields of all states in the same order
    let flat = cases.map(|(state, input)| {
        let mut values = Vec::new();
        state.map(|v| values.push(v));
        input.map(|v| values.push(v));
        values
    });
    let mut index = 0;
    let mut pack = |_: f64| {
        index += 1;
        Lanes(std::array::from_fn(|lane| flat[lane][index - 1]))
    };
    let mut lanes = cases[0].0.map(&mut pack);
    let lane_input = cases[0].1.map(&mut pack);
    let scheme = Implicit::new(&crane);
    let wide_scheme = Implicit::new(&wide);
    let mut alone = cases.map(|(state, _)| state);
    for step in 0..50 {
        if step % 2 == 0 {
            explicit(&wide, &mut lanes, &lane_input);
        } else {
            implicit(&wide_scheme, &wide, &mut lanes, &lane_input);
        }
        for (lane, state) in alone.iter_mut().enumerate() {
            if step % 2 == 0 {
                explicit(&crane, state, &cases[lane].1);
            } else {
                implicit(&scheme, &crane, state, &cases[lane].1);
            }
        }
    }
    for (lane, state) in alone.into_iter().enumerate() {
        assert_eq!(lanes.map(|v| v.0[lane]), state, "lane {lane}");
    }
}

#[test]
fn single_precision_follows_double() {
    let (crane, at_rest) = resting::<3>(&described(&[]), 0.2);
    let single = crane.map(&mut |v| v as f32);
    let (mut x, mut y) = (at_rest, at_rest.map(|v| v as f32));
    let input = Input { pump_speed: 20.0, holding_valve: 1.0 };
    for _ in 0..4000 {
        published(&crane, &mut x, &input, 50e-6);
        published(&single, &mut y, &input.map(|v| v as f32), 50e-6);
    }
    let (a, b) = (crane.outputs(&x), single.outputs(&y));
    assert!((a.stroke - f64::from(b.stroke)).abs() < 1e-4, "{} {}", a.stroke, b.stroke);
    assert!((a.pressure_a / f64::from(b.pressure_a) - 1.0).abs() < 0.02);
}

#[test]
fn derivatives_match_central_differences_at_scattered_states() {
    let (crane, at_rest) = resting::<3>(&described(&["pump.delivery=computed"]), 0.25);
    let dual = crane.map(&mut D::constant);
    let mut random = Scatter(23);
    for _ in 0..30 {
        let (state, input) = scattered(&at_rest, &mut random);
        // along one direction that changes every state a little
        let mut direction = Vec::new();
        state.map(|v| direction.push(v.abs().max(1e-6) * random.next()));
        let along = |h: f64| {
            let mut k = 0;
            state.map(|v| {
                k += 1;
                v + h * direction[k - 1]
            })
        };
        let mut k = 0;
        let moving = state.map(|v| {
            k += 1;
            D { value: v, slope: [direction[k - 1]] }
        });
        let slopes = dual.derivative(&moving, &input.map(D::constant));
        let h = 1e-7;
        let (ahead, behind) =
            (crane.derivative(&along(h), &input), crane.derivative(&along(-h), &input));
        let pairs = slopes
            .circuit
            .nodes
            .to_array()
            .into_iter()
            .zip(ahead.circuit.nodes.to_array().into_iter().zip(behind.circuit.nodes.to_array()))
            .chain(
                slopes
                    .angular_acceleration
                    .into_iter()
                    .zip(ahead.angular_acceleration.into_iter().zip(behind.angular_acceleration)),
            );
        for (slope, (a, b)) in pairs {
            let difference = (a - b) / (2.0 * h);
            let size = difference.abs().max(1e-3 * a.abs()).max(1.0);
            assert!(
                (slope.slope[0] - difference).abs() < 1e-4 * size,
                "{} against {difference}",
                slope.slope[0]
            );
        }
    }
}
