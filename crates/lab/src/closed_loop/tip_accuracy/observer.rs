//! Tip estimators of a crane, run beside its closed loop and compared with other methods.

use super::height_map::HeightMap;
use super::rest_table::RestTable;
use super::survey_noise::SlopeMoments;
use super::{INSTANT, Method, TipInstant};
use crate::LabError;
use crate::closed_loop::sample::Sample;
use crate::virtual_survey::{SurveyOrder, virtual_survey};
use hydroboom_control::estimation::tip::{TipEstimator, TipLoad, TipMemory, TipParameters};
use hydroboom_control::feedback::scheduled_lqr_controller::ScheduledLqrController;
use hydroboom_control::measurement::Measurement;
use hydroboom_description::Description;
use hydroboom_design::tip::tip_estimator;
use hydroboom_design::tip_survey::SurveyError;
use nalgebra::{Matrix3, Vector3};
use std::collections::VecDeque;

/// Errors of one method on one crane \[mm\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Errors {
    pub(super) count: f64,
    sum: f64,
    squares: f64,
    /// Number of instants within two standard deviations, and sum of the standard deviations.
    pub(super) within: f64,
    pub(super) deviations: f64,
}

impl Errors {
    fn add(&mut self, error: f64, deviation: f64) {
        self.count += 1.0;
        self.sum += error;
        self.squares += error * error;
        self.within += f64::from(u8::from(error.abs() <= 2.0 * deviation));
        self.deviations += deviation;
    }

    /// Mean error.
    pub(super) fn bias(&self) -> f64 {
        self.sum / self.count
    }

    /// RMS error.
    pub(super) fn rms(&self) -> f64 {
        (self.squares / self.count).sqrt()
    }

    /// RMS about the mean error.
    pub(super) fn rms_about(&self) -> f64 {
        (self.squares / self.count - self.bias().powi(2)).max(0.0).sqrt()
    }
}

/// Estimators of the tip of one crane.
pub(super) struct TipEstimators {
    unsurveyed: TipEstimator<f64>,
    surveyed: TipEstimator<f64>,
    map: HeightMap,
    /// Covariance of the fitted parameters due to the survey's noise alone.
    pub(super) noise: Matrix3<f64>,
}

impl TipEstimators {
    /// Estimators of a model without a survey of the crane, and with one.
    pub(super) fn new(
        model: &Description,
        crane: &Description,
        order: &SurveyOrder,
    ) -> Result<Self, LabError> {
        let unsurveyed =
            tip_estimator(model).ok_or_else(|| SurveyError::NoTip(model.name.clone()))?;
        let survey = virtual_survey(crane, order)?;
        let fit = survey.fit(model)?;
        let map = HeightMap::fit(&survey, &|stroke| rigid_height(&unsurveyed, stroke))
            .ok_or_else(|| SurveyError::NoFit(survey.file.clone()))?;
        let noise = Matrix3::from_fn(|i, j| fit.noise[i][j]);
        Ok(Self { unsurveyed, surveyed: fit.estimator, map, noise })
    }
}

/// Height of a rigid boom's tip at a piston position \[m\].
fn rigid_height(estimator: &TipEstimator<f64>, stroke: f64) -> f64 {
    let stiff = TipParameters { bending: 0.0, base: 0.0, stroke_offset: 0.0 };
    let load = TipLoad { piston: stroke, payload: 0.0, acceleration: 0.0 };
    estimator.model.position(&stiff, &load)[1]
}

/// Results of a crane's course.
#[derive(Clone, Default)]
pub(super) struct Run {
    pub(super) errors: [Errors; Method::ALL.len()],
    pub(super) slopes: SlopeMoments,
    pub(super) course: Vec<TipInstant>,
}

/// Estimator of the tip beside a closed loop, compared with other methods and the truth.
pub(super) struct Observer<'a> {
    controller: ScheduledLqrController,
    known: &'a TipEstimators,
    at_rest: &'a RestTable,
    memory: TipMemory<f64>,
    past: VecDeque<Sample>,
    delay: usize,
    command: f64,
    number: u64,
    every: u64,
    pub(super) run: Run,
}

impl<'a> Observer<'a> {
    /// Before the first control period of a crane's course with a model's estimator.
    pub(super) fn new(
        controller: ScheduledLqrController,
        known: &'a TipEstimators,
        at_rest: &'a RestTable,
        model: &Description,
        crane: &Description,
    ) -> Self {
        Self {
            controller,
            known,
            at_rest,
            memory: TipMemory::default(),
            past: VecDeque::new(),
            delay: crane.numbers.fieldbus_delay.round() as usize,
            command: 0.0,
            number: 0,
            every: (INSTANT / model.numbers.control_period).round().max(1.0) as u64,
            run: Run::default(),
        }
    }

    /// Takes in a control period.
    pub(super) fn see(&mut self, sample: &Sample) {
        self.number += 1;
        let measurement = Measurement::new(self.number, sample.time, [sample.signals]);
        self.controller.observe(&measurement, self.command);
        if let Some(estimated) = self.controller.estimated() {
            let filter = &self.controller.estimator().filter;
            self.known.unsurveyed.update(&mut self.memory, filter, &estimated.filter);
        }
        self.command = sample.command.motor_speed;
        self.past.push_back(*sample);
        // the estimator has no measurement before the delay has passed
        if self.past.len() <= self.delay {
            return;
        }
        let Some(measured) = self.past.pop_front() else { return };
        if self.number.is_multiple_of(self.every) {
            self.compare(&measured);
        }
    }

    fn compare(&mut self, measured: &Sample) {
        let Some(estimated) = self.controller.estimated() else { return };
        let (filter, known) = (&estimated.filter, self.known);
        let model = &self.controller.estimator().filter.model;
        let payload = self.memory.payload;
        // the other methods use the same payload
        let load = TipLoad { payload, ..TipLoad::of(model, &filter.estimate) };
        let outputs = &measured.truth.outputs;
        let found = Method::ALL.map(|method| {
            let by = |tip: &TipEstimator<f64>| {
                let tip = tip.estimate(&self.memory, model, filter);
                (tip.y, tip.deviation_y)
            };
            let rigid = || rigid_height(&known.unsurveyed, load.piston);
            match method {
                Method::Rigid => (rigid(), 0.0),
                Method::Published => (self.at_rest.at(&load), 0.0),
                Method::Unsurveyed => by(&known.unsurveyed),
                Method::Map => (rigid() + known.map.at(&load), 0.0),
                Method::Surveyed => by(&known.surveyed),
            }
        });
        for (errors, (height, deviation)) in self.run.errors.iter_mut().zip(found) {
            errors.add((height - outputs.tip_y) * 1e3, deviation * 1e3);
        }
        self.run.slopes.add(Vector3::from(known.surveyed.slopes(&load).0[1]));
        self.run.course.push(TipInstant {
            time_s: measured.time,
            rigid_y_m: rigid_height(&known.unsurveyed, outputs.stroke),
            true_y_m: outputs.tip_y,
            estimated_y_m: found.map(|(height, _)| height),
            deviation_y_m: found.map(|(_, deviation)| deviation),
        });
    }
}
