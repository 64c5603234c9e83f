//! Crane model as blocks: as a whole, and divided into hydraulics and boom as in the paper.

use crate::block::{Block, Entry, Target, Variable};
use crate::error::ExportError;
use crate::expression::{Expression, record};
use crate::given::{noded, parameters, variable};
use crate::graph::{Graph, Node};
use crate::name::plain;
use crate::step_limit::longest_step;
use hydroboom_description::{BuildError, Description};
use hydroboom_model::circuit::{CircuitState, Flows, Nodes};
use hydroboom_model::stepping::published;
use hydroboom_model::{BoomState, Crane, CraneState, Input, Outputs};
use std::collections::HashMap;
use std::rc::Rc;

/// Segments of the published model.
pub(crate) const SEGMENTS: usize = 3;

type E = Expression;

/// The paper's equations (docs/reference/theory.md) of each node's pressure, in the order of [`Nodes`].
const NODE_EQUATIONS: [&str; 5] = ["(8)", "(A12)", "(A13)", "(9)", "(A20)"];
/// Equations of the flows, in the order of [`Flows`]; the relief valves are our addition.
const FLOW_EQUATIONS: [&str; 10] =
    ["(5)", "(5)", "(A1)", "(A2)", "(A3)", "(A7)", "(A8)", "(A9)", "(A10)", "(A11)"];
/// Equations of some outputs.
const OUTPUT_EQUATIONS: [(&str, &str); 4] = [
    ("stroke", "equation (28)"),
    ("velocity", "equation (29)"),
    ("friction_force", "equation (10)"),
    ("cylinder_force", "A_p p_A - A_r p_B - F_fr + F_stop"),
];

/// Recording of a crane's step.
struct Recorded {
    graph: Rc<Graph>,
    parameters: Vec<(Variable, Node)>,
    inputs: Vec<(Variable, Node)>,
    step: (Variable, Node),
    states: Vec<(Variable, Node)>,
    next: Vec<Node>,
    /// The states after one Newton step towards equilibrium.
    balanced: Vec<Node>,
    before: Outputs<E>,
    after: Outputs<E>,
    /// Load pressure before and after the step.
    load_pressure: [Node; 2],
    labels: HashMap<Node, (String, String)>,
}

/// The crane in equilibrium at the start of its motion. The exported code takes no substeps: its step must be stable.
pub(crate) fn resting(description: &Description) -> Result<CraneState<f64, SEGMENTS>, ExportError> {
    let found = description.coordinates();
    if found != SEGMENTS {
        return Err(ExportError::Segments { found });
    }
    longest_step(description)?;
    let crane = description.crane::<SEGMENTS>()?;
    let n = &description.numbers;
    let start = description.start_over(n, n.motion_start);
    Ok(crane.at_rest(&start).map_err(BuildError::from)?)
}

fn recorded(description: &Description) -> Result<Recorded, ExportError> {
    let rest = resting(description)?;
    let (graph, recorded) = record(|| recording(description, &rest));
    Ok(Recorded { graph: Rc::new(graph), ..recorded? })
}

/// State variables of the crane, initially in equilibrium.
pub(crate) fn state(
    rest: &CraneState<f64, SEGMENTS>,
) -> (Vec<(Variable, E)>, CraneState<E, SEGMENTS>) {
    let mut states: Vec<(Variable, E)> = Vec::new();
    let mut state = |name: &str, unit: &str, meaning: &str, value: f64| {
        states.push(variable(name, unit, meaning, value));
        states[states.len() - 1].1
    };
    let angle = std::array::from_fn(|i| {
        let meaning = format!("Absolute angle of segment {}, phi_{}", i + 1, i + 1);
        state(&format!("angle_{}", i + 1), "rad", &meaning, rest.boom.angle[i])
    });
    let angular_velocity = std::array::from_fn(|i| {
        let meaning = format!("Absolute angular velocity of segment {}", i + 1);
        let value = rest.boom.angular_velocity[i];
        state(&format!("angular_velocity_{}", i + 1), "rad/s", &meaning, value)
    });
    let bristle = state("bristle", "m", "Deflection of the seals before they slide", rest.bristle);
    let nodes = rest.circuit.nodes.to_array();
    let nodes = std::array::from_fn(|k| {
        let meaning = format!("{}, below vapour pressure a cavity", Nodes::MEANINGS[k].trim());
        state(&format!("pressure_{}", Nodes::NAMES[k]), "Pa", &meaning, nodes[k])
    });
    let gas = rest.circuit.gas_volume;
    let gas_volume = state("gas_volume", "m3", "Gas volume of the accumulator, V_g", gas);
    let boom = BoomState { angle, angular_velocity };
    let circuit = CircuitState { nodes: Nodes::from_array(nodes), gas_volume };
    (states, CraneState { boom, bristle, circuit })
}

/// The numbers of a state in the order of [`state`].
pub(crate) fn numbers(state: &CraneState<E, SEGMENTS>) -> Vec<Node> {
    let numbers = [
        &state.boom.angle[..],
        &state.boom.angular_velocity,
        &[state.bristle],
        &state.circuit.nodes.to_array(),
        &[state.circuit.gas_volume],
    ];
    numbers.concat().into_iter().map(E::node).collect()
}

/// Records a step of the published scheme with the outputs before and after it.
fn recording(
    description: &Description,
    rest: &CraneState<f64, SEGMENTS>,
) -> Result<Recorded, ExportError> {
    let (parameters, given) = parameters(description);
    let crane: Crane<E, SEGMENTS> = description.crane_over(&given)?;
    let speed = variable(Input::NAMES[0], Input::UNITS[0], Input::MEANINGS[0].trim(), 0.0);
    let valve = variable(Input::NAMES[1], Input::UNITS[1], Input::MEANINGS[1].trim(), 1.0);
    let step = variable("step", "s", "Step, below the limit that `hydroboom check` shows", {
        description.numbers.simulation_period
    });

    let (states, now) = state(rest);
    let input = Input { pump_speed: speed.1, holding_valve: valve.1 };
    let mut moved = now;
    published(&crane, &mut moved, &input, step.1);
    let next = numbers(&moved);
    let (before, after) = (crane.outputs(&now), crane.outputs(&moved));

    let labels = labels(&crane, &now, &input, &moved, &before);
    let start = description.start_over(&given, given.motion_start);
    let balanced = numbers(&crane.balanced(&start, &now));
    Ok(Recorded {
        graph: Rc::default(),
        parameters,
        inputs: [speed, valve].into_iter().map(noded).collect(),
        step: noded(step),
        states: states.into_iter().map(noded).collect(),
        next,
        balanced,
        before,
        after,
        load_pressure: [&before, &after]
            .map(|seen| crane.cylinder.load_pressure(seen.pressure_a, seen.pressure_b).node()),
        labels,
    })
}

/// Names and meanings of intermediate results of a step from `now` to `moved`. They are computed again: that gives the
/// same nodes.
fn labels(
    crane: &Crane<E, SEGMENTS>,
    now: &CraneState<E, SEGMENTS>,
    input: &Input<E>,
    moved: &CraneState<E, SEGMENTS>,
    before: &Outputs<E>,
) -> HashMap<Node, (String, String)> {
    let mut labels = HashMap::new();
    let mut label = |number: E, name: &str, comment: &str| {
        let taken = || (plain(name), comment.trim().to_string());
        labels.entry(number.node()).or_insert_with(taken);
    };
    let coordinates = now.circuit.nodes.to_array();
    let pressures = crane.circuit.pressures(&now.circuit).to_array();
    let rates = crane.derivative(now, input);
    for (k, pressure) in pressures.into_iter().enumerate() {
        let name = Nodes::NAMES[k];
        label(pressure, &format!("p_{name}"), Nodes::MEANINGS[k]);
        let modulus = crane.circuit.oil.bulk_modulus(coordinates[k]);
        label(modulus, &format!("beta_{name}"), "Bulk modulus there, equation (7)");
        let comment = format!(
            "{}: its rate of change, equation {}",
            Nodes::MEANINGS[k].trim(),
            NODE_EQUATIONS[k]
        );
        label(rates.circuit.nodes.to_array()[k], &format!("dp_{name}"), &comment);
    }
    label(rates.circuit.gas_volume, "d_gas_volume", "Rate of change of V_g, equation (A21)");
    for (k, flow) in crane.flows(now, input).to_array().into_iter().enumerate() {
        let meaning = Flows::MEANINGS[k].trim();
        let comment = match FLOW_EQUATIONS.get(k) {
            Some(equation) => format!("{meaning}, equation {equation}"),
            None => meaning.to_string(),
        };
        label(flow, &format!("q_{}", Flows::NAMES[k]), &comment);
    }
    for (k, value) in before.to_array().into_iter().enumerate() {
        let (name, meaning) = (Outputs::NAMES[k], Outputs::MEANINGS[k].trim());
        let equation = OUTPUT_EQUATIONS.iter().find(|(of, _)| *of == name);
        let comment = match equation {
            Some((_, equation)) => format!("{meaning}, {equation}"),
            None => meaning.to_string(),
        };
        label(value, name, &comment);
    }
    for (i, acceleration) in rates.angular_acceleration.into_iter().enumerate() {
        let comment = format!("Angular acceleration of segment {}, equation (26)", i + 1);
        label(acceleration, &format!("acceleration_{}", i + 1), &comment);
        let (velocity, angle) = (moved.boom.angular_velocity[i], moved.boom.angle[i]);
        label(velocity, &format!("next_velocity_{}", i + 1), "its new velocity, equation (31)");
        label(angle, &format!("next_angle_{}", i + 1), "its new angle, equation (32)");
    }
    for (i, segment) in crane.boom.segments().iter().enumerate() {
        let names = ["length", "mass", "centre_x", "centre_y", "inertia"];
        for (name, value) in names.into_iter().zip(segment.to_array()) {
            let (name, of) = (format!("segment_{}_{name}", i + 1), format!("of segment {}", i + 1));
            label(value, &name, &of);
        }
    }
    labels
}

fn load_pressure() -> Variable {
    Variable {
        name: "load_pressure".into(),
        unit: "Pa".into(),
        meaning: "Load pressure, p_L = p_A - (A_r/A_p) p_B".into(),
        initial: 0.0,
    }
}

/// Outputs of the crane as block outputs.
fn shown() -> Vec<Variable> {
    let all = Outputs::NAMES.iter().zip(Outputs::UNITS).zip(Outputs::MEANINGS);
    let shown = |((name, unit), meaning): ((&&str, &str), &str)| Variable {
        name: (*name).into(),
        unit: unit.replace('³', "3"),
        meaning: meaning.trim().into(),
        initial: 0.0,
    };
    all.map(shown).collect()
}

/// Block of the whole crane model: an integration step of the published scheme, the outputs, and a Newton step to the
/// equilibrium.
///
/// # Errors
///
/// [`ExportError::Segments`] if the boom does not have three coordinates, [`ExportError::Step`] if the crane file's
/// step is not stable, [`ExportError::Build`] if there is no such crane or no equilibrium.
pub fn crane_model(description: &Description) -> Result<Block, ExportError> {
    let r = recorded(description)?;
    let states = |nodes: &[Node]| -> Vec<(Target, Node)> {
        nodes.iter().enumerate().map(|(k, node)| (Target::State(k), *node)).collect()
    };
    let (next, balanced) = (states(&r.next), states(&r.balanced));
    let seen = r.before.to_array().map(E::node).into_iter().chain([r.load_pressure[0]]);
    let seen = seen.enumerate().map(|(k, node)| (Target::Output(k), node)).collect();
    let mut outputs = shown();
    outputs.push(load_pressure());
    let mut inputs = r.inputs;
    inputs.push(r.step);
    Ok(Block {
        period: None,
        name: "model".into(),
        meaning: format!("{}: hydraulics and boom, the published time step", description.name),
        graph: r.graph,
        parameters: r.parameters,
        inputs,
        states: r.states,
        outputs,
        entries: vec![
            Entry { name: "step".into(), meaning: "one step".into(), results: next },
            Entry { name: "see".into(), meaning: "outputs of a state".into(), results: seen },
            Entry {
                name: "balance".into(),
                meaning: "one step of Newton's method from a state near rest to the state of rest at motion_start_mm; \
                          to be called until the state changes no more than its last digits"
                    .into(),
                results: balanced,
            },
        ],
        labels: r.labels,
    })
}

/// Crane model as two blocks as in the paper, hydraulics and boom. Piston position \[m\], velocity \[m/s\] and force
/// \[N\] are exchanged once a step, with their values at its beginning, so that both together give the whole crane's
/// step.
///
/// # Errors
///
/// [`ExportError::Segments`] if the boom does not have three coordinates, [`ExportError::Step`] if the crane file's
/// step is not stable, [`ExportError::Build`] if there is no such crane or no equilibrium.
pub fn blocks(description: &Description) -> Result<[Block; 2], ExportError> {
    let r = recorded(description)?;
    let boom_states = 2 * SEGMENTS;
    let outputs = shown();
    let seen = |of: &Outputs<E>, name: &str| {
        let k = Outputs::NAMES.iter().position(|n| *n == name).unwrap_or(0);
        (outputs[k].clone(), of.to_array()[k].node())
    };
    let between = |name: &str, initial: f64| {
        let (variable, node) = seen(&r.before, name);
        (Variable { initial, ..variable }, node)
    };
    let entry = |results: Vec<(Target, Node)>| {
        vec![Entry { name: "step".into(), meaning: "one step".into(), results }]
    };
    let results = |states: &[Node], shown: &[(Variable, Node)]| {
        let states = states.iter().enumerate().map(|(k, node)| (Target::State(k), *node));
        let shown = shown.iter().enumerate().map(|(k, (_, node))| (Target::Output(k), *node));
        entry(states.chain(shown).collect())
    };
    let names = |shown: &[(Variable, Node)]| shown.iter().map(|(v, _)| v.clone()).collect();

    let start = description.numbers.motion_start;
    let force = seen(&r.before, "cylinder_force");
    let hydraulic_shown = [
        force.clone(),
        (load_pressure(), r.load_pressure[1]),
        seen(&r.after, "pressure_pump_a"),
        seen(&r.after, "pressure_a"),
        seen(&r.after, "pressure_b"),
        seen(&r.after, "pressure_pump_b"),
        seen(&r.after, "pressure_accumulator"),
    ];
    let mut inputs = r.inputs.clone();
    inputs.extend([between("stroke", start), between("velocity", 0.0), r.step.clone()]);
    let hydraulics = Block {
        period: None,
        name: "hydraulic_model".into(),
        meaning: format!("{}: circuit, cylinder and its friction", description.name),
        graph: Rc::clone(&r.graph),
        parameters: r.parameters.clone(),
        inputs,
        states: r.states[boom_states..].to_vec(),
        outputs: names(&hydraulic_shown),
        entries: results(&r.next[boom_states..], &hydraulic_shown),
        labels: r.labels.clone(),
    };
    let boom_shown = [
        seen(&r.after, "stroke"),
        seen(&r.after, "velocity"),
        seen(&r.after, "tip_x"),
        seen(&r.after, "tip_y"),
        seen(&r.after, "tip_deflection"),
    ];
    let boom = Block {
        period: None,
        name: "flexible_boom".into(),
        meaning: format!("{}: boom and payload", description.name),
        graph: r.graph,
        parameters: r.parameters,
        inputs: vec![force, r.step],
        states: r.states[..boom_states].to_vec(),
        outputs: names(&boom_shown),
        entries: results(&r.next[..boom_states], &boom_shown),
        labels: r.labels,
    };
    Ok([hydraulics, boom])
}
