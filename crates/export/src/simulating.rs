//! Controllers with the crane that they simulate, each in one block: a motor speed is found every control period (`update`), and
//! the simulated crane moves on in the steps between (`step`).

use crate::block::{Block, ControlPeriod, Entry, Target, Variable};
use crate::controller::{frame_outputs, simulating_period};
use crate::crane::{SEGMENTS, numbers, resting, state};
use crate::error::ExportError;
use crate::expression::{Expression, record};
use crate::following::recorded_law;
use crate::given::{gains, motor_speed, noded, of_machine, parameters, remembered, variable};
use crate::graph::Node;
use hydroboom_control::controller::AxisState;
use hydroboom_control::deviation::Watched;
use hydroboom_control::deviation_memory::DeviationMemory;
use hydroboom_control::feedback::benchmark::BenchmarkInput;
use hydroboom_control::model_following::{FollowingMemory, ModelFollowing};
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::supervision::framed::SimulatedCrane;
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_math::Real;
use hydroboom_model::stepping::published;
use hydroboom_model::{Crane, CraneState, Input};
use std::collections::HashMap;
use std::rc::Rc;

type E = Expression;

/// What the controllers of both cranes see in a period.
struct Period {
    reference: SetPoint<E>,
    measured: BenchmarkInput<E>,
    seen: AxisState<E>,
}

/// What the controllers of both cranes do in a period.
struct Done {
    /// What is read for them beside.
    inputs: Vec<(Variable, E)>,
    /// What they remember.
    states: Vec<(Variable, E)>,
    begun: Vec<E>,
    next: Vec<E>,
    /// Which of that is the speed of the simulated motor.
    motor: usize,
    /// Speed of the machine's motor.
    speed: E,
}

/// The benchmark controller with simulation feedforward (section 4, figure 15) within the frame that holds
/// and releases the load, with the crane that it simulates. The benchmark's gains can be tuned; the simulated
/// crane is as described.
///
/// # Errors
///
/// [`ExportError`] for cranes that are not exported, or that have no limits.
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
        output("simulated_stroke", "m", "Its piston position as the period begins"),
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
            entry(
                "update",
                "one control period; then come the steps of the simulated crane",
                updated,
            ),
            entry("step", "one step of the simulated crane", stepped),
        ],
        period: Some(ControlPeriod::of(description, true)),
        labels: HashMap::new(),
    })
}

/// Model following: state feedback on the simulated crane, an observer and feedback of what the machine differs. Its
/// gains are designed for the crane as described, and stay what they are when a parameter is tuned; what it aims at does not.
///
/// # Errors
///
/// [`ExportError`] for cranes that are not exported, or of which no such controller can be designed.
pub fn model_following(description: &Description) -> Result<Block, ExportError> {
    let law = recorded_law(description)?;
    let about = ["model_following", "model following (docs/model-following.md)"];
    block(description, about, |period, given| following(period, &law(given)))
}

fn following(at: &Period, law: &ModelFollowing<E>) -> Done {
    let Period { reference, measured, seen, .. } = at;
    let of_memory = |before: &str, [names, units, meanings]: [&[&str]; 3]| {
        remembered(before, names, units, meanings)
    };
    let mut states = of_memory(
        "following_",
        [&FollowingMemory::NAMES, &FollowingMemory::UNITS, &FollowingMemory::MEANINGS],
    );
    let mut following = FollowingMemory::from_array(std::array::from_fn(|k| states[k].1));
    let more = of_memory(
        "deviation_",
        [&DeviationMemory::NAMES, &DeviationMemory::UNITS, &DeviationMemory::MEANINGS],
    );
    let mut deviation = DeviationMemory::from_array(std::array::from_fn(|k| more[k].1));
    states.extend(more);
    let read = motor_speed();

    let BenchmarkInput { stroke, load_pressure } = *measured;
    let machine = Watched { stroke, load_pressure, motor_speed: read.1 };
    let begun = (law.start(), law.begin(&machine, seen));
    let turns = law.update(&mut following, reference, seen);
    let led = following.led(reference, E::one());
    let speed = law.steer(&mut deviation, &machine, seen, turns, &led);
    let of =
        |a: FollowingMemory<E>, b: DeviationMemory<E>| [&a.to_array()[..], &b.to_array()].concat();
    let motor = FollowingMemory::NAMES.iter().position(|name| *name == "motor_speed");
    Done {
        inputs: vec![read],
        motor: motor.unwrap_or(0),
        states,
        begun: of(begun.0, begun.1),
        next: of(following, deviation),
        speed,
    }
}

fn block(
    description: &Description,
    about: [&str; 2],
    controls: impl Fn(&Period, &Numbers<E>) -> Done,
) -> Result<Block, ExportError> {
    let rest = resting(description)?;
    let (graph, block) = record(|| recording(description, &rest, about, controls));
    Ok(Block { graph: Rc::new(graph), ..block? })
}

fn recording(
    description: &Description,
    rest: &CraneState<f64, SEGMENTS>,
    [name, meaning]: [&str; 2],
    controls: impl Fn(&Period, &Numbers<E>) -> Done,
) -> Result<Block, ExportError> {
    let (parameters, given) = parameters(description);
    let crane: Crane<E, SEGMENTS> = description.crane_over(&given)?;
    let input = |name: &str, unit: &str, meaning: &str| variable(name, unit, meaning, 0.0);
    let [position, velocity, stroke, load] = of_machine();
    let step = variable(
        "step",
        "s",
        "Step of the simulated crane, below the limit that `hydroboom check` shows",
        description.numbers.simulation_period,
    );

    let (mut states, now) = state(rest);
    let moving = states.len();
    let outputs = crane.outputs(&now);
    let seen = AxisState {
        stroke: outputs.stroke,
        velocity: outputs.velocity,
        load_pressure: crane.cylinder.load_pressure(outputs.pressure_a, outputs.pressure_b),
    };
    let period = Period {
        reference: SetPoint { position: position.1, velocity: velocity.1 },
        measured: BenchmarkInput { stroke: stroke.1, load_pressure: load.1 },
        seen,
    };
    let done = controls(&period, &given);
    let turns = done.states[done.motor].1;
    let mut moved = now;
    published(&crane, &mut moved, &Input { pump_speed: turns, holding_valve: E::one() }, step.1);

    let shown = [
        input("motor_speed", "rev/s", "Motor speed for the machine, n_ref").0,
        input("simulated_motor_speed", "rev/s", "Motor speed of the simulated crane").0,
        input("simulated_stroke", "m", "Its piston position as the period begins").0,
        input("simulated_velocity", "m/s", "Its piston velocity").0,
        input("simulated_load_pressure", "Pa", "Its load pressure").0,
    ];
    let to_show =
        [done.speed, done.next[done.motor], seen.stroke, seen.velocity, seen.load_pressure];
    let kept = |values: &[E]| -> Vec<(Target, Node)> {
        let place = |(k, value): (usize, &E)| (Target::State(moving + k), value.node());
        values.iter().enumerate().map(place).collect()
    };
    let mut updated = kept(&done.next);
    updated.extend(to_show.iter().enumerate().map(|(k, value)| (Target::Output(k), value.node())));
    let stepped = numbers(&moved).into_iter().enumerate();
    let stepped = stepped.map(|(k, node)| (Target::State(k), node)).collect();
    let entry = |name: &str, meaning: &str, results: Vec<(Target, Node)>| Entry {
        name: name.into(),
        meaning: meaning.into(),
        results,
    };
    let begun = kept(&done.begun);
    states.extend(done.states);
    let mut inputs = vec![position, velocity, stroke, load];
    inputs.extend(done.inputs);
    inputs.push(step);
    Ok(Block {
        name: name.into(),
        meaning: format!("{}: {meaning}", description.name),
        graph: Rc::default(),
        parameters,
        inputs: inputs.into_iter().map(noded).collect(),
        states: states.into_iter().map(noded).collect(),
        outputs: shown.to_vec(),
        entries: vec![
            entry("begin", "begins without a bump at what is measured and simulated", begun),
            entry("update", "the motor speeds of a control period; then come its steps", updated),
            entry("step", "one step of the simulated crane", stepped),
        ],
        period: None,
        labels: HashMap::new(),
    })
}
