//! Run of the filter along a log, one control period after the other.

use super::input_signals::interval_of;
use super::measurements::{Measurements, Newest};
use super::{ESTIMATES, EstimateRow, INNOVATIONS};
use crate::virtual_estimates::{OF_STATE, quantities};
use hydroboom_control::estimation::error_covariance::{ERRORS, as_variables, output_deviation};
use hydroboom_control::estimation::extended_kalman_filter::{EstimatorInput, EstimatorState};
use hydroboom_control::estimation::reduced_model::state_index::{self, LOAD_PRESSURE, VELOCITY};
use hydroboom_control::estimation::state_estimator::{StateEstimator, StateEstimatorState};
use hydroboom_control::estimation::tip::{TipEstimator, TipMemory};
use hydroboom_math::Dual;
use hydroboom_measurement::Track;

/// Indices of payload, transition pressure, unknown flow and drive lag among the estimates.
pub(crate) const PAYLOAD: usize = 1;
pub(crate) const TRANSITION: usize = 4;
const FLOW: usize = OF_STATE;
pub(crate) const LAG: usize = OF_STATE + 1;
const TIP: usize = OF_STATE + 2;
/// Largest number of rows kept; longer logs are decimated.
const MOST_ROWS: usize = 20_000;
/// Sampling intervals of the position without a sample that count as a gap.
const GAP: f64 = 5.0;
/// Time over which the initial velocity is averaged \[s\]; below [`REST`] the crane is at rest.
const BEGINNING: f64 = 0.1;
/// Velocity below which the crane is at rest \[m/s\].
pub(crate) const REST: f64 = 2e-3;
/// Initial standard deviation of the velocity of a crane in motion \[m/s\], which may oscillate.
const START_IN_MOTION: f64 = 0.02;
/// Time after a start in which load changes are not reported \[s\].
const SETTLING: f64 = 0.5;

/// Input signals of the filter.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    pub(crate) position: &'a Track,
    pub(crate) pressure_a: Option<&'a Track>,
    pub(crate) pressure_b: Option<&'a Track>,
    pub(crate) speed: Option<&'a Track>,
    pub(crate) command: Option<&'a Track>,
    pub(crate) valve: Option<&'a Track>,
    /// Whether speed and command are sampled finely enough for the drive lag.
    pub(crate) identifies_lag: bool,
    pub(crate) begin: f64,
    /// Whether motor speed or command was recorded.
    pub(crate) has_drive: bool,
    /// The filter's period \[s\].
    pub(crate) period: f64,
    pub(crate) periods: usize,
    /// Rod-side area over piston area.
    pub(crate) area_ratio: f64,
    /// Whether pump-side pressures replace those of the cylinder; they are equal while the valve is open.
    pub(crate) is_pump_side: bool,
    /// Payload of the crane file \[kg\].
    pub(crate) payload: f64,
    /// Estimator of the tip position, for a boom that has one.
    pub(crate) tip: Option<TipEstimator<f64>>,
    /// Time for which the mean NIS stays above its threshold after a load change \[s\].
    pub(crate) persistence: f64,
}

impl Source<'_> {
    /// Whether the load pressure was measured.
    pub(crate) fn has_pressure(&self) -> bool {
        self.pressure_a.and(self.pressure_b).is_some()
    }

    /// Log time of the end \[s\].
    pub(crate) fn end(&self) -> f64 {
        self.begin + self.periods as f64 * self.period
    }
}

/// Result of a filter run along a log.
pub(crate) struct Run {
    pub(crate) rows: Vec<EstimateRow>,
    pub(crate) every: usize,
    pub(crate) initial_deviation: [f64; ESTIMATES.len()],
    /// Sum and number of normalised innovations squared, and sum of innovations over their standard
    /// deviations, per signal and window of one second.
    pub(crate) windows: Vec<[(f64, u32, f64); 2]>,
    /// Times at which the mean NIS rose above its threshold \[s\].
    pub(crate) load_changes: Vec<f64>,
    /// Minus twice the log-likelihood.
    pub(crate) cost: f64,
    pub(crate) counted: u64,
    pub(crate) diverged: bool,
    pub(crate) restarts: u32,
    pub(crate) began_in_motion: bool,
    /// Smallest standard deviation of each estimate over its initial one.
    pub(crate) variance_ratio: [f64; ESTIMATES.len()],
}

impl Run {
    /// Minus twice the log-likelihood per measured value.
    pub(crate) fn mean_cost(&self) -> f64 {
        self.cost / self.counted.max(1) as f64
    }

    /// A run that has not begun.
    fn new(source: &Source<'_>) -> Self {
        let samples = source.position.time().len().min(source.periods);
        Self {
            rows: Vec::new(),
            every: samples.div_ceil(MOST_ROWS).max(1),
            initial_deviation: [f64::NAN; ESTIMATES.len()],
            windows: Vec::new(),
            load_changes: Vec::new(),
            cost: 0.0,
            counted: 0,
            diverged: false,
            restarts: 0,
            began_in_motion: false,
            variance_ratio: [f64::INFINITY; ESTIMATES.len()],
        }
    }

    /// Notes a start of the filter in a state, at a motor speed \[rev/s\]; the first one has the initial deviations.
    fn start(
        &mut self,
        estimator: &StateEstimator<f64>,
        source: &Source<'_>,
        begun: &StateEstimatorState<f64>,
        motor_speed: f64,
        is_restart: bool,
    ) {
        if is_restart {
            self.restarts += 1;
            return;
        }
        self.initial_deviation = estimated(estimator, begun, motor_speed).1;
        self.initial_deviation[TIP..]
            .copy_from_slice(&tip_of(source, estimator, &TipMemory::default(), begun).1);
    }

    /// Keeps the estimates of a period.
    fn add_row(
        &mut self,
        estimator: &StateEstimator<f64>,
        source: &Source<'_>,
        state: &StateEstimatorState<f64>,
        tip_memory: &TipMemory<f64>,
        at: &Moment,
    ) {
        let (mut estimate, mut deviation) = estimated(estimator, state, at.motor_speed);
        let (tip, of_tip) = tip_of(source, estimator, tip_memory, state);
        estimate[TIP..].copy_from_slice(&tip);
        deviation[TIP..].copy_from_slice(&of_tip);
        if !source.has_drive {
            estimate[LAG] = f64::NAN;
        }
        for (ratio, (now, initial)) in
            self.variance_ratio.iter_mut().zip(deviation.iter().zip(&self.initial_deviation))
        {
            *ratio = ratio.min(now / initial);
        }
        let of = |k: usize, value: f64| if at.is_good[k] { value } else { f64::NAN };
        let filter = &state.filter;
        self.rows.push(EstimateRow {
            time: at.time,
            is_held: at.is_held,
            estimate: std::array::from_fn(|k| estimate[k] / ESTIMATES[k].1),
            deviation: std::array::from_fn(|k| deviation[k] / ESTIMATES[k].1),
            innovation: std::array::from_fn(|k| of(k, filter.innovation[k] / INNOVATIONS[k].1)),
            innovation_deviation: std::array::from_fn(|k| {
                let deviation = filter.innovation[k].abs() / filter.nis[k].sqrt();
                of(k, deviation / INNOVATIONS[k].1)
            }),
            mean_nis: filter.mean_nis,
        });
    }
}

/// A control period of which the estimates are kept.
struct Moment {
    /// Time of the log \[s\].
    time: f64,
    /// Motor speed \[rev/s\].
    motor_speed: f64,
    /// Whether the load-holding valve was shut.
    is_held: bool,
    /// Whether position and load pressure were measured.
    is_good: [bool; 2],
}

/// Test for load changes: the mean NIS stays above its threshold.
struct LoadChangeTest {
    /// Time at which the filter was initialised \[s\].
    begun_at: f64,
    /// Time since which the mean NIS has been above its threshold \[s\].
    above_since: f64,
    is_reported: bool,
}

impl LoadChangeTest {
    fn new(begin: f64) -> Self {
        Self { begun_at: begin, above_since: begin, is_reported: false }
    }

    /// Time of a load change \[s\], once it has lasted for `persistence` \[s\]. Shortly after a start none is reported.
    fn found(&mut self, is_above: bool, time: f64, persistence: f64) -> Option<f64> {
        if !is_above {
            self.above_since = time;
            self.is_reported = false;
            return None;
        }
        let lasts = time - self.above_since > persistence;
        if self.is_reported || !lasts {
            return None;
        }
        self.is_reported = true;
        (self.above_since - self.begun_at > SETTLING).then_some(self.above_since)
    }
}

/// Time range that includes all samples.
pub(crate) const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// Runs the filter through a log. `late` \[s\] is the assumed delay of position and pressure. `keeps_rows`
/// selects the rows that are kept. The likelihood uses samples taken from `scored[0]` to `scored[1]` \[s\],
/// the same ones for every assumed delay.
pub(crate) fn run(
    estimator: &StateEstimator<f64>,
    source: &Source<'_>,
    late: [f64; 2],
    scored: [f64; 2],
    keeps_rows: bool,
) -> Run {
    let period = estimator.filter.period;
    let mut run = Run::new(source);
    let gap = GAP * interval_of(Some(source.position)).max(period);
    let test = &estimator.filter.innovation_test;
    let mut measurements = Measurements::new(source, late);
    let mut state: Option<StateEstimatorState<f64>> = None;
    let mut tip_memory = TipMemory::default();
    let mut load_changes = LoadChangeTest::new(source.begin);
    let (mut seen, mut has_begun, mut last_speed, mut sampled) = (source.begin, false, 0.0, 0);
    for k in 0..=source.periods {
        let time = source.begin + k as f64 * period;
        let is_held = source.valve.and_then(|v| v.held(time - period)).is_some_and(|v| v < 0.5);
        let newest = measurements.newest(source, time + 0.25 * period, is_held);
        let Newest { position, pressure, times } = newest;
        let is_scored = times.map(|at| at.is_some_and(|at| (scored[0]..=scored[1]).contains(&at)));
        if position.is_some() || pressure.is_some() {
            seen = time;
        } else if time - seen > gap && state.is_some() {
            state = None;
            measurements.forget();
        }
        let commanded = source.command.and_then(|command| command.held(time - period));
        let predicted = || {
            let state = state.as_ref().filter(|_| commanded.is_some())?;
            Some(estimator.predicted_speed(state))
        };
        let read = source.speed.and_then(|speed| speed.at(time));
        let speed = read.or_else(predicted).unwrap_or(last_speed);
        last_speed = speed;
        let Some(input) = measurements.input(estimator, source, &newest, speed) else { continue };
        let Some(filter) = &mut state else {
            let begun = begin(estimator, source, &input, time, &mut run.began_in_motion);
            run.start(estimator, source, &begun, speed, has_begun);
            has_begun = true;
            load_changes.begun_at = time;
            state = Some(begun);
            tip_memory = TipMemory::default();
            continue;
        };
        match is_held {
            true => estimator.hold(filter, &input),
            // without a recorded command the lag is not identifiable: the speed stands for the command
            false => estimator.update(filter, &input, commanded.unwrap_or(speed)),
        }
        if let Some(tip) = source.tip {
            tip.update(&mut tip_memory, &estimator.filter, &filter.filter);
        }
        if !source.identifies_lag {
            filter.drive = estimator.drive.start(estimator.drive_coefficient);
        }
        let is_good = [position.is_some(), pressure.is_some()].map(|good| good && !is_held);
        count(&mut run, &filter.filter, is_good, is_scored, time - source.begin);
        let is_above = filter.filter.mean_nis > test.threshold && !is_held;
        run.load_changes.extend(load_changes.found(is_above, time, source.persistence));
        run.diverged |= estimator.filter.has_diverged(&filter.filter);
        let is_sampled =
            position.is_some() || (pressure.is_some() && source.position.at(time).is_none());
        sampled += usize::from(is_sampled);
        if keeps_rows && is_sampled && sampled % run.every == 0 {
            let at = Moment { time, motor_speed: speed, is_held, is_good };
            run.add_row(estimator, source, filter, &tip_memory, &at);
        }
        // a filter with non-finite estimates is initialised again
        if !filter.filter.estimate.to_array().into_iter().all(f64::is_finite) {
            run.diverged = true;
            state = None;
        }
    }
    for (k, initial) in run.initial_deviation.iter_mut().enumerate() {
        *initial /= ESTIMATES[k].1;
    }
    run
}

/// Initial filter state. A crane in motion starts with its velocity; without a load pressure the payload is
/// unknown.
fn begin(
    estimator: &StateEstimator<f64>,
    source: &Source<'_>,
    input: &EstimatorInput<f64>,
    time: f64,
    in_motion: &mut bool,
) -> StateEstimatorState<f64> {
    let mut state = estimator.start(input);
    let filter = &mut state.filter;
    let mut widen = |place: usize, deviation: f64| {
        filter.covariance[place][place] = deviation * deviation;
        filter.errors[place][place] = deviation * deviation;
    };
    if !source.has_pressure() {
        widen(LOAD_PRESSURE, estimator.filter.force_change);
        widen(state_index::PAYLOAD, estimator.filter.payload_change);
    }
    if let (Some(x0), Some(x1)) = (source.position.at(time), source.position.at(time + BEGINNING)) {
        let velocity = (x1 - x0) / BEGINNING;
        if velocity.abs() > REST {
            *in_motion = true;
            widen(VELOCITY, START_IN_MOTION.max(0.2 * velocity.abs()));
            filter.estimate.velocity = velocity;
        }
    }
    state
}

/// Accumulates the innovations of the measured signals.
fn count(
    run: &mut Run,
    filter: &EstimatorState<f64>,
    is_good: [bool; 2],
    is_scored: [bool; 2],
    since: f64,
) {
    let window = since.max(0.0) as usize;
    while run.windows.len() <= window {
        run.windows.push([(0.0, 0, 0.0); 2]);
    }
    for (k, is_good) in is_good.into_iter().enumerate() {
        let (nu, nis) = (filter.innovation[k], filter.nis[k]);
        if !is_good || nis <= 0.0 || nis.is_nan() {
            continue;
        }
        let (sum, number, bias) = &mut run.windows[window][k];
        *sum += nis;
        *number += 1;
        *bias += nis.sqrt().copysign(nu);
        if is_scored[k] {
            run.cost += nis + (nu * nu / nis).ln();
            run.counted += 1;
        }
    }
}

/// Estimates and their standard deviations in SI units.
fn estimated(
    estimator: &StateEstimator<f64>,
    state: &StateEstimatorState<f64>,
    motor_speed: f64,
) -> ([f64; ESTIMATES.len()], [f64; ESTIMATES.len()]) {
    let (settings, filter) = (&estimator.filter, &state.filter);
    let constant = Dual::<f64, ERRORS>::constant;
    let (model, z) = as_variables(&settings.model, &filter.estimate);
    let found = quantities(&model, &z, constant(motor_speed), constant(state.rod_side_term));
    let (mut estimate, mut deviation) = ([0.0; ESTIMATES.len()], [0.0; ESTIMATES.len()]);
    let all = std::iter::once(model.piston(&z)).chain(found);
    for (k, h) in all.enumerate() {
        (estimate[k], deviation[k]) = (h.value, output_deviation(&filter.errors, &h.slope));
    }
    deviation[PAYLOAD] = settings.payload_deviation(filter);
    // from a motor speed to a flow
    estimate[FLOW] *= settings.model.displacement;
    deviation[FLOW] *= settings.model.displacement;
    let (lag, period) = (&state.drive, settings.period);
    estimate[LAG] = lag.time_constant(period);
    // magnitude of d tau/dg = −tau²/(T (1 − g))
    deviation[LAG] =
        lag.variance.max(0.0).sqrt() * estimate[LAG].powi(2) / (period * (1.0 - lag.coefficient));
    (estimate, deviation)
}

/// Position of the tip relative to the boom's bearing, and its standard deviation \[m\]; NaN if it is not
/// estimated.
fn tip_of(
    source: &Source<'_>,
    estimator: &StateEstimator<f64>,
    memory: &TipMemory<f64>,
    state: &StateEstimatorState<f64>,
) -> ([f64; 2], [f64; 2]) {
    let found = source.tip.map(|tip| tip.estimate(memory, &estimator.filter.model, &state.filter));
    found.map_or(([f64::NAN; 2], [f64::NAN; 2]), |tip| {
        ([tip.x, tip.y], [tip.deviation_x, tip.deviation_y])
    })
}
