//! The boom's equations of motion and its segments.

use crate::cranes::{Scatter, described, resting, scattered};
use hydroboom_math::Dual;

type D = Dual<f64, 1>;

#[test]
fn equations_of_motion_agree_with_lagrange() {
    // d/dt dT/dphi' - dT/dphi + dV/dphi = joints + arm F, with T and V from the energies: an
    // independent derivation of the mass matrix, the centripetal terms and gravity
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
            // the outer slope along coordinate i, the inner one along time
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
    // at its own stiffness a finer boom rings a little lower, and converges
    let mode = |segments: usize| {
        let crane = described(&[&format!("boom.segments={segments}")]);
        let frictionless = hydroboom_lab::eigenfrequency::without_friction(&crane).unwrap();
        hydroboom_lab::eigenfrequency::locked_mode(&frictionless, 0.2).unwrap().frequency_hz
    };
    let (three, ten, twenty, fifty) = (mode(3), mode(10), mode(20), mode(50));
    assert!((0.93..0.97).contains(&(ten / three)), "{ten} against {three}");
    assert!((twenty / ten - 1.0).abs() < 0.02, "{twenty} against {ten}");
    assert!((fifty / twenty - 1.0).abs() < 0.01, "{fifty} against {twenty}");
}
