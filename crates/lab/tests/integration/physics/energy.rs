//! Energy: every power has its store, and the balance closes.

use super::cranes::{Scatter, described, resting, scattered};
use hydroboom_description::Description;
use hydroboom_lab::energy_audit::audit;
use hydroboom_lab::numerical_damping::lossless;
use hydroboom_lab::plant;
use hydroboom_lab::study::IMPLICIT_STEP;
use hydroboom_math::Dual;
use hydroboom_model::Input;
use hydroboom_model::Nodes;
use hydroboom_model::Scheme;

type D = Dual<f64, 1>;

#[test]
fn every_power_has_its_energy() {
    // dE/dt along the motion, by exact differentiation, against the sum of the named powers
    for overrides in [
        &[][..],
        &["friction.law=lugre", "pump.delivery=computed", "relief.valves=fitted"],
        &[
            "boom.segments=10",
            "relief.valves=fitted",
            "relief.cracking_bar=60",
            "relief.opening_bar=80",
        ],
        &[
            "boom.segments=10",
            "base.stiffness_knm_per_rad=3000",
            "base.slack_mrad=0.5",
            "pump.slip_l_min_per_bar=0.002",
            "pump.slip_cm3_per_rev_bar=0.0004",
        ],
    ] {
        let description = described(overrides);
        let mut random = Scatter(7);
        let check = |random: &mut Scatter| match description.coordinates() {
            3 => energy_rates::<3>(&description, random),
            10 => energy_rates::<10>(&description, random),
            _ => energy_rates::<11>(&description, random),
        };
        for _ in 0..40 {
            let (rate, power, size) = check(&mut random);
            let error = (rate - power).abs();
            assert!(error < 1e-8 * size, "{rate} against {power} W, {overrides:?}");
        }
    }
}

/// dE/dt by differentiation, by the named powers, and the magnitude of the largest power.
fn energy_rates<const N: usize>(
    description: &Description,
    random: &mut Scatter,
) -> (f64, f64, f64) {
    let (crane, at_rest) = resting::<N>(description, 0.2);
    let (state, input) = scattered(&at_rest, random);
    let rates = crane.derivative(&state, &input);
    let dual = crane.map(&mut D::constant);
    let mut moving = state.map(D::constant);
    for i in 0..crane.boom.coordinates() {
        moving.boom.angle[i].slope = [state.boom.angular_velocity[i]];
        moving.boom.angular_velocity[i].slope = [rates.angular_acceleration[i]];
    }
    moving.bristle.slope = [rates.bristle];
    let slopes = rates.circuit.nodes.to_array();
    let mut nodes = moving.circuit.nodes.to_array();
    nodes.iter_mut().zip(slopes).for_each(|(q, slope)| q.slope = [slope]);
    moving.circuit.nodes = Nodes::from_array(nodes);
    moving.circuit.gas_volume.slope = [rates.circuit.gas_volume];
    let rate = dual.energy(&moving).total().slope[0];
    let power = crane.power(&state, &input);
    let size = power.to_array().into_iter().map(f64::abs).fold(1.0, f64::max);
    (rate, power.net(), size)
}

#[test]
fn frictionless_crane_keeps_its_energy_for_a_minute() {
    let description = lossless(&described(&[])).unwrap();
    let mut start = description.start(0.2);
    start.preload = 0.0;
    let mut crane = plant(&description, &start, Scheme::RungeKutta4, 20e-6).unwrap();
    crane.lift(2e-3).unwrap();
    let input = Input { pump_speed: 0.0, holding_valve: 0.0 };
    let before = crane.energy();
    let mut exchanged: f64 = 0.0;
    for _ in 0..600 {
        crane.advance(&input, 5000).unwrap();
        exchanged = exchanged.max((crane.energy().gravitational - before.gravitational).abs());
    }
    let drift = (crane.energy().total() - before.total()).abs();
    assert!(drift < 1e-6 * exchanged, "{drift} J of {exchanged} J");
}

#[test]
fn energy_audit_closes_over_a_motion_cycle() {
    let crane = described(&[]);
    let residual = |step| audit(&crane, Scheme::Implicit, step).unwrap().relative_residual;
    let (coarse, default, fine) = (residual(1e-3), residual(IMPLICIT_STEP), residual(62.5e-6));
    assert!(default < 1e-4, "{default}");
    // second order where smooth; valves that crack within a step reduce the order
    let order = (coarse / fine).log2() / 4.0;
    assert!((1.6..2.4).contains(&order), "{order}: {coarse} to {fine}");
}

#[test]
fn energy_audit_of_the_virtual_crane_closes_too() {
    // elastic base, slip, LuGre friction, ten segments; at its own step and at shorter ones
    let crane = Description::uia_virtual().unwrap();
    let step = crane.numbers.virtual_step;
    let residual = |step| audit(&crane, Scheme::Implicit, step).unwrap().relative_residual;
    let [own, fine] = [step, 0.25 * step].map(residual);
    // a bristle that breaks away within a step reduces the order
    assert!(own < 1e-6 && fine < 0.3 * own, "{own}, {fine}");
}
