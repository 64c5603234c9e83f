//! Record of an estimator that runs beside a controller: its innovations, and its errors by phase of the course.

use super::quantity::{Quantity, estimates};
use crate::closed_loop::consistency_statistics::{Errors, Innovations};
use crate::closed_loop::sample::Sample;
use crate::closed_loop::scenario::Course;
use hydroboom_control::feedback::scheduled_lqr_controller::ScheduledLqrController;
use hydroboom_control::measurement::Measurement;
use hydroboom_description::Description;
use hydroboom_model::hydraulics::Oil;
use std::collections::VecDeque;

/// Window of the innovations \[s\].
const WINDOW: f64 = 1.0;
/// Lags of the autocorrelation \[s\].
const LAGS: [f64; 2] = [0.02, 0.2];
/// Interval between two evaluations of the errors \[s\]: in general, and within [`LOAD_CHANGE`] after a
/// load change.
const INSTANTS: [f64; 2] = [0.5, 0.05];
/// Time after a load change with separate rows \[s\].
const LOAD_CHANGE: f64 = 0.5;
/// Time after a load change until the end of the recovery phase \[s\].
const RECOVERY: f64 = 2.0;
/// Time after a start, stop or reversal of the reference with separate rows \[s\].
const START: f64 = 0.5;

/// Phase of a course, by the motion of the reference and the load changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The half second after a load change.
    AfterLoadChange,
    /// From 0.5 s to 2 s after a load change.
    Recovery,
    /// The half second after the reference starts, stops or reverses.
    AfterStart,
    /// The reference moves.
    Motion,
    /// The reference rests.
    Rest,
}

impl Phase {
    /// All phases, in the order of tables.
    pub const ALL: [Self; 5] =
        [Self::AfterLoadChange, Self::Recovery, Self::AfterStart, Self::Motion, Self::Rest];

    /// Name in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::AfterLoadChange => "0.5 s after a load change",
            Self::Recovery => "0.5 to 2 s after a load change",
            Self::AfterStart => "0.5 s after a start, stop or reversal",
            Self::Motion => "in motion",
            Self::Rest => "at rest",
        }
    }
}

/// Errors by phase, then by quantity.
pub(super) type ErrorTable = [[Errors; Quantity::ALL.len()]; Phase::ALL.len()];

/// Statistics of the estimator along a course of a crane.
#[derive(Clone, Debug)]
pub(super) struct Run {
    pub(super) innovations: [Innovations; 2],
    /// Longest time for which the innovations were inconsistent \[s\].
    pub(super) longest_inconsistent: f64,
    pub(super) errors: ErrorTable,
}

/// Records the statistics of an estimator that runs beside another controller.
pub(super) struct ConsistencyRecorder<'a> {
    controller: ScheduledLqrController,
    crane: &'a Description,
    course: &'a dyn Course,
    /// Control period \[s\].
    period: f64,
    /// Motor speed commanded in the previous period \[rev/s\].
    command: f64,
    /// True samples of the measurement delay and of now, newest last.
    past: VecDeque<Sample>,
    delay: usize,
    /// Number of control periods so far.
    number: usize,
    /// Direction of the reference, and the time of its last change \[s\].
    direction: (f64, f64),
    pub(super) run: Run,
}

impl<'a> ConsistencyRecorder<'a> {
    pub(super) fn new(
        controller: ScheduledLqrController,
        period: f64,
        crane: &'a Description,
        course: &'a dyn Course,
    ) -> Self {
        let samples = |time: f64| (time / period).round() as usize;
        let [first, last] = LAGS.map(samples);
        let innovations = Innovations::new(samples(WINDOW), first..=last);
        Self {
            controller,
            crane,
            course,
            period,
            command: 0.0,
            past: VecDeque::new(),
            delay: crane.numbers.fieldbus_delay.round() as usize,
            number: 0,
            direction: (0.0, f64::NEG_INFINITY),
            run: Run {
                innovations: [innovations.clone(), innovations],
                longest_inconsistent: 0.0,
                errors: ErrorTable::default(),
            },
        }
    }

    /// Processes a control period.
    pub(super) fn record(&mut self, sample: &Sample) {
        self.number += 1;
        let measurement = Measurement::new(self.number as u64, sample.time, [sample.signals]);
        let has_begun = self.controller.estimated().is_some();
        self.controller.observe(&measurement, self.command);
        self.command = sample.command.motor_speed;
        self.past.push_back(*sample);
        // the estimator has no measurement before the delay has passed
        if self.past.len() <= self.delay {
            return;
        }
        let Some(measured) = self.past.pop_front() else { return };
        self.follow_reference(&measured);
        if has_begun {
            self.compare(&measured, sample.signals.motor_speed);
        }
    }

    fn follow_reference(&mut self, measured: &Sample) {
        let velocity = measured.reference.velocity;
        let direction = if velocity == 0.0 { 0.0 } else { velocity.signum() };
        if direction != self.direction.0 {
            self.direction = (direction, measured.time);
        }
    }

    /// Compares the estimate with the true state at the time of the measurement; `motor_speed` is the
    /// measured one \[rev/s\].
    fn compare(&mut self, measured: &Sample, motor_speed: f64) {
        let Some(estimated) = self.controller.estimated() else { return };
        let filter = &estimated.filter;
        self.run.longest_inconsistent = self.run.longest_inconsistent.max(filter.inconsistent_time);
        let phase = self.phase(measured.time);
        let is_load_change = phase == Phase::AfterLoadChange;
        for (k, innovations) in self.run.innovations.iter_mut().enumerate() {
            let normalised = filter.nis[k].max(0.0).sqrt().copysign(filter.innovation[k]);
            innovations.add((!is_load_change).then_some(normalised));
        }
        let periods = (INSTANTS[usize::from(is_load_change)] / self.period).round() as usize;
        let number = (measured.time / self.period).round() as usize;
        if !number.is_multiple_of(periods.max(1)) {
            return;
        }
        let settings = &self.controller.estimator().filter;
        let found = estimates(settings, filter, motor_speed, estimated.rod_side_term);
        let truth = self.truth(measured);
        let errors = &mut self.run.errors[phase as usize];
        for ((errors, (value, deviation)), truth) in errors.iter_mut().zip(found).zip(truth) {
            errors.add(value - truth, deviation);
        }
    }

    fn phase(&self, time: f64) -> Phase {
        let mut loads = self.course.loads().iter();
        let since_load =
            loads.rfind(|load| load.time < time).map_or(f64::INFINITY, |load| time - load.time);
        let (direction, changed) = self.direction;
        if since_load <= LOAD_CHANGE {
            Phase::AfterLoadChange
        } else if since_load <= RECOVERY {
            Phase::Recovery
        } else if time - changed <= START {
            Phase::AfterStart
        } else if direction != 0.0 {
            Phase::Motion
        } else {
            Phase::Rest
        }
    }

    fn truth(&self, measured: &Sample) -> [f64; Quantity::ALL.len()] {
        let (truth, o) = (&measured.truth, &measured.truth.outputs);
        let n = &self.crane.numbers;
        let hung = self.course.loads().iter().rfind(|load| load.time < measured.time);
        Quantity::ALL.map(|quantity| match quantity {
            Quantity::Position => o.stroke,
            Quantity::Velocity => o.velocity,
            Quantity::LoadPressure => {
                o.pressure_a - self.crane.cylinder().area_ratio() * o.pressure_b
            }
            Quantity::Payload => hung.map_or(n.payload, |load| load.mass),
            Quantity::Friction | Quantity::FrictionAndUnknownForce => o.friction_force,
            Quantity::BulkModulus => Oil {
                bulk_modulus_max: n.bulk_modulus_max,
                bulk_modulus_min: n.bulk_modulus_min,
                transition_pressure: truth.transition_pressure,
                transition_slope: 1.0 / n.transition_width,
                vapour_pressure: n.vapour_pressure,
            }
            .bulk_modulus(o.pressure_a),
        })
    }
}
