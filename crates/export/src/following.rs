//! Model following in two blocks, for languages that put the simulated crane together from blocks of their own: what steers the
//! simulated crane, and what steers the machine.

use crate::block::{Block, Entry, Target, Variable};
use crate::error::ExportError;
use crate::expression::{Expression, record};
use crate::given::{motor_speed, noded, of_machine, parameters, remembered, variable};
use crate::graph::Node;
use hydroboom_control::controller::AxisState;
use hydroboom_control::deviation::Watched;
use hydroboom_control::deviation_memory::DeviationMemory;
use hydroboom_control::model_following::{FollowingMemory, ModelFollowing};
use hydroboom_control::out_of_reach::Led;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_design::{bending, law, stations};
use hydroboom_math::Real;
use std::collections::HashMap;
use std::rc::Rc;

type E = Expression;

/// What state feedback tells the feedback of the machine: by how much the reference runs ahead, and what it takes of a motor.
const AHEAD: [&str; 2] =
    ["reference_ahead", "By how much the reference runs ahead of what a crane can follow"];
const TAKES: [&str; 2] =
    ["reference_motor_speed", "Motor speed that takes what can be followed of the reference"];

/// A law as designed for the crane of a description, with its other numbers from outside.
pub(crate) fn recorded_law(
    description: &Description,
) -> Result<impl Fn(&Numbers<E>) -> ModelFollowing<E>, ExportError> {
    let (stations, bending) = (stations(description)?, bending(description)?);
    Ok(move |n: &Numbers<E>| law(n, stations.map(|s| s.map(E::lit)), bending.map(E::lit)))
}

/// What is seen of the simulated crane, from outside.
fn simulated() -> ([(Variable, E); 3], AxisState<E>) {
    let input = |name: &str, unit: &str, meaning: &str| variable(name, unit, meaning, 0.0);
    let all = [
        input("simulated_stroke", "m", "Piston position of the simulated crane"),
        input("simulated_velocity", "m/s", "Its piston velocity"),
        input("simulated_load_pressure", "Pa", "Its load pressure"),
    ];
    let seen = AxisState { stroke: all[0].1, velocity: all[1].1, load_pressure: all[2].1 };
    (all, seen)
}

/// State feedback on the simulated crane, its motor's limits and all.
///
/// # Errors
///
/// [`ExportError`] when none can be designed.
pub fn state_feedback(description: &Description) -> Result<Block, ExportError> {
    let designed = recorded_law(description)?;
    let (graph, block) = record(|| {
        let (parameters, given) = parameters(description);
        let law = designed(&given);
        let [position, velocity, ..] = of_machine();
        let reference = SetPoint { position: position.1, velocity: velocity.1 };
        let (inputs, seen) = simulated();
        let [names, units, meanings] =
            [FollowingMemory::NAMES, FollowingMemory::UNITS, FollowingMemory::MEANINGS];
        let states = remembered("", &names, &units, &meanings);
        let mut memory = FollowingMemory::from_array(std::array::from_fn(|k| states[k].1));
        let speed = law.update(&mut memory, &reference, &seen);
        block(
            [
                "state_feedback",
                "State feedback that makes the simulated crane follow the reference (docs/model-following.md)",
            ],
            parameters,
            [position, velocity].into_iter().chain(inputs).collect(),
            states,
            [&law.start().to_array()[..], &memory.to_array()[..]],
            vec![
                output(
                    "simulated_motor_speed",
                    "rev/s",
                    "Motor speed of the simulated crane",
                    speed,
                ),
                output(AHEAD[0], "m", AHEAD[1], memory.ahead),
                output(TAKES[0], "rev/s", TAKES[1], memory.reference_speed),
            ],
        )
    });
    Ok(Block { graph: Rc::new(graph), ..block })
}

/// Feedback of what the machine differs from the simulated crane, which is the feedforward.
///
/// # Errors
///
/// [`ExportError`] when none can be designed.
pub fn following_controller(description: &Description) -> Result<Block, ExportError> {
    let designed = recorded_law(description)?;
    let (graph, block) = record(|| {
        let (parameters, given) = parameters(description);
        let law = designed(&given);
        let [position, velocity, stroke, load] = of_machine();
        let read = motor_speed();
        let speed = variable("simulated_speed", "rev/s", "Motor speed of the simulated crane", 0.0);
        let (inputs, seen) = simulated();
        let input = |name: &str, unit: &str, meaning: &str| variable(name, unit, meaning, 0.0);
        let ahead = input(AHEAD[0], "m", AHEAD[1]);
        let takes = input(TAKES[0], "rev/s", TAKES[1]);
        let led = Led {
            reference: SetPoint { position: position.1, velocity: velocity.1 },
            ahead: ahead.1,
            motor_speed: takes.1,
            // what is exported is told where to be now, and of no path ahead
            travels: E::zero(),
        };
        let machine = Watched { stroke: stroke.1, load_pressure: load.1, motor_speed: read.1 };
        let [names, units, meanings] =
            [DeviationMemory::NAMES, DeviationMemory::UNITS, DeviationMemory::MEANINGS];
        let states = remembered("deviation_", &names, &units, &meanings);
        let mut memory = DeviationMemory::from_array(std::array::from_fn(|k| states[k].1));
        let begun = law.begin(&machine, &seen);
        let asked = law.steer(&mut memory, &machine, &seen, speed.1, &led);
        block(
            [
                "following_controller",
                "Feedback of what the machine differs from the simulated crane",
            ],
            parameters,
            [position, velocity, ahead, takes, stroke, load, read, speed]
                .into_iter()
                .chain(inputs)
                .collect(),
            states,
            [&begun.to_array()[..], &memory.to_array()[..]],
            vec![output("motor_speed", "rev/s", "Motor speed, n_ref", asked)],
        )
    });
    Ok(Block { graph: Rc::new(graph), ..block })
}

/// A quantity that is shown.
fn output(name: &str, unit: &str, meaning: &str, value: E) -> (Variable, Node) {
    let (name, unit, meaning) = (name.into(), unit.into(), meaning.into());
    (Variable { name, unit, meaning, initial: 0.0 }, value.node())
}

/// A block that begins, and finds a motor speed each period.
fn block(
    [name, meaning]: [&str; 2],
    parameters: Vec<(Variable, Node)>,
    inputs: Vec<(Variable, E)>,
    states: Vec<(Variable, E)>,
    [begun, next]: [&[E]; 2],
    outputs: Vec<(Variable, Node)>,
) -> Block {
    let kept = |values: &[E]| -> Vec<_> {
        values.iter().enumerate().map(|(k, v)| (Target::State(k), v.node())).collect()
    };
    let mut updated = kept(next);
    updated.extend(outputs.iter().enumerate().map(|(k, (_, node))| (Target::Output(k), *node)));
    let entry = |name: &str, meaning: &str, results| Entry {
        name: name.into(),
        meaning: meaning.into(),
        results,
    };
    Block {
        name: name.into(),
        meaning: meaning.into(),
        graph: Rc::default(),
        parameters,
        inputs: inputs.into_iter().map(noded).collect(),
        states: states.into_iter().map(noded).collect(),
        outputs: outputs.into_iter().map(|(shown, _)| shown).collect(),
        entries: vec![
            entry("begin", "begins without a bump at what is seen", kept(begun)),
            entry("update", "the motor speed of a control period", updated),
        ],
        period: None,
        labels: HashMap::new(),
    }
}
