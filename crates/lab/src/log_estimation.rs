//! Extended Kalman filter on a recorded log: states and parameters with their bounds over time.
//!
//! The filter steps with its own control period. A sample is used in the period in which it was taken, and
//! the newest one if there are several. In a period without a sample, as in a log with a longer interval,
//! the filter predicts. Missing values are not filled in. A gap, in which neither position nor pressure was
//! recorded, ends an estimate, and the filter is initialised again after it.

use crate::LabError;
use crate::log_verdict::{Verdict, delay, is_consistent, likeliest_noise, noise_findings, verdict};
use crate::virtual_estimates::{OF_STATE, quantities};
use hydroboom_control::estimation::error_covariance::{ERRORS, as_variables, output_deviation};
use hydroboom_control::estimation::extended_kalman_filter::EstimatorInput;
use hydroboom_control::estimation::reduced_model::state_index::{self, LOAD_PRESSURE, VELOCITY};
use hydroboom_control::estimation::state_estimator::{StateEstimator, StateEstimatorState};
use hydroboom_control::estimation::tip::{TipEstimator, TipMemory};
use hydroboom_description::Description;
use hydroboom_description::schema::CircuitChoice;
use hydroboom_design::scheduled_lqr::{designed, known_delay};
use hydroboom_design::tip::tip_estimator;
use hydroboom_design::unknown_flow::{UnknownFlowPrior, unknown_flow_estimator};
use hydroboom_math::Dual;
use hydroboom_measurement::{Signal, Signals, TimeBase, Track};

/// Estimated quantities: names ending in their units, and these units in SI units.
pub const ESTIMATES: [(&str, f64); OF_STATE + 4] = [
    ("piston_position_mm", 1e-3),
    ("payload_kg", 1.0),
    ("load_pressure_bar", 1e5),
    ("piston_velocity_mm_s", 1e-3),
    ("transition_pressure_bar", 1e5),
    ("friction_n", 1.0),
    ("disturbance_bar", 1e5),
    ("unknown_flow_l_min", 1e-3 / 60.0),
    ("drive_lag_ms", 1e-3),
    ("tip_x_mm", 1e-3),
    ("tip_y_mm", 1e-3),
];
/// Innovations: names ending in their units, and these units in SI units.
pub const INNOVATIONS: [(&str, f64); 2] = [("position_mm", 1e-3), ("load_pressure_bar", 1e5)];
/// Indices of payload, transition pressure, unknown flow and drive lag among the estimates.
pub(crate) const PAYLOAD: usize = 1;
pub(crate) const TRANSITION: usize = 4;
const FLOW: usize = OF_STATE;
pub(crate) const LAG: usize = OF_STATE + 1;
const TIP: usize = OF_STATE + 2;
/// Largest number of rows kept; longer logs are decimated.
const MOST_ROWS: usize = 20_000;
/// Longest log \[control periods\]: a day at 1 ms.
const MOST_PERIODS: f64 = 9e7;
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
/// Longest interval of a log \[control periods\] from which the drive lag is identified.
const FINE: f64 = 1.5;

/// Estimates at one time in the units of [`ESTIMATES`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimateRow {
    /// Time of the log \[s\].
    pub time: f64,
    /// Whether the load-holding valve was shut.
    pub is_held: bool,
    /// Estimates.
    pub estimate: [f64; ESTIMATES.len()],
    /// Their standard deviations.
    pub deviation: [f64; ESTIMATES.len()],
    /// Innovations in the units of [`INNOVATIONS`]; NaN without a measurement.
    pub innovation: [f64; 2],
    /// Their standard deviations by the filter.
    pub innovation_deviation: [f64; 2],
    /// Mean of the normalised innovation squared \[1\].
    pub mean_nis: f64,
}

/// The filter's estimates along a log.
#[derive(Clone, Debug)]
pub struct LogEstimate {
    /// Log time at which the estimates begin \[s\].
    pub begin: f64,
    /// Duration of the estimates \[s\].
    pub duration: f64,
    /// The filter's period \[s\].
    pub period: f64,
    /// Median interval of the log's position and pressure \[s\].
    pub interval: [f64; 2],
    /// Standard deviations of position \[m\] and load pressure \[Pa\] that the filter assumes.
    pub noise: [f64; 2],
    /// Prior of the unknown flow of a valve-controlled crane.
    pub unknown_flow_prior: Option<UnknownFlowPrior>,
    /// Estimates at the samples of the log, decimated for a long log.
    pub rows: Vec<EstimateRow>,
    /// Standard deviations at the start, in the units of [`ESTIMATES`].
    pub initial_deviation: [f64; ESTIMATES.len()],
    /// Verdict from innovations, other signals and bounds.
    pub verdict: Verdict,
    /// Remarks on the use of the log.
    pub remarks: Vec<String>,
}

impl LogEstimate {
    /// Last estimates while the valve was open; the last of all if it never was.
    pub fn last_released(&self) -> Option<&EstimateRow> {
        self.rows.iter().rev().find(|row| !row.is_held).or(self.rows.last())
    }

    /// Heading for [`last_released`](Self::last_released).
    pub fn last_heading(&self) -> String {
        match (self.last_released(), self.rows.last()) {
            (Some(row), Some(last)) if row.time < last.time => {
                format!("at {:.2} s, before the load was held", row.time)
            }
            _ => "at the end".into(),
        }
    }
}

/// Estimates along a log of the described crane: `signals` in SI units, from `from` to `to` \[s\] of the
/// log's time.
///
/// The piston's position is required. Load pressure, motor speed, its command and the load-holding valve
/// are used if recorded.
///
/// ```
/// use hydroboom_description::Description;
/// use hydroboom_lab::log_estimation::estimate;
/// use hydroboom_measurement::{Signal, Signals, Track};
/// # let time: Vec<f64> = (0..2000).map(|k| 1e-3 * f64::from(k)).collect();
/// # let all = |value: f64| vec![value; time.len()];
/// # let (stroke_m, p_a_pa, p_b_pa, motor_rev_s) = (all(0.2), all(75e5), all(3e5), all(0.0));
/// let crane = Description::uia_single_boom()?;
/// let mut signals = Signals::default();
/// signals.insert(Signal::Stroke, Track::new(&time, &stroke_m));
/// signals.insert(Signal::PressureA, Track::new(&time, &p_a_pa));
/// signals.insert(Signal::PressureB, Track::new(&time, &p_b_pa));
/// signals.insert(Signal::MotorSpeed, Track::new(&time, &motor_rev_s));
/// let estimated = estimate(&crane, &signals, (None, None))?;
/// let last = &estimated.rows[estimated.rows.len() - 1];
/// println!("payload {:.0} kg +- {:.0} kg", last.estimate[1], 2.0 * last.deviation[1]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// [`LabError::Input`] if there is no position, or less than 0.1 s of it; [`LabError::Design`] if the crane
/// file gives no reduced model.
pub fn estimate(
    description: &Description,
    signals: &Signals,
    (from, to): (Option<f64>, Option<f64>),
) -> Result<LogEstimate, LabError> {
    let refused = |reason: String| LabError::Input { file: "the log".into(), reason };
    let position = signals.get(Signal::Stroke).ok_or_else(|| {
        refused("has no piston position, without which nothing can be estimated".into())
    })?;
    let mut remarks = Vec::new();
    let has_motor =
        [Signal::MotorSpeed, Signal::MotorCommand].iter().any(|s| signals.get(*s).is_some());
    let (mut estimator, unknown_flow_prior) = match description.choices.circuit {
        CircuitChoice::SelfContained => {
            let estimator = designed(description, known_delay(description) as usize)?.0;
            match has_motor {
                true => (estimator, None),
                false => {
                    let (estimator, spread) = with_unknown_pump(description, estimator);
                    (estimator, Some(spread))
                }
            }
        }
        CircuitChoice::ValveControlled => {
            let (estimator, spread) = unknown_flow_estimator(description)?;
            (estimator, Some(spread))
        }
    };
    let pressure_a = substitute(signals, Signal::PressureA, Signal::PressurePumpA, &mut remarks);
    let pressure_b = substitute(signals, Signal::PressureB, Signal::PressurePumpB, &mut remarks);
    let (first, last) = (position.time()[0], position.time()[position.time().len() - 1]);
    let (begin, end) = (from.map_or(first, |t| t.max(first)), to.map_or(last, |t| t.min(last)));
    let interval = |track: Option<&Track>| {
        track.and_then(|t| TimeBase::of(t.time())).map_or(f64::NAN, |base| base.interval)
    };
    let interval = [interval(Some(position)), interval(pressure_a)];
    let period = estimator.filter.period;
    if !(end - begin >= 0.1 && (end - begin) / period < MOST_PERIODS) {
        return Err(refused(format!(
            "has a position from {first:.3} to {last:.3} s, of which {begin:.3} to {end:.3} s is left; a tenth of a second is needed, and a day at most"
        )));
    }
    let steps = interval.map(|interval| (interval / period).max(1.0));
    // the time constant of the innovation test counts measurements: it is scaled to the log's interval
    estimator.filter.innovation_test.time_constant /=
        if steps[1].is_finite() { 0.5 * (steps[0] + steps[1]) } else { steps[0] };
    let area_ratio = description.cylinder().area_ratio();
    let load_pressure: Vec<f64> = match (pressure_a, pressure_b) {
        (Some(a), Some(b)) => {
            let pairs = a.time().iter().zip(a.values());
            pairs.filter_map(|(time, a)| Some(a - area_ratio * b.at(*time)?)).collect()
        }
        _ => Vec::new(),
    };
    let found = [scatter(position.values()), scatter(&load_pressure)];
    for (noise, found) in estimator.filter.measurement_noise.iter_mut().zip(found) {
        *noise = noise.max(found);
    }
    estimator.filter.sensor_lag += position.filter();
    let speed = signals.get(Signal::MotorSpeed).filter(|_| unknown_flow_prior.is_none());
    let command = signals.get(Signal::MotorCommand).filter(|_| unknown_flow_prior.is_none());
    let is_fine = |track: Option<&Track>| interval_of(track) <= FINE * period;
    let identifies_lag = is_fine(speed) && is_fine(command);
    remark_on_drive(unknown_flow_prior, speed, command, identifies_lag, &mut remarks);
    let valve = signals.get(Signal::HoldingValve);
    if valve.is_none() && unknown_flow_prior.is_none() {
        remarks.push("the load-holding valve was not logged: it is taken as open".into());
    }
    remark_on_sampling(&interval, period, &mut remarks);
    let source = Source {
        position,
        pressure_a,
        pressure_b,
        speed,
        command: command.filter(|_| identifies_lag || speed.is_none()),
        identifies_lag,
        has_drive: unknown_flow_prior.is_none(),
        valve,
        begin,
        period,
        periods: ((end - begin) / period).floor() as usize,
        area_ratio,
        is_pump_side: signals.get(Signal::PressureA).is_none(),
        payload: description.numbers.payload,
        tip: tip_estimator(description).filter(|_| unknown_flow_prior.is_none()),
        persistence: 2.0 * description.numbers.tuning.estimator_nis_time,
    };
    let mut found = run(&estimator, &source, [0.0; 2], ALL, true);
    let mut noisy = Vec::new();
    if is_consistent(&found) == Some(false) {
        // either a signal is delayed or noisier than expected: the more likely cause is used
        let late = delay(&estimator, &source).map_or(0.0, |delay| delay.gain);
        let (noise, gain) = likeliest_noise(&estimator, &source);
        if gain > late {
            noisy = noise_findings(estimator.filter.measurement_noise, noise);
            estimator.filter.measurement_noise = noise;
            found = run(&estimator, &source, [0.0; 2], ALL, true);
        }
    }
    let run = found;
    if run.rows.is_empty() {
        return Err(refused(
            "never has position and pressure at the same time: nothing was estimated".into(),
        ));
    }
    if run.restarts > 0 {
        remarks.push(format!(
            "after {} gap{} the filter began anew",
            run.restarts,
            if run.restarts == 1 { "" } else { "s" }
        ));
    }
    if run.began_in_motion {
        remarks.push("it begins in motion: the first second counts little".into());
    }
    if run.every > 1 {
        remarks.push(format!("the estimates of one in {} samples are kept", run.every));
    }
    let mut verdict = verdict(description, signals, &estimator, &source, &run);
    verdict.findings.extend(noisy);
    Ok(LogEstimate {
        begin,
        duration: end - begin,
        period,
        interval,
        noise: estimator.filter.measurement_noise,
        unknown_flow_prior,
        initial_deviation: run.initial_deviation,
        rows: run.rows,
        verdict,
        remarks,
    })
}

/// Estimator for a log without motor speed: the unknown flow may be any that the motor allows.
fn with_unknown_pump(
    description: &Description,
    mut estimator: StateEstimator<f64>,
) -> (StateEstimator<f64>, UnknownFlowPrior) {
    let n = &description.numbers;
    let filter = &mut estimator.filter;
    // a motion's ramp takes the motor to its speed, which determines the random walk
    let (largest, drift) = (n.motor_speed, n.motor_speed / n.ramp.sqrt());
    filter.initial_deviation.unknown_flow = largest;
    filter.process_noise.unknown_flow = drift;
    (filter.lowest.unknown_flow, filter.highest.unknown_flow) = (-largest, largest);
    let flow = filter.model.displacement;
    (estimator, UnknownFlowPrior { initial_deviation: largest * flow, random_walk: drift * flow })
}

fn interval_of(track: Option<&Track>) -> f64 {
    track.and_then(|t| TimeBase::of(t.time())).map_or(f64::INFINITY, |base| base.interval)
}

/// A pressure signal, or that on the pump side of the open valve if it was not recorded.
fn substitute<'a>(
    signals: &'a Signals,
    wanted: Signal,
    beside: Signal,
    remarks: &mut Vec<String>,
) -> Option<&'a Track> {
    if let Some(track) = signals.get(wanted) {
        return Some(track);
    }
    let (name, other) = (wanted.symbol(), beside.symbol());
    let found = signals.get(beside);
    remarks.push(match found {
        Some(_) => format!(
            "{name} was not recorded: {other} stands for it, which is the same only while the valve between them is open"
        ),
        None => format!(
            "{name} was not recorded, and neither was {other}: the load pressure is not measured"
        ),
    });
    found
}

fn remark_on_drive(
    unknown_flow_prior: Option<UnknownFlowPrior>,
    speed: Option<&Track>,
    command: Option<&Track>,
    identifies_lag: bool,
    remarks: &mut Vec<String>,
) {
    if let Some(spread) = unknown_flow_prior {
        remarks.push(format!(
            "no motor speed tells the flow: the flow into the piston side is an unknown input, with a standard deviation of {:.1} l/min at the start and a \
             change of {:.1} l/min in a second",
            spread.initial_deviation * 60e3,
            spread.random_walk * 60e3
        ));
        return;
    }
    match (speed, command) {
        (None, Some(_)) => remarks.push("the motor's speed was not recorded: it is predicted from its command".into()),
        (Some(_), None) => remarks.push("the motor's command was not recorded: the drive lag is that of the crane file".into()),
        (Some(_), Some(_)) if !identifies_lag => remarks.push(
            "motor speed and command were recorded too rarely for a drive lag: it is that of the crane file".into(),
        ),
        _ => {}
    }
}

fn remark_on_sampling(interval: &[f64; 2], period: f64, remarks: &mut Vec<String>) {
    let ratio = interval[0] / period;
    if (ratio - 1.0).abs() > 0.05 {
        let how = match ratio > 1.0 {
            true => "between samples the filter predicts",
            false => "the newest sample of a period counts",
        };
        remarks.push(format!(
            "the log has a position every {:.3} ms, the filter a period of {:.3} ms: {how}",
            interval[0] * 1e3,
            period * 1e3
        ));
    }
}

/// Standard deviation of a signal's noise from its third differences, whose variance is 20 times that of
/// white noise. The median makes it insensitive to motion.
fn scatter(values: &[f64]) -> f64 {
    let mut sizes: Vec<f64> =
        values.windows(4).map(|v| (v[3] - 3.0 * v[2] + 3.0 * v[1] - v[0]).abs()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
    // half of a normal distribution is within 0.6745 standard deviations
    median / 0.6745 / 20_f64.sqrt()
}

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

impl Run {
    /// Minus twice the log-likelihood per measured value.
    pub(crate) fn mean_cost(&self) -> f64 {
        self.cost / self.counted.max(1) as f64
    }
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

/// Iterator over the samples of a signal.
struct Samples<'a> {
    track: &'a Track,
    next: usize,
}

impl<'a> Samples<'a> {
    fn new(track: &'a Track, from: f64) -> Self {
        Self { track, next: track.time().partition_point(|t| *t < from) }
    }

    /// Time and value of the newest unused sample up to a time \[s\].
    fn newest(&mut self, until: f64) -> Option<(f64, f64)> {
        let before = self.next;
        while self.track.time().get(self.next).is_some_and(|t| *t <= until) {
            self.next += 1;
        }
        let last = self.next.checked_sub(1).filter(|_| self.next > before)?;
        Some((self.track.time()[last], self.track.values()[last]))
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
    let samples = source.position.time().len().min(source.periods);
    let every = samples.div_ceil(MOST_ROWS).max(1);
    let mut run = Run {
        rows: Vec::new(),
        every,
        initial_deviation: [f64::NAN; ESTIMATES.len()],
        windows: Vec::new(),
        load_changes: Vec::new(),
        cost: 0.0,
        counted: 0,
        diverged: false,
        restarts: 0,
        began_in_motion: false,
        variance_ratio: [f64::INFINITY; ESTIMATES.len()],
    };
    let gap = GAP * interval_of(Some(source.position)).max(period);
    let threshold = estimator.filter.innovation_test.threshold;
    let mut positions = Samples::new(source.position, source.begin + late[0]);
    let mut pressures = source.pressure_a.map(|t| Samples::new(t, source.begin + late[1]));
    let mut state: Option<StateEstimatorState<f64>> = None;
    let mut tip_memory = TipMemory::default();
    let (mut last_position, mut last_pressure) = (None, None);
    let (mut seen, mut has_begun) = (source.begin, false);
    let (mut above_since, mut is_reported) = (source.begin, false);
    let mut begun_at = source.begin;
    let (mut last_speed, mut sampled) = (0.0, 0_usize);
    for k in 0..=source.periods {
        let time = source.begin + k as f64 * period;
        let until = time + 0.25 * period;
        let is_held = source.valve.and_then(|v| v.held(time - period)).is_some_and(|v| v < 0.5);
        let newest = positions.newest(until + late[0]);
        let newest_pressure =
            pressures.as_mut().and_then(|samples| samples.newest(until + late[1]));
        let position = newest.map(|(_, x)| x);
        let pressure = newest_pressure.and_then(|(at, a)| {
            let b = source.pressure_b?.at(at)?;
            Some((a - source.area_ratio * b, source.area_ratio * b))
        });
        // a shut valve separates the pump side from the cylinder
        let pressure = pressure.filter(|_| !(is_held && source.is_pump_side));
        let is_scored = [newest, newest_pressure]
            .map(|sample| sample.is_some_and(|(at, _)| (scored[0]..=scored[1]).contains(&at)));
        last_position = position.or(last_position);
        last_pressure = pressure.or(last_pressure);
        if position.is_some() || pressure.is_some() {
            seen = time;
        } else if time - seen > gap && state.is_some() {
            state = None;
            (last_position, last_pressure) = (None, None);
        }
        let read = source.speed.and_then(|speed| speed.at(time));
        let told = source.command.and_then(|command| command.held(time - period));
        let speed = match (read, &state) {
            (Some(speed), _) => speed,
            (None, Some(state)) if told.is_some() => estimator.predicted_speed(state),
            _ => last_speed,
        };
        last_speed = speed;
        let Some(x) = last_position else { continue };
        let model = &estimator.filter.model;
        // without a load pressure signal that of the crane file's payload is used
        let (p, rod_side_term) = match (last_pressure, source.pressure_a.and(source.pressure_b)) {
            (Some(last), _) => last,
            (None, None) => (model.at(x, source.payload).holding_pressure, 0.0),
            // the first pressure sample is still to come
            (None, Some(_)) => continue,
        };
        let number = |is: bool| f64::from(u8::from(is));
        let input = EstimatorInput {
            position: x,
            position_is_good: number(position.is_some()),
            load_pressure: p,
            load_pressure_is_good: number(pressure.is_some()),
            rod_side_term,
            motor_speed: speed,
        };
        let Some(filter) = &mut state else {
            let begun = begin(estimator, source, &input, time, &mut run.began_in_motion);
            run.restarts += u32::from(has_begun);
            if !has_begun {
                run.initial_deviation = estimated(estimator, &begun, speed).1;
                run.initial_deviation[TIP..]
                    .copy_from_slice(&tip_of(source, estimator, &TipMemory::default(), &begun).1);
            }
            (has_begun, begun_at) = (true, time);
            state = Some(begun);
            tip_memory = TipMemory::default();
            continue;
        };
        match is_held {
            true => estimator.hold(filter, &input),
            // without a recorded command the lag is not identifiable: the speed stands for the command
            false => estimator.update(filter, &input, told.unwrap_or(speed)),
        }
        if let Some(tip) = source.tip {
            tip.update(&mut tip_memory, &estimator.filter, &filter.filter);
        }
        if !source.identifies_lag {
            filter.drive = estimator.drive.start(estimator.drive_coefficient);
        }
        let is_good = [position.is_some(), pressure.is_some()].map(|good| good && !is_held);
        count(&mut run, &filter.filter, is_good, is_scored, time - source.begin);
        let is_above = filter.filter.mean_nis > threshold;
        if !is_above || is_held {
            above_since = time;
            is_reported = false;
        } else if !is_reported && time - above_since > source.persistence {
            is_reported = true;
            if above_since - begun_at > SETTLING {
                run.load_changes.push(above_since);
            }
        }
        run.diverged |= estimator.filter.has_diverged(&filter.filter);
        let is_sampled =
            position.is_some() || (pressure.is_some() && source.position.at(time).is_none());
        sampled += usize::from(is_sampled);
        if keeps_rows && is_sampled && sampled % every == 0 {
            let (mut estimate, mut deviation) = estimated(estimator, filter, speed);
            let (tip, of_tip) = tip_of(source, estimator, &tip_memory, filter);
            estimate[TIP..].copy_from_slice(&tip);
            deviation[TIP..].copy_from_slice(&of_tip);
            if !source.has_drive {
                estimate[LAG] = f64::NAN;
            }
            for (ratio, (now, initial)) in
                run.variance_ratio.iter_mut().zip(deviation.iter().zip(&run.initial_deviation))
            {
                *ratio = ratio.min(now / initial);
            }
            let of = |k: usize, value: f64| if is_good[k] { value } else { f64::NAN };
            let filter = &filter.filter;
            run.rows.push(EstimateRow {
                time,
                is_held,
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
    filter: &hydroboom_control::estimation::extended_kalman_filter::EstimatorState<f64>,
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

/// Name of an estimate without its unit, for tables.
pub fn readable(name: &str) -> String {
    let cut = ["_mm_s", "_mm", "_kg", "_bar", "_n", "_l_min", "_ms"];
    let bare = cut.iter().find_map(|unit| name.strip_suffix(unit)).unwrap_or(name);
    bare.replace('_', " ")
}

/// Unit in an estimate's name.
pub fn unit(name: &str) -> &'static str {
    const UNITS: [(&str, &str); 7] = [
        ("_mm_s", "mm/s"),
        ("_mm", "mm"),
        ("_kg", "kg"),
        ("_bar", "bar"),
        ("_l_min", "l/min"),
        ("_ms", "ms"),
        ("_n", "N"),
    ];
    UNITS.iter().find(|(end, _)| name.ends_with(end)).map_or("", |(_, unit)| unit)
}
