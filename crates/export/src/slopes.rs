//! Exact derivatives of the model's rates and outputs, for linearisation: the model over dual numbers of recorded
//! expressions.

use crate::block::{Block, Entry, Target, Variable};
use crate::crane::SEGMENTS;
use crate::error::ExportError;
use crate::expression::{Expression, record};
use crate::plan::Plan;
use hydroboom_description::Description;
use hydroboom_description::schema::{KEYS, Numbers};
use hydroboom_math::{Dual, Real};
use hydroboom_model::circuit::{CircuitState, Nodes};
use hydroboom_model::{BoomState, Crane, CraneState, Input};
use std::array::from_fn;
use std::collections::HashMap;
use std::rc::Rc;

type E = Expression;
/// A recorded number with its derivative along one direction.
type D = Dual<E, 1>;

/// Companion of a block of [`crane_model`](crate::crane_model): the rates of its states and their directional
/// derivatives, and those of the outputs (product of the Jacobian and a vector).
///
/// The block has no states. Inputs: the model's parameters in use, inputs and states, in the model's order; then a
/// seed for each of these, its component of the direction. Outputs: the rate of each state; the derivatives of the
/// rates; and those of the model's outputs.
///
/// # Errors
///
/// [`ExportError::Build`] if no crane of three segments can be built from the description.
pub fn slopes(description: &Description, of: &Block) -> Result<Block, ExportError> {
    let used = Plan::of(of)?.parameters;
    let (graph, block) = record(|| recording(description, of, &used));
    Ok(Block { graph: Rc::new(graph), ..block? })
}

/// Input quantities, their seeds, and both as dual numbers.
#[derive(Default)]
struct Given {
    values: Vec<(Variable, E)>,
    seeds: Vec<(Variable, E)>,
}

impl Given {
    fn number(&mut self, variable: &Variable) -> D {
        let (value, seed) = (E::input(), E::input());
        self.values.push((variable.clone(), value));
        let name = format!("seed_{}", variable.name);
        let meaning = format!("component of the direction along {}", variable.name);
        self.seeds.push((Variable { name, meaning, initial: 0.0, ..variable.clone() }, seed));
        D { value, slope: [seed] }
    }
}

fn recording(description: &Description, of: &Block, used: &[usize]) -> Result<Block, ExportError> {
    let mut given = Given::default();
    let mut numbers = Vec::new();
    for (k, (key, value, _)) in description.entries().enumerate() {
        let number = match used.contains(&k) {
            true => given.number(&of.parameters[k].0),
            false => D::lit(value),
        };
        numbers.push(number * D::lit(key.factor));
    }
    let numbers: [D; KEYS.len()] = from_fn(|k| numbers.get(k).copied().unwrap_or(D::zero()));
    let crane: Crane<D, SEGMENTS> = description.crane_over(&Numbers::from_array(numbers))?;

    let inputs: Vec<D> = of.inputs.iter().map(|(v, _)| given.number(v)).collect();
    let states: Vec<D> = of.states.iter().map(|(v, _)| given.number(v)).collect();
    let [speed, valve] = [0, 1].map(|k| inputs[k]);
    let input = Input { pump_speed: speed, holding_valve: valve };
    let mut states = states.into_iter();
    let mut next = || states.next().unwrap_or(D::zero());
    let now = CraneState {
        boom: BoomState { angle: from_fn(|_| next()), angular_velocity: from_fn(|_| next()) },
        bristle: next(),
        circuit: CircuitState { nodes: Nodes::from_array(from_fn(|_| next())), gas_volume: next() },
    };
    let moved = crane.derivative(&now, &input);
    let rates = [
        &now.boom.angular_velocity[..],
        &moved.angular_acceleration,
        &[moved.bristle],
        &moved.circuit.nodes.to_array(),
        &[moved.circuit.gas_volume],
    ];
    let rates = rates.concat();
    let seen = crane.outputs(&now);
    let load = crane.cylinder.load_pressure(seen.pressure_a, seen.pressure_b);
    let seen = seen.to_array().into_iter().chain([load]);

    let mut outputs: Vec<(Variable, E)> = Vec::new();
    let mut slopes: Vec<(Variable, E)> = Vec::new();
    let along = |v: &Variable, slope: E| {
        let name = format!("slope_{}", v.name);
        let meaning = format!("directional derivative of {}", v.name);
        (Variable { name, meaning, ..v.clone() }, slope)
    };
    for ((state, _), rate) in of.states.iter().zip(rates) {
        let rate_of = Variable {
            name: format!("der_{}", state.name),
            unit: format!("{}/s", state.unit).replace("/s/s", "/s2"),
            meaning: format!("Rate of change of {}", state.name),
            initial: 0.0,
        };
        slopes.push(along(&rate_of, rate.slope[0]));
        outputs.push((rate_of, rate.value));
    }
    slopes.extend(of.outputs.iter().zip(seen).map(|(v, number)| along(v, number.slope[0])));
    outputs.extend(slopes);

    let results = outputs.iter().enumerate();
    let results = results.map(|(k, (_, number))| (Target::Output(k), number.node())).collect();
    let noded = |(variable, number): (Variable, E)| (variable, number.node());
    Ok(Block {
        name: format!("{}_slopes", of.name),
        meaning: format!("{}: rates of change and directional derivatives", of.name),
        graph: Rc::default(),
        parameters: Vec::new(),
        inputs: given.values.into_iter().chain(given.seeds).map(noded).collect(),
        states: Vec::new(),
        outputs: outputs.into_iter().map(|(variable, _)| variable).collect(),
        entries: vec![Entry {
            name: "see".into(),
            meaning: "rates, and directional derivatives of rates and outputs".into(),
            results,
        }],
        period: None,
        labels: HashMap::new(),
    })
}
