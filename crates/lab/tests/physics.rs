//! What must hold for the assembled crane, whatever its parameters.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_description::Description;
use hydroboom_lab::numerical_damping::{lossless, numerical_damping};
use hydroboom_lab::{energy_audit::audit, plant, study::IMPLICIT_STEP};
use hydroboom_math::{Dual, Lanes};
use hydroboom_model::stepping::{Implicit, published, runge_kutta_4};
use hydroboom_model::{
    Crane, CraneState, Input, Invalid, Nodes, Scheme, Simulation, SimulationError,
};

type D = Dual<f64, 1>;

fn described(overrides: &[&str]) -> Description {
    let mut crane = Description::uia_single_boom().unwrap();
    for assignment in overrides {
        crane.set(assignment).unwrap();
    }
    crane
}

fn resting<const N: usize>(
    description: &Description,
    stroke: f64,
) -> (Crane<f64, N>, CraneState<f64, N>) {
    let crane = description.crane::<N>().unwrap();
    let state = crane.at_rest(&description.start(stroke)).unwrap();
    (crane, state)
}

/// Default implicit steps in a duration \[s\].
fn steps(duration: f64) -> u32 {
    (duration / IMPLICIT_STEP).round() as u32
}

/// A fixed sequence of numbers in -1..1 that looks random: states for property checks.
struct Scatter(u64);

impl Scatter {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// A moving state around rest, valves in any position, low-pressure nodes near their kinks.
fn scattered<const N: usize>(
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

#[test]
fn every_power_has_its_energy() {
    // dE/dt along the motion, exactly, against the sum of the named powers
    for overrides in [
        &[][..],
        &["friction.law=lugre", "pump.delivery=computed", "relief.valves=fitted"],
        &[
            "boom.segments=10",
            "relief.valves=fitted",
            "relief.cracking_bar=60",
            "relief.opening_bar=80",
        ],
    ] {
        let description = described(overrides);
        let mut random = Scatter(7);
        let check = |random: &mut Scatter| match description.segment_shares.len() {
            3 => energy_rates::<3>(&description, random),
            _ => energy_rates::<10>(&description, random),
        };
        for _ in 0..40 {
            let (rate, power, size) = check(&mut random);
            let error = (rate - power).abs();
            assert!(error < 1e-8 * size, "{rate} against {power} W, {overrides:?}");
        }
    }
}

/// dE/dt by differentiation, by the named powers, and the size of the largest power.
fn energy_rates<const N: usize>(
    description: &Description,
    random: &mut Scatter,
) -> (f64, f64, f64) {
    let (crane, at_rest) = resting::<N>(description, 0.2);
    let (state, input) = scattered(&at_rest, random);
    let rates = crane.derivative(&state, &input);
    let dual = crane.map(&mut D::constant);
    let mut moving = state.map(D::constant);
    for i in 0..crane.boom.len() {
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
fn oil_that_leaves_one_node_arrives_in_another() {
    // every internal flow leaves one node and enters another; what the five nodes gain in all is
    // only what the pump gains by k_flow
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
    // piston side carries the load: side B breathes with the accumulator, side A does not
    let q = at(70e5, 70e5, 5e5, 5e5, 1.0);
    assert!(q.return_flow > 1e-5 && q.bleed == 0.0, "{q:?}");
    // rod side carries it (pulling load): side A opens through orifice 10, side B does not
    let q = at(5e5, 5e5, 70e5, 70e5, 1.0);
    assert!(q.bleed > 1e-6 && q.return_flow == 0.0, "{q:?}");
    // a starved side B draws from the accumulator and pushes nothing back
    let q = at(70e5, 70e5, 1e5, 1e5, 1.0);
    assert!(q.suction > 0.0 && q.return_flow == 0.0, "{q:?}");
    // lifting and lowering pass with the valve energised
    assert!(at(72e5, 70e5, 5e5, 3e5, 1.0).to_a > 0.0);
    assert!(at(68e5, 70e5, 5e5, 3e5, 1.0).to_a < 0.0);
    // not energised: free towards the cylinder, shut against the load
    assert!(at(72e5, 70e5, 5e5, 3e5, 0.0).to_a > 0.0);
    let q = at(3e5, 70e5, 5e5, 3e5, 0.0);
    assert!(q.to_a == 0.0 && q.from_b == 0.0, "{q:?}");
}

#[test]
fn nothing_rings_at_the_start_wherever_it_is() {
    for overrides in [&[][..], &["boom.segments=10"], &["boom.segments=1"], &["payload.mass_kg=50"]]
    {
        let description = described(overrides);
        for stroke in [0.01, 0.25, 0.49] {
            let mut start = description.start(stroke);
            start.preloaded = false;
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
    start.preloaded = false;
    let mut crane = plant(&description, &start, Scheme::Implicit, 2e-3).unwrap();
    let before = crane.outputs();
    for _ in 0..3600 {
        crane.advance(&Input { pump_speed: 0.0, holding_valve: 0.0 }, 500).unwrap();
    }
    let moved = (crane.outputs().stroke - before.stroke).abs();
    assert!(moved < 1e-6, "{moved} m in an hour");
}

#[test]
fn frictionless_crane_keeps_its_energy_for_a_minute() {
    let description = lossless(&described(&[])).unwrap();
    let mut start = description.start(0.2);
    start.preloaded = false;
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
    // second order on smooth stretches; valves that crack within a step cost a part of it
    let order = (coarse / fine).log2() / 4.0;
    assert!((1.6..2.4).contains(&order), "{order}: {coarse} to {fine}");
}

#[test]
fn time_steps_have_the_order_and_the_damping_they_claim() {
    for seen in numerical_damping(&described(&[])).unwrap() {
        let wanted = match seen.scheme.as_str() {
            "published" => Some(1.0),
            "implicit" => Some(2.0),
            // below rounding at any step that is stable
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
fn violent_events_are_taken_in_parts_and_steps_agree() {
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
fn oil_is_conserved_through_cavitation() {
    // a starved piston side: the load is pulled off its oil, then dropped back
    // (check valves that open only at 90 bar keep the chamber closed)
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

#[test]
fn lanes_repeat_f64_bit_for_bit() {
    let (crane, at_rest) = resting::<3>(&described(&["friction.law=lugre"]), 0.2);
    let mut random = Scatter(5);
    let cases: [(CraneState<f64, 3>, Input<f64>); 8] =
        std::array::from_fn(|_| scattered(&at_rest, &mut random));
    let wide = crane.map(&mut |v| Lanes([v; 8]));
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
    let implicit = Implicit::new(&crane);
    let wide_implicit = Implicit::new(&wide);
    let mut alone = cases.map(|(state, _)| state);
    for step in 0..50 {
        if step % 2 == 0 {
            published(&wide, &mut lanes, &lane_input, Lanes([2e-5; 8]));
        } else {
            wide_implicit.step(&wide, &mut lanes, &lane_input, Lanes([1e-4; 8]));
        }
        for (lane, state) in alone.iter_mut().enumerate() {
            if step % 2 == 0 {
                published(&crane, state, &cases[lane].1, 2e-5);
            } else {
                implicit.step(&crane, state, &cases[lane].1, 1e-4);
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
        // along one direction that moves everything a little
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

#[test]
fn published_scheme_substeps_where_it_would_blow_up() {
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
fn a_crane_driven_into_ruin_says_so_and_keeps_its_last_good_state() {
    let (crane, at_rest) = resting::<3>(&described(&[]), 0.45);
    let mut simulation = Simulation::new(crane, at_rest, Scheme::Implicit, 250e-6).unwrap();
    let full_speed = Input { pump_speed: 50.0, holding_valve: 1.0 };
    let error = (0..40_000).find_map(|_| simulation.advance(&full_speed, 4).err());
    let Some(SimulationError::Invalid { reason, .. }) = error else {
        panic!("no relief valve, no limit, and no error: {error:?}");
    };
    assert!(matches!(reason, Invalid::Pressure | Invalid::Stroke), "{reason:?}");
    assert!(crane.validity(simulation.state()).check().is_ok());
    // with relief valves the same drive is survived against the stop
    let (crane, at_rest) = resting::<3>(&described(&["relief.valves=fitted"]), 0.45);
    let mut simulation = Simulation::new(crane, at_rest, Scheme::Implicit, 250e-6).unwrap();
    simulation.advance(&full_speed, 8000).unwrap();
    let outputs = crane.outputs(simulation.state());
    assert!((0.5..0.51).contains(&outputs.stroke), "{}", outputs.stroke);
}

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
