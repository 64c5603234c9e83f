//! Thread of the control task: its cycle, and the load held after a failure.

use super::Between;
use super::simulation_thread::{ASKED, Shown, from_words};
use crate::conditions::Conditions;
use crate::control_task::{ControlTask, Deadlines, Period, Record};
use crate::course::Course;
use crate::desk::Desk;
use crate::failure::{Failure, guarded};
use crate::machine::{Machine, Outgoing};
use crate::operator::Operator;
use crate::posix::{now, thread_time, wait_until};
use crate::session::Ending;
use crate::timing::Timing;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::Measurement;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::supervisor::{Decision, State};
use rtrb::{Consumer, Producer};
use std::sync::atomic::Ordering;
use std::sync::mpsc::Sender;

/// Release delay beyond which the clock has jumped or the computer was suspended \[ns\].
const CLOCK_JUMP: u64 = 1_000_000_000;
/// Periods of a held load at rest before a run ends.
const RESTED: u32 = 200;

/// State of the control task's thread.
pub(super) struct Steering<'a> {
    pub(super) task: ControlTask,
    pub(super) machine: Box<dyn Machine>,
    pub(super) desk: &'a Desk,
    pub(super) courses: Consumer<Course>,
    pub(super) records: Producer<Record>,
    pub(super) ending: Ending,
    pub(super) spin: u64,
    pub(super) timing: Timing,
    /// Sequence number of the last command.
    pub(super) sequence: u64,
    /// Last record.
    pub(super) last: Option<Record>,
}

/// Cycle of the control task, until the load is held and the session is to end. After a panic the load is
/// held until then.
pub(super) fn steer_guarded(
    mut with: Steering<'_>,
    between: &Between,
    failures: &Sender<Failure>,
) -> (Timing, Decision) {
    let end = match guarded(|| steer(&mut with, between)) {
        Ok(ended) => ended,
        Err(why) => hold(&mut with, between, why, failures),
    };
    (with.timing, end)
}

/// Holds the load after a failure of the control task: at once, then in every period until the session
/// ends.
fn hold(
    with: &mut Steering<'_>,
    between: &Between,
    why: String,
    failures: &Sender<Failure>,
) -> Decision {
    let Steering { task, machine, desk, records, ending, spin, timing, sequence, last, .. } = with;
    let mut shut = || {
        *sequence += 1;
        guarded(|| machine.write(*sequence, &Outgoing::SAFE)).is_ok()
    };
    let mut is_heard = shut();
    // the simulation stops
    between.asked.publish([0; ASKED]);
    // an error means that the receiver has ended
    let _ = failures.send(Failure::Control(why));
    let decision = Decision {
        command: AxisCommand { motor_speed: 0.0, holding_valve: 0.0 },
        state: State::Fault,
        cause: Some(Cause::ControllerInvalid),
        ..Decision::IDLE
    };
    let mut record = Record {
        decision,
        course_time: None,
        deadlines: None,
        ..last.unwrap_or_else(|| unrecorded(decision, desk.strategy(), task.conditions()))
    };
    let period = timing.period as f64 * 1e-9;
    let mut release = now();
    let mut done_for = 0;
    loop {
        record.time += period;
        if records.push(record).is_err() {
            between.dropped.fetch_add(1, Ordering::Relaxed);
        }
        done_for = match *ending == Ending::OnceDone || desk.is_closing() {
            true => done_for + 1,
            false => 0,
        };
        if done_for > RESTED {
            return decision;
        }
        release = now().max(release + timing.period);
        wait_until(release, *spin);
        // a machine whose write fails too is left to its own watchdog
        is_heard = is_heard && shut();
    }
}

/// Record for a control task that failed before its first record.
fn unrecorded(decision: Decision, strategy: Strategy, conditions: Conditions) -> Record {
    Record {
        time: 0.0,
        course_time: None,
        course_speed: 0.0,
        reference: SetPoint::default(),
        start_offset: 0.0,
        measurement: Measurement::default(),
        status: None,
        link: None,
        simulated: None,
        decision,
        strategy,
        fallback: None,
        estimates: None,
        conditions,
        deadlines: None,
    }
}

/// Cycle of the control task.
fn steer(with: &mut Steering<'_>, between: &Between) -> Decision {
    let Steering { task, machine, desk, courses, records, ending, spin, timing, sequence, last } =
        with;
    let mut operator = Operator::new(timing.period as f64 * 1e-9);
    let first = now();
    let mut release = first;
    let mut executed = first;
    let mut done_for = 0;
    let mut execution = 0;
    loop {
        release = machine.release(release + timing.period);
        wait_until(release, *spin);
        let late = now().saturating_sub(release);
        timing.released(late);
        let missed = late / timing.period;
        release += missed * timing.period;

        let clock = now();
        let elapsed = clock.saturating_sub(executed) as f64 * 1e-9;
        executed = clock;
        let before = thread_time();
        operator.listen(desk);
        if let Ok(course) = courses.pop() {
            task.take(course);
        }
        let seen = between.simulated.read().map(|(_, words)| from_words(&words));
        let shown = seen.map_or(Shown::default(), |(_, shown)| shown);
        let record = task.period(&Period {
            elapsed,
            incoming: machine.read(),
            simulated: seen.map(|(simulated, _)| simulated),
            request: operator.request(),
            strategy: desk.strategy(),
            missed: u32::try_from(missed).unwrap_or(u32::MAX),
            attended: desk.is_attended(),
            clock_jumped: late > CLOCK_JUMP,
            deadlines: Some(Deadlines {
                control_late: late,
                control_execution: execution,
                control_missed: timing.missed,
                simulation_late: shown.late,
                simulation_execution: shown.execution,
                simulation_missed: shown.missed,
            }),
        });
        operator.see(&record.decision);
        *sequence += 1;
        // a command computed before this process was suspended is not sent afterwards
        let is_late = (now() - clock) as f64 * 1e-9 > task.watchdog();
        let outgoing = if is_late { Outgoing::SAFE } else { Outgoing::of(&record.decision) };
        machine.write(*sequence, &outgoing);
        *last = Some(record);
        let pump = task.simulated_motor();
        let Conditions { payload, transition_pressure } = task.conditions();
        let [speed, payload, transition_pressure] =
            [pump.unwrap_or(0.0), payload, transition_pressure].map(f64::to_bits);
        let (moves, delay) = (u64::from(pump.is_some()), task.command_delay() as u64);
        between.asked.publish([moves, delay, speed, payload, transition_pressure]);
        if records.push(record).is_err() {
            between.dropped.fetch_add(1, Ordering::Relaxed);
        }
        execution = thread_time() - before;
        timing.executed(execution, now() - clock, clock - first);

        // the final command, motor at zero and valve shut, must reach the machine before the loop ends
        done_for = match ending.has_come(&operator, desk, &record.decision) {
            true => done_for + 1,
            false => 0,
        };
        if done_for > RESTED {
            return record.decision;
        }
    }
}
