//! The model under a log's inputs, and how each of its signals moves with each key.

use crate::drive::Drive;
use crate::error::IdentifyError;
use crate::experiment::{COMPARED, Experiment};
use crate::free::Free;
use hydroboom_description::schema::Numbers;
use hydroboom_description::{BuildError, Description};
use hydroboom_math::{Dual, Real};
use hydroboom_model::circuit::Coordinates;
use hydroboom_model::stepping::{Implicit, MOST_PARTS, has_settled};
use hydroboom_model::{
    BoomState, Circuit, Crane, CraneState, EquilibriumError, Start, ValveControlled,
    ValveCraneState, ValveInput, ValveStart,
};
use rayon::prelude::*;
use std::array::from_fn;

/// Segments of the published model.
const SEGMENTS: usize = 3;
/// Keys that one run is differentiated by.
const TOGETHER: usize = 5;
/// Steps in a control period, of the implicit scheme. The published one will not do: at the load-holding valves
/// it chatters within bounds, and its slopes, exact as they are, grow without any.
pub(crate) const STEPS: u32 = 2;

/// What the model shows at the samples of an experiment, in SI units, signals in the order of
/// [`COMPARED`].
pub type Prediction = Vec<[f64; COMPARED.len()]>;

/// What a model starts from: stroke, then the pressures p_PA, p_B, p_PB, p_acc, or p_A and p_B of a valve-controlled
/// crane; last how far off its rest p_A is as an oscillation test begins; none where nothing was measured.
pub(crate) const STARTS: usize = 6;

/// A number that a model can be run over: plain, or with slopes.
pub trait Number: Real {
    /// Whether it has slopes.
    const HAS_SLOPES: bool;

    /// Without slopes.
    fn plain(self) -> f64;

    /// Another value with the same slopes.
    fn at(self, value: f64) -> Self;

    /// The state of rest of a self-contained crane.
    ///
    /// # Errors
    ///
    /// [`EquilibriumError`] where there is none.
    fn rest<const N: usize>(
        crane: &Crane<Self, N>,
        start: &Start<Self>,
    ) -> Result<CraneState<Self, N>, EquilibriumError>;

    /// The state of rest of a valve-controlled crane.
    ///
    /// # Errors
    ///
    /// [`EquilibriumError`] where there is none.
    fn valve_rest<const N: usize>(
        crane: &Crane<Self, N, ValveControlled<Self>>,
        start: &ValveStart<Self>,
    ) -> Result<ValveCraneState<Self, N>, EquilibriumError>;
}

impl Number for f64 {
    const HAS_SLOPES: bool = false;

    fn plain(self) -> f64 {
        self
    }

    fn at(self, value: f64) -> Self {
        value
    }

    fn rest<const N: usize>(
        crane: &Crane<f64, N>,
        start: &Start,
    ) -> Result<CraneState<f64, N>, EquilibriumError> {
        crane.at_rest(start)
    }

    fn valve_rest<const N: usize>(
        crane: &Crane<f64, N, ValveControlled<f64>>,
        start: &ValveStart,
    ) -> Result<ValveCraneState<f64, N>, EquilibriumError> {
        crane.at_rest(start)
    }
}

impl<const P: usize> Number for Dual<f64, P> {
    const HAS_SLOPES: bool = true;

    fn plain(self) -> f64 {
        self.value
    }

    fn at(self, value: f64) -> Self {
        Self { value, ..self }
    }

    fn rest<const N: usize>(
        crane: &Crane<Self, N>,
        start: &Start<Self>,
    ) -> Result<CraneState<Self, N>, EquilibriumError> {
        crane.at_rest_along(start)
    }

    fn valve_rest<const N: usize>(
        crane: &Crane<Self, N, ValveControlled<Self>>,
        start: &ValveStart<Self>,
    ) -> Result<ValveCraneState<Self, N>, EquilibriumError> {
        crane.at_rest_along(start)
    }
}

/// What a model over some numbers shows at the samples of an experiment.
type Shown<T> = Vec<[T; COMPARED.len()]>;

/// Builds a model over some numbers, starts it at rest where the experiment begins, and runs it.
fn shown<T: Number>(
    model: &Description,
    n: &Numbers<T>,
    begin: &[Option<T>; STARTS],
    experiment: &Experiment,
) -> Result<Shown<T>, IdentifyError> {
    let found = model.coordinates();
    match (&experiment.drive, found) {
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

/// The same of a valve-controlled crane.
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
        // what such a circuit has not, no log of it has either
        [T::zero(), a, b, T::zero(), T::zero()]
    })
}

/// The state at rest that an experiment begins with.
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

/// The boom turned, the oil locked in, until p_A is off its rest by a swing \[Pa\].
///
/// A search along a slope that has no slopes itself: where it settles, its slopes have settled too.
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

/// A model's steps. Numbers with slopes follow plain ones: the plain step finds the solution, and one iteration more
/// the slopes at it, at less than half the cost of finding both together.
struct Stepper<'a, T: Number, const N: usize, C: Circuit<T>> {
    crane: &'a Crane<T, N, C>,
    scheme: Implicit<T, C>,
    plain: Crane<f64, N, C::Over<f64>>,
    plain_scheme: Implicit<f64, C::Over<f64>>,
}

/// A state over plain numbers.
type Plain<T, const N: usize, C> =
    CraneState<f64, N, <<C as Circuit<T>>::Over<f64> as Circuit<f64>>::State>;

impl<'a, T: Number, const N: usize, C: Circuit<T>> Stepper<'a, T, N, C> {
    fn new(crane: &'a Crane<T, N, C>) -> Self {
        let plain = crane.over(&mut T::plain);
        let plain_scheme = Implicit::new(&plain);
        Self { crane, scheme: Implicit::new(crane), plain, plain_scheme }
    }

    /// The state a control period later, in as many parts as the steps need to settle; none where they do not.
    fn moved(
        &self,
        state: &CraneState<T, N, C::State>,
        input: &C::Input,
        experiment: &Experiment,
    ) -> Option<CraneState<T, N, C::State>> {
        let mut parts = experiment.steps;
        while parts <= MOST_PARTS {
            let mut trial = *state;
            let step = experiment.period / f64::from(parts);
            if (0..parts).all(|_| self.step(&mut trial, input, step)) {
                return Some(trial);
            }
            parts *= 2;
        }
        None
    }

    /// One step; whether it settled.
    fn step(&self, state: &mut CraneState<T, N, C::State>, input: &C::Input, step: f64) -> bool {
        if !T::HAS_SLOPES {
            let left = self.scheme.step(self.crane, state, input, T::lit(step));
            return has_settled(left.plain());
        }
        let mut second = without_slopes::<T, N, C>(state);
        let plain_input = C::input_over(input, &mut T::plain);
        let (left, first) = self.plain_scheme.stages(&self.plain, &mut second, &plain_input, step);
        let solved = [first, second].map(|stage| with_slopes::<T, N, C>(state, &stage));
        self.scheme.follow(self.crane, state, input, T::lit(step), &solved);
        has_settled(left)
    }
}

fn without_slopes<T: Number, const N: usize, C: Circuit<T>>(
    state: &CraneState<T, N, C::State>,
) -> Plain<T, N, C> {
    let q = C::coordinates(&state.circuit);
    CraneState {
        boom: BoomState {
            angle: state.boom.angle.map(T::plain),
            angular_velocity: state.boom.angular_velocity.map(T::plain),
        },
        bristle: state.bristle.plain(),
        circuit: <C::Over<f64> as Circuit<f64>>::from_coordinates(&Coordinates {
            stiff: q.stiff.map(T::plain),
            slow: q.slow.map(T::plain),
        }),
    }
}

/// A state with the slopes of another one.
fn with_slopes<T: Number, const N: usize, C: Circuit<T>>(
    slopes: &CraneState<T, N, C::State>,
    values: &Plain<T, N, C>,
) -> CraneState<T, N, C::State> {
    let (q, v) = (
        C::coordinates(&slopes.circuit),
        <C::Over<f64> as Circuit<f64>>::coordinates(&values.circuit),
    );
    CraneState {
        boom: BoomState {
            angle: from_fn(|i| slopes.boom.angle[i].at(values.boom.angle[i])),
            angular_velocity: from_fn(|i| {
                slopes.boom.angular_velocity[i].at(values.boom.angular_velocity[i])
            }),
        },
        bristle: slopes.bristle.at(values.bristle),
        circuit: C::from_coordinates(&Coordinates {
            stiff: from_fn(|i| q.stiff[i].at(v.stiff[i])),
            slow: from_fn(|i| q.slow[i].at(v.slow[i])),
        }),
    }
}

/// Runs the model from a state at rest; what it shows at each sample: position, then `pressures`.
fn run<T: Number, const N: usize, C: Circuit<T>>(
    crane: &Crane<T, N, C>,
    mut state: CraneState<T, N, C::State>,
    inputs: impl Iterator<Item = C::Input>,
    experiment: &Experiment,
    pressures: impl Fn(&C, &C::State) -> [T; COMPARED.len() - 1],
) -> Result<Shown<T>, IdentifyError> {
    let stepper = Stepper::new(crane);
    let show = |state: &CraneState<T, N, C::State>| {
        let pose = crane.boom.pose(&state.boom.angle);
        let [pump_a, a, b, pump_b, accumulator] = pressures(&crane.circuit, &state.circuit);
        [crane.boom.cylinder_pose(&pose).stroke, pump_a, a, b, pump_b, accumulator]
    };
    let broken = |k: usize| {
        let time = k as f64 * experiment.period;
        IdentifyError::Broken { log: experiment.name.clone(), time }
    };
    let mut seen = Vec::with_capacity(experiment.samples.len());
    for (k, input) in inputs.enumerate() {
        if k % experiment.every == 0 {
            let now = show(&state);
            if now.iter().any(|v| !v.plain().is_finite()) {
                return Err(broken(k));
            }
            seen.push(now);
        }
        state = stepper.moved(&state, &input, experiment).ok_or_else(|| broken(k))?;
    }
    if seen.len() < experiment.samples.len() {
        seen.push(show(&state));
    }
    Ok(seen)
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
    let begin = from_fn(|k| experiment.beginning[k].map(|v| v + offsets[k]));
    shown(model, &model.numbers, &begin, experiment)
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
