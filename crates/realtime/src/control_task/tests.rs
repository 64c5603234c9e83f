//! Fallback to the benchmark controller, and recovery of what failed.

use super::*;
use crate::machine::Incoming;
use crate::operator::Operator;
use crate::simulation_task::SimulationTask;
use hydroboom_control::estimation::state_estimator::StateEstimator;
use hydroboom_control::feedback::scheduled_lqr::ScheduledLqr;
use hydroboom_control::supervision::supervisor::State;
use hydroboom_design::limits;
use hydroboom_design::scheduled_lqr::designed;
use hydroboom_virtual_crane::VirtualCrane;
use std::sync::Arc;

const PERIOD: f64 = 1e-3;
const ASKED: Strategy = Strategy::ScheduledLqr;

/// Virtual crane with a control task.
struct Rig {
    model: Description,
    control: ControlTask,
    simulation: SimulationTask,
    machine: VirtualCrane,
    operator: Operator,
    number: u64,
}

impl Rig {
    fn new() -> Self {
        let model = Description::uia_single_boom().unwrap();
        let crane = Description::uia_virtual().unwrap();
        let motion = crane.motion(model.numbers.fast);
        let mut start = crane.start(motion.start);
        start.preload = 0.0;
        let course = Course::new(Arc::new(motion));
        let limits = limits(&model, motion.speed).unwrap();
        Self {
            control: ControlTask::new(&model, course, limits, ASKED),
            simulation: SimulationTask::new(&model, motion.start).unwrap(),
            machine: VirtualCrane::new(&crane, &start).unwrap(),
            operator: Operator::automatic(PERIOD),
            number: 0,
            model,
        }
    }

    fn period(&mut self) -> Record {
        self.number += 1;
        let measurement = Measurement { number: self.number, ..self.machine.measurement() };
        let record = self.control.period(&Period {
            elapsed: PERIOD,
            incoming: Some(Incoming::new(measurement, self.machine.valve())),
            simulated: Some(self.simulation.simulated()),
            request: self.operator.request(),
            strategy: ASKED,
            missed: 0,
            attended: true,
            clock_jumped: false,
            deadlines: None,
        });
        self.operator.see(&record.decision);
        if let Some(speed) = self.control.simulated_motor() {
            (0..20).for_each(|_| self.simulation.step(speed));
        }
        self.machine.advance(&record.decision.command).unwrap();
        record
    }

    /// Runs until a time of the course \[s\].
    fn until(&mut self, time: f64) -> Record {
        for _ in 0..60_000 {
            let record = self.period();
            assert_eq!(record.decision.cause, None);
            if record.course_time.is_some_and(|now| now >= time) {
                return record;
            }
        }
        panic!("the course does not come to {time} s");
    }

    /// Runs until the load is held again.
    fn rest_of_course(&mut self) -> Vec<Record> {
        let mut records = Vec::new();
        while !self.operator.is_done() && records.len() < 60_000 {
            records.push(self.period());
        }
        records
    }

    /// Replaces the scheduled LQR by a changed one that has observed the last measurement.
    fn replace(&mut self, change: impl Fn(&mut StateEstimator<f64>, &mut ScheduledLqr<f64>)) {
        let delay = known_delay(&self.model) as usize;
        let (mut estimator, mut law) = designed(&self.model, delay).unwrap();
        change(&mut estimator, &mut law);
        let mut controller = ScheduledLqrController::new(estimator, law, self.control.area_ratio);
        controller.observe(&self.control.measurement, self.control.decision.command.motor_speed);
        controller.take_over(self.control.preview.now().position);
        self.control.scheduled_lqr = Some(controller);
    }
}

/// The benchmark controller completes the course. The command jumps no further than the motor's slew limit
/// allows in a period.
fn the_benchmark_finishes(before: &Record, after: &[Record], cause: Fallback) {
    let at = after.iter().position(|r| r.fallback.is_some()).expect("it is followed on");
    assert_eq!(
        (after[at].fallback, after[at].strategy),
        (Some(cause), Strategy::BenchmarkClosedLoop)
    );
    let previous = if at == 0 { before } else { &after[at - 1] };
    let speed = |r: &Record| r.decision.command.motor_speed;
    let jump = speed(&after[at]) - speed(previous);
    assert!(jump.abs() < 0.5, "a jump of {jump} rev/s");
    // a failed strategy is not retried in motion
    let rest = &after[at..];
    let controlled = rest.iter().filter(|r| r.decision.controls);
    assert!(controlled.clone().count() > 1000, "no motion left");
    for record in controlled {
        assert_eq!(
            (record.fallback, record.strategy),
            (Some(cause), Strategy::BenchmarkClosedLoop)
        );
        assert!(speed(record).is_finite());
    }
    let end = rest[rest.len() - 1].decision;
    assert_eq!((end.state, end.cause), (State::Holding, None));
}

#[test]
fn a_command_that_is_not_finite_falls_back_to_the_benchmark() {
    let mut rig = Rig::new();
    let before = rig.until(4.0);
    assert_eq!((before.strategy, before.fallback), (ASKED, None));
    rig.replace(|_, law| law.settings.position_tolerance = f64::NAN);
    let after = rig.rest_of_course();
    assert_eq!(after[0].fallback, Some(Fallback::Command));
    the_benchmark_finishes(&before, &after, Fallback::Command);
}

#[test]
fn a_diverged_estimator_falls_back_to_the_benchmark() {
    let mut rig = Rig::new();
    let before = rig.until(4.0);
    // with a divergence time of zero it diverges at once: the filter starts at rest while the piston moves
    rig.replace(|estimator, _| estimator.filter.divergence_time = 0.0);
    let after = rig.rest_of_course();
    the_benchmark_finishes(&before, &after, Fallback::Estimator);
}

/// Non-finite estimates must not persist while the load is held: every later course would run under the
/// benchmark controller.
#[test]
fn a_nonfinite_estimator_restarts_while_the_load_is_held() {
    let mut rig = Rig::new();
    let before = rig.until(4.0);
    // the friction is not used while the load is held, so that the NaN appears in motion
    rig.replace(|estimator, _| estimator.filter.model.coulomb = f64::NAN);
    let after = rig.rest_of_course();
    the_benchmark_finishes(&before, &after, Fallback::Estimator);
    let moving = after.iter().rfind(|r| r.decision.controls).unwrap().estimates.unwrap();
    assert!(moving.state.transition_pressure.is_nan(), "it has not failed");
    let held = after[after.len() - 1].estimates.unwrap();
    let numbers = held.state.to_array().into_iter().chain(held.deviation.to_array());
    assert!(numbers.into_iter().all(f64::is_finite), "{held:?}");
}
