//! Replay of a log: its measurements are the machine's, and the commands have no effect.

use crate::control_task::{ControlTask, Period, Record};
use crate::course::Course;
use crate::log::Row;
use crate::machine::{Incoming, Machine, Outgoing};
use crate::setup::SetupError;
use crate::simulation_task::{AtRest, SimulationTask};
use hydroboom_control::measurement::Measurement;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::supervisor::{Request, State};
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_math::Real;
use std::sync::Arc;

/// Machine that returns the measurements of a log, one per call, and ignores commands.
pub struct Replay {
    measurements: Vec<Option<Measurement>>,
    next: usize,
    newest: Option<Incoming>,
}

impl Replay {
    /// Machine that returns the measurements of these rows in their order.
    pub fn new(rows: &[Row]) -> Self {
        let measurements = rows.iter().map(|row| row.measurement).collect();
        Self { measurements, next: 0, newest: None }
    }
}

impl Machine for Replay {
    fn read(&mut self) -> Option<Incoming> {
        let row = self.measurements.get(self.next).copied();
        self.next += 1;
        if let Some(Some(measurement)) = row {
            self.newest = Some(Incoming::new(measurement, None));
        }
        self.newest
    }

    fn write(&mut self, _sequence: u64, _outgoing: &Outgoing) {}
}

/// Logged set points as a trajectory.
struct Recorded {
    /// Time of the first set point \[s\].
    from: f64,
    period: f64,
    references: Vec<SetPoint<f64>>,
    speed: f64,
}

impl Trajectory for Recorded {
    fn reference(&self, t: f64) -> SetPoint<f64> {
        let k = ((t - self.from) / self.period).round().max(0.0) as usize;
        let beyond = k.saturating_sub(self.references.len().saturating_sub(1)) as f64;
        let last = self.references.last().copied().unwrap_or_default();
        // beyond the end of a stopped course the preview extrapolates at constant velocity
        let on = last.position + beyond * self.period * last.velocity;
        self.references.get(k).copied().unwrap_or(SetPoint { position: on, ..last })
    }
    fn duration(&self) -> f64 {
        // ends in the period of the last set point, which ended by itself or by a stop
        self.from + self.period * (self.references.len() as f64 - 1.5)
    }
    fn speed(&self) -> f64 {
        self.speed
    }
}

/// Recomputes the records of a log from its measurements, row by row. `strategy` replaces the logged control strategy;
/// none keeps it. Without rows there are no records.
///
/// # Errors
///
/// [`SetupError`] if the model cannot be built or has no supervision limits.
pub fn replay(
    model: &Description,
    rows: &[Row],
    strategy: Option<Strategy>,
) -> Result<Vec<Record>, SetupError> {
    let n = &model.numbers;
    let steps = (n.control_period / n.simulation_period).round() as u32;
    let first = rows.iter().find_map(|row| row.measurement);
    let begin = first
        .map_or(n.motion_start, |first| Real::clamp(first.axes[0].signals.stroke, 0.0, n.stroke));
    let strategy_of = |row: &Row| strategy.unwrap_or(row.strategy);
    let chosen = rows.first().map_or(Strategy::BenchmarkClosedLoop, strategy_of);
    let resting =
        Recorded { from: 0.0, period: n.control_period, references: vec![], speed: n.fast };
    let resting = Course::new(Arc::new(resting));
    let mut control = ControlTask::new(model, resting, limits(model, n.fast)?, chosen);
    let mut simulation = SimulationTask::new(model, begin)?;
    let mut machine = Replay::new(rows);
    let mut records = Vec::with_capacity(rows.len());
    let mut state = State::Idle;
    for (k, row) in rows.iter().enumerate() {
        if begins(rows, k) {
            let course = recorded(model, &rows[k..]);
            let stroke = course.reference(-course.approach()).position;
            simulation.synchronise(&AtRest::new(model, &control.conditions(), stroke)?);
            control.take(course);
        }
        // times are logged in microseconds: a row is one period unless more have passed
        let since = rows.get(k.wrapping_sub(1)).map_or(n.control_period, |b| row.time - b.time);
        let periods = (since / n.control_period).round().max(1.0);
        let record = control.period(&Period {
            elapsed: periods * n.control_period,
            incoming: machine.read(),
            simulated: Some(simulation.simulated()),
            request: request(rows, k, state),
            strategy: strategy_of(row),
            missed: 0,
            attended: true,
            clock_jumped: false,
            deadlines: None,
        });
        state = record.decision.state;
        simulation.set_conditions(&control.conditions());
        simulation.set_command_delay(control.command_delay());
        if let Some(speed) = control.simulated_motor() {
            (0..steps).for_each(|_| simulation.step(speed));
        }
        records.push(record);
    }
    Ok(records)
}

/// Whether a start was requested in this row: a release begins.
fn begins(rows: &[Row], k: usize) -> bool {
    rows[k].releasing && !rows.get(k.wrapping_sub(1)).is_some_and(|before| before.releasing)
}

/// Request in a row, inferred from the logged states.
fn request(rows: &[Row], k: usize, state: State) -> Request {
    let row = &rows[k];
    let before = if k == 0 { State::Idle } else { rows[k - 1].state };
    let is_course_over = rows[k..].iter().take(2).all(|row| row.course_time.is_none());
    match (state, row.state) {
        (State::Idle, _) => Request::Enable,
        (State::Ready, State::Holding | State::Moving) => Request::Hold,
        (_, State::Fault) if before != State::Fault && row.cause == "emergency-stop" => {
            Request::EmergencyStop
        }
        (State::Fault, State::Ready) if before == State::Fault => Request::Reset,
        (State::Moving, State::Stopping) if before == State::Moving && is_course_over => {
            Request::Stop
        }
        (State::Holding, State::Holding) if begins(rows, k) => Request::Start,
        _ => Request::None,
    }
}

/// Course of the logged set points that follow.
fn recorded(model: &Description, rows: &[Row]) -> Course {
    let running = rows.iter().skip_while(|row| row.course_time.is_none());
    let course: Vec<&Row> = running.take_while(|row| row.course_time.is_some()).collect();
    let references: Vec<SetPoint<f64>> = course
        .iter()
        .map(|row| SetPoint {
            position: row.reference.position - row.start_offset,
            ..row.reference
        })
        .collect();
    let fastest = references.iter().map(|r| r.velocity.abs()).fold(0.0, f64::max);
    let from = course.first().and_then(|row| row.course_time).unwrap_or(0.0);
    // an older log does not contain the speed, and a truncated one may not reach it
    let told = course.first().and_then(|row| row.course_speed);
    let speed = told.unwrap_or(fastest.max(model.numbers.fast));
    let path = Recorded { from, period: model.numbers.control_period, references, speed };
    Course::with_approach(Arc::new(path), -from)
}
