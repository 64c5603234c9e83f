//! Integration steps: order, damping, agreement, stability limits, and behaviour beyond them.

use super::cranes::{described, resting};
use hydroboom_lab::numerical_damping::numerical_damping;
use hydroboom_lab::plant;
use hydroboom_model::Input;
use hydroboom_model::Invalid;
use hydroboom_model::Scheme;
use hydroboom_model::Simulation;
use hydroboom_model::SimulationError;
use hydroboom_model::StepLimit;
use hydroboom_model::stepping::Implicit;
use hydroboom_model::stepping::published;
use hydroboom_model::stepping::runge_kutta_4;

#[test]
fn schemes_converge_to_the_same_motion() {
    let (crane, at_rest) = resting::<3>(&described(&["friction.law=lugre"]), 0.2);
    let implicit = Implicit::new(&crane);
    let input = Input { pump_speed: 15.0, holding_valve: 1.0 };
    let (mut a, mut b, mut c) = (at_rest, at_rest, at_rest);
    for _ in 0..100_000 {
        published(&crane, &mut a, &input, 2e-6);
        runge_kutta_4(&crane, &mut b, &input, 2e-6);
    }
    for _ in 0..20_000 {
        implicit.step(&crane, &mut c, &input, 10e-6);
    }
    let [a, b, c] = [a, b, c].map(|s| crane.outputs(&s));
    assert!((a.stroke - b.stroke).abs() < 2e-6 && (c.stroke - b.stroke).abs() < 1e-7);
    assert!((c.pressure_a - b.pressure_a).abs() < 1e3, "{} {}", c.pressure_a, b.pressure_a);
}

#[test]
fn time_steps_have_their_stated_order_and_damping() {
    for seen in numerical_damping(&described(&[])).unwrap() {
        let wanted = match seen.scheme.as_str() {
            "published" => Some(1.0),
            "implicit" => Some(2.0),
            // rounding dominates at any stable step
            _ => None,
        };
        match (wanted, seen.order) {
            (Some(wanted), Some(order)) => assert!((order - wanted).abs() < 0.05, "{seen:?}"),
            (None, None) => {}
            _ => panic!("{seen:?}"),
        }
        if seen.scheme == "implicit" {
            assert!((0.0..1e-6).contains(&seen.damping_ratio), "{seen:?}");
        }
    }
}

#[test]
fn impacts_are_substepped_and_step_sizes_agree() {
    // full speed into the end stop and back, with the relief valves of a real machine
    let crane = described(&["relief.valves=fitted"]);
    let run = |step: f64| {
        let (model, at_rest) = resting::<3>(&crane, 0.45);
        let mut simulation = Simulation::new(model, at_rest, Scheme::Implicit, step).unwrap();
        let each = (1e-2 / step).round() as u32;
        let mut highest: f64 = 0.0;
        for k in 0..200 {
            let pump_speed = if k < 100 { 20.0 } else { -20.0 };
            simulation.advance(&Input { pump_speed, holding_valve: 1.0 }, each).unwrap();
            highest = highest.max(model.outputs(simulation.state()).pressure_a);
        }
        (model.outputs(simulation.state()).stroke, highest)
    };
    let ((fine, fine_peak), (coarse, coarse_peak)) = (run(50e-6), run(2e-3));
    assert!((coarse - fine).abs() < 1e-4, "{coarse} {fine}");
    assert!((coarse_peak / fine_peak - 1.0).abs() < 0.01, "{coarse_peak} {fine_peak}");
}

#[test]
fn published_scheme_substeps_where_it_would_be_unstable() {
    for (overrides, substeps) in [
        (&["boom.segments=20"][..], 2..5),
        (&["boom.segments=50"][..], 10..30),
        (
            &[
                "boom.segment_lengths_mm=110.6,110.6,110.6,110.6,110.6,609.4,609.4,609.4,609.4,609.4",
            ],
            5..9,
        ),
    ] {
        let description = described(overrides);
        let start = description.start(0.2);
        let mut crane = plant(&description, &start, Scheme::Published, 50e-6).unwrap();
        assert!(substeps.contains(&crane.substeps()), "{} {overrides:?}", crane.substeps());
        crane.lift(1e-3).unwrap();
        crane.advance(&Input { pump_speed: 5.0, holding_valve: 1.0 }, 4000).unwrap();
    }
}

/// Bristles so stiff that a step of 50 us is unstable once the piston slides at 120 mm/s, and stable at
/// rest. Forward Euler needs h < 2 g/(sigma_0 |v|), 36 us there. With substeps the force is that of the
/// implicit scheme.
#[test]
fn stiff_bristles_take_substeps_while_the_piston_slides() {
    let stiff = described(&["friction.law=lugre", "friction.bristle_stiffness_n_per_mm=3e5"]);
    let start = stiff.start(0.2);
    let mut published = plant(&stiff, &start, Scheme::Published, 50e-6).unwrap();
    let mut implicit = plant(&stiff, &start, Scheme::Implicit, 500e-6).unwrap();
    let usual = published.substeps();
    let lift = Input { pump_speed: 41.0, holding_valve: 1.0 };
    published.advance(&lift, 20_000).unwrap();
    implicit.advance(&lift, 2_000).unwrap();
    let [explicit, wanted] = [published.outputs(), implicit.outputs()];
    assert!((usual + 1..=8).contains(&published.substeps()), "{}", published.substeps());
    let off = explicit.friction_force / wanted.friction_force - 1.0;
    assert!(off.abs() < 0.02, "friction off by {off}");
    assert!((explicit.stroke - wanted.stroke).abs() < 0.5e-3, "{explicit:?} {wanted:?}");
    // closed form of the step limit at a velocity
    let n = &stiff.numbers;
    let g = n.coulomb + n.stiction * (-(0.12 / n.stribeck_velocity).powi(2)).exp();
    let limit = StepLimit::of_bristles(&stiff.friction_law(), 0.12);
    assert!((limit / (0.7 * 2.0 * g / (3e8 * 0.12)) - 1.0).abs() < 1e-9, "{limit}");
    // bristles that a thousand substeps cannot follow are refused, with their key
    let absurd = described(&["friction.law=lugre", "friction.bristle_stiffness_n_per_mm=1e8"]);
    let refused = plant(&absurd, &absurd.start(0.2), Scheme::Published, 50e-6)
        .map_err(|error| error.to_string())
        .and_then(|mut crane| crane.advance(&lift, 20_000).map_err(|error| error.to_string()));
    assert!(refused.unwrap_err().contains("limit of "));
}

#[test]
fn impossible_steps_and_inputs_are_refused() {
    let (crane, at_rest) = resting::<3>(&described(&[]), 0.2);
    for step in [0.0, -1e-3, f64::NAN, f64::INFINITY, 1.0] {
        let refused = Simulation::new(crane, at_rest, Scheme::Published, step);
        assert!(matches!(refused, Err(SimulationError::Step { .. })), "{step}");
    }
    let mut simulation = Simulation::new(crane, at_rest, Scheme::Implicit, 1e-3).unwrap();
    let bad = Input { pump_speed: f64::NAN, holding_valve: 1.0 };
    assert!(matches!(simulation.advance(&bad, 1), Err(SimulationError::Input { .. })));
}

#[test]
fn an_invalid_state_is_an_error_and_the_last_valid_one_is_kept() {
    let (crane, at_rest) = resting::<3>(&described(&[]), 0.45);
    let mut simulation = Simulation::new(crane, at_rest, Scheme::Implicit, 250e-6).unwrap();
    let full_speed = Input { pump_speed: 50.0, holding_valve: 1.0 };
    let error = (0..40_000).find_map(|_| simulation.advance(&full_speed, 4).err());
    let Some(SimulationError::Invalid { reason, .. }) = error else {
        panic!("no relief valve, no limit, and no error: {error:?}");
    };
    assert!(matches!(reason, Invalid::Pressure | Invalid::Stroke), "{reason:?}");
    assert!(crane.validity(simulation.state()).check().is_ok());
    // with relief valves the same input is survived against the end stop
    let (crane, at_rest) = resting::<3>(&described(&["relief.valves=fitted"]), 0.45);
    let mut simulation = Simulation::new(crane, at_rest, Scheme::Implicit, 250e-6).unwrap();
    simulation.advance(&full_speed, 8000).unwrap();
    let outputs = crane.outputs(simulation.state());
    assert!((0.5..0.51).contains(&outputs.stroke), "{}", outputs.stroke);
}

#[test]
fn a_step_that_does_not_converge_is_rejected() {
    // full speed into an end stop and back with too long a step, until one does not converge
    let (crane, mut state) = resting::<3>(&described(&["relief.valves=fitted"]), 0.45);
    let implicit = Implicit::new(&crane);
    let step = 2e-3;
    for k in 0..2000 {
        let pump_speed = if k % 500 < 250 { 25.0 } else { -25.0 };
        let input = Input { pump_speed, holding_valve: 1.0 };
        let mut alone = state;
        // the convergence tolerance of the pressure is 0.01 bar
        if implicit.step(&crane, &mut alone, &input, step) > 1e3 {
            let mut simulation = Simulation::new(crane, state, Scheme::Implicit, step).unwrap();
            simulation.advance(&input, 1).unwrap();
            assert_ne!(*simulation.state(), alone, "kept at step {k}");
            return;
        }
        state = alone;
    }
    panic!("every step settled: the test needs a more violent event");
}
