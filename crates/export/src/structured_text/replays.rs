//! Recordings for the test bench: inputs of each exported block, and the outputs computed by Rust.

use super::bench::{CALLS, PERIODS, Replay, Values, ramp};
use crate::crane::{SEGMENTS, resting};
use crate::error::ExportError;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::supervision::frame::{FrameInput, FrameOutput};
use hydroboom_control::supervision::framed::{
    FramedBenchmarkState, FramedSimulationState, SimulatedCrane,
};
use hydroboom_description::Description;
use hydroboom_design::{framed_benchmark, framed_simulation_feedforward};
use hydroboom_model::stepping::published;
use hydroboom_model::{Crane, Input, Outputs};
use hydroboom_virtual_crane::VirtualCrane;

/// Scales of signals in a motion: position \[m\], velocity \[m/s\], tip \[m\], pressure \[Pa\], force \[N\], motor
/// speed \[rev/s\].
const POSITION: f64 = 0.1;
const VELOCITY: f64 = 0.1;
const TIP: f64 = 1.0;
const PRESSURE: f64 = 1e7;
const FORCE: f64 = 1e5;
const SPEED: f64 = 50.0;

/// Calls in which blocks are reset. The published step amplifies rounding differences once the check valves open, so a
/// run without reset is short.
const RESETS: [usize; 3] = [0, 145, 220];
/// Number of calls after which the simulated crane under feedback is reset, for the same reason.
const FEEDFORWARD_RESET: usize = 60;
/// Simulation steps in a control period; fewer than in normal operation, so that the valves open during these calls.
const STEPS: i32 = 1;
/// Calls in which `bPrepare` is set without a change of parameters.
const PREPARED: [usize; 2] = [37, 277];
/// Calls during which the 3/2 valve is de-energised.
const SHUT: std::ops::Range<usize> = 65..105;
/// Number of calls during which inputs stay constant.
const HELD: usize = 10;

/// Recordings of all exported blocks that have a test bench.
pub(super) fn replays(description: &Description) -> Result<Vec<Replay>, ExportError> {
    let [hydraulics, boom] = crane(description)?;
    let course = Course::of(description)?;
    Ok(vec![
        hydraulics,
        boom,
        benchmark(description, &course)?,
        feedforward_controller(description, &course)?,
        feedforward(description)?,
    ])
}

/// Calls in which blocks are reset, except the one that contains the crane.
fn resets(call: usize) -> bool {
    RESETS.contains(&call)
}

/// One number for each call.
fn numbers(of: impl FnMut(usize) -> f64) -> Values {
    Values::Numbers((0..CALLS).map(of).collect())
}

/// Inputs of a block, together with its flags.
fn with_flags(
    resets: fn(usize) -> bool,
    inputs: Vec<(&'static str, Values)>,
) -> Vec<(&'static str, Values)> {
    let flags = |of: fn(usize) -> bool| Values::Truths((0..CALLS).map(of).collect());
    let mut all =
        vec![("bReset", flags(resets)), ("bPrepare", flags(|call| PREPARED.contains(&call)))];
    all.extend(inputs);
    all
}

/// Rounds to a few digits.
fn short(value: f64) -> f64 {
    const DIGITS: usize = 5;
    format!("{value:.DIGITS$e}").parse().unwrap_or(value)
}

/// A sine with a period of `calls`, an amplitude and a mean value, constant over a number of calls.
fn wave(call: usize, calls: f64, height: f64, middle: f64) -> f64 {
    let turn = std::f64::consts::TAU * (call - call % HELD) as f64 / calls;
    short(middle + height * turn.sin())
}

/// Load pressure of the simulated crane.
fn load_pressure(crane: &Crane<f64, SEGMENTS>, seen: &Outputs<f64>) -> f64 {
    crane.cylinder.load_pressure(seen.pressure_a, seen.pressure_b)
}

/// Hydraulics and boom together, through the switching of the 3/2 valve.
fn crane(description: &Description) -> Result<[Replay; 2], ExportError> {
    let rest = resting(description)?;
    let crane = description.crane::<SEGMENTS>()?;
    let step = description.numbers.simulation_period;
    let given = |call: usize| Input {
        pump_speed: wave(call, 300.0, 15.0, 0.0),
        holding_valve: if SHUT.contains(&call) { 0.0 } else { 1.0 },
    };
    let mut state = rest;
    let moved: Vec<(Outputs<f64>, Outputs<f64>)> = (0..CALLS)
        .map(|call| {
            if resets(call) {
                state = rest;
            }
            let before = crane.outputs(&state);
            published(&crane, &mut state, &given(call), step);
            (before, crane.outputs(&state))
        })
        .collect();
    let before = |of: fn(&Outputs<f64>) -> f64| numbers(|call| of(&moved[call].0));
    let after = |of: fn(&Outputs<f64>) -> f64| numbers(|call| of(&moved[call].1));
    let force = before(|seen| seen.cylinder_force);
    let hydraulics = Replay {
        block: "FB_HydraulicModel",
        each_period: false,
        inputs: with_flags(
            resets,
            vec![
                ("nPump", numbers(|call| given(call).pump_speed)),
                ("uValve", numbers(|call| given(call).holding_valve)),
                ("xCyl", before(|seen| seen.stroke)),
                ("vCyl", before(|seen| seen.velocity)),
                ("tStep", numbers(|_| step)),
            ],
        ),
        outputs: vec![
            ("fCyl", force.clone(), FORCE),
            ("pL", numbers(|call| load_pressure(&crane, &moved[call].1)), PRESSURE),
            ("pPA", after(|seen| seen.pressure_pump_a), PRESSURE),
            ("pA", after(|seen| seen.pressure_a), PRESSURE),
            ("pB", after(|seen| seen.pressure_b), PRESSURE),
            ("pPB", after(|seen| seen.pressure_pump_b), PRESSURE),
            ("pAcc", after(|seen| seen.pressure_accumulator), PRESSURE),
        ],
    };
    let boom = Replay {
        block: "FB_FlexibleBoom",
        each_period: false,
        inputs: with_flags(resets, vec![("fCyl", force), ("tStep", numbers(|_| step))]),
        outputs: vec![
            ("xCyl", after(|seen| seen.stroke), POSITION),
            ("vCyl", after(|seen| seen.velocity), VELOCITY),
            ("xTip", after(|seen| seen.tip_x), TIP),
            ("yTip", after(|seen| seen.tip_y), TIP),
            ("wTip", after(|seen| seen.tip_deflection), TIP),
        ],
    };
    Ok([hydraulics, boom])
}

/// A machine that holds its load, releases it and moves slowly, sampled once a call.
struct Course {
    readings: Vec<FrameInput<f64>>,
}

/// Calls before the start command, and before the reference moves.
const STARTED: usize = 10;
const MOVING: usize = 250;
/// Alternating scatter of the readings: position \[m\], pressure \[Pa\].
const POSITION_SCATTER: f64 = 1e-6;
const PRESSURE_SCATTER: f64 = 1e3;

impl Course {
    /// Simulates the benchmark on the virtual crane of the description.
    fn of(description: &Description) -> Result<Self, ExportError> {
        let (machine, _) = description.virtual_crane();
        let n = &machine.numbers;
        let mut start = machine.start(n.motion_start);
        start.preload = 0.0;
        let mut crane = VirtualCrane::new(&machine, &start)?;
        let controller = framed_benchmark(description)?;
        let mut state = FramedBenchmarkState::default();
        let mut readings = Vec::new();
        for period in 0..CALLS * PERIODS {
            let call = period / PERIODS;
            let r = crane.signals();
            let moved = period.saturating_sub(MOVING * PERIODS) as f64 * n.control_period;
            let now = FrameInput {
                enable: 1.0,
                start: f64::from(u8::from(call >= STARTED)),
                valve_state: -1.0,
                reference_position: n.motion_start + n.slow * moved,
                reference_velocity: if moved > 0.0 { n.slow } else { 0.0 },
                stroke: r.stroke,
                pressure_pump_a: r.pressure_pump_a,
                pressure_a: r.pressure_a,
                pressure_b: r.pressure_b,
                pressure_pump_b: r.pressure_pump_b,
                motor_speed_read: r.motor_speed,
                ..FrameInput::default()
            };
            let (next, output) = controller.advance(&state, &now);
            state = next;
            let (motor_speed, holding_valve) = (output.motor_speed, output.holding_valve);
            crane.advance(&AxisCommand { motor_speed, holding_valve })?;
            if period % PERIODS == PERIODS - 1 {
                readings.push(now.map(short));
            }
        }
        Ok(Self { readings })
    }

    fn ramps(&self, of: fn(&FrameInput<f64>) -> f64, scatter: f64) -> Values {
        Values::Ramps(self.readings.iter().map(of).collect(), scatter)
    }

    /// Inputs in the form of the replay.
    fn inputs(&self) -> Vec<(&'static str, Values)> {
        let truths = |of: fn(&FrameInput<f64>) -> f64| {
            Values::Truths(self.readings.iter().map(|r| of(r) > 0.5).collect())
        };
        vec![
            ("bEnable", truths(|r| r.enable)),
            ("bHold", truths(|r| r.hold)),
            ("bStart", truths(|r| r.start)),
            ("bResetFault", truths(|r| r.reset_fault)),
            ("uValveRead", numbers(|call| self.readings[call].valve_state)),
            ("xRef", self.ramps(|r| r.reference_position, 0.0)),
            ("vRef", self.ramps(|r| r.reference_velocity, 0.0)),
            ("xCyl", self.ramps(|r| r.stroke, POSITION_SCATTER)),
            ("pPA", self.ramps(|r| r.pressure_pump_a, PRESSURE_SCATTER)),
            ("pA", self.ramps(|r| r.pressure_a, PRESSURE_SCATTER)),
            ("pB", self.ramps(|r| r.pressure_b, PRESSURE_SCATTER)),
            ("pPB", self.ramps(|r| r.pressure_pump_b, PRESSURE_SCATTER)),
            ("nRead", self.ramps(|r| r.motor_speed_read, 0.0)),
        ]
    }

    /// Inputs in a period of a call, computed as the test bench does.
    fn input(&self, call: usize, period: usize) -> FrameInput<f64> {
        let of = |of: fn(&FrameInput<f64>) -> f64, scatter: f64| {
            let (before, now) = (&self.readings[call.saturating_sub(1)], &self.readings[call]);
            ramp(&[of(before), of(now)], scatter, 1, period)
        };
        let now = &self.readings[call];
        FrameInput {
            reference_position: of(|r| r.reference_position, 0.0),
            reference_velocity: of(|r| r.reference_velocity, 0.0),
            stroke: of(|r| r.stroke, POSITION_SCATTER),
            pressure_pump_a: of(|r| r.pressure_pump_a, PRESSURE_SCATTER),
            pressure_a: of(|r| r.pressure_a, PRESSURE_SCATTER),
            pressure_b: of(|r| r.pressure_b, PRESSURE_SCATTER),
            pressure_pump_b: of(|r| r.pressure_pump_b, PRESSURE_SCATTER),
            motor_speed_read: of(|r| r.motor_speed_read, 0.0),
            ..*now
        }
    }

    /// Outputs of a controller in the last period of each call.
    fn shown<R>(&self, mut advance: impl FnMut(&FrameInput<f64>) -> R) -> Vec<R> {
        let mut call = |call: usize| {
            let mut last = None;
            for period in 0..PERIODS {
                last = Some(advance(&self.input(call, period)));
            }
            last
        };
        (0..CALLS).filter_map(&mut call).collect()
    }
}

/// Outputs of the frame with their scales.
fn frame_outputs(shown: &[FrameOutput<f64>]) -> Vec<(&'static str, Values, f64)> {
    let values = |of: fn(&FrameOutput<f64>) -> f64| numbers(|call| of(&shown[call]));
    vec![
        ("nRef", values(|o| o.motor_speed), SPEED),
        (
            "bHoldingValve",
            Values::Truths(shown.iter().map(|o| o.holding_valve > 0.5).collect()),
            1.0,
        ),
        ("nStatus", Values::Counts(shown.iter().map(|o| o.status as i32).collect()), 1.0),
        ("referenceOffset", values(|o| o.reference_offset), POSITION),
        ("oscillationAmplitude", values(|o| o.oscillation_amplitude), POSITION),
        ("oscillationFrequency", values(|o| o.oscillation_frequency), 1.0),
    ]
}

/// The benchmark controller within the frame: the load is held, released and moved.
fn benchmark(description: &Description, course: &Course) -> Result<Replay, ExportError> {
    let controller = framed_benchmark(description)?;
    let mut state = FramedBenchmarkState::default();
    let shown = course.shown(|now| {
        let (next, output) = controller.advance(&state, now);
        state = next;
        output
    });
    Ok(Replay {
        block: "FB_BenchmarkController",
        each_period: true,
        inputs: with_flags(|call| call == 0, course.inputs()),
        outputs: frame_outputs(&shown),
    })
}

/// The simulation feedforward within the frame, with a simulated crane at the machine's position.
fn feedforward_controller(
    description: &Description,
    course: &Course,
) -> Result<Replay, ExportError> {
    let controller = framed_simulation_feedforward(description)?;
    let middle = description.numbers.motion_start;
    let pressure = |call: usize| wave(call, 70.0, 2e5, 6.5e6);
    let mut state = FramedSimulationState::default();
    state.alignment.position = middle;
    let strokes: Vec<f64> = course.readings.iter().map(|r| r.stroke).collect();
    let mut count = 0;
    let shown = course.shown(|now| {
        let call = count / PERIODS;
        let crane = SimulatedCrane {
            stroke: ramp(&strokes, 0.0, call, count % PERIODS),
            velocity: 0.0,
            load_pressure: pressure(call),
        };
        count += 1;
        let (next, output) = controller.advance(&state, now, &crane);
        state = next;
        (output, state.alignment.motor)
    });
    let outputs: Vec<FrameOutput<f64>> = shown.iter().map(|(output, _)| *output).collect();
    let mut compared = frame_outputs(&outputs);
    compared.push(("nMotor", numbers(|call| shown[call].1), SPEED));
    let mut inputs = course.inputs();
    inputs.extend([
        ("xSim", Values::Ramps(strokes, 0.0)),
        ("vSim", numbers(|_| 0.0)),
        ("pLSim", numbers(pressure)),
    ]);
    Ok(Replay {
        block: "FB_SimulationFeedforwardController",
        each_period: true,
        inputs: with_flags(|call| call == 0, inputs),
        outputs: compared,
    })
}

/// The same with the simulated crane, which is moved to the held position.
fn feedforward(description: &Description) -> Result<Replay, ExportError> {
    let crane = description.crane::<SEGMENTS>()?;
    let controller = framed_simulation_feedforward(description)?;
    let step = description.numbers.simulation_period;
    let rest = resting(description)?;
    let resets = |call: usize| call.is_multiple_of(FEEDFORWARD_RESET);
    let middle = description.numbers.motion_start;
    let given = |call: usize| FrameInput {
        enable: 1.0,
        valve_state: -1.0,
        reference_position: middle,
        // so far away that it is moved at its largest speed
        stroke: middle + 0.05,
        pressure_pump_a: 3e5,
        pressure_a: wave(call, 100.0, 1e5, 6.5e6),
        pressure_b: 5e5,
        pressure_pump_b: 3e5,
        ..FrameInput::default()
    };
    let begun = || {
        let mut state = FramedSimulationState::default();
        state.alignment.position = middle;
        state
    };
    let (mut state, mut simulated) = (begun(), rest);
    let shown: Vec<(FrameOutput<f64>, f64, Outputs<f64>)> = (0..CALLS)
        .map(|call| {
            if resets(call) {
                (state, simulated) = (begun(), rest);
            }
            let seen = crane.outputs(&simulated);
            let shows = SimulatedCrane {
                stroke: seen.stroke,
                velocity: seen.velocity,
                load_pressure: load_pressure(&crane, &seen),
            };
            let (next, output) = controller.advance(&state, &given(call), &shows);
            state = next;
            let input = Input { pump_speed: state.alignment.motor, holding_valve: 1.0 };
            published(&crane, &mut simulated, &input, step);
            (output, state.alignment.motor, crane.outputs(&simulated))
        })
        .collect();
    let value = |of: fn(&FrameInput<f64>) -> f64| numbers(|call| of(&given(call)));
    let mut inputs = vec![
        ("bEnable", Values::Truths(vec![true; CALLS])),
        ("bHold", Values::Truths(vec![false; CALLS])),
        ("bStart", Values::Truths(vec![false; CALLS])),
        ("bResetFault", Values::Truths(vec![false; CALLS])),
        ("uValveRead", value(|u| u.valve_state)),
        ("xRef", value(|u| u.reference_position)),
        ("vRef", value(|u| u.reference_velocity)),
        ("xCyl", value(|u| u.stroke)),
        ("pPA", value(|u| u.pressure_pump_a)),
        ("pA", value(|u| u.pressure_a)),
        ("pB", value(|u| u.pressure_b)),
        ("pPB", value(|u| u.pressure_pump_b)),
        ("nRead", value(|u| u.motor_speed_read)),
    ];
    inputs
        .extend([("tStep", numbers(|_| step)), ("nPerPeriod", Values::Counts(vec![STEPS; CALLS]))]);
    let outputs: Vec<FrameOutput<f64>> = shown.iter().map(|(output, ..)| *output).collect();
    let mut compared = frame_outputs(&outputs);
    compared.extend([
        ("nSim", numbers(|call| shown[call].1), SPEED),
        ("xSim", numbers(|call| shown[call].2.stroke), POSITION),
        ("vSim", numbers(|call| shown[call].2.velocity), VELOCITY),
        ("pLSim", numbers(|call| load_pressure(&crane, &shown[call].2)), PRESSURE),
    ]);
    Ok(Replay {
        block: "FB_SimulationFeedforward",
        each_period: false,
        inputs: with_flags(resets, inputs),
        outputs: compared,
    })
}
