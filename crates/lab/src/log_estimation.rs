//! Extended Kalman filter on a recorded log: states and parameters with their bounds over time.
//!
//! The filter steps with its own control period. A sample is used in the period in which it was taken, and
//! the newest one if there are several. In a period without a sample, as in a log with a longer interval,
//! the filter predicts. Missing values are not filled in. A gap, in which neither position nor pressure was
//! recorded, ends an estimate, and the filter is initialised again after it.

pub(crate) mod filter_run;
mod input_signals;
mod measurements;

use crate::LabError;
use crate::log_verdict::likelihood::{delay, likeliest_noise, noise_findings};
use crate::log_verdict::{SignalFinding, Verdict, is_consistent, verdict};
use crate::virtual_estimates::OF_STATE;
use filter_run::{ALL, Run, Source, run};
use hydroboom_control::estimation::extended_kalman_filter::ExtendedKalmanFilter;
use hydroboom_control::estimation::state_estimator::StateEstimator;
use hydroboom_description::Description;
use hydroboom_description::schema::CircuitChoice;
use hydroboom_design::scheduled_lqr::{designed, known_delay};
use hydroboom_design::tip::tip_estimator;
use hydroboom_design::unknown_flow::{UnknownFlowPrior, unknown_flow_estimator};
use hydroboom_measurement::{Signal, Signals, TimeBase, Track};
use input_signals::{
    interval_of, load_pressures, remark_on_drive, remark_on_sampling, scatter, substitute,
    with_unknown_pump,
};

/// Estimated quantities: name, which ends in the display unit, and the size of that unit in SI units.
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
/// Innovations of the measured signals: name, which ends in the display unit, and the size of that unit in SI units.
pub const INNOVATIONS: [(&str, f64); 2] = [("position_mm", 1e-3), ("load_pressure_bar", 1e5)];
/// Longest log \[control periods\]: a day at 1 ms.
const MOST_PERIODS: f64 = 9e7;
/// Longest interval of a log \[control periods\] from which the drive lag is identified.
const FINE: f64 = 1.5;

/// Estimates of the filter at one time of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimateRow {
    /// Time of the log \[s\].
    pub time: f64,
    /// Whether the load-holding valve was shut.
    pub is_held: bool,
    /// Estimates, in the order and the units of [`ESTIMATES`].
    pub estimate: [f64; ESTIMATES.len()],
    /// Standard deviations of the estimates, in the same order and units.
    pub deviation: [f64; ESTIMATES.len()],
    /// Innovations, in the order and the units of [`INNOVATIONS`]; NaN without a measurement.
    pub innovation: [f64; 2],
    /// Standard deviations of the innovations by the filter, in the same units.
    pub innovation_deviation: [f64; 2],
    /// Mean normalised innovation squared (NIS) \[-\]; 1 for a consistent filter.
    pub mean_nis: f64,
}

/// Estimates of the filter along a log, with their verdict.
#[derive(Clone, Debug)]
pub struct LogEstimate {
    /// Log time at which the estimates begin \[s\].
    pub begin: f64,
    /// Duration of the estimates \[s\].
    pub duration: f64,
    /// Control period of the filter \[s\].
    pub period: f64,
    /// Median sampling intervals of the log's position and piston-side pressure \[s\]; NaN for a missing signal.
    pub interval: [f64; 2],
    /// Standard deviations of position \[m\] and load pressure \[Pa\] that the filter assumes.
    pub noise: [f64; 2],
    /// Prior of the unknown flow of a valve-controlled crane; none for a pump-controlled one.
    pub unknown_flow_prior: Option<UnknownFlowPrior>,
    /// Estimates at the samples of the log; a long log is decimated.
    pub rows: Vec<EstimateRow>,
    /// Standard deviations at the start, in the units of [`ESTIMATES`].
    pub initial_deviation: [f64; ESTIMATES.len()],
    /// Verdict from innovations, other signals and bounds.
    pub verdict: Verdict,
    /// Remarks on how the log was used, a sentence each.
    pub remarks: Vec<String>,
}

impl LogEstimate {
    /// Last estimates while the load-holding valve was open; the last ones of all if it never was. None without rows.
    pub fn last_released(&self) -> Option<&EstimateRow> {
        self.rows.iter().rev().find(|row| !row.is_held).or(self.rows.last())
    }

    /// Heading of a table of [`last_released`](Self::last_released), which states its time.
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
/// [`LabError::Input`] if there is no position, less than 0.1 s of it or more than a day at 1 ms, or never a position
/// and a pressure at the same time. [`LabError::Design`] if the crane file gives no reduced model.
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
    let (mut estimator, unknown_flow_prior) = estimator_for(description, has_motor)?;
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
    let area_ratio = description.cylinder().area_ratio();
    let load_pressure = load_pressures(pressure_a, pressure_b, area_ratio);
    adapt_to_log(&mut estimator.filter, position, &load_pressure, interval);
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
    let (run, noisy) = likeliest_run(&mut estimator, &source);
    if run.rows.is_empty() {
        return Err(refused(
            "never has position and pressure at the same time: nothing was estimated".into(),
        ));
    }
    remark_on_run(&run, &mut remarks);
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

/// Adapts the filter to a log's sampling intervals \[s\], to its noise, and to the filter of its position.
fn adapt_to_log(
    filter: &mut ExtendedKalmanFilter<f64>,
    position: &Track,
    load_pressure: &[f64],
    interval: [f64; 2],
) {
    let steps = interval.map(|interval| (interval / filter.period).max(1.0));
    // the time constant of the innovation test counts measurements: it is scaled to the log's interval
    filter.innovation_test.time_constant /=
        if steps[1].is_finite() { 0.5 * (steps[0] + steps[1]) } else { steps[0] };
    let found = [scatter(position.values()), scatter(load_pressure)];
    for (noise, found) in filter.measurement_noise.iter_mut().zip(found) {
        *noise = noise.max(found);
    }
    filter.sensor_lag += position.filter();
}

/// Estimator for a crane's circuit, with the prior of the unknown flow where no motor speed tells the flow.
fn estimator_for(
    description: &Description,
    has_motor: bool,
) -> Result<(StateEstimator<f64>, Option<UnknownFlowPrior>), LabError> {
    Ok(match description.choices.circuit {
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
    })
}

/// Runs the filter along the log. If its innovations are inconsistent, a signal is either delayed or noisier than
/// expected: if noise is the more likely cause, the filter takes on the likeliest noise and runs again.
fn likeliest_run(
    estimator: &mut StateEstimator<f64>,
    source: &Source<'_>,
) -> (Run, Vec<SignalFinding>) {
    let found = run(estimator, source, [0.0; 2], ALL, true);
    if is_consistent(&found) != Some(false) {
        return (found, Vec::new());
    }
    let late = delay(estimator, source).map_or(0.0, |delay| delay.gain);
    let (noise, gain) = likeliest_noise(estimator, source);
    if gain > late {
        let noisy = noise_findings(estimator.filter.measurement_noise, noise);
        estimator.filter.measurement_noise = noise;
        return (run(estimator, source, [0.0; 2], ALL, true), noisy);
    }
    (found, Vec::new())
}

fn remark_on_run(run: &Run, remarks: &mut Vec<String>) {
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
}

/// Name of an estimate without the unit at its end, for tables, with spaces for underscores. A name without a known
/// unit is not cut.
pub fn readable(name: &str) -> String {
    let cut = ["_mm_s", "_mm", "_kg", "_bar", "_n", "_l_min", "_ms"];
    let bare = cut.iter().find_map(|unit| name.strip_suffix(unit)).unwrap_or(name);
    bare.replace('_', " ")
}

/// Display unit at the end of an estimate's name, as `mm/s` for `_mm_s`; empty if the name ends in no known unit.
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
