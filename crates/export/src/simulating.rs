//! Simulation feedforward with its simulated crane in one block. `update` computes the motor speed every control
//! period; `step` advances the simulated crane in the steps between.

use crate::block::{Block, ControlPeriod, Entry, Target};
use crate::controller::{frame_outputs, simulating_period};
use crate::crane::{SEGMENTS, numbers, resting, state};
use crate::error::ExportError;
use crate::expression::{Expression, record};
use crate::given::{gains, noded, variable};
use crate::graph::Node;
use hydroboom_control::supervision::framed::SimulatedCrane;
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_math::Real;
use hydroboom_model::stepping::published;
use hydroboom_model::{Crane, CraneState, Input};
use std::collections::HashMap;
use std::rc::Rc;

type E = Expression;

/// Block of the benchmark controller with simulation feedforward (paper, section 4, figure 15) within the frame that
/// holds and releases the load, together with the simulated crane. The benchmark's gains are parameters; the simulated
/// crane is constant, as described.
///
/// # Errors
///
/// [`ExportError::Segments`], [`ExportError::Step`] or [`ExportError::Build`] if the crane cannot be exported, as for
/// [`crane_model`](crate::crane_model). [`ExportError::Design`] if no limits can be derived.
pub fn simulation_feedforward(description: &Description) -> Result<Block, ExportError> {
    let rest = resting(description)?;
    let (graph, block) = record(|| framed(description, &rest));
    Ok(Block { graph: Rc::new(graph), ..block? })
}

fn framed(
    description: &Description,
    rest: &CraneState<f64, SEGMENTS>,
) -> Result<Block, ExportError> {
    let (parameters, numbers_given) = gains(description);
    let crane: Crane<E, SEGMENTS> =
        description.crane_over(&Numbers::from_array(description.numbers.to_array().map(E::lit)))?;
    let (mut states, now) = state(rest);
    let outputs = crane.outputs(&now);
    let seen = SimulatedCrane {
        stroke: outputs.stroke,
        velocity: outputs.velocity,
        load_pressure: crane.cylinder.load_pressure(outputs.pressure_a, outputs.pressure_b),
    };
    let period = simulating_period(description, &numbers_given, &seen)?;
    let turns = period.states[period.motor].1;
    let mut moved = now;
    let input = Input { pump_speed: turns, holding_valve: E::one() };
    published(&crane, &mut moved, &input, E::lit(description.numbers.simulation_period));

    let output = |name: &str, unit: &str, meaning: &str| variable(name, unit, meaning, 0.0).0;
    let mut shown = frame_outputs();
    shown.extend([
        output("simulated_motor_speed", "rev/s", "Motor speed of the simulated crane"),
        output("simulated_stroke", "m", "Its piston position at the beginning of the period"),
        output("simulated_velocity", "m/s", "Its piston velocity"),
        output("simulated_load_pressure", "Pa", "Its load pressure"),
    ]);
    let mut values = period.outputs;
    values.extend([period.next[period.motor], seen.stroke, seen.velocity, seen.load_pressure]);
    let moving = states.len();
    let place = |(k, value): (usize, &E)| (Target::State(moving + k), value.node());
    let mut updated: Vec<(Target, Node)> = period.next.iter().enumerate().map(place).collect();
    updated.extend(values.iter().enumerate().map(|(k, value)| (Target::Output(k), value.node())));
    let stepped = numbers(&moved).into_iter().enumerate();
    let stepped = stepped.map(|(k, node)| (Target::State(k), node)).collect();
    states.extend(period.states);
    let entry = |name: &str, meaning: &str, results: Vec<(Target, Node)>| Entry {
        name: name.into(),
        meaning: meaning.into(),
        results,
    };
    Ok(Block {
        name: "simulation_feedforward".into(),
        meaning: format!(
            "{}: benchmark controller with simulation feedforward (section 4, figure 15) that holds and releases the load",
            description.name
        ),
        graph: Rc::default(),
        parameters,
        inputs: period.inputs.into_iter().map(noded).collect(),
        states: states.into_iter().map(noded).collect(),
        outputs: shown,
        entries: vec![
            entry("update", "one control period, before the steps of the simulated crane", updated),
            entry("step", "one step of the simulated crane", stepped),
        ],
        period: Some(ControlPeriod::of(description, true)),
        labels: HashMap::new(),
    })
}
