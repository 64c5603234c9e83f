//! Controllers as blocks, without what they simulate.

use crate::block::{Block, Entry, Target, Variable};
use crate::expression::{Expression, record};
use crate::given::{noded, of_machine, parameters, variable};
use crate::graph::Node;
use hydroboom_control::{BenchmarkMemory, Measured, Reference};
use hydroboom_description::Description;
use hydroboom_math::Real;
use std::collections::HashMap;
use std::rc::Rc;

type E = Expression;

/// The benchmark controller with a feedforward from outside.
pub fn controller(description: &Description) -> Block {
    let (graph, mut block) = record(|| controlling(description));
    block.graph = Rc::new(graph);
    block
}

fn controlling(description: &Description) -> Block {
    let (parameters, numbers) = parameters(description);
    let controller = description.benchmark_over(&numbers);
    let input = |name: &str, unit: &str, meaning: &str| variable(name, unit, meaning, 0.0);
    let [position, velocity, stroke, load] = of_machine();
    let share = input(
        "simulated_speed",
        "rev/s",
        "Motor speed of a simulation, in the place of the velocity feedforward",
    );
    let use_it = input(
        "simulation_leads",
        "1",
        "1: the simulated speed is the feedforward; 0: the reference's velocity is",
    );
    let integral = variable("integral", "m/s", "Integral share of u_FC, as a velocity", 0.0);
    let low_passed =
        variable("low_passed", "Pa", "Low-passed load pressure; begins at the load pressure", 0.0);

    let reference = Reference { position: position.1, velocity: velocity.1 };
    let measured = Measured { stroke: stroke.1, load_pressure: load.1 };
    let mut memory = BenchmarkMemory { integral: integral.1, low_passed: low_passed.1 };
    let own = controller.velocity_feedforward(&reference);
    let leads = E::lit(0.5).lt(use_it.1);
    let feedforward = E::select(leads, share.1, own);
    let speed = controller.update(&mut memory, &reference, &measured, feedforward);
    let begun = controller.start(&measured);

    let mut labels = HashMap::new();
    let label = |name: &str, comment: &str| (name.to_string(), comment.to_string());
    labels.insert(own.node(), label("u_ff", "velocity feedforward (1)"));
    labels.insert((position.1 - stroke.1).node(), label("position_error", "position error"));
    let entry = |name: &str, meaning: &str, results: Vec<(Target, Node)>| Entry {
        name: name.into(),
        meaning: meaning.into(),
        results,
    };
    let states = |memory: &BenchmarkMemory<E>| {
        let [integral, low_passed] = memory.to_array();
        vec![(Target::State(0), integral.node()), (Target::State(1), low_passed.node())]
    };
    let mut results = states(&memory);
    results.push((Target::Output(0), speed.node()));
    Block {
        name: "benchmark_controller".into(),
        meaning: "Benchmark controller: feedforward, PI, pressure feedback (section 2.3.1)".into(),
        graph: Rc::default(),
        parameters,
        inputs: [position, velocity, stroke, load, share, use_it].into_iter().map(noded).collect(),
        states: [integral, low_passed].into_iter().map(noded).collect(),
        outputs: vec![Variable {
            name: "motor_speed".into(),
            unit: "rev/s".into(),
            meaning: "Motor speed, n_ref".into(),
            initial: 0.0,
        }],
        entries: vec![
            entry("begin", "begins without a bump at what is measured", states(&begun)),
            entry("update", "the motor speed of a control period", results),
        ],
        labels,
    }
}

/// The motor of the simulated crane, which follows what is asked of it as the drive can.
pub fn simulated_motor(description: &Description) -> Block {
    let (graph, mut block) = record(|| {
        let (parameters, numbers) = parameters(description);
        let benchmark = description.benchmark_over(&numbers);
        let wanted = variable("wanted_speed", "rev/s", "Motor speed asked for", 0.0);
        let speed = variable("simulated_motor_speed", "rev/s", "Motor speed", 0.0);
        let next = benchmark.limits.follow(speed.1, wanted.1, benchmark.period).node();
        let shown = speed.0.clone();
        Block {
            name: "simulated_motor".into(),
            meaning: "Motor of the simulated crane: what is asked of it, within its speed and slew"
                .into(),
            graph: Rc::default(),
            parameters,
            inputs: vec![noded(wanted)],
            states: vec![noded(speed)],
            outputs: vec![shown],
            entries: vec![Entry {
                name: "update".into(),
                meaning: "the motor speed of a control period".into(),
                results: vec![(Target::State(0), next), (Target::Output(0), next)],
            }],
            labels: HashMap::new(),
        }
    });
    block.graph = Rc::new(graph);
    block
}
