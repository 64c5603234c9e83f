//! The model under a log's inputs, and how each of its signals moves with each key.

use crate::error::IdentifyError;
use crate::experiment::{COMPARED, Experiment};
use crate::free::Free;
use hydroboom_description::schema::Numbers;
use hydroboom_description::{BuildError, Description};
use hydroboom_math::{Dual, Real};
use hydroboom_model::stepping::{Implicit, MOST_PARTS};
use hydroboom_model::{Crane, CraneState, EquilibriumError, Input, Start};
use rayon::prelude::*;
use std::array::from_fn;

/// Segments of the published model.
const SEGMENTS: usize = 3;
/// Keys that one run is differentiated by.
const TOGETHER: usize = 4;
/// Steps in a control period, of the implicit scheme. The published one will not do: at the load-holding valves
/// it chatters within bounds, and its slopes, exact as they are, grow without any.
const STEPS: u32 = 2;

/// What the model shows at the samples of an experiment, in SI units, signals in the order of
/// [`COMPARED`].
pub type Prediction = Vec<[f64; COMPARED.len()]>;

/// What a model starts from: stroke, then the pressures p_PA, p_B, p_PB, p_acc; none where nothing was measured.
pub(crate) const STARTS: usize = 5;

/// The state at rest that an experiment begins with.
///
/// The accumulator's gas follows the isothermal law from its working pressure. `at_rest` finds the state of a start:
/// plainly, or with slopes.
fn beginning<T: Real>(
    model: &Description,
    n: &Numbers<T>,
    begin: &[Option<T>; STARTS],
    at_rest: impl FnOnce(&Start<T>) -> Result<CraneState<T, SEGMENTS>, EquilibriumError>,
) -> Result<CraneState<T, SEGMENTS>, IdentifyError> {
    let [stroke, pump_a, rod_side, pump_b, accumulator] = *begin;
    let mut start = model.start_over(n, stroke.unwrap_or(n.motion_start));
    if let Some(pressure) = rod_side {
        start.rod_side_pressure = pressure;
    }
    if let Some(pressure) = accumulator {
        let (filled, now) = (n.working_pressure + n.atmosphere, pressure + n.atmosphere);
        start.gas_volume = start.gas_volume * filled / now;
        start.accumulator_pressure = pressure;
    }
    let mut state = at_rest(&start).map_err(BuildError::from)?;
    let nodes = &mut state.circuit.nodes;
    nodes.pump_a = pump_a.unwrap_or(nodes.pump_a);
    nodes.pump_b = pump_b.unwrap_or(nodes.pump_b);
    Ok(state)
}

/// Runs the model from a state at rest; what it shows at each sample.
fn run<T: Real>(
    crane: &Crane<T, SEGMENTS>,
    mut state: CraneState<T, SEGMENTS>,
    experiment: &Experiment,
    value: impl Fn(T) -> f64,
) -> Result<Vec<[T; COMPARED.len()]>, IdentifyError> {
    let scheme = Implicit::new(crane);
    let broken = |k: usize| {
        let time = k as f64 * experiment.period;
        IdentifyError::Broken { log: experiment.name.clone(), time }
    };
    let mut seen = Vec::with_capacity(experiment.samples.len());
    for (k, input) in experiment.inputs.iter().enumerate() {
        if k % experiment.every == 0 {
            let now = show(crane, &state);
            if now.iter().any(|v| !value(*v).is_finite()) {
                return Err(broken(k));
            }
            seen.push(now);
        }
        let input = Input {
            pump_speed: T::lit(input.pump_speed),
            holding_valve: T::lit(input.holding_valve),
        };
        // a step that does not settle is taken in parts, as often as it takes
        let mut parts = STEPS;
        state = loop {
            let mut trial = state;
            let step = T::lit(experiment.period / f64::from(parts));
            let settled = (0..parts).all(|_| {
                Implicit::has_settled(value(scheme.step(crane, &mut trial, &input, step)))
            });
            match settled {
                true => break trial,
                false if parts < MOST_PARTS => parts *= 2,
                false => return Err(broken(k)),
            }
        };
    }
    if seen.len() < experiment.samples.len() {
        seen.push(show(crane, &state));
    }
    Ok(seen)
}

fn show<T: Real>(
    crane: &Crane<T, SEGMENTS>,
    state: &CraneState<T, SEGMENTS>,
) -> [T; COMPARED.len()] {
    let p = crane.circuit.pressures(&state.circuit);
    let pose = crane.boom.pose(&state.boom.angle);
    [crane.boom.cylinder_pose(&pose).stroke, p.pump_a, p.a, p.b, p.pump_b, p.accumulator]
}

/// What the model shows under an experiment's inputs.
///
/// # Errors
///
/// [`IdentifyError`] when there is no such model, or it breaks off.
pub fn predict(model: &Description, experiment: &Experiment) -> Result<Prediction, IdentifyError> {
    predict_from(model, experiment, &[0.0; STARTS])
}

/// The same with each start moved by an offset.
pub(crate) fn predict_from(
    model: &Description,
    experiment: &Experiment,
    offsets: &[f64; STARTS],
) -> Result<Prediction, IdentifyError> {
    check(model)?;
    let crane = model.crane::<SEGMENTS>().map_err(BuildError::from)?;
    let begin = from_fn(|k| experiment.beginning[k].map(|v| v + offsets[k]));
    let state = beginning(model, &model.numbers, &begin, |start| crane.at_rest(start))?;
    run(&crane, state, experiment, |v| v)
}

/// What the model shows, and its slope along ln θ of each key: a prediction for each key, in units of the signal.
///
/// # Errors
///
/// As [`predict`].
pub fn sensitivities(
    model: &Description,
    experiment: &Experiment,
    free: &[Free],
) -> Result<(Prediction, Vec<Prediction>), IdentifyError> {
    let keys: Vec<Direction> = free.iter().map(|key| Direction::Key(*key)).collect();
    slopes_from(model, experiment, &[0.0; STARTS], &keys)
}

/// What a prediction is differentiated by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Direction {
    /// ln θ of a key.
    Key(Free),
    /// A start, in SI units.
    Start(usize),
}

/// What the model shows with each start moved by an offset, and its slope along each direction.
pub(crate) fn slopes_from(
    model: &Description,
    experiment: &Experiment,
    offsets: &[f64; STARTS],
    directions: &[Direction],
) -> Result<(Prediction, Vec<Prediction>), IdentifyError> {
    type D = Dual<f64, TOGETHER>;
    check(model)?;
    let parts: Vec<&[Direction]> = directions.chunks(TOGETHER).collect();
    let runs: Result<Vec<Vec<[D; COMPARED.len()]>>, IdentifyError> = parts
        .par_iter()
        .map(|part| {
            let mut numbers = model.numbers.to_array().map(D::constant);
            let mut begin: [Option<D>; STARTS] =
                from_fn(|k| experiment.beginning[k].map(|v| D::constant(v + offsets[k])));
            for (direction, along) in part.iter().enumerate() {
                match along {
                    // dθ = θ d ln θ
                    Direction::Key(key) => {
                        let value = numbers[key.place].value;
                        numbers[key.place].slope[direction] = value;
                    }
                    Direction::Start(k) => {
                        if let Some(value) = &mut begin[*k] {
                            value.slope[direction] = 1.0;
                        }
                    }
                }
            }
            let numbers = Numbers::from_array(numbers);
            let crane = model.crane_over::<D, SEGMENTS>(&numbers).map_err(BuildError::from)?;
            let state = beginning(model, &numbers, &begin, |start| crane.at_rest_along(start))?;
            run(&crane, state, experiment, |v| v.value)
        })
        .collect();
    let runs = runs?;
    let Some(first) = runs.first() else {
        return Ok((predict_from(model, experiment, offsets)?, Vec::new()));
    };
    let values = first.iter().map(|row| row.map(|v| v.value)).collect();
    let slopes = (0..directions.len())
        .map(|k| {
            let (part, direction) = (k / TOGETHER, k % TOGETHER);
            runs[part].iter().map(|row| row.map(|v| v.slope[direction])).collect()
        })
        .collect();
    Ok((values, slopes))
}

fn check(model: &Description) -> Result<(), IdentifyError> {
    match model.coordinates() {
        SEGMENTS => Ok(()),
        found => Err(IdentifyError::Segments { found }),
    }
}
