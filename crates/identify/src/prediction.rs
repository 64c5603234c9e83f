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
const DERIVATIVES_PER_RUN: usize = 8;
/// Implicit integration steps per control period. The published scheme is not suitable: at the load-holding
/// valves it chatters within bounds, and its exact derivatives grow without bound.
pub(crate) const STEPS: u32 = 2;

/// Response of the model in SI units: a row for each sample of an experiment, a column for each of [`COMPARED`]. The
/// column of a signal that the model does not have is zero: pump sides and accumulator of a valve-controlled crane,
/// and the motor speed where the experiment has no motor command.
pub type Prediction = Vec<[f64; COMPARED.len()]>;

/// Number of initial values: stroke, then the pressures p_PA, p_B, p_PB, p_acc, or p_A and p_B of a
/// valve-controlled crane. The last one is the initial deviation of p_A from its rest in an oscillation
/// test. None if not measured.
pub(crate) const INITIAL_VALUES: usize = 6;

/// Signals of a model over a number type at the samples of an experiment.
type Response<T> = Vec<[T; COMPARED.len()]>;

/// Builds a model over a number type, initialises it at rest at the start of the experiment, and simulates
/// it with the drive.
fn simulated<T: Number>(
    model: &Description,
    n: &Numbers<T>,
    initial: &[Option<T>; INITIAL_VALUES],
    experiment: &Experiment,
) -> Result<Response<T>, IdentifyError> {
    let mut response = crane_response(model, n, initial, experiment)?;
    if let Some(motor_command) = &experiment.motor_command {
        let speeds = motor_command.read(n, experiment.every, response.len());
        response.iter_mut().zip(speeds).for_each(|(row, speed)| row[CRANE] = speed);
    }
    for (signal, filter) in
        experiment.filters.iter().enumerate().filter(|(_, filter)| **filter > 0.0)
    {
        filtered(&mut response, signal, experiment.interval() / filter);
    }
    Ok(response)
}

/// The same for the crane alone.
fn crane_response<T: Number>(
    model: &Description,
    n: &Numbers<T>,
    initial: &[Option<T>; INITIAL_VALUES],
    experiment: &Experiment,
) -> Result<Response<T>, IdentifyError> {
    let found = model.coordinates();
    match (&experiment.drive.merged(experiment.merged), found) {
        (Drive::Pump(inputs), SEGMENTS) => {
            let crane = model.crane_over::<T, SEGMENTS>(n)?;
            let state = initial_state(model, n, initial, &crane)?;
            let inputs = inputs.iter().map(|input| input.map(T::lit));
            run(&crane, state, inputs, experiment, |circuit, state| {
                let p = circuit.pressures(state);
                [p.pump_a, p.a, p.b, p.pump_b, p.accumulator]
            })
        }
        (Drive::Valve(inputs, _), 2) => {
            valve_crane_response::<T, 2>(model, n, initial, inputs, experiment)
        }
        (Drive::Valve(inputs, _), 3) => {
            valve_crane_response::<T, 3>(model, n, initial, inputs, experiment)
        }
        _ => Err(IdentifyError::Segments { found }),
    }
}

/// The same for a valve-controlled crane.
fn valve_crane_response<T: Number, const N: usize>(
    model: &Description,
    n: &Numbers<T>,
    initial: &[Option<T>; INITIAL_VALUES],
    inputs: &[ValveInput<f64>],
    experiment: &Experiment,
) -> Result<Response<T>, IdentifyError> {
    let crane = model.valve_crane_over::<T, N>(n)?;
    let [stroke, piston_side, rod_side, ..] = *initial;
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
fn initial_state<T: Number>(
    model: &Description,
    n: &Numbers<T>,
    initial: &[Option<T>; INITIAL_VALUES],
    crane: &Crane<T, SEGMENTS>,
) -> Result<CraneState<T, SEGMENTS>, IdentifyError> {
    let [stroke, pump_a, rod_side, pump_b, accumulator, deflection] = *initial;
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
    Ok(match deflection {
        Some(deflection) => deflected(crane, &state, deflection),
        None => state,
    })
}

/// Rotates the boom with trapped oil until p_A deviates from its rest by `swing` \[Pa\].
///
/// The iteration uses the derivative's value only; when the angle has converged, its derivatives have too.
fn deflected<T: Number>(
    crane: &Crane<T, SEGMENTS>,
    rest: &CraneState<T, SEGMENTS>,
    deflection: T,
) -> CraneState<T, SEGMENTS> {
    const DIFFERENCE_STEP: f64 = 1e-4;
    let off = |angle: T| crane.lifted(rest, angle).circuit.nodes.a - rest.circuit.nodes.a;
    let slope = off(T::lit(DIFFERENCE_STEP)).plain() / DIFFERENCE_STEP;
    let mut angle = T::zero();
    for _ in 0..6 {
        angle = angle + (deflection - off(angle)) / T::lit(slope);
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
) -> Result<Response<T>, IdentifyError> {
    let stepper = Stepper::new(crane);
    let observe = |state: &CraneState<T, N, C::State>| {
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
    let mut response = Vec::with_capacity(experiment.samples.len());
    for (k, input) in inputs.enumerate() {
        if k % every == 0 {
            if experiment.is_stopped() {
                return Err(IdentifyError::Stopped);
            }
            let now = observe(&state);
            if now.iter().any(|v| !v.plain().is_finite()) {
                return Err(broken(k));
            }
            response.push(now);
        }
        state = stepper
            .moved(crane, &state, &input, period, experiment.steps)
            .ok_or_else(|| broken(k))?;
    }
    if response.len() < experiment.samples.len() {
        response.push(observe(&state));
    }
    Ok(response)
}

/// First-order filter of a signal: exact for a signal that is linear between samples, whose interval is
/// `ratio` filter time constants.
fn filtered<T: Number>(response: &mut Response<T>, signal: usize, ratio: f64) {
    let decay = (-ratio).exp();
    // decay of the initial value, and response to the ramp between samples
    let (last, next) = ((1.0 - decay) / ratio - decay, 1.0 - (1.0 - decay) / ratio);
    let Some(first) = response.first() else { return };
    let (mut before, mut output) = (first[signal], first[signal]);
    for row in &mut *response {
        let now = row[signal];
        output = T::lit(decay) * output + T::lit(last) * before + T::lit(next) * now;
        // the filter starts in steady state
        (before, row[signal]) = (now, output);
    }
}

/// Response of the model to an experiment's inputs, from its measured initial values, at the times of its samples.
///
/// ```
/// use hydroboom_description::Description;
/// use hydroboom_identify::{Experiment, Window, predict};
/// use hydroboom_measurement::{Measurement, Signal, Signals, Track};
/// let time: Vec<f64> = (0..500).map(|k| 1e-3 * f64::from(k)).collect();
/// let mut signals = Signals::default();
/// signals.insert(Signal::Stroke, Track::new(&time, &vec![0.2; time.len()]));
/// signals.insert(Signal::MotorSpeed, Track::new(&time, &vec![0.0; time.len()]));
/// let log = Measurement { name: "log".into(), channels: Vec::new(), remarks: Vec::new(), time: None };
/// let model = Description::uia_single_boom()?;
/// let experiment = Experiment::new(&model, &log, &signals, Window::default())?;
/// let prediction = predict(&model, &experiment)?;
/// assert_eq!(prediction.len(), experiment.samples.len());
/// assert!((prediction[0][0] - 0.2).abs() < 1e-3, "the piston starts at 0.2 m");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// [`IdentifyError::Segments`] if the type of model is not supported, [`IdentifyError::Build`] if there is no such
/// model or no state of rest. [`IdentifyError::Broken`] if the simulation fails, [`IdentifyError::Stopped`] if it was
/// stopped.
pub fn predict(model: &Description, experiment: &Experiment) -> Result<Prediction, IdentifyError> {
    predict_from(model, experiment, &[0.0; INITIAL_VALUES])
}

/// The same with an offset on each initial value.
pub(crate) fn predict_from(
    model: &Description,
    experiment: &Experiment,
    offsets: &[f64; INITIAL_VALUES],
) -> Result<Prediction, IdentifyError> {
    let initial = from_fn(|k| experiment.initial_values[k].map(|v| v + offsets[k]));
    simulated(model, &model.numbers, &initial, experiment)
}

/// Response of the model as [`predict`], and its derivatives with respect to ln θ of each free key, exact by dual
/// numbers. The derivatives are in the signals' SI units: one array per key, in the order of `free`, of the response's
/// shape.
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
    sensitivities_from(model, experiment, &[0.0; INITIAL_VALUES], &keys)
}

/// Variable of differentiation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Direction {
    /// ln θ of a key.
    Key(Free),
    /// Initial value in SI units.
    InitialValue(usize),
}

/// Prediction with an offset on each initial value, and its derivatives along the given directions.
pub(crate) fn sensitivities_from(
    model: &Description,
    experiment: &Experiment,
    offsets: &[f64; INITIAL_VALUES],
    directions: &[Direction],
) -> Result<(Prediction, Vec<Prediction>), IdentifyError> {
    type D = Dual<f64, DERIVATIVES_PER_RUN>;
    let parts: Vec<&[Direction]> = directions.chunks(DERIVATIVES_PER_RUN).collect();
    let runs: Result<Vec<Vec<[D; COMPARED.len()]>>, IdentifyError> = parts
        .par_iter()
        .map(|part| {
            let mut numbers = model.numbers.to_array().map(D::constant);
            let mut initial: [Option<D>; INITIAL_VALUES] =
                from_fn(|k| experiment.initial_values[k].map(|v| D::constant(v + offsets[k])));
            for (direction, along) in part.iter().enumerate() {
                match along {
                    // dθ = θ d ln θ
                    Direction::Key(key) => {
                        let value = numbers[key.place].value;
                        numbers[key.place].slope[direction] = value;
                    }
                    Direction::InitialValue(k) => {
                        if let Some(value) = &mut initial[*k] {
                            value.slope[direction] = 1.0;
                        }
                    }
                }
            }
            simulated(model, &Numbers::from_array(numbers), &initial, experiment)
        })
        .collect();
    let runs = runs?;
    let Some(first) = runs.first() else {
        return Ok((predict_from(model, experiment, offsets)?, Vec::new()));
    };
    let values = first.iter().map(|row| row.map(|v| v.value)).collect();
    let slopes = (0..directions.len())
        .map(|k| {
            let (part, direction) = (k / DERIVATIVES_PER_RUN, k % DERIVATIVES_PER_RUN);
            runs[part].iter().map(|row| row.map(|v| v.slope[direction])).collect()
        })
        .collect();
    Ok((values, slopes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filtered_ramp_lags_by_the_time_constant() {
        let (interval, constant) = (0.01, 0.3);
        let time = |k: usize| k as f64 * interval;
        let mut response: Response<f64> =
            (0..500).map(|k| [2.0 + 0.7 * time(k); COMPARED.len()]).collect();
        filtered(&mut response, 0, interval / constant);
        for (k, row) in response.iter().enumerate() {
            let late = constant * (1.0 - (-time(k) / constant).exp());
            let exact = 2.0 + 0.7 * (time(k) - late);
            assert!((row[0] - exact).abs() < 1e-12, "{} for {exact} at {}", row[0], time(k));
            assert_eq!(row[1], 2.0 + 0.7 * time(k));
        }
    }
}
