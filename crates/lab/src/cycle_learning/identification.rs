//! Identification of a machine from a cycle or a log: output-error fit of the crate `identify`, with crane
//! and drive in one least-squares problem.
//!
//! The measured motor speed is the model's input. The controller does not bias the fit, because its
//! commands reach the machine through that speed alone. If the command was recorded too, the drive is
//! identified from command and speed.

use super::drive_delay::{with_estimated_delay, with_half_as_lag};
use super::identified_payload::IdentifiedPayload;
use super::stages::Stages;
use crate::LabError;
use hydroboom_description::schema::{FrictionChoice, Numbers};
use hydroboom_description::{Description, Difference};
use hydroboom_identify::{
    Experiment, Free, IdentifyError, Judgement, Nuisance, Task, Tuned, Window, differences, fit,
    verdict,
};
use hydroboom_measurement::{Measurement, Signal, Signals};
use hydroboom_virtual_crane::fieldbus_delay;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Keys that affect the piston's motion in a cycle: load, friction, oil, pump and its leakage, check
/// valves. The drive's keys are added to them.
const IDENTIFIED: [&str; 14] = [
    "payload.mass_kg",
    "cylinder.dead_volume_a_l",
    "cylinder.dead_volume_b_l",
    "friction.viscous_ns_per_m",
    "friction.coulomb_n",
    "friction.stiction_n",
    "oil.transition_bar",
    "pump.flow_gain",
    "pump.internal_leakage_m3_s_sqrtpa",
    "pump.case_leakage_a_m3_s_sqrtpa",
    "pump.slip_l_min_per_bar",
    "pump.slip_cm3_per_rev_bar",
    "check_valve.cracking_bar",
    "check_valve.flow_coefficient_m3_s_sqrtpa",
];

/// Model runs after which a search counts as two thirds done.
const USUAL_RUNS: f64 = 40.0;

/// Probability threshold of the identified keys under the crane file's prior. Below it the log is
/// attributed to another crane.
const IMPROBABLE: f64 = 1e-3;
/// Number of most deviating keys named in that case.
const NAMED: usize = 3;

/// Result of an identification.
pub(crate) struct Identification {
    /// Identified model: with friction that holds at rest, the identified drive, and the initial pressures of the log.
    pub model: Description,
    /// Validity of the model: position, pressures, frequency and damping of the log against their limits.
    pub judged: Vec<Judgement>,
    /// Reason why the log hardly belongs to the crane of the file; none if the keys agree with the prior.
    pub improbable: Option<String>,
    /// Identified payload; none if it was not free, as of a model without a payload.
    pub payload: Option<IdentifiedPayload>,
    /// Remarks on the log, a sentence each.
    pub remarks: Vec<String>,
}

/// Identifies a model of the machine of a log.
///
/// # Errors
///
/// [`LabError::Identify`] if the log lacks a required signal, or the model cannot be run with the log's motor speed;
/// [`LabError::Stopped`] on request.
pub(crate) fn identified(
    model: &Description,
    (log, signals): (&Measurement, &Signals),
    window: Window,
    stages: &Stages<'_>,
) -> Result<Identification, LabError> {
    let mut model = with_positive_start_values(model);
    model.choices.friction = FrictionChoice::LuGre;
    // a crane file without a fieldbus delay gets the typical one
    let stated = model.numbers.fieldbus_delay;
    model.numbers.fieldbus_delay = fieldbus_delay(&model) / (2.0 * model.numbers.control_period);
    let is_commanded = [Signal::MotorCommand, Signal::MotorSpeed]
        .into_iter()
        .all(|signal| signals.get(signal).is_some());
    if is_commanded {
        model = with_half_as_lag(&model);
    }
    let watched = stages.watched();
    let mut experiments = Experiment::each(&model, log, signals, window)?;
    experiments.iter_mut().for_each(|experiment| experiment.stop_by(&watched.stop));
    let mut free: Vec<Free> = IDENTIFIED
        .iter()
        .map(|path| Free::from_path(path))
        .collect::<Result<Vec<_>, _>>()?
        .into_iter()
        .filter(|key| key.value(&model) > 0.0)
        .collect();
    let mut remarks: Vec<String> = experiments.iter().flat_map(|e| e.remarks.clone()).collect();
    match is_commanded {
        true => free.extend(Free::of_drive(&model)),
        false => remarks.push(
            "the log lacks commanded or measured motor speed: the drive's delay is not identified"
                .into(),
        ),
    }
    // all measurements of a period share one bus; the tracked position is the measured one, so it has no
    // offset
    let fixed = [Nuisance::named("delay")?, Nuisance::named("stroke.offset")?].concat();
    let task = Task {
        model: &model,
        experiments: &experiments,
        free: &free,
        fixed: &fixed,
        resume: None,
        generations: 0,
    };
    let go_on = |runs: usize| watched.within(1.0 - (-(runs as f64) / USUAL_RUNS).exp());
    let found = match watched.run(|| fit(&task, &|progress| go_on(progress.runs))) {
        Err(IdentifyError::Stopped) => return Err(LabError::Stopped),
        found => found?,
    };
    let shown = experiments.iter().zip(&found.predictions.1);
    let judged = shown.flat_map(|(experiment, shown)| verdict(&differences(experiment, shown)));
    let judged = judged.collect();
    let improbable = improbable(&found.tuned);
    let payload = IdentifiedPayload::of(&found.tuned, &model);
    let begin = experiments.first().map_or(0.0, |experiment| experiment.begin);
    let mut machine = with_measured_pressures(&found.description, signals, begin);
    machine.numbers.fieldbus_delay = stated;
    Ok(Identification {
        model: with_estimated_delay(&machine),
        judged,
        improbable,
        payload,
        remarks,
    })
}

/// Reason why the keys that the log determines together contradict the prior; none if they agree. Their squared
/// deviations in standard deviations sum to χ² with as many degrees of freedom.
///
/// An estimate is shrunk towards the prior: it varies about it by the prior's variance less the posterior one (G. Box,
/// Sampling and Bayes' inference in scientific modelling and robustness, J. R. Stat. Soc. A 143, 1980, 383-430). The
/// log determines a key where its own information exceeds the prior's.
fn improbable(tuned: &[Tuned]) -> Option<String> {
    let of_crane = tuned.iter().filter(|t| !t.key.is_of_drive() && t.from_logs < t.prior);
    let mut far: Vec<(String, f64)> = of_crane
        .filter_map(|t| {
            let moves = t.prior * t.prior - t.deviation * t.deviation;
            let distance = (t.value.1 / t.value.0).ln().abs() / moves.sqrt();
            (moves > 0.0).then(|| (t.key.path(), distance))
        })
        .collect();
    let square: f64 = far.iter().map(|(_, d)| d * d).sum();
    let chance = 1.0 - ChiSquared::new(far.len() as f64).ok()?.cdf(square);
    far.sort_by(|a, b| b.1.total_cmp(&a.1));
    let named: Vec<String> = far
        .iter()
        .take(NAMED)
        .map(|(key, d)| format!("{key} by {d:.1} standard deviations"))
        .collect();
    (chance < IMPROBABLE).then(|| {
        format!(
            "the {} keys that the log determines deviate from their prior more than the file's crane would \
             (chi-squared {square:.0}): {}",
            far.len(),
            named.join(", ")
        )
    })
}

/// Model whose identified numbers are positive, so that their logarithm exists: a zero is replaced by the
/// middle of its range.
fn with_positive_start_values(model: &Description) -> Description {
    let mut started = model.clone();
    let mut numbers = started.numbers.to_array();
    for key in IDENTIFIED.iter().filter_map(|path| Free::from_path(path).ok()) {
        let range = model.range(&key.path());
        if let (true, Some(range)) = (numbers[key.place] == 0.0, range) {
            numbers[key.place] = 0.5 * (range.low + range.high);
        }
    }
    started.numbers = Numbers::from_array(numbers);
    started
}

/// Model with initial pressures from the measurements of a machine at rest, as far as they are there. A
/// load held at the start of the log gives no information on a start with an open valve.
fn with_measured_pressures(model: &Description, signals: &Signals, begin: f64) -> Description {
    let mut model = model.clone();
    let read = |signal: Signal| {
        let track = signals.get(signal)?;
        track.at(begin).or_else(|| track.held(begin))
    };
    let is_held = signals.get(Signal::HoldingValve).and_then(|valve| valve.held(begin));
    if is_held.is_some_and(|open| open < 0.5) {
        return model;
    }
    let n = &mut model.numbers;
    n.rod_side = read(Signal::PressureB).unwrap_or(n.rod_side);
    n.working_pressure = read(Signal::PressureAccumulator).unwrap_or(n.working_pressure);
    let above = |signal: Signal| Some(read(signal)? - n.working_pressure);
    if let (Some(held), Some(loaded)) = (above(Signal::PressureA), above(Signal::PressurePumpA)) {
        // an empty crane may hold less pressure than the accumulator
        n.preload = if held > 0.0 { (loaded / held).clamp(0.0, 1.0) } else { 1.0 };
    }
    model
}

/// Identified numbers of a description as overrides (`--set`) for any command.
pub(crate) fn overrides(model: &Description, identified: &Description) -> Vec<String> {
    let of = |difference: Difference| match difference.there.parse::<f64>() {
        Ok(value) => format!("{}={}", difference.key, six_digits(value)),
        Err(_) => difference.assignment(),
    };
    model.differences(identified).into_iter().map(of).collect()
}

/// Six significant digits, more than a log determines.
fn six_digits(value: f64) -> String {
    match (1e-3..1e6).contains(&value.abs()) {
        true => {
            let decimals = 5 - value.abs().log10().floor() as i32;
            format!("{value:.0$}", usize::try_from(decimals).unwrap_or(0))
        }
        false => format!("{value:.5e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::Record;
    use super::super::replay::{at_rest, replayed};
    use super::*;
    use crate::closed_loop::monte_carlo::member;
    use crate::closed_loop::scenario::CourseChoice;
    use hydroboom_control::command::AxisCommand;
    use hydroboom_identify::Determination;
    use std::f64::consts::TAU;

    /// Keys with a prior standard deviation of 0.3, with the given distances from the prior and posterior standard
    /// deviations.
    fn keys(distances: &[(f64, f64)]) -> Vec<Tuned> {
        let key = |(path, (distance, left)): (&&str, &(f64, f64))| Tuned {
            key: Free::from_path(path).unwrap(),
            value: (1.0, distance.exp()),
            prior: 0.3,
            deviation: *left,
            from_logs: (left.powi(-2) - 0.3_f64.powi(-2)).max(1e-6).powf(-0.5),
            others_exact: *left,
            determination: Determination::Determined,
            partner: None,
        };
        IDENTIFIED.iter().zip(distances).map(key).collect()
    }

    /// A log as informative as the prior moves an estimate half of the way. Three such keys of a crane 3.6
    /// standard deviations away contradict the prior, as one well determined key does.
    #[test]
    fn estimates_shrunk_towards_the_prior_are_tested_against_their_own_variance() {
        let half = 0.5_f64.sqrt() * 0.29;
        assert!(improbable(&keys(&[(0.3 * 3.6, 0.001)])).is_some());
        assert!(improbable(&keys(&[(0.15 * 3.6, half); 3])).is_some());
        // a key without information in the log adds no degree of freedom; small deviations are no contradiction
        let message = improbable(&keys(&[(0.3 * 3.6, 0.001), (0.0, 0.3), (0.0, 0.3), (0.0, 0.3)]));
        assert!(message.unwrap().starts_with("the 1 keys"));
        assert_eq!(improbable(&keys(&[(0.3, 0.001), (-0.2, half), (0.25, half)])), None);
        assert_eq!(improbable(&keys(&[(0.0, 0.3)])), None);
    }

    /// The interval is that of the fit, about the mass at the model's lever.
    #[test]
    fn the_identified_payload_has_an_interval_and_a_lever() {
        let model = Description::uia_single_boom().unwrap();
        let mut found = keys(&[(0.1, 0.02)]);
        let payload = IdentifiedPayload::of(&found, &model).unwrap();
        assert!((payload.lever_mm - 3600.0).abs() < 1e-9, "{payload:?}");
        let [low, high] = payload.interval_95_kg.unwrap();
        assert!(low < payload.mass_kg && payload.mass_kg < high, "{payload:?}");
        assert!(((high / low).ln() / (2.0 * 1.96) - 0.02).abs() < 1e-4, "{payload:?}");
        found[0].deviation = f64::INFINITY;
        assert_eq!(IdentifiedPayload::of(&found, &model).unwrap().interval_95_kg, None);
        assert_eq!(IdentifiedPayload::of(&[], &model), None);
    }

    /// Dead time, bandwidth and damping of a virtual crane's drive are identified from two seconds of
    /// commands. The drive runs in steps of 0.25 ms, under load and behind a fieldbus. As with measurement
    /// noise, the commands step beyond the slew rate.
    #[test]
    fn the_drive_of_a_virtual_crane_is_found() {
        let model = super::super::drive_delay::with_drive(&Description::uia_single_boom().unwrap());
        let mut crane = member(&Description::uia_virtual().unwrap(), 1, 142).unwrap().crane;
        crane.set("drive.dead_time_ms=3.3").unwrap();
        crane.set("drive.damping_ratio=1.1").unwrap();
        let n = &crane.numbers;
        let course = CourseChoice::Motion(n.fast).of(&crane).unwrap();
        let leaping = |k: u32| AxisCommand {
            motor_speed: 10.0 * f64::sin(1e-4 * f64::from(k * k % 9001)),
            holding_valve: 1.0,
        };
        let commands: Vec<_> = (0..2000).map(leaping).collect();
        let go_on = |_: f64| true;
        let stages = Stages::new(2, &go_on);
        let mut machine = at_rest(&crane, course.as_ref()).unwrap();
        let (record, _): (Record, _) =
            replayed(&commands, &mut machine, course.as_ref(), &stages).unwrap();
        let (log, signals) = record.log();
        let found = identified(&model, (&log, &signals), Window::default(), &stages).unwrap();
        let found = found.model.numbers;
        let lag = |n: &Numbers<f64>| 2.0 * n.drive_damping / (TAU * n.drive_bandwidth);
        // the model has the typical fieldbus delay, which is the virtual crane's
        assert_eq!(fieldbus_delay(&model), 2.0 * n.fieldbus_delay * n.control_period);
        for (found, there) in [
            (found.drive_bandwidth, n.drive_bandwidth),
            (found.drive_damping, n.drive_damping),
            (found.drive_dead_time + lag(&found), n.drive_dead_time + lag(n)),
            (found.tuning.estimator_drive_lag, n.drive_dead_time + lag(n)),
        ] {
            assert!((found - there).abs() < 0.02 * there, "{found} for {there}");
        }
        assert!(
            (found.drive_dead_time - n.drive_dead_time).abs() < 0.2e-3,
            "{}",
            found.drive_dead_time
        );
    }
}
