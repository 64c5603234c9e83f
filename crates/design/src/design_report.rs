//! Design report: load mode and stability margins of both control loops at a piston position.

use crate::linear::Mode;
use crate::operating_points::rod_side_term;
use crate::scheduled_lqr::{designed, known_delay};
use crate::small_signal_controller::SmallSignalController;
use crate::{Actuation, DesignError, LinearisedPlant, Loop, Margins, margins};
use hydroboom_control::estimation::state_estimator::StateEstimator;
use hydroboom_control::feedback::scheduled_lqr::ScheduledLqr;
use hydroboom_description::{Description, millimetres};
use serde::Serialize;

/// Load mode and stability margins of both loops at a piston position.
#[derive(Clone, Debug, Serialize)]
pub struct DesignReport {
    /// Piston position \[mm\].
    pub stroke_mm: f64,
    /// Mode of boom and load on the oil's spring; `None` if it is overdamped, or if no mass on a hydraulic spring
    /// fits.
    pub load_mode: Option<Mode>,
    /// Margins of the benchmark controller's loop.
    pub benchmark: Margins,
    /// Margins of the scheduled LQR's loop.
    pub scheduled_lqr: Margins,
}

/// Loop of the benchmark controller, with the drive lag and fieldbus delay that the estimator assumes before
/// identification.
///
/// Sampling delays it by half a control period.
pub fn benchmark_loop(description: &Description) -> Loop {
    let n = &description.numbers;
    let fieldbus = 2.0 * f64::from(known_delay(description)) * n.control_period;
    Loop::Benchmark {
        controller: description.benchmark(),
        high_pass: n.high_pass_time,
        actuation: Actuation {
            delay: n.tuning.estimator_drive_lag + fieldbus + 0.5 * n.control_period,
            drive: [0.0; 2],
            sensor_lag: 0.0,
        },
    }
}

/// Loop of the scheduled LQR, settled at rest at a piston position \[m\] with the crane file's payload and drive lag.
///
/// # Errors
///
/// As [`designed`].
pub fn scheduled_lqr_loop(description: &Description, stroke: f64) -> Result<Loop, DesignError> {
    let design = designed(description, known_delay(description) as usize)?;
    Ok(scheduled_lqr_loop_at(description, &design, stroke, description.numbers.payload))
}

/// Loop of the scheduled LQR from a given design of estimator and law, settled at rest at `stroke` \[m\] with an
/// estimated payload \[kg\].
///
/// Its friction slides, as that of its linearised crane: friction that sticks is a spring to the estimator. With a
/// crane that slides the loop would then be unstable.
pub fn scheduled_lqr_loop_at(
    description: &Description,
    (estimator, law): &(StateEstimator<f64>, ScheduledLqr<f64>),
    stroke: f64,
    payload: f64,
) -> Loop {
    let n = &description.numbers;
    let mut estimator = *estimator;
    estimator.filter.model.presliding_stiffness = 0.0;
    let controller = SmallSignalController::at_rest(
        &estimator,
        law,
        stroke,
        payload,
        rod_side_term(description),
    );
    Loop::ScheduledLqr {
        controller: Box::new(controller),
        actuation: Actuation {
            delay: (2.0 * f64::from(known_delay(description)) + 0.5) * n.control_period,
            drive: [n.tuning.estimator_drive_lag, 0.0],
            sensor_lag: estimator.filter.sensor_lag,
        },
    }
}

/// Load mode and margins of both loops at a piston position \[m\].
///
/// # Errors
///
/// [`DesignError`] if the crane cannot be linearised there, if its loop gain is not finite, or if the reduced model
/// cannot be fitted over the stroke.
pub fn design_report(description: &Description, stroke: f64) -> Result<DesignReport, DesignError> {
    let crane = LinearisedPlant::new(description, stroke)?;
    Ok(DesignReport {
        stroke_mm: millimetres(stroke),
        load_mode: crane.load_mode().ok().copied(),
        benchmark: margins(&crane, &benchmark_loop(description))?,
        scheduled_lqr: margins(&crane, &scheduled_lqr_loop(description, stroke)?)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stability by the argument principle. A distance from −1 exists for an unstable loop as well.
    #[test]
    fn both_loops_are_stable_over_the_stroke() {
        let description = Description::uia_single_boom().unwrap();
        for share in [0.05, 0.5, 0.95] {
            let report = design_report(&description, share * description.numbers.stroke).unwrap();
            assert_eq!(
                (report.benchmark.unstable_poles, report.scheduled_lqr.unstable_poles),
                (0, 0),
                "{report:?}"
            );
        }
    }

    /// A third of the payload makes the oil soft. The benchmark with the paper's gains is then
    /// unstable, and an unstable loop has no margins.
    #[test]
    fn an_unstable_loop_is_reported_without_margins() {
        let mut light = Description::uia_single_boom().unwrap();
        light.set("payload.mass_kg=100").unwrap();
        let report = design_report(&light, 0.25).unwrap();
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["benchmark"]["stable"], false);
        assert!(json["benchmark"]["unstable_poles"].as_u64() >= Some(1), "{json}");
        assert!(json["benchmark"]["phase_deg"].is_null() && json["benchmark"]["gain"].is_null());
        assert_eq!(json["scheduled_lqr"]["stable"], true);
        assert!(json["scheduled_lqr"]["phase_deg"].as_f64() > Some(30.0), "{json}");
    }
}
