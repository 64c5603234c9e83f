//! What the test bench replays: each exported block, its inputs, and what Rust computes of them.

use super::bench::{CALLS, Replay, Values};
use crate::crane::{SEGMENTS, resting};
use crate::error::ExportError;
use hydroboom_control::{Measured, Reference};
use hydroboom_description::Description;
use hydroboom_model::stepping::published;
use hydroboom_model::{Crane, CraneState, Input, Outputs};

/// What signals come to in a motion: position \[m\], velocity \[m/s\], tip \[m\], pressure \[Pa\], force \[N\], motor speed \[rev/s\].
const POSITION: f64 = 0.1;
const VELOCITY: f64 = 0.1;
const TIP: f64 = 1.0;
const PRESSURE: f64 = 1e7;
const FORCE: f64 = 1e5;
const SPEED: f64 = 50.0;

/// Calls in which blocks begin again. The published step makes much of the last digit once the check valves let oil through, so
/// that goes on for some calls only.
const RESETS: [usize; 3] = [0, 145, 220];
/// Calls after which the simulated crane that is steered begins again, for the same reason.
const STEERED: usize = 110;
/// Its steps in a control period. Fewer than in a motion, so that the valves open in these calls.
const STEPS: usize = 5;
/// Calls that say that a parameter was changed, although none was.
const PREPARED: [usize; 2] = [37, 277];
/// Calls between which the 3/2 valve is shut.
const SHUT: std::ops::Range<usize> = 65..105;
/// Calls in which inputs stay as they are.
const HELD: usize = 10;

/// Every exported block that has a test bench.
pub(super) fn replays(description: &Description) -> Result<Vec<Replay>, ExportError> {
    let [hydraulics, boom] = crane(description)?;
    Ok(vec![
        hydraulics,
        boom,
        benchmark(description),
        motor(description),
        feedforward(description)?,
    ])
}

/// Calls in which blocks begin again, but for that which has the crane in it.
fn resets(call: usize) -> bool {
    RESETS.contains(&call)
}

/// One value for each call.
fn numbers(of: impl FnMut(usize) -> f64) -> Values {
    Values::Numbers((0..CALLS).map(of).collect())
}

/// Inputs of a block, with those that each has.
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

/// A number of few digits.
fn short(value: f64) -> f64 {
    const DIGITS: usize = 5;
    format!("{value:.DIGITS$e}").parse().unwrap_or(value)
}

/// A wave of this many calls and this height about a middle, in steps.
fn wave(call: usize, calls: f64, height: f64, middle: f64) -> f64 {
    let turn = std::f64::consts::TAU * (call - call % HELD) as f64 / calls;
    short(middle + height * turn.sin())
}

/// Load pressure of the simulated crane.
fn load_pressure(crane: &Crane<f64, SEGMENTS>, seen: &Outputs<f64>) -> f64 {
    crane.cylinder.load_pressure(seen.pressure_a, seen.pressure_b)
}

/// Hydraulics and boom, which go together, through the switching of the 3/2 valve.
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

/// The benchmark controller, with either feedforward, at the motor's limits for some of the time.
fn benchmark(description: &Description) -> Replay {
    let controller = description.benchmark();
    let middle = description.numbers.motion_start;
    let reference = |call: usize| Reference {
        position: wave(call, 120.0, 0.05, middle),
        velocity: wave(call, 90.0, 0.4, 0.0),
    };
    let measured = |call: usize| Measured {
        stroke: wave(call, 110.0, 0.04, middle),
        load_pressure: wave(call, 70.0, 5e5, 6.5e6),
    };
    let simulated = |call: usize| wave(call, 100.0, 20.0, 0.0);
    let leads = |call: usize| SHUT.contains(&call);
    let mut memory = controller.start(&measured(0));
    let speed = numbers(|call| {
        if resets(call) {
            memory = controller.start(&measured(call));
        }
        let own = controller.velocity_feedforward(&reference(call));
        let share = if leads(call) { simulated(call) } else { own };
        controller.update(&mut memory, &reference(call), &measured(call), share)
    });
    Replay {
        block: "FB_BenchmarkController",
        inputs: with_flags(
            resets,
            vec![
                ("xRef", numbers(|call| reference(call).position)),
                ("vRef", numbers(|call| reference(call).velocity)),
                ("xCyl", numbers(|call| measured(call).stroke)),
                ("pL", numbers(|call| measured(call).load_pressure)),
                ("nSim", numbers(simulated)),
                ("uLead", numbers(|call| f64::from(u8::from(leads(call))))),
            ],
        ),
        outputs: vec![("nRef", speed, SPEED)],
    }
}

/// The simulated motor, faster asked for than it can, and beyond what it can.
fn motor(description: &Description) -> Replay {
    let benchmark = description.benchmark();
    let asked = |call: usize| wave(call, 260.0, 80.0, 0.0);
    let mut speed = 0.0;
    let shown = numbers(|call| {
        if resets(call) {
            speed = 0.0;
        }
        speed = benchmark.limits.follow(speed, asked(call), benchmark.period);
        speed
    });
    Replay {
        block: "FB_SimulatedMotor",
        inputs: with_flags(resets, vec![("nWanted", numbers(asked))]),
        outputs: vec![("nMotor", shown, SPEED)],
    }
}

/// All four together: the simulated crane under the benchmark controller.
fn feedforward(description: &Description) -> Result<Replay, ExportError> {
    let rest = resting(description)?;
    let crane = description.crane::<SEGMENTS>()?;
    let (benchmark, step) = (description.benchmark(), description.numbers.simulation_period);
    let resets = |call: usize| call.is_multiple_of(STEERED);
    let middle = description.numbers.motion_start;
    let reference = |call: usize| Reference {
        position: wave(call, 600.0, 1e-3, middle),
        velocity: wave(call, 600.0, 0.025, 0.0),
    };
    let sees = |state: &CraneState<f64, SEGMENTS>| {
        let seen = crane.outputs(state);
        Measured { stroke: seen.stroke, load_pressure: load_pressure(&crane, &seen) }
    };
    let mut state = rest;
    let (mut memory, mut motor, mut since) = (benchmark.start(&sees(&rest)), 0.0, 0);
    let shown: Vec<(f64, Outputs<f64>)> = (0..CALLS)
        .map(|call| {
            if resets(call) {
                (state, motor, since) = (rest, 0.0, 0);
                memory = benchmark.start(&sees(&rest));
            }
            if since % STEPS == 0 {
                let own = benchmark.velocity_feedforward(&reference(call));
                let asked = benchmark.update(&mut memory, &reference(call), &sees(&state), own);
                motor = benchmark.limits.follow(motor, asked, benchmark.period);
            }
            since += 1;
            let input = Input { pump_speed: motor, holding_valve: 1.0 };
            published(&crane, &mut state, &input, step);
            (motor, crane.outputs(&state))
        })
        .collect();
    Ok(Replay {
        block: "FB_SimulationFeedforward",
        inputs: with_flags(
            resets,
            vec![
                ("xRef", numbers(|call| reference(call).position)),
                ("vRef", numbers(|call| reference(call).velocity)),
                ("tStep", numbers(|_| step)),
                ("nPerPeriod", Values::Counts(vec![STEPS as i32; CALLS])),
            ],
        ),
        outputs: vec![
            ("nFeedforward", numbers(|call| shown[call].0), SPEED),
            ("xSim", numbers(|call| shown[call].1.stroke), POSITION),
            ("vSim", numbers(|call| shown[call].1.velocity), VELOCITY),
            ("pLSim", numbers(|call| load_pressure(&crane, &shown[call].1)), PRESSURE),
        ],
    })
}
