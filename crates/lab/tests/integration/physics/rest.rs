//! A crane at rest stays at rest.

use super::cranes::{described, steps};
use hydroboom_lab::plant;
use hydroboom_lab::study::IMPLICIT_STEP;
use hydroboom_model::Input;
use hydroboom_model::Scheme;

#[test]
fn a_start_at_any_stroke_excites_no_oscillation() {
    let base = ["base.stiffness_knm_per_rad=3000", "base.slack_mrad=0.5"];
    for overrides in
        [&[][..], &["boom.segments=10"], &["boom.segments=1"], &["payload.mass_kg=50"], &base]
    {
        let description = described(overrides);
        for stroke in [0.01, 0.25, 0.49] {
            let mut start = description.start(stroke);
            start.preload = 0.0;
            let mut crane = plant(&description, &start, Scheme::Implicit, IMPLICIT_STEP).unwrap();
            let before = crane.outputs();
            crane.advance(&Input { pump_speed: 0.0, holding_valve: 0.0 }, steps(1.0)).unwrap();
            let after = crane.outputs();
            let moved = (after.stroke - before.stroke).abs();
            assert!(moved < 1e-9, "{moved} m in a second at {stroke}, {overrides:?}");
        }
    }
}

#[test]
fn pre_loaded_start_only_leaks() {
    let description = described(&[]);
    let start = description.start(0.25);
    let mut crane = plant(&description, &start, Scheme::Implicit, IMPLICIT_STEP).unwrap();
    let before = crane.outputs();
    crane.advance(&Input { pump_speed: 0.0, holding_valve: 1.0 }, steps(10.0)).unwrap();
    let after = crane.outputs();
    // leakage of about 0.35 mm/s, after the valve's own play has been used up
    let sunk = (before.stroke - after.stroke) * 1e3;
    assert!((1.0..5.0).contains(&sunk), "sank {sunk} mm in 10 s");
    assert!((after.pressure_a - before.pressure_a).abs() < 2.5e5, "{}", after.pressure_a);
}

#[test]
fn a_held_load_stays_for_an_hour() {
    let description = described(&["friction.law=lugre"]);
    let mut start = description.start(0.25);
    start.preload = 0.0;
    let mut crane = plant(&description, &start, Scheme::Implicit, 2e-3).unwrap();
    let before = crane.outputs();
    for _ in 0..3600 {
        crane.advance(&Input { pump_speed: 0.0, holding_valve: 0.0 }, 500).unwrap();
    }
    let moved = (crane.outputs().stroke - before.stroke).abs();
    assert!(moved < 1e-6, "{moved} m in an hour");
}
