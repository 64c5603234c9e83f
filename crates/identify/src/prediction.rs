//! Prediction: the model's response to a log's inputs, and its sensitivity to each key.

use crate::drive::Drive;
use crate::error::IdentifyError;
use crate::experiment::{COMPARED, CRANE, Experiment};
use crate::free::Free;
use crate::number::{Number, Stepper};
use hydroboom_description::schema::Numbers;
use hydroboom_description::{BuildError, Description};
use hydroboom_math::Dual;
use hydroboom_model::{Circuit, Crane, CraneState, ValveInput};
use rayon::prelude::*;
use std::array::from_fn;

/// Number of segments of the published model.
const SEGMENTS: usize = 3;
/// Number of derivatives computed in one run.
const TOGETHER: usize = 8;
/// Implicit integration steps per control period. The published scheme is not suitable: at the load-holding
/// valves it chatters within bounds, and its exact derivatives grow without bound.
pub(crate) const STEPS: u32 = 2;

/// Signals of the model at the samples of an experiment, in SI units and in the order of [`COMPARED`].
pub type Prediction = Vec<[f64; COMPARED.len()]>;

/// Number of initial values: stroke, then the pressures p_PA, p_B, p_PB, p_acc, or p_A and p_B of a
/// valve-controlled crane. The last one is the initial deviation of p_A from its rest in an oscillation
/// test. None if not measured.
pub(crate) const STARTS: usize = 6;

/// Signals of a model over a number type at the samples of an experiment.
type Shown<T> = Vec<[T; COMPARED.len()]>;

/// Builds a model over a number type, initialises it at rest at the start of the experiment, and simulates
/// it with the drive.
fn shown<T: Number>(
    model: &Description,
    n: &Numbers<T>,
    begin: &[Option<T>; STARTS],
    experiment: &Experiment,
) -> Result<Shown<T>, IdentifyError> {
    let mut seen = of_crane(model, n, begin, experiment)?;
    if let Some(asked) = &experiment.asked {
        let speeds = asked.read(n, experiment.every, seen.len());
        seen.iter_mut().zip(speeds).for_each(|(row, speed)| row[CRANE] = speed);
    }
    for (signal, filter) in
        experiment.filters.iter().enumerate().filter(|(_, filter)| **filter > 0.0)
    {
        filtered(&mut seen, signal, experiment.interval() / filter);
    }
    Ok(seen)
}

/// The same for the crane alone.
fn of_crane<T: Number>(
    model: &Description,
    n: &Numbers<T>,
    begin: &[Option<T>; STARTS],
    experiment: &Experiment,
) -> Result<Shown<T>, IdentifyError> {
    let found = model.coordinates();
    match (&experiment.drive.merged(experiment.merged), found) {
        (Drive::Pump(inputs), SEGMENTS) => {
            let crane = model.crane_over::<T, SEGMENTS>(n)?;
            let state = beginning(model, n, begin, &crane)?;
            let inputs = inputs.iter().map(|input| input.map(T::lit));
            run(&crane, state, inputs, experiment, |circuit, state| {
                let p = circuit.pressures(state);
                [p.pump_a, p.a, p.b, p.pump_b, p.accumulator]
            })
        }
        (Drive::Valve(inputs, _), 2) => at_valve::<T, 2>(model, n, begin, inputs, experiment),
        (Drive::Valve(inputs, _), 3) => at_valve::<T, 3>(model, n, begin, inputs, experiment),
        _ => Err(IdentifyError::Segments { found }),
    }
}

/// The same for a valve-controlled crane.
fn at_valve<T: Number, const N: usize>(
    model: &Description,
    n: &Numbers<T>,
    begin: &[Option<T>; STARTS],
    inputs: &[ValveInput<f64>],
    experiment: &Experiment,
) -> Result<Shown<T>, IdentifyError> {
    let crane = model.valve_crane_over::<T, N>(n)?;
    let [stroke, piston_side, rod_side, ..] = *begin;
    let mut start = model.valve_start_over(n, stroke.unwrap_or(T::lit(0.5) * n.stroke));
    start.pressure_a = piston_side;
    start.pressure_b = rod_side.unwrap_or(start.pressure_b);
    let state = T::valve_rest(&crane, &start).map_err(BuildError::from)?;
    let inputs = inputs.iter().map(|input| input.map(T::lit));
    run(&crane, state, inputs, experiment, |circuit, state| {
        let (a, b) = circuit.chambers(state);
        // signals that such a circuit does not have are not in its logs either
        [T::zero(), a, b, T::zero(), T::zero()]
    })
}

/// Initial state of an experiment, at rest.
///
/// The accumulator's gas follows the isothermal law from its working pressure.
fn beginning<T: Number>(
    model: &Description,
    n: &Numbers<T>,
    begin: &[Option<T>; STARTS],
    crane: &Crane<T, SEGMENTS>,
) -> Result<CraneState<T, SEGMENTS>, IdentifyError> {
    let [stroke, pump_a, rod_side, pump_b, accumulator, swing] = *begin;
    let mut start = model.start_over(n, stroke.unwrap_or(n.motion_start));
    if let Some(pressure) = rod_side {
        start.rod_side_pressure = pressure;
    }
    if let Some(pressure) = accumulator {
        let (filled, now) = (n.working_pressure + n.atmosphere, pressure + n.atmosphere);
        start.gas_volume = start.gas_volume * filled / now;
        start.accumulator_pressure = pressure;
    }
    let mut state = T::rest(crane, &start).map_err(BuildError::from)?;
    let nodes = &mut state.circuit.nodes;
    nodes.pump_a = pump_a.unwrap_or(nodes.pump_a);
    nodes.pump_b = pump_b.unwrap_or(nodes.pump_b);
    Ok(match swing {
        Some(swing) => lifted(crane, &state, swing),
        None => state,
    })
}

/// Rotates the boom with trapped oil until p_A deviates from its rest by `swing` \[Pa\].
///
/// The iteration uses a plain slope; when its value has converged, its derivatives have converged too.
fn lifted<T: Number>(
    crane: &Crane<T, SEGMENTS>,
    rest: &CraneState<T, SEGMENTS>,
    swing: T,
) -> CraneState<T, SEGMENTS> {
    const NUDGE: f64 = 1e-4;
    let off = |angle: T| crane.lifted(rest, angle).circuit.nodes.a - rest.circuit.nodes.a;
    let slope = off(T::lit(NUDGE)).plain() / NUDGE;
    let mut angle = T::zero();
    for _ in 0..6 {
        angle = angle + (swing - off(angle)) / T::lit(slope);
    }
    crane.lifted(rest, angle)
}

/// Simulates the model from a state at rest and returns its signals at each sample: position, then
/// `pressures`.
fn run<T: Number, const N: usize, C: Circuit<T>>(
    crane: &Crane<T, N, C>,
    mut state: CraneState<T, N, C::State>,
    inputs: impl Iterator<Item = C::Input>,
    experiment: &Experiment,
    pressures: impl Fn(&C, &C::State) -> [T; CRANE - 1],
) -> Result<Shown<T>, IdentifyError> {
    let stepper = Stepper::new(crane);
    let show = |state: &CraneState<T, N, C::State>| {
        let pose = crane.boom.pose(&state.boom.angle);
        let [pump_a, a, b, pump_b, accumulator] = pressures(&crane.circuit, &state.circuit);
        let stroke = crane.boom.cylinder_pose(&pose).stroke;
        // the motor speed is computed separately
        [stroke, pump_a, a, b, pump_b, accumulator, T::zero()]
    };
    let (period, every) =
        (experiment.period * experiment.merged as f64, experiment.every / experiment.merged);
    let broken = |k: usize| {
        let time = k as f64 * period;
        IdentifyError::Broken { log: experiment.name.clone(), time }
    };
    let mut seen = Vec::with_capacity(experiment.samples.len());
    for (k, input) in inputs.enumerate() {
        if k % every == 0 {
            let now = show(&state);
            if now.iter().any(|v| !v.plain().is_finite()) {
                return Err(broken(k));
            }
            seen.push(now);
        }
        state = stepper
            .moved(crane, &state, &input, period, experiment.steps)
            .ok_or_else(|| broken(k))?;
    }
    if seen.len() < experiment.samples.len() {
        seen.push(show(&state));
    }
    Ok(seen)
}

/// First-order filter of a signal: exact for a signal that is linear between samples, whose interval is
/// `ratio` filter time constants.
fn filtered<T: Number>(seen: &mut Shown<T>, signal: usize, ratio: f64) {
    let fades = (-ratio).exp();
    // decay of the initial value, and response to the ramp between samples
    let (last, next) = ((1.0 - fades) / ratio - fades, 1.0 - (1.0 - fades) / ratio);
    let Some(first) = seen.first() else { return };
    let (mut before, mut shown) = (first[signal], first[signal]);
    for row in &mut *seen {
        let now = row[signal];
        shown = T::lit(fades) * shown + T::lit(last) * before + T::lit(next) * now;
        // the filter starts in steady state
        (before, row[signal]) = (now, shown);
    }
}

/// Prediction of the model for an experiment's inputs.
///
/// # Errors
///
/// [`IdentifyError`] if there is no such model, or the simulation fails.
pub fn predict(model: &Description, experiment: &Experiment) -> Result<Prediction, IdentifyError> {
    predict_from(model, experiment, &[0.0; STARTS])
}

/// The same with an offset on each initial value.
pub(crate) fn predict_from(
    model: &Description,
    experiment: &Experiment,
    offsets: &[f64; STARTS],
) -> Result<Prediction, IdentifyError> {
    let begin = from_fn(|k| experiment.beginning[k].map(|v| v + offsets[k]));
    shown(model, &model.numbers, &begin, experiment)
}

/// Prediction, and its derivative with respect to ln θ of each key, in units of the signals.
///
/// # Errors
///
/// See [`predict`].
pub fn sensitivities(
    model: &Description,
    experiment: &Experiment,
    free: &[Free],
) -> Result<(Prediction, Vec<Prediction>), IdentifyError> {
    let keys: Vec<Direction> = free.iter().map(|key| Direction::Key(*key)).collect();
    slopes_from(model, experiment, &[0.0; STARTS], &keys)
}

/// Variable of differentiation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Direction {
    /// ln θ of a key.
    Key(Free),
    /// Initial value in SI units.
    Start(usize),
}

/// Prediction with an offset on each initial value, and its derivatives along the given directions.
pub(crate) fn slopes_from(
    model: &Description,
    experiment: &Experiment,
    offsets: &[f64; STARTS],
    directions: &[Direction],
) -> Result<(Prediction, Vec<Prediction>), IdentifyError> {
    type D = Dual<f64, TOGETHER>;
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
            shown(model, &Numbers::from_array(numbers), &begin, experiment)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_through_a_filter_follows_late_by_its_time_constant() {
        let (interval, constant) = (0.01, 0.3);
        let time = |k: usize| k as f64 * interval;
        let mut seen: Shown<f64> =
            (0..500).map(|k| [2.0 + 0.7 * time(k); COMPARED.len()]).collect();
        filtered(&mut seen, 0, interval / constant);
        for (k, row) in seen.iter().enumerate() {
            let late = constant * (1.0 - (-time(k) / constant).exp());
            let exact = 2.0 + 0.7 * (time(k) - late);
            assert!((row[0] - exact).abs() < 1e-12, "{} for {exact} at {}", row[0], time(k));
            assert_eq!(row[1], 2.0 + 0.7 * time(k));
        }
    }
}
