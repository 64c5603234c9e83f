//! Framed controllers as blocks: the frame holds and releases the load. Simulated cranes are separate blocks.

use crate::block::{Block, ControlPeriod, Entry, Target, Variable};
use crate::error::ExportError;
use crate::expression::{Expression, record};
use crate::given::{gains, noded, remembered, variable};
use crate::graph::Node;
use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_control::feedback::benchmark::BenchmarkMemory;
use hydroboom_control::memory::Memory;
use hydroboom_control::reference::preview::{DISTANT, PERIODS_AHEAD, PreviewAhead};
use hydroboom_control::supervision::drive_monitor::DriveMonitorState;
use hydroboom_control::supervision::frame::{FrameInput, FrameMemory, FrameOutput, FrameState};
use hydroboom_control::supervision::framed::{
    Alignment, FramedBenchmark, FramedBenchmarkState, FramedMemory, FramedSimulationFeedforward,
    FramedSimulationState, SimulatedCrane,
};
use hydroboom_control::supervision::framed_scheduled_lqr::{
    EstimatorOutput, EstimatorRequest, FramedScheduledLqr, FramedScheduledLqrInput,
    FramedScheduledLqrState,
};
use hydroboom_control::supervision::oscillation_detector::OscillationState;
use hydroboom_control::supervision::release::ReleaseState;
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_design::{framed_benchmark, framed_scheduled_lqr};
use hydroboom_math::Real;
use std::array::from_fn;
use std::collections::HashMap;
use std::rc::Rc;

type E = Expression;

/// States for the fields of a record, with a prefix to their names, and the record of their nodes.
macro_rules! states {
    ($Record:ident, $before:literal) => {{
        let (names, units, meanings) = ($Record::NAMES, $Record::UNITS, $Record::MEANINGS);
        let states = remembered($before, &names, &units, &meanings);
        let record = $Record::from_array(std::array::from_fn(|k| states[k].1));
        (states, record)
    }};
}

/// Inputs of the frame.
fn frame_input() -> (Vec<(Variable, E)>, FrameInput<E>) {
    let (mut inputs, record) = states!(FrameInput, "");
    for (variable, _) in &mut inputs {
        // a valve without a position switch
        if variable.name == "valve_state" {
            variable.initial = -1.0;
        }
    }
    (inputs, record)
}

/// States of the frame.
fn frame_state() -> (Vec<(Variable, E)>, FrameState<E>) {
    let (mut states, memory) = states!(FrameMemory, "frame_");
    let (more, drive) = states!(DriveMonitorState, "drive_");
    states.extend(more);
    let (more, release) = states!(ReleaseState, "release_");
    states.extend(more);
    let (more, oscillation) = states!(OscillationState, "oscillation_");
    states.extend(more);
    (states, FrameState { memory, drive, release, oscillation })
}

/// The numbers of a frame's state, in the order of [`frame_state`].
fn frame_numbers(state: &FrameState<E>) -> Vec<E> {
    let FrameState { memory, drive, release, oscillation } = *state;
    let mut all = memory.to_array().to_vec();
    all.extend(drive.to_array());
    all.extend(release.to_array());
    all.extend(oscillation.to_array());
    all
}

/// Outputs of the frame.
pub(crate) fn frame_outputs() -> Vec<Variable> {
    let rows = FrameOutput::NAMES.iter().zip(FrameOutput::UNITS).zip(FrameOutput::MEANINGS);
    rows.map(|((name, unit), meaning)| Variable {
        name: (*name).into(),
        unit: unit.into(),
        meaning: meaning.trim().into(),
        initial: 0.0,
    })
    .collect()
}

/// Results for states and outputs, from given indices on.
fn results(states: &[E], first: usize, outputs: &[E]) -> Vec<(Target, Node)> {
    let states = states.iter().enumerate().map(|(k, e)| (Target::State(first + k), e.node()));
    let outputs = outputs.iter().enumerate().map(|(k, e)| (Target::Output(k), e.node()));
    states.chain(outputs).collect()
}

/// Block of the benchmark controller (PI with velocity feedforward and pressure feedback) within the frame that holds
/// and releases the load. Its gains are parameters; limits, release and all other values derived from the crane are
/// constants of the code.
///
/// # Errors
///
/// [`ExportError::Design`] if no limits can be derived for the crane.
pub fn controller(description: &Description) -> Result<Block, ExportError> {
    let framed = framed_benchmark(description)?;
    let (graph, mut block) = record(|| {
        let (parameters, numbers) = gains(description);
        let controller = FramedBenchmark::<E> {
            frame: framed.frame.over(),
            benchmark: description.benchmark_over(&numbers),
            area_ratio: E::lit(framed.area_ratio),
        };
        let (inputs, input) = frame_input();
        let (mut states, frame) = frame_state();
        let (more, memory) = states!(FramedMemory, "controller_");
        states.extend(more);
        let state = FramedBenchmarkState { frame, controller: memory };
        let (next, output) = controller.advance(&state, &input);
        let mut kept = frame_numbers(&next.frame);
        kept.extend(next.controller.to_array());
        Block {
            name: "benchmark_controller".into(),
            meaning: format!(
                "{}: benchmark controller (section 2.3.1 of doi:10.3390/act14020080) that holds and releases the load",
                description.name
            ),
            graph: Rc::default(),
            parameters,
            inputs: inputs.into_iter().map(noded).collect(),
            states: states.into_iter().map(noded).collect(),
            outputs: frame_outputs(),
            entries: vec![Entry {
                name: "update".into(),
                meaning: "one control period".into(),
                results: results(&kept, 0, &output.to_array()),
            }],
            period: Some(ControlPeriod::of(description, false)),
            labels: HashMap::new(),
        }
    });
    block.graph = Rc::new(graph);
    Ok(block)
}

/// Array inputs or states: variables of one name, numbered by their index.
fn placed(names: &[&str], before: &str, unit: &str, meaning: &str) -> Vec<(Variable, E)> {
    let mut all = Vec::new();
    for of_one in names.chunk_by(|a, b| a == b) {
        let is_table = of_one.len() > 1;
        all.extend(of_one.iter().enumerate().map(|(k, name)| {
            let place = if is_table { format!("[{k}]") } else { String::new() };
            variable(&format!("{before}{name}{place}"), unit, meaning, 0.0)
        }));
    }
    all
}

/// Block of the scheduled LQR with its state estimator within the frame that holds and releases the load. Its inputs
/// include the preview of the reference.
///
/// # Errors
///
/// [`ExportError::Design`] if no limits or no reduced model can be derived for the crane.
pub fn scheduled_lqr_controller(description: &Description) -> Result<Block, ExportError> {
    let framed = framed_scheduled_lqr(description)?;
    let (graph, mut block) = record(|| {
        let controller: FramedScheduledLqr<E> = framed.over();
        let (mut inputs, frame_input) = frame_input();
        let (more, request) = states!(EstimatorRequest, "");
        inputs.extend(more);
        let (more, retained) = states!(RetainedParameters, "restored_");
        inputs.extend(more);
        let meaning = "Control periods after now that the preview has; 0 to 800, beyond 800 with distant positions";
        let length = variable("preview_length", "1", meaning, 0.0);
        let mut table = |name: &str, count: usize, unit: &str, meaning: &str| {
            let all = placed(&vec![name; count], "preview_", unit, meaning);
            let numbers: Vec<E> = all.iter().map(|(_, number)| *number).collect();
            inputs.extend(all);
            numbers
        };
        let near = "in each control period after now, the next one first";
        let far = "Position every 50 ms behind the 800 periods";
        let position = table("position", PERIODS_AHEAD, "m", &format!("Position {near}"));
        let velocity = table("velocity", PERIODS_AHEAD, "m/s", &format!("Velocity {near}"));
        let distant = table("distant_position", DISTANT, "m", far);
        let ahead = PreviewAhead {
            length: length.1,
            position: from_fn(|k| position[k]),
            velocity: from_fn(|k| velocity[k]),
            distant: from_fn(|k| distant[k]),
        };
        inputs.push(length);
        let (mut states, frame) = frame_state();
        let mut names = Vec::new();
        let memory = controller.start().visited(&mut |name, number| {
            names.push(name);
            number
        });
        let more = placed(&names, "lqr_", "SI", "Of estimator and law");
        let mut numbers = more.iter().map(|(_, number)| *number);
        let memory = memory.visited(&mut |_, zero| numbers.next().unwrap_or(zero));
        states.extend(more);
        let before = FramedScheduledLqrState { frame, controller: memory };
        let input = FramedScheduledLqrInput { frame: frame_input, request, retained, ahead };
        let (next, output) = controller.advance(&before, &input);
        let mut kept = frame_numbers(&next.frame);
        let _ = next.controller.visited(&mut |_, number| {
            kept.push(number);
            number
        });
        let mut outputs = frame_outputs();
        outputs.extend(states!(EstimatorOutput, "").0.into_iter().map(|(v, _)| v));
        outputs.extend(states!(RetainedParameters, "retained_").0.into_iter().map(|(v, _)| v));
        let mut shown = output.frame.to_array().to_vec();
        shown.extend(output.estimator.to_array());
        shown.extend(output.retained.to_array());
        Block {
            name: "scheduled_lqr_controller".into(),
            meaning: format!(
                "{}: scheduled LQR with its state estimator that holds and releases the load",
                description.name
            ),
            graph: Rc::default(),
            parameters: Vec::new(),
            inputs: inputs.into_iter().map(noded).collect(),
            states: states.into_iter().map(noded).collect(),
            outputs,
            entries: vec![Entry {
                name: "update".into(),
                meaning: "one control period".into(),
                results: results(&kept, 0, &shown),
            }],
            period: Some(ControlPeriod::of(description, false)),
            labels: HashMap::new(),
        }
    });
    block.graph = Rc::new(graph);
    Ok(block)
}

/// A recorded control period of the simulation feedforward within the frame.
pub(crate) struct RecordedPeriod {
    /// Inputs besides those of the simulated crane.
    pub inputs: Vec<(Variable, E)>,
    /// States of frame, controller and alignment, with their expressions.
    pub states: Vec<(Variable, E)>,
    /// Index of the simulated crane's motor speed \[rev/s\] among the states.
    pub motor: usize,
    /// Expressions of the states after the control period, in their order.
    pub next: Vec<E>,
    /// Expressions of the outputs of the frame.
    pub outputs: Vec<E>,
}

/// Records a control period with the given outputs of the simulated crane.
///
/// # Errors
///
/// [`ExportError::Design`] if no limits can be derived for the crane.
pub(crate) fn simulating_period(
    description: &Description,
    numbers: &Numbers<E>,
    crane: &SimulatedCrane<E>,
) -> Result<RecordedPeriod, ExportError> {
    let framed = framed_benchmark(description)?;
    let controller = FramedSimulationFeedforward::<E> {
        frame: framed.frame.over(),
        benchmark: description.benchmark_over(numbers),
        area_ratio: E::lit(framed.area_ratio),
    };
    let (inputs, input) = frame_input();
    let (mut states, frame) = frame_state();
    let (more, memory) = states!(FramedMemory, "controller_");
    states.extend(more);
    let (more, simulated) = states!(BenchmarkMemory, "simulated_");
    states.extend(more);
    let (mut more, alignment) = states!(Alignment, "alignment_");
    let [motor, position] = ["alignment_motor", "alignment_position"]
        .map(|name| more.iter().position(|(v, _)| v.name == name).unwrap_or_default());
    more[position].0.initial = description.numbers.motion_start;
    let motor = states.len() + motor;
    states.extend(more);
    let state = FramedSimulationState { frame, controller: memory, simulated, alignment };
    let (next, output) = controller.advance(&state, &input, crane);
    let mut kept = frame_numbers(&next.frame);
    kept.extend(next.controller.to_array());
    kept.extend(next.simulated.to_array());
    kept.extend(next.alignment.to_array());
    Ok(RecordedPeriod { inputs, states, motor, next: kept, outputs: output.to_array().to_vec() })
}

/// Block of the benchmark controller with simulation feedforward within the frame, for a simulated crane in a separate
/// block: the outputs of that crane are inputs, its motor speed \[rev/s\] is an output.
///
/// # Errors
///
/// [`ExportError::Design`] if no limits can be derived for the crane.
pub fn simulation_feedforward_controller(description: &Description) -> Result<Block, ExportError> {
    let (graph, block) = record(|| -> Result<Block, ExportError> {
        let (parameters, numbers) = gains(description);
        let input = |name: &str, unit: &str, meaning: &str| variable(name, unit, meaning, 0.0);
        let shown = [
            input("simulated_stroke", "m", "Piston position of the simulated crane"),
            input("simulated_velocity", "m/s", "Its piston velocity"),
            input("simulated_load_pressure", "Pa", "Its load pressure"),
        ];
        let crane =
            SimulatedCrane { stroke: shown[0].1, velocity: shown[1].1, load_pressure: shown[2].1 };
        let mut period = simulating_period(description, &numbers, &crane)?;
        period.inputs.extend(shown);
        let mut outputs = frame_outputs();
        outputs.push(Variable {
            name: "simulated_motor_speed".into(),
            unit: "rev/s".into(),
            meaning: "Motor speed of the simulated crane".into(),
            initial: 0.0,
        });
        period.outputs.push(period.next[period.motor]);
        Ok(Block {
            name: "simulation_feedforward_controller".into(),
            meaning: format!(
                "{}: benchmark controller with simulation feedforward (section 4, figure 15) that holds and releases the load",
                description.name
            ),
            graph: Rc::default(),
            parameters,
            inputs: period.inputs.into_iter().map(noded).collect(),
            states: period.states.into_iter().map(noded).collect(),
            outputs,
            entries: vec![Entry {
                name: "update".into(),
                meaning: "one control period".into(),
                results: results(&period.next, 0, &period.outputs),
            }],
            period: Some(ControlPeriod::of(description, false)),
            labels: HashMap::new(),
        })
    });
    Ok(Block { graph: Rc::new(graph), ..block? })
}
