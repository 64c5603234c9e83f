//! Hydraulic circuit: conservation of oil, and opening of the valves.

use super::cranes::{Scatter, described, resting, scattered};
use hydroboom_model::CraneState;
use hydroboom_model::Flows;
use hydroboom_model::Input;
use hydroboom_model::Nodes;
use hydroboom_model::Scheme;
use hydroboom_model::Simulation;

#[test]
fn oil_that_leaves_one_node_arrives_in_another() {
    // every internal flow leaves one node and enters another; the sum over the five nodes is the pump's
    // gain by k_flow
    let (crane, at_rest) = resting::<3>(&described(&["relief.valves=fitted"]), 0.25);
    let mut random = Scatter(11);
    for _ in 0..100 {
        let (state, input) = scattered(&at_rest, &mut random);
        let q = crane.flows(&state, &input);
        let gained: f64 = crane.circuit.net_flows(&q).to_array().iter().sum();
        assert!((gained - (q.pump_delivery - q.pump)).abs() < 1e-16, "{gained}");
    }
}

#[test]
fn circuit_obeys_its_four_quadrant_table() {
    let (crane, _) = resting::<3>(&described(&[]), 0.25);
    let low = 2.5e5;
    let at = |pump_a: f64, a: f64, b: f64, pump_b: f64, valve: f64| {
        let p = Nodes { pump_a, a, b, pump_b, accumulator: low };
        crane.circuit.flows(&p, 0.0, valve)
    };
    // piston side carries the load: side B is connected to the accumulator, side A is not
    let q = at(70e5, 70e5, 5e5, 5e5, 1.0);
    assert!(q.return_flow > 1e-5 && q.bleed == 0.0, "{q:?}");
    // rod side carries the load (pulling load): side A opens through orifice 10, side B does not
    let q = at(5e5, 5e5, 70e5, 70e5, 1.0);
    assert!(q.bleed > 1e-6 && q.return_flow == 0.0, "{q:?}");
    // a starved side B draws from the accumulator without return flow
    let q = at(70e5, 70e5, 1e5, 1e5, 1.0);
    assert!(q.suction > 0.0 && q.return_flow == 0.0, "{q:?}");
    // lifting and lowering flows pass with the valve energised
    assert!(at(72e5, 70e5, 5e5, 3e5, 1.0).to_a > 0.0);
    assert!(at(68e5, 70e5, 5e5, 3e5, 1.0).to_a < 0.0);
    // de-energised: open towards the cylinder, closed against the load
    assert!(at(72e5, 70e5, 5e5, 3e5, 0.0).to_a > 0.0);
    let q = at(3e5, 70e5, 5e5, 3e5, 0.0);
    assert!(q.to_a == 0.0 && q.from_b == 0.0, "{q:?}");
}

#[test]
fn oil_is_conserved_through_cavitation() {
    // cavitating piston side: the load is pulled away from its oil, then dropped back (check valves that
    // open only at 90 bar keep the chamber closed)
    let closed = ["holding_valve.opening_bar=95", "holding_valve.cracking_bar=90"];
    let (crane, at_rest) = resting::<3>(&described(&closed), 0.1);
    let mut state = at_rest;
    state.boom.angular_velocity = [2.0; 3];
    let mut simulation = Simulation::new(crane, state, Scheme::Implicit, 25e-6).unwrap();
    let input = Input { pump_speed: 0.0, holding_valve: 0.0 };
    let mass = |s: &Simulation<3>| {
        let (q, x) = (s.state().circuit.nodes.a, s.crane().outputs(s.state()).stroke);
        let (oil, volume) = (&crane.circuit.oil, crane.cylinder.volume_a(x));
        let filled = volume - oil.cavity_volume(q, volume);
        filled * oil.compression(oil.pressure(q)).exp()
    };
    let before = mass(&simulation);
    let mut cavitated = false;
    for _ in 0..20_000 {
        simulation.advance(&input, 1).unwrap();
        let outputs = crane.outputs(simulation.state());
        cavitated |= outputs.cavity_volume > 0.0;
        assert!(outputs.pressure_a >= crane.circuit.oil.vapour_pressure);
    }
    assert!(cavitated, "the test must reach cavitation");
    let after = mass(&simulation);
    assert!((after / before - 1.0).abs() < 2e-5, "{before} m3 became {after} m3");
}

/// Volume balance: the pump's flow on the lifting side moves the piston, is compressed, or leaves the
/// circuit. Up and down, with oil so soft that each opening of a valve compresses much of it, and with
/// steps of a control period.
#[test]
fn implicit_steps_conserve_oil() {
    let soft_and_light = described(&["payload.mass_kg=54", "oil.transition_bar=18"]);
    let (crane, at_rest) = resting::<3>(&soft_and_light, 0.15);
    let (circuit, cylinder, step) = (crane.circuit, crane.cylinder, 1e-3);
    let stored = |then: &CraneState<f64, 3>, now: &CraneState<f64, 3>| {
        let [x0, x1] = [then, now].map(|s| crane.outputs(s).stroke);
        let compressed = |node: fn(&Nodes<f64>) -> f64| {
            let [then, now] = [then, now].map(|s| circuit.oil.compression(node(&s.circuit.nodes)));
            now - then
        };
        cylinder.piston_area * (x1 - x0)
            + 0.5 * (cylinder.volume_a(x0) + cylinder.volume_a(x1)) * compressed(|p| p.a)
            + circuit.volume_pump_a * compressed(|p| p.pump_a)
    };
    let leaving = |q: &Flows<f64>| q.internal_leakage + q.case_leakage_a + q.bleed;
    let mut simulation = Simulation::new(crane, at_rest, Scheme::Implicit, step).unwrap();
    let (mut lost, mut most) = (0.0_f64, 0.0_f64);
    for k in 0..6000 {
        let pump_speed = 18.0 * (std::f64::consts::PI * f64::from(k) / 3000.0).sin();
        let input = Input { pump_speed, holding_valve: 1.0 };
        let then = *simulation.state();
        simulation.advance(&input, 1).unwrap();
        let now = simulation.state();
        let [begun, ended] = [&then, now].map(|s| crane.flows(s, &input));
        let left = 0.5 * step * (leaving(&begun) + leaving(&ended));
        lost += step * ended.pump_delivery - left - stored(&then, now);
        most = most.max(stored(&at_rest, now));
    }
    // leaving flow and volumes are averaged over steps, and Newton's iterations end at 1 Pa; an error of 1
    // bar at every opening of a valve would amount to thousandths
    assert!(lost.abs() < 1e-5 * most, "{lost} m3 of {most}");
}
