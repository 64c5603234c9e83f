//! Equations of motion and segments of the boom.

use super::cranes::{Scatter, described, resting, scattered};
use hydroboom_description::Description;
use hydroboom_lab::eigenfrequency::{locked_mode, without_friction};
use hydroboom_math::Dual;

type D = Dual<f64, 1>;

#[test]
fn equations_of_motion_agree_with_lagrange() {
    // d/dt dT/dphi' - dT/dphi + dV/dphi = joints + arm F, with T and V from the energies: an independent
    // derivation of mass matrix, centripetal terms and gravity
    let description = described(&["payload.y_mm=80", "payload.inertia_kgm2=12"]);
    let (crane, at_rest) = resting::<3>(&description, 0.3);
    let mut random = Scatter(3);
    for _ in 0..20 {
        let (state, input) = scattered(&at_rest, &mut random);
        let alpha = crane.derivative(&state, &input).angular_acceleration;
        let force = crane.outputs(&state).cylinder_force;
        let boom = crane.boom.map(&mut |v: f64| Dual::<D, 1>::constant(D::constant(v)));
        let energies = |angle: [Dual<D, 1>; 3], velocity: [Dual<D, 1>; 3]| {
            let state = hydroboom_model::BoomState { angle, angular_velocity: velocity };
            let pose = boom.pose(&angle);
            let potential = boom.gravitational_energy(&pose) + boom.elastic_energy(&state);
            (boom.kinetic_energy(&pose, &state), potential)
        };
        let pose = crane.boom.pose(&state.boom.angle);
        let cylinder = crane.boom.cylinder_pose(&pose);
        for i in 0..3 {
            // outer derivative with respect to coordinate i, inner one with respect to time
            let variable = |value: f64, rate: f64, own: bool| Dual {
                value: Dual { value, slope: [rate] },
                slope: [Dual { value: f64::from(u8::from(own)), slope: [0.0] }],
            };
            let omega = state.boom.angular_velocity;
            let angle = state.boom.angle;
            let by_velocity = energies(
                std::array::from_fn(|k| variable(angle[k], omega[k], false)),
                std::array::from_fn(|k| variable(omega[k], alpha[k], k == i)),
            );
            let by_angle = energies(
                std::array::from_fn(|k| variable(angle[k], omega[k], k == i)),
                std::array::from_fn(|k| variable(omega[k], alpha[k], false)),
            );
            let momentum_rate = by_velocity.0.slope[0].slope[0];
            let left = momentum_rate - by_angle.0.slope[0].value + by_angle.1.slope[0].value;
            let damper = |j: usize| crane.boom.joints()[j].damping * (omega[j + 1] - omega[j]);
            let joints =
                if i < 2 { damper(i) } else { 0.0 } - if i > 0 { damper(i - 1) } else { 0.0 };
            let right = joints + cylinder.arm[i] * force;
            let size = 1e4 + right.abs();
            assert!((left - right).abs() < 1e-9 * size, "segment {i}: {left} against {right}");
        }
    }
}

#[test]
fn number_of_segments_is_free_and_layouts_agree() {
    // with its own stiffness a finer boom has a slightly lower frequency, which converges
    let mode = |segments: usize| {
        let crane = described(&[&format!("boom.segments={segments}")]);
        let frictionless = hydroboom_lab::eigenfrequency::without_friction(&crane).unwrap();
        locked_mode(&frictionless, 0.2).unwrap().frequency_hz
    };
    let (three, ten, twenty, fifty) = (mode(3), mode(10), mode(20), mode(50));
    assert!((0.93..0.97).contains(&(ten / three)), "{ten} against {three}");
    assert!((twenty / ten - 1.0).abs() < 0.02, "{twenty} against {ten}");
    assert!((fifty / twenty - 1.0).abs() < 0.01, "{fifty} against {twenty}");
}

#[test]
fn more_segments_converge_at_second_order_or_better() {
    let frictionless = without_friction(&Description::uia_virtual().unwrap()).unwrap();
    let frequency =
        |segments: usize| locked_mode(&frictionless.divided(segments), 0.2).unwrap().frequency_hz;
    let [coarse, middle, fine, finest] = [6, 12, 24, 48].map(frequency);
    // halving the segments reduces the change to a quarter
    assert!((middle - coarse).abs() > 3.5 * (fine - middle).abs(), "{coarse} {middle} {fine}");
    assert!((fine - middle).abs() > 3.5 * (finest - fine).abs(), "{middle} {fine} {finest}");
}

#[test]
fn an_elastic_base_is_a_spring_in_series_with_the_cylinder() {
    // rigid boom on oil and base: 1/ω² = J (1/k_oil + 1/k_base), each stiffness referred to the boom; the
    // base alone follows from a second crane, without knowledge of the oil
    let overrides = |stiffness: f64| {
        described(&[
            "boom.segments=1",
            "friction.coulomb_n=0",
            "friction.stiction_n=0",
            "friction.viscous_ns_per_m=0",
            "base.inertia_kgm2=0.01",
            &format!("base.stiffness_knm_per_rad={stiffness}"),
        ])
    };
    let period_square = |stiffness: f64| {
        let mode = locked_mode(&overrides(stiffness), 0.25).unwrap();
        (1.0 / (2.0 * std::f64::consts::PI * mode.frequency_hz)).powi(2)
    };
    let rigid = period_square(0.0);
    let (soft, stiff) = (period_square(3000.0) - rigid, period_square(30_000.0) - rigid);
    assert!((soft / stiff / 10.0 - 1.0).abs() < 1e-2, "{soft} s² against {stiff} s²");
    assert!(soft > 0.1 * rigid, "{soft} s² beside {rigid} s²");
}

#[test]
fn play_in_the_bearings_shifts_a_loaded_boom_and_stiffens_nothing() {
    let described =
        |slack: &str| described(&["boom.segments=10", "base.stiffness_knm_per_rad=3000", slack]);
    let frequency = |slack| locked_mode(&described(slack), 0.25).unwrap().frequency_hz;
    // the load keeps the bearing on one side of its play
    let (without, with) = (frequency("base.slack_mrad=0"), frequency("base.slack_mrad=0.5"));
    assert!((with / without - 1.0).abs() < 1e-3, "{with} Hz against {without} Hz");
    let base_angle = |slack| resting::<11>(&described(slack), 0.25).1.boom.angle[10];
    let shifted = base_angle("base.slack_mrad=0.5") / base_angle("base.slack_mrad=0");
    let angle = base_angle("base.slack_mrad=0");
    let expected = 1.0 + 0.5e-3 / angle.abs();
    assert!((shifted - expected).abs() < 1e-2 * expected, "{shifted} against {expected}");
}
