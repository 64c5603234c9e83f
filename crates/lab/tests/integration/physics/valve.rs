//! Valve-controlled crane compared with closed-form solutions.

use hydroboom_description::Description;
use hydroboom_model::stepping::{Implicit, runge_kutta_4};
use hydroboom_model::{Circuit, Crane, ValveControlled, ValveCraneState, ValveInput};
use std::f64::consts::TAU;

type Lift = Crane<f64, 2, ValveControlled<f64>>;

/// The crane with overrides, at rest at a stroke \[m\].
fn lift(overrides: &[&str], stroke: f64) -> (Lift, ValveCraneState<f64, 2>) {
    let mut description = Description::patu_lift().unwrap();
    for assignment in overrides {
        description.set(assignment).unwrap();
    }
    let n = &description.numbers;
    let crane = description.valve_crane_over(n).unwrap();
    let state = crane.at_rest(&description.valve_start_over(n, stroke)).unwrap();
    (crane, state)
}

fn stroke(crane: &Lift, state: &ValveCraneState<f64, 2>) -> f64 {
    crane.boom.cylinder_pose(&crane.boom.pose(&state.boom.angle)).stroke
}

const CLOSED: ValveInput<f64> = ValveInput { command: 5.77, supply: 91e5, tank: 1e5 };
const LIFTING: ValveInput<f64> = ValveInput { command: 4.5, supply: 91e5, tank: 1e5 };
/// Stiff links without friction, air and leakage, for which closed forms hold.
const PLAIN: [&str; 8] = [
    "link_2.joint_stiffness_knm_per_rad=1e6",
    "friction.coulomb_n=0.01",
    "friction.stiction_n=0",
    "friction.viscous_ns_per_m=0",
    "friction.bristle_damping_ns_per_m=0",
    "trapped_air.rod_side_l=0",
    "valve.leakage_l_min_per_bar=0",
    "oil.bulk_modulus_min_mpa=1200",
];

#[test]
fn with_the_valve_closed_the_crane_stays_at_rest() {
    let (crane, begin) = lift(&["valve.leakage_l_min_per_bar=0"], 0.2);
    let scheme = Implicit::new(&crane);
    let mut state = begin;
    for _ in 0..2000 {
        state = scheme.settled(&crane, &state, &CLOSED, 1e-3).unwrap();
    }
    assert!((stroke(&crane, &state) - stroke(&crane, &begin)).abs() < 1e-7);
    assert!((state.circuit.a - begin.circuit.a).abs() < 100.0);
}

#[test]
fn a_locked_cylinder_oscillates_with_the_frequency_of_oil_and_inertia() {
    let (crane, begin) = lift(&PLAIN, 0.25);
    // k = A²/C_A + A_r²/C_B with C = V/beta + V_hose (1/beta + 1/wall); J of both links as one rigid body
    let (c, circuit) = (&crane.cylinder, &crane.circuit);
    let beta = circuit.oil.bulk_modulus_max;
    let of = |volume: f64, hose: f64| (volume + hose) / beta + hose / circuit.hose_a.wall_modulus;
    let (of_a, of_b) =
        (of(c.volume_a(0.25), circuit.hose_a.volume), of(c.volume_b(0.25), circuit.hose_b.volume));
    let k = c.piston_area.powi(2) / of_a + c.rod_side_area.powi(2) / of_b;
    let pose = crane.boom.pose(&begin.boom.angle);
    let inertia: f64 = crane.boom.inertial_moments(&pose, &[1.0; 2]).iter().sum();
    let arm = crane.boom.cylinder_pose(&pose).arm[0];
    // neglected: the weight above its bearing and the lever's rotation with the boom, together below one
    // percent
    let expected = (k * arm * arm / inertia).sqrt() / TAU;

    let mut state = begin;
    // small amplitude: the rod side is at 1 bar and must not cavitate
    state.boom.angular_velocity = [0.001; 2];
    let scheme = Implicit::new(&crane);
    let (mut last, mut crossings) = (0.0, Vec::new());
    for step in 0..40_000 {
        state = scheme.settled(&crane, &state, &CLOSED, 5e-5).unwrap();
        let now = state.circuit.a - begin.circuit.a;
        if last < 0.0 && now >= 0.0 {
            crossings.push((f64::from(step) + last / (last - now)) * 5e-5);
        }
        last = now;
    }
    let periods = (crossings.len() - 1) as f64;
    let found = periods / (crossings[crossings.len() - 1] - crossings[0]);
    assert!((found / expected - 1.0).abs() < 0.01, "{found} Hz, {expected} Hz by hand");
}

#[test]
fn a_compensated_edge_moves_the_piston_at_its_own_speed() {
    let (crane, mut state) = lift(&["valve.leakage_l_min_per_bar=0"], 0.1);
    let scheme = Implicit::new(&crane);
    let valve = &crane.circuit.valve;
    let from = stroke(&crane, &state);
    for _ in 0..6000 {
        state = scheme.settled(&crane, &state, &LIFTING, 5e-4).unwrap();
    }
    let (begin, p_begin) = (stroke(&crane, &state), state.circuit.a);
    for _ in 0..4000 {
        state = scheme.settled(&crane, &state, &LIFTING, 5e-4).unwrap();
    }
    let (end, p_end) = (stroke(&crane, &state), state.circuit.a);
    assert!(begin > from);
    // over whole seconds the oscillation averages out, and the chamber stores the volume of its pressure
    // change
    let edge = crane.circuit.supply_to_a.coefficient(valve.travel(LIFTING.command));
    let delivered = 2.0 * edge * valve.compensated_drop.sqrt();
    let compressed = (p_end - p_begin) * 2.5e-3 / 0.5e9;
    let moved = crane.cylinder.piston_area * (end - begin);
    let apart = (moved + compressed) / delivered - 1.0;
    assert!(apart.abs() < 5e-3, "{apart}: {moved} of {delivered} m3");
}

#[test]
fn a_spool_answers_a_step_as_a_second_order_lag() {
    let (crane, begin) = lift(&[], 0.1);
    let scheme = Implicit::new(&crane);
    let valve = &crane.circuit.valve;
    let (omega, zeta) = (valve.bandwidth, valve.damping);
    let damped = omega * (1.0 - zeta * zeta).sqrt();
    let goal = valve.travel(LIFTING.command);
    let error = |h: f64| {
        let mut state = begin;
        let mut worst = 0.0_f64;
        for step in 1..=(0.5 / h) as u32 {
            state = scheme.settled(&crane, &state, &LIFTING, h).unwrap();
            let t = f64::from(step) * h;
            let fading = (-zeta * omega * t).exp();
            let turned = (damped * t).cos() + zeta * omega / damped * (damped * t).sin();
            worst = worst.max((state.circuit.spool - goal * (1.0 - fading * turned)).abs());
        }
        worst
    };
    let (whole, half) = (error(5e-4), error(2.5e-4));
    assert!(whole < 1e-3 * goal, "{whole} of {goal}");
    assert!((3.0..5.0).contains(&(whole / half)), "{whole}, with half the step {half}");
}

#[test]
fn trapped_air_on_the_rod_side_follows_its_gas_law() {
    let shut = [
        "valve.leakage_l_min_per_bar=0",
        "valve.b_to_tank_m3_s_sqrtpa=1e-12",
        // as much as the rod side holds
        "trapped_air.rod_side_l=3.6",
    ];
    let (crane, mut state) = lift(&shut, 0.1);
    let c = &crane.circuit;
    let scheme = Implicit::new(&crane);
    // the volume that is not air is a constant amount of oil
    let air = |p: f64| {
        let share = c.air.atmosphere / (p + c.air.atmosphere);
        c.air.rod_side * share.powf(1.0 / c.air.polytropic_exponent)
    };
    let hose = |p: f64| c.hose_b.volume * (1.0 + p / c.hose_b.wall_modulus);
    let oil = |x: f64, p: f64| crane.cylinder.volume_b(x) + hose(p) - air(p);
    let (x, p) = (stroke(&crane, &state), state.circuit.b);
    let begin = oil(x, p);
    for _ in 0..20_000 {
        state = scheme.settled(&crane, &state, &LIFTING, 5e-4).unwrap();
    }
    let (x_end, p_end) = (stroke(&crane, &state), state.circuit.b);
    let end = oil(x_end, p_end);
    assert!(p_end > p + 0.5e5 && x_end > x + 0.1, "{p_end} Pa at {x_end} m");
    let swept = crane.cylinder.rod_side_area * (x_end - x);
    assert!((end - begin).abs() < 2e-3 * swept, "{begin} m3, then {end} m3 of oil");
}

#[test]
fn both_schemes_move_a_valve_controlled_crane_alike() {
    let (crane, begin) = lift(&[], 0.2);
    let mut implicit = begin;
    let mut explicit = begin;
    let scheme = Implicit::new(&crane);
    for _ in 0..2000 {
        implicit = scheme.settled(&crane, &implicit, &LIFTING, 2.5e-4).unwrap();
        for _ in 0..25 {
            runge_kutta_4(&crane, &mut explicit, &LIFTING, 1e-5);
        }
    }
    let apart = stroke(&crane, &implicit) - stroke(&crane, &explicit);
    assert!(apart.abs() < 2e-6, "{apart} m");
    let (a, b) =
        (crane.circuit.chambers(&implicit.circuit), crane.circuit.chambers(&explicit.circuit));
    assert!((a.0 - b.0).abs() < 3e3, "{a:?} {b:?}");
}

#[test]
fn friction_carries_the_load_that_pressure_does_not() {
    let mut description = Description::patu_lift().unwrap();
    description.set("valve.leakage_l_min_per_bar=0").unwrap();
    let n = &description.numbers;
    let crane: Lift = description.valve_crane_over(n).unwrap();
    let mut start = description.valve_start_over(n, 0.2);
    let carrying = crane.at_rest(&start).unwrap().circuit.a;
    // 2 bar too little: the bristles hold 1.6 kN, and nothing moves
    start.pressure_a = Some(carrying - 2e5);
    let begin = crane.at_rest(&start).unwrap();
    assert!((begin.circuit.a - (carrying - 2e5)).abs() < 1.0);
    let scheme = Implicit::new(&crane);
    let mut state = begin;
    for _ in 0..1000 {
        state = scheme.settled(&crane, &state, &CLOSED, 1e-3).unwrap();
    }
    assert!((stroke(&crane, &state) - 0.2).abs() < 2e-6, "{}", stroke(&crane, &state));
    // 50 bar too little exceeds the friction: the pressure is what friction cannot hold
    start.pressure_a = Some(carrying - 50e5);
    let short = crane.at_rest(&start).unwrap().circuit.a;
    let held = n.coulomb / crane.cylinder.piston_area;
    assert!((carrying - short - held).abs() < 1.0, "{short} of {carrying}");
}
