//! Cost of each performance limit on a crane along a course, alone and together with the others.

use super::conditions::{Condition, conditions};
use super::crane_along_course::CraneAlongCourse;
use super::delay::Delay;
use super::disturbances::{Disturbances, linearised};
use super::motor_limits::{LeastError, MotorLimits, least_error, least_error_without_preview};
use super::prediction_error::Information;
use super::sensor_noise::{EXACT, SensorNoise};
use super::unknown_payload::{at_rest, deviation, feedforward_error};
use crate::LabError;
use crate::closed_loop::scenario::Course;
use hydroboom_control::estimation::reduced_model::STATES;
use hydroboom_description::Description;
use rayon::prelude::*;
use serde::Serialize;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Limit of control performance, of the motor or of the information.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Limit {
    /// Largest motor speed.
    MotorSpeed,
    /// Largest rate of change of the motor speed.
    Slew,
    /// Sensors, fieldbus and control period.
    Delay,
    /// Noise and resolution of the sensors.
    SensorNoise,
    /// Payload that is unknown when the course begins.
    UnknownPayload,
}

impl Limit {
    /// All limits, in the order of tables.
    pub const ALL: [Self; 5] =
        [Self::MotorSpeed, Self::Slew, Self::Delay, Self::SensorNoise, Self::UnknownPayload];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::MotorSpeed => "motor speed",
            Self::Slew => "motor slew rate",
            Self::Delay => "delay",
            Self::SensorNoise => "sensor noise",
            Self::UnknownPayload => "unknown payload",
        }
    }

    /// Whether it is a limit of the motor, which applies even with complete knowledge.
    pub fn is_of_motor(self) -> bool {
        matches!(self, Self::MotorSpeed | Self::Slew)
    }
}

/// Tracking error that one limit costs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LimitCost {
    /// Limit of performance.
    pub limit: Limit,
    /// Lower bound of the RMS true error with this limit alone \[mm\].
    pub alone_mm: f64,
    /// Lower bound of the RMS true error with all limits except this one \[mm\].
    pub all_others_mm: f64,
}

/// Lower bounds of the tracking error of a crane along a course for any controller: RMS true error over the whole
/// course, rests included.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PerformanceBounds {
    /// Name of the course.
    pub course: String,
    /// Bound without any limit \[mm\]: always zero.
    pub none_mm: f64,
    /// Cost of each limit, in the order of [`Limit::ALL`].
    pub limits: Vec<LimitCost>,
    /// Bound with both limits of the motor, complete knowledge and no delay \[mm\].
    pub motor_mm: f64,
    /// Bound with delay, sensor noise and unknown payload, and a motor without limits \[mm\].
    pub information_mm: f64,
    /// Bound with all limits \[mm\]: √(motor² + information²), because the squares add.
    pub all_mm: f64,
    /// Bound with all limits and without preview of reference and load changes \[mm\]. The crane starts on the
    /// reference and learns of each change when it occurs. Commands are delayed by fieldbus and drive. It is no
    /// smaller than the bound with preview.
    pub not_known_ahead_mm: f64,
    /// Number of load changes along the course. `not_known_ahead_mm` linearises each about its new load, which is
    /// valid for small ones.
    pub load_changes: usize,
    /// Largest possible gap below `motor_mm` \[%\] of it: another motion of the linearised model might be better by
    /// this share. Zero if `motor_mm` is below 1e-6 mm.
    pub motor_gap_percent: f64,
    /// RMS true error of feedforward alone, with the payload estimated during the course \[mm\]: an estimate, no
    /// bound.
    pub feedforward_mm: f64,
    /// Standard deviation of the estimated payload \[kg\] before the course, at the start of the first ramp, and at
    /// the end.
    pub payload_deviation_kg: [f64; 3],
    /// Quantities on which the bounds depend, with their values and sources.
    pub conditions: Vec<Condition>,
}

/// Number of parts of the computation, for progress: the model, four motions, prediction errors.
pub const BOUND_PARTS: usize = 6;

/// Error that counts as zero \[mm\]; the searches for motions end at a tenth of it.
const NONE: f64 = 1e-6;

/// Longest course \[s\]: its covariances and derivatives take about 0.5 GB.
pub const LONGEST_COURSE: f64 = 300.0;

/// Lower bounds of the tracking error of a crane along a course, with an unknown payload between two limits \[kg\].
/// `go_on` receives the number of completed parts out of [`BOUND_PARTS`]; none if it returned false.
///
/// # Errors
///
/// [`LabError::NoBound`] if the course is longer than [`LONGEST_COURSE`], or a search does not converge;
/// [`LabError::Design`] if the crane has no reduced model.
pub fn performance_bounds(
    crane: &Description,
    course: &dyn Course,
    payloads: [f64; 2],
    go_on: &(dyn Fn(usize) -> bool + Sync),
) -> Result<Option<PerformanceBounds>, LabError> {
    if course.duration() > LONGEST_COURSE {
        return Err(LabError::NoBound(format!(
            "{} takes {:.0} s: bounds are computed for courses of up to {LONGEST_COURSE:.0} s, so take a faster or a shorter one",
            course.name(),
            course.duration()
        )));
    }
    let along = CraneAlongCourse::new(crane, course)?;
    if !go_on(1) {
        return Ok(None);
    }
    let Some([by_speed, by_slew, by_both, unforeseen]) = least_errors(crane, &along, go_on)? else {
        return Ok(None);
    };
    let known = Knowledge::new(crane, &along, payloads);
    let all_known = known.remaining_error(true, true, true);
    let information_mm = all_known.rms_mm;
    let motor = |without: Option<Limit>| match without {
        Some(Limit::MotorSpeed) => by_slew.rms_mm,
        Some(Limit::Slew) => by_speed.rms_mm,
        _ => by_both.rms_mm,
    };
    let is_there = |without: Limit| {
        let has = |limit| without != limit;
        [has(Limit::Delay), has(Limit::SensorNoise), has(Limit::UnknownPayload)]
    };
    let cost = |limit: Limit| {
        let [delay, noise, payload] = is_there(limit);
        let (alone_mm, others) = match limit {
            Limit::MotorSpeed => (by_speed.rms_mm, information_mm),
            Limit::Slew => (by_slew.rms_mm, information_mm),
            _ => (
                known.remaining_error(!delay, !noise, !payload).rms_mm,
                known.remaining_error(delay, noise, payload).rms_mm,
            ),
        };
        LimitCost { limit, alone_mm, all_others_mm: motor(Some(limit)).hypot(others) }
    };
    let feedforward = feedforward_error(&along, &known.course, &all_known.covariances);
    let begins =
        along.reference.iter().position(|set_point| set_point.velocity != 0.0).unwrap_or(0);
    let payload = |k: usize| all_known.payload_deviation(k);
    let bounds = PerformanceBounds {
        course: course.name(),
        none_mm: 0.0,
        limits: Limit::ALL.map(cost).to_vec(),
        motor_mm: by_both.rms_mm,
        information_mm,
        all_mm: by_both.rms_mm.hypot(information_mm),
        not_known_ahead_mm: unforeseen.rms_mm.max(by_both.rms_mm).hypot(information_mm),
        load_changes: course.loads().len(),
        motor_gap_percent: match by_both.rms_mm > NONE {
            true => 100.0 * (1.0 - by_both.least_mm / by_both.rms_mm),
            false => 0.0,
        },
        feedforward_mm: 1e3 * feedforward,
        payload_deviation_kg: [deviation(payloads), payload(begins), payload(along.periods())],
        conditions: conditions(crane, payloads),
    };
    Ok(go_on(BOUND_PARTS).then_some(bounds))
}

/// Least errors with a limit of the motor's speed, of its slew rate, with both, and with both without preview; none if
/// `go_on` returned false.
fn least_errors(
    crane: &Description,
    along: &CraneAlongCourse,
    go_on: &(dyn Fn(usize) -> bool + Sync),
) -> Result<Option<[LeastError; 4]>, LabError> {
    let done = AtomicUsize::new(1);
    let n = &crane.numbers;
    let (speed, slew, none) = (n.motor_speed, n.motor_slew, f64::INFINITY);
    // the last one has no preview
    let motors =
        [(speed, none, true), (none, slew, true), (speed, slew, true), (speed, slew, false)];
    let blind = Delay::of(crane).command_periods();
    let one = |&(speed, slew, is_known_ahead): &(f64, f64, bool)| {
        let still = || go_on(done.load(Ordering::Relaxed));
        let limits = MotorLimits { speed, slew };
        let found = match is_known_ahead {
            true => least_error(along, limits, &still),
            false => least_error_without_preview(along, limits, blind, &still),
        };
        done.fetch_add(1, Ordering::Relaxed);
        found
    };
    let found = motors.par_iter().map(one).collect::<Result<Vec<_>, _>>()?;
    let found: Option<Vec<LeastError>> = found.into_iter().collect();
    Ok(found.and_then(|found| found.try_into().ok()))
}

/// Information on a crane along its reference.
struct Knowledge {
    course: super::prediction_error::LinearCourse<STATES>,
    delay: Delay,
    noise: SensorNoise,
    /// Covariance at rest with an unknown payload.
    unknown: [[f64; STATES]; STATES],
}

/// Remaining error due to incomplete information.
struct RemainingError {
    rms_mm: f64,
    covariances: Vec<[[f64; STATES]; STATES]>,
}

impl RemainingError {
    fn payload_deviation(&self, k: usize) -> f64 {
        use hydroboom_control::estimation::reduced_model::state_index::PAYLOAD;
        self.covariances.get(k).map_or(0.0, |p| p[PAYLOAD][PAYLOAD].max(0.0).sqrt())
    }
}

impl Knowledge {
    fn new(crane: &Description, along: &CraneAlongCourse, payloads: [f64; 2]) -> Self {
        let disturbances = Disturbances::of(crane);
        Self {
            course: linearised(along, &disturbances),
            delay: Delay::of(crane),
            noise: SensorNoise::of(crane),
            unknown: at_rest(along, deviation(payloads)),
        }
    }

    /// Remaining error with or without delay, sensor noise and unknown payload.
    fn remaining_error(&self, delay: bool, noise: bool, payload: bool) -> RemainingError {
        let known = Information {
            initial: if payload { self.unknown } else { [[0.0; STATES]; STATES] },
            noise: if noise { self.noise } else { EXACT }.variances(),
            horizon: if delay { self.delay.periods() } else { 0.0 },
        };
        let found = self.course.prediction_error(&known);
        RemainingError { rms_mm: 1e3 * found.rms, covariances: found.covariances }
    }
}

#[cfg(test)]
mod tests {
    use super::super::strategies::strategy_errors;
    use super::*;
    use crate::closed_loop::scenario::CourseChoice;
    use hydroboom_control::strategy::Strategy;

    /// The paper's crane and its virtual crane with a motion of a few seconds.
    fn short() -> [Description; 2] {
        [Description::uia_single_boom(), Description::uia_virtual()].map(|crane| {
            let mut crane = crane.unwrap();
            let n = &mut crane.numbers;
            (n.rest, n.dwell, n.ramp) = (0.4, 0.4, 0.3);
            n.motion_end = n.motion_start + 0.06;
            crane
        })
    }

    /// The model with typical equipment, which is linearised faster.
    fn equipped() -> Description {
        let [model, _] = short();
        model.virtual_crane().0
    }

    fn bounds(crane: &Description, payloads: [f64; 2]) -> PerformanceBounds {
        let course = crane.motion(crane.numbers.fast);
        performance_bounds(crane, &course, payloads, &|_| true).unwrap().unwrap()
    }

    const PAYLOADS: [f64; 2] = [280.0, 380.0];

    /// Removing a limit never increases the bound, and missing preview never reduces it.
    #[test]
    fn limits_together_cost_no_less_than_any_alone() {
        let crane = equipped();
        let found = bounds(&crane, PAYLOADS);
        for cost in &found.limits {
            assert!(
                cost.alone_mm <= found.all_mm && cost.all_others_mm <= found.all_mm,
                "{cost:?}"
            );
        }
        // each motor limit alone is weaker than both, and the motor's limits are weaker than all
        let cost = |limit| found.limits.iter().find(|cost| cost.limit == limit).unwrap();
        let motor = [Limit::MotorSpeed, Limit::Slew].map(|limit| cost(limit).alone_mm);
        assert!(motor.iter().all(|alone| *alone <= 1.001 * found.motor_mm), "{motor:?}");
        assert!(found.motor_mm < found.all_mm && found.information_mm < found.all_mm);
        assert!(found.all_mm < found.not_known_ahead_mm, "{found:?}");
        // a payload that is known exactly and at once costs nothing
        assert!(cost(Limit::UnknownPayload).alone_mm < 1e-6);
    }

    /// The error due to noise and drifts is linear in them: doubled, they double the error.
    #[test]
    fn doubled_noise_and_drifts_double_the_error() {
        let crane = equipped();
        let course = crane.motion(crane.numbers.fast);
        let along = CraneAlongCourse::new(&crane, &course).unwrap();
        let left = |times: f64| {
            let mut crane = crane.clone();
            let n = &mut crane.numbers;
            for value in [
                &mut n.position_noise,
                &mut n.position_resolution,
                &mut n.pressure_noise,
                &mut n.tuning.estimator_disturbance_drift,
                &mut n.tuning.estimator_friction_drift,
                &mut n.tuning.estimator_flow_drift,
            ] {
                *value *= times;
            }
            // coarser resolution of the pressure
            n.pressure_bits -= times.log2();
            Knowledge::new(&crane, &along, PAYLOADS).remaining_error(true, true, false).rms_mm
        };
        let [once, twice] = [1.0, 2.0].map(left);
        assert!((twice / once - 2.0).abs() < 1e-6, "{once} {twice} mm");
    }

    #[test]
    fn a_tighter_limit_never_lowers_the_bound() {
        let crane = equipped();
        let known = bounds(&crane, PAYLOADS);
        type Change = fn(&mut Description);
        let tighter: [(Limit, Change); 4] = [
            (Limit::MotorSpeed, |crane| crane.numbers.motor_speed *= 0.5),
            (Limit::Slew, |crane| crane.numbers.motor_slew *= 0.3),
            (Limit::Delay, |crane| crane.numbers.fieldbus_delay += 3.0),
            (Limit::SensorNoise, |crane| crane.numbers.position_noise *= 3.0),
        ];
        for (limit, change) in tighter {
            let mut other = crane.clone();
            change(&mut other);
            let found = bounds(&other, PAYLOADS);
            let alone = |of: &PerformanceBounds| {
                of.limits.iter().find(|cost| cost.limit == limit).unwrap().alone_mm
            };
            assert!(alone(&found) > alone(&known) && found.all_mm > known.all_mm, "{limit:?}");
        }
        let known_payload = bounds(&crane, [crane.numbers.payload; 2]);
        assert!(known_payload.all_mm < known.all_mm);
        assert!(known_payload.feedforward_mm < known.feedforward_mm);
        let [before, begun, ended] = known.payload_deviation_kg;
        assert!(before > begun && begun > ended, "{before} {begun} {ended} kg");
    }

    /// Each strategy's error exceeds the bound under the same conditions, also with too slow a motor.
    #[test]
    fn every_strategy_is_above_the_bound() {
        let cranes = short();
        let fastest = cranes[1].numbers.motor_speed;
        for speed in [fastest, 0.6 * fastest] {
            let [model, crane] = cranes.each_ref().map(|crane| {
                let mut crane = crane.clone();
                crane.numbers.motor_speed = speed;
                crane
            });
            let found = bounds(&crane, PAYLOADS);
            let course = CourseChoice::Motion(crane.numbers.fast);
            let all = strategy_errors(&model, &crane, &course, found.all_mm, &|_| true).unwrap();
            assert_eq!(all.len(), Strategy::ALL.len());
            for one in all {
                assert!(one.over_bound.is_none_or(|over| over > 1.0), "{speed} rev/s: {one:?}");
            }
        }
    }

    #[test]
    fn courses_without_bounds_are_refused() {
        let crane = Description::uia_virtual().unwrap();
        let refused = |course: &dyn Course| {
            performance_bounds(&crane, course, PAYLOADS, &|_| true).unwrap_err().to_string()
        };
        assert!(refused(&crane.motion(1e-3)).contains("up to 300 s"));
        let course = crane.motion(crane.numbers.fast);
        assert_eq!(performance_bounds(&crane, &course, PAYLOADS, &|_| false).unwrap(), None);
    }
}
