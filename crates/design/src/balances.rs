//! By what is learned of a crane, and how well it is known before: its balances of oil and of load, and how late its motor is.

use crate::model_following::{DOUBT, stiffness};
use hydroboom_control::command_lag::CommandLag;
use hydroboom_control::flow_balance::{Balance, FlowBalance};
use hydroboom_control::learner::Balances;
use hydroboom_control::load_balance::LoadBalance;
use hydroboom_control::model_following::ModelFollowing;
use hydroboom_control::schedule::Schedule;
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;

/// How far the pump's slip is from what the crane file has, by standard deviation, as a share of the displacement by pressure \[1/Pa\].
const SLIP: f64 = 1.5e-9;

/// A pump is thought to leak at least so much, as a share of what it delivers at the motor's highest speed, though a crane file may say that
/// nothing leaks.
const TIGHTEST: f64 = 1e-3;

/// Leakage is stated for a pressure across the pump of at least this much \[Pa\], though a crane may rest on less: it is divided by.
const LEAST_ACROSS: f64 = 1e5;

/// What can be learned of the crane of a description, and how well it is known before: a pump's flow to 3 percent, leakage to
/// three times its own size (worn pumps, hot oil), the pressure at which oil stiffens (by the air in it) to 8 bar, friction of
/// seals to a third and of cold oil to one and a half times its own size, a payload at rest to 3 bar, how late the motor is to 10 ms. All are estimates.
pub fn balances(description: &Description, schedule: &Schedule) -> Balances {
    let n = &description.numbers;
    let area = description.cylinder().piston_area;
    let load = LoadBalance {
        coulomb: n.coulomb / area,
        viscous: n.viscous / area,
        weighed: 3e5,
        friction: [0.33, 1.5],
        scatter: 1e5,
        window: 100,
        memory: 0.999,
        period: n.control_period,
    };
    let lag = CommandLag {
        before: n.following_lead,
        uncertainty: 1e-2,
        scatter: 5e-3,
        window: 100,
        memory: 0.999,
        period: n.control_period,
    };
    Balances { load, flow: flow_balance(description, schedule), lag }
}

fn flow_balance(description: &Description, schedule: &Schedule) -> FlowBalance {
    let n = &description.numbers;
    let law = schedule.at(n.payload);
    let leakage = leakage(n, &law);
    let resting = law.station(0.5 * n.stroke).rest.load_pressure;
    let stated_at = (resting + law.beyond_load - n.rod_side).max(LEAST_ACROSS);
    let laminar = n.slip_at_rest * stated_at;
    let by_root = (n.internal_leakage + n.case_leakage_a) * stated_at.sqrt();
    let leaks = leakage.max(TIGHTEST * n.displacement * n.motor_speed);
    FlowBalance {
        piston_area: description.cylinder().piston_area,
        displacement: n.displacement,
        delivery: n.displacement * n.motor_speed,
        volume: n.volume_pump_a + n.dead_volume_a,
        stiffness: stiffness(n),
        stated_at,
        laminar: if laminar > 0.0 { laminar / (laminar + by_root) } else { 0.0 },
        before: Balance {
            flow_gain: n.flow_gain,
            leakage,
            slip: n.slip_per_speed,
            transition: n.transition,
        },
        uncertainty: Balance {
            flow_gain: 0.03,
            leakage: 3.0 * leaks,
            slip: SLIP * n.displacement,
            transition: DOUBT,
        },
        scatter: 1e-4,
        position_scatter: 2e-5,
        pressure_scatter: 1e4,
        compression_error: 0.15,
        window: 100,
        memory: 0.999,
        period: n.control_period,
    }
}

/// What leaks of a crane as it is described while it rests at mid-stroke \[m³/s\], by the state feedback for its payload: the pump holds
/// the load by as much.
pub fn leakage(numbers: &Numbers<f64>, law: &ModelFollowing<f64>) -> f64 {
    let resting = law.station(0.5 * numbers.stroke).rest;
    resting.holding_speed * numbers.displacement * numbers.flow_gain
}
