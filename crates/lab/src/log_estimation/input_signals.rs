//! Signals that the filter takes from a log: what stands in for missing ones, their noise, and remarks on them.

use hydroboom_control::estimation::state_estimator::StateEstimator;
use hydroboom_description::Description;
use hydroboom_design::unknown_flow::UnknownFlowPrior;
use hydroboom_measurement::{Signal, Signals, TimeBase, Track};

/// Estimator for a log without motor speed: the unknown flow may be any that the motor allows.
pub(super) fn with_unknown_pump(
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

/// Median sampling interval of a signal \[s\]; infinite without one.
pub(super) fn interval_of(track: Option<&Track>) -> f64 {
    track.and_then(|t| TimeBase::of(t.time())).map_or(f64::INFINITY, |base| base.interval)
}

/// A pressure signal, or that on the pump side of the open valve if it was not recorded.
pub(super) fn substitute<'a>(
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

pub(super) fn remark_on_drive(
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

pub(super) fn remark_on_sampling(interval: &[f64; 2], period: f64, remarks: &mut Vec<String>) {
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

/// Load pressures at the samples of the piston side's pressure \[Pa\]; none if a pressure is missing.
pub(super) fn load_pressures(
    pressure_a: Option<&Track>,
    pressure_b: Option<&Track>,
    area_ratio: f64,
) -> Vec<f64> {
    match (pressure_a, pressure_b) {
        (Some(a), Some(b)) => {
            let pairs = a.time().iter().zip(a.values());
            pairs.filter_map(|(time, a)| Some(a - area_ratio * b.at(*time)?)).collect()
        }
        _ => Vec::new(),
    }
}

/// Standard deviation of a signal's noise from its third differences, whose variance is 20 times that of
/// white noise. The median makes it insensitive to motion.
pub(super) fn scatter(values: &[f64]) -> f64 {
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
