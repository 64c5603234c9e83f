//! Scheduled LQR at work.

use super::{Shown, Steers};
use crate::LabError;
use hydroboom_control::estimation::extended_kalman_filter::EstimatorInput;
use hydroboom_control::estimation::state_estimator::{StateEstimator, StateEstimatorState};
use hydroboom_control::feedback::scheduled_lqr::{ScheduledLqr, ScheduledLqrState};
use hydroboom_control::reference::preview::Preview;
use hydroboom_control::signals::Reading;
use hydroboom_description::Description;

pub(super) struct Scheduled {
    estimator: StateEstimator<f64>,
    law: ScheduledLqr<f64>,
    preview: Option<Preview<f64>>,
    state: Option<(StateEstimatorState<f64>, ScheduledLqrState<f64>)>,
    ratio: f64,
    periods: u64,
    debug: bool,
}

impl Scheduled {
    pub(super) fn new(model: &Description) -> Result<Self, LabError> {
        let (equipped, _) = model.virtual_crane();
        let delay = equipped.numbers.fieldbus_delay.round() as usize;
        let (estimator, law) = hydroboom_design::scheduled_lqr::designed(model, delay)?;
        let cylinder = model.cylinder();
        Ok(Self {
            estimator,
            law,
            preview: None,
            state: None,
            ratio: cylinder.rod_side_area / cylinder.piston_area,
            periods: 0,
            debug: std::env::var("DEBUG").is_ok(),
        })
    }

    fn input(&self, r: &Reading<f64>) -> EstimatorInput<f64> {
        EstimatorInput {
            position: r.stroke,
            position_is_good: 1.0,
            load_pressure: r.pressure_a - self.ratio * r.pressure_b,
            load_pressure_is_good: 1.0,
            pressure_beyond: self.ratio * r.pressure_b,
            motor_speed: r.motor_speed,
        }
    }
}

impl Steers for Scheduled {
    fn speed(&mut self, shown: &Shown<'_>) -> f64 {
        let input = self.input(&shown.reading);
        match &mut self.preview {
            None => self.preview = Some(Preview::new(self.law.period, shown.ahead)),
            Some(preview) => preview.advance(shown.ahead),
        }
        let Some(preview) = &self.preview else { return 0.0 };
        let (estimated, state) = self.state.get_or_insert_with(|| {
            let estimated = self.estimator.start(&input);
            let state = self.law.start(&self.estimator, &estimated, input.position);
            (estimated, state)
        });
        if self.periods > 0 {
            self.estimator.update(estimated, &input, state.command);
        }
        self.periods += 1;
        let speed = self.law.update(state, &self.estimator, estimated, preview);
        if self.debug && self.periods.is_multiple_of(10) {
            let z = &estimated.filter.estimate;
            eprintln!(
                "{:.3} e {:.3} off {:.2} w {:.1} p {:.2} d {:.2} f {:.2} r {:.2} m {:.0} T {:.1} nis {:.2} g {:.3} n {:.1} u {speed:.1} win {:.3} K {:.2?}",
                self.periods as f64 * 1e-3,
                (input.position - shown.reference.position) * 1e3,
                state.offset * 1e3,
                z.velocity * 1e3,
                z.load_pressure * 1e-5,
                z.disturbance * 1e-5,
                z.friction * 1e-5,
                z.unknown_flow,
                z.payload,
                z.transition_pressure * 1e-5,
                estimated.filter.mean_nis,
                estimated.drive.share,
                input.motor_speed,
                state.window,
                [
                    state.regulator.gain[0] * 1e-3,
                    state.regulator.gain[1] * 1e-3,
                    state.regulator.gain[2] * 1e5,
                    state.regulator.gain[3]
                ],
            );
        }
        speed
    }
}
