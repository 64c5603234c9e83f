//! Executive in real time: simulation and control task, each a thread on a core of its own.
//!
//! The cycle allocates no memory, takes no lock, writes no log, and makes no system call but the clock and
//! the wait. Missed releases are counted. The control task skips the periods that it missed, and the
//! supervisor reports a fault after too many in a sliding window. The simulation catches up within a bound.
//! Beyond it the simulation stays delayed, and the benchmark controller takes over.
//!
//! A failure of either task is reported. If the control task panics, its thread holds the load at once and
//! until the session ends. If the simulation panics, it is marked as failed and the benchmark controller
//! takes over.

use crate::conditions::Conditions;
use crate::control_task::{ControlTask, Deadlines, Period, Record};
use crate::course::Course;
use crate::desk::Desk;
use crate::failure::{Failure, guarded, hand_panics_on};
use crate::machine::{Machine, Outgoing};
use crate::operator::Operator;
use crate::posix::{lock_memory, now, stay_awake, stolen, thread_time, wait_until};
use crate::real_time_thread::prepare;
use crate::session::{Attendant, Ending, Lookout, Order};
use crate::simulation_task::{AtRest, Simulated, SimulationTask};
use crate::slot::Slot;
use crate::timing::Timing;
use crate::trouble::Tampering;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::controller::{AxisState, SimulatedState};
use hydroboom_control::measurement::Measurement;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::supervisor::{Decision, State};
use rtrb::{Consumer, Producer, RingBuffer};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::Duration;
use thiserror::Error;

/// Cores and spin times of the tasks.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Core of the simulation.
    pub simulation_core: usize,
    /// Core of the control task.
    pub control_core: usize,
    /// Time before a release of the simulation that is spent spinning instead of sleeping \[ns\].
    pub simulation_spin: u64,
    /// The same for the control task \[ns\].
    pub control_spin: u64,
}

impl Default for Placement {
    fn default() -> Self {
        Self { simulation_core: 1, control_core: 0, simulation_spin: 25_000, control_spin: 60_000 }
    }
}

/// SCHED_FIFO priorities. The simulation has the higher one, because its steps are shorter.
const SIMULATION_PRIORITY: i32 = 80;
const CONTROL_PRIORITY: i32 = 70;

/// Largest number of steps that the simulation catches up at once: 0.1 s.
const CATCH_UP: u64 = 2000;
/// Release delay beyond which the clock has jumped or the computer was suspended \[ns\].
const CLOCK_JUMP: u64 = 1_000_000_000;
/// Capacity of the queue of records to the log: about four seconds.
const QUEUE: usize = 4096;
/// Capacity of the queue of orders to a task.
const ORDERS: usize = 16;
/// Steps over which the simulation's worst timing is taken: one control period.
const SHOWN: u64 = 20;
/// Periods of a held load at rest before a run ends.
const RESTED: u32 = 200;

/// Summary of a run in real time.
#[derive(Clone, Debug)]
pub struct RealTime {
    /// Deadline statistics of the simulation.
    pub simulation: Timing,
    /// Deadline statistics of the control task.
    pub control: Timing,
    /// Real-time privileges that the system refused, each with the consequence.
    pub lost: Vec<String>,
    /// Time that the hypervisor took from the cores of simulation and control \[s\]. None if the kernel
    /// does not report it.
    pub stolen: Option<[f64; 2]>,
    /// Records dropped because the log was too slow.
    pub dropped: u64,
    /// Failed tasks in order of failure.
    pub failures: Vec<Failure>,
    /// Last decision of the supervisor.
    pub end: Decision,
}

/// Error that prevents a run.
#[derive(Debug, Error)]
pub enum ExecutiveError {
    /// No memory for the timing histograms.
    #[error("no memory for the timing histograms")]
    Memory,
    /// A thread panicked outside its guarded task, which is a defect of the program.
    #[error("a real-time thread ended by itself")]
    Thread,
}

/// Data shared by both tasks.
struct Between {
    simulated: Slot<SIMULATED>,
    /// Whether the simulated crane moves, its pump speed, and its conditions.
    asked: Slot<4>,
    ended: AtomicBool,
    dropped: AtomicU64,
}

/// Tasks, machine and settings of a run.
pub struct Tasks {
    /// The control task.
    pub control: ControlTask,
    /// The simulation.
    pub simulation: SimulationTask,
    /// Machine.
    pub machine: Box<dyn Machine>,
    /// Periods of simulation and control task \[s\].
    pub periods: (f64, f64),
    /// Cores and spin times.
    pub placement: Placement,
}

/// Runs a session in real time. The attendant receives every record in an ordinary thread without a time
/// limit. `tamper` applies the ordered faults to a virtual machine.
///
/// # Errors
///
/// [`ExecutiveError`] if the run cannot start.
pub fn run(
    tasks: Tasks,
    lookout: Lookout<'_>,
    tamper: &mut dyn FnMut(Tampering),
) -> Result<RealTime, ExecutiveError> {
    let Tasks { control, simulation, machine, periods, placement } = tasks;
    let Lookout { desk, attendant, ending } = lookout;
    let nanoseconds = |seconds: f64| (seconds * 1e9).round() as u64;
    let (simulation_period, control_period) = (nanoseconds(periods.0), nanoseconds(periods.1));
    let timing = |period| Timing::new(period).ok_or(ExecutiveError::Memory);
    let (simulation_timing, control_timing) = (timing(simulation_period)?, timing(control_period)?);
    let between = Between {
        simulated: Slot::default(),
        asked: Slot::default(),
        ended: AtomicBool::new(false),
        dropped: AtomicU64::new(0),
    };
    let shown = Shown::default();
    between.simulated.publish(words(&simulation.simulated(), &shown));
    let (records, to_observe) = RingBuffer::new(QUEUE);
    let (mut courses, courses_taken) = RingBuffer::new(ORDERS);
    let (mut states, states_taken) = RingBuffer::new(ORDERS);
    let (simulation_fails, failures) = channel();
    let control_fails = simulation_fails.clone();
    hand_panics_on();
    let mut lost = Vec::new();
    if let Err(error) = lock_memory() {
        lost.push(format!("memory is not locked ({error}): a page may be missing in the cycle"));
    }
    let awake = stay_awake();
    if let Err(error) = &awake {
        lost.push(format!("the processor may sleep deeply ({error}): tasks are released later"));
    }
    let cores = [placement.simulation_core, placement.control_core];
    let stolen_before = cores.map(stolen);
    let between = &between;
    thread::scope(|scope| {
        let simulation = scope.spawn(move || {
            let lost = prepare("the simulation", placement.simulation_core, SIMULATION_PRIORITY);
            let simulating = Simulating {
                task: simulation,
                states: states_taken,
                timing: simulation_timing,
                spin: placement.simulation_spin,
            };
            (simulate_guarded(simulating, between, &simulation_fails), lost)
        });
        let control = scope.spawn(move || {
            // the flag is set on a panic too, so that no thread waits for this one
            let _ended = EndsWithMe(&between.ended);
            let lost = prepare("the control task", placement.control_core, CONTROL_PRIORITY);
            let steering = Steering {
                task: control,
                machine,
                desk,
                courses: courses_taken,
                records,
                ending,
                spin: placement.control_spin,
                timing: control_timing,
                sequence: 0,
                last: None,
            };
            (steer_guarded(steering, between, &control_fails), lost)
        });
        let mut hand_over = |order| match order {
            // a full queue has lost its consumer
            Order::Course(course) => drop(courses.push(course)),
            Order::Synchronise(at) => drop(states.push(*at)),
            Order::Tamper(what) => tamper(what),
        };
        let _closed = ClosesUnattended(desk);
        let failures = collect(to_observe, between, &failures, attendant, &mut hand_over);
        let ended = |_| ExecutiveError::Thread;
        let ((control, end), lost_by_control) = control.join().map_err(ended)?;
        let (simulation, lost_by_simulation) = simulation.join().map_err(ended)?;
        lost.extend(lost_by_simulation);
        lost.extend(lost_by_control);
        let dropped = between.dropped.load(Ordering::Relaxed);
        let taken = |k: usize| Some(stolen(cores[k])? - stolen_before[k]?);
        let stolen = taken(0).zip(taken(1)).map(|(simulation, control)| [simulation, control]);
        Ok(RealTime { simulation, control, lost, stolen, dropped, failures, end })
    })
}

/// Sets the flag that ends the other threads when its own thread ends.
struct EndsWithMe<'a>(&'a AtomicBool);

impl Drop for EndsWithMe<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// Requests a controlled stop and the end of the session if the attendant panics.
struct ClosesUnattended<'a>(&'a Desk);

impl Drop for ClosesUnattended<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.close();
        }
    }
}

/// Timing of the simulation as reported to the control task \[ns\].
#[derive(Clone, Copy, Default)]
struct Shown {
    late: u64,
    execution: u64,
    missed: u64,
}

/// Number of words that carry the simulation's state to the control task.
const SIMULATED: usize = 12;

fn words(simulated: &Simulated, shown: &Shown) -> [u64; SIMULATED] {
    let [inner, middle, outer] = simulated.angle.map(f64::to_bits);
    [
        simulated.steps,
        simulated.epoch,
        simulated.axis().stroke.to_bits(),
        simulated.axis().velocity.to_bits(),
        simulated.axis().load_pressure.to_bits(),
        inner,
        middle,
        outer,
        u64::from(simulated.failed),
        shown.late,
        shown.execution,
        shown.missed,
    ]
}

fn from_words(words: &[u64; SIMULATED]) -> (Simulated, Shown) {
    let number = |k: usize| f64::from_bits(words[k]);
    let simulated = Simulated {
        steps: words[0],
        epoch: words[1],
        state: SimulatedState {
            axes: [AxisState { stroke: number(2), velocity: number(3), load_pressure: number(4) }],
        },
        angle: [number(5), number(6), number(7)],
        failed: words[8] != 0,
    };
    (simulated, Shown { late: words[9], execution: words[10], missed: words[11] })
}

/// State of the simulation's thread.
struct Simulating {
    task: SimulationTask,
    states: Consumer<AtRest>,
    timing: Timing,
    spin: u64,
}

/// Cycle of the simulation. After a panic the simulation is marked as failed and keeps its last state.
fn simulate_guarded(mut with: Simulating, between: &Between, failures: &Sender<Failure>) -> Timing {
    if let Err(why) = guarded(|| simulate(&mut with, between)) {
        let failed = Simulated { failed: true, ..with.task.simulated() };
        between.simulated.publish(words(&failed, &Shown::default()));
        // an error means that the receiver has ended
        let _ = failures.send(Failure::Simulation(why));
    }
    with.timing
}

/// Cycle of the simulation.
fn simulate(with: &mut Simulating, between: &Between) {
    let Simulating { task, states, timing, spin } = with;
    let first = now();
    let mut release = first;
    let mut pump = None;
    // of the present interval, and of the one before
    let (mut worst, mut shown) = (Shown::default(), Shown::default());
    while !between.ended.load(Ordering::Acquire) {
        release += timing.period;
        wait_until(release, *spin);
        let late = now() - release;
        timing.released(late);
        // missed steps are caught up
        let missed = late / timing.period;
        let steps = 1 + missed.min(CATCH_UP);
        release += missed * timing.period;
        if timing.steps.is_multiple_of(SHOWN) {
            shown = worst;
            worst = Shown::default();
        }
        worst.late = worst.late.max(late);
        shown.missed = timing.missed;
        for _ in 0..steps {
            let clock = now();
            let before = thread_time();
            if let Ok(at) = states.pop() {
                task.synchronise(&at);
            }
            if let Some((_, [moves, numbers @ ..])) = between.asked.read() {
                let [speed, payload, transition_pressure] = numbers.map(f64::from_bits);
                pump = (moves == 1).then_some(speed);
                task.set_conditions(&Conditions { payload, transition_pressure });
            }
            if let Some(speed) = pump {
                task.step(speed);
            }
            between.simulated.publish(words(&task.simulated(), &shown));
            let on_processor = thread_time() - before;
            worst.execution = worst.execution.max(on_processor);
            timing.executed(on_processor, now() - clock, clock - first);
        }
    }
}

/// State of the control task's thread.
struct Steering<'a> {
    task: ControlTask,
    machine: Box<dyn Machine>,
    desk: &'a Desk,
    courses: Consumer<Course>,
    records: Producer<Record>,
    ending: Ending,
    spin: u64,
    timing: Timing,
    /// Sequence number of the last command.
    sequence: u64,
    /// Last record.
    last: Option<Record>,
}

/// Cycle of the control task, until the load is held and the session is to end. After a panic the load is
/// held until then.
fn steer_guarded(
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
    between.asked.publish([0; 4]);
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
        between.asked.publish([u64::from(pump.is_some()), speed, payload, transition_pressure]);
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

/// Drains the queue of records and passes orders on until both tasks have ended. Returns the failures.
fn collect(
    mut queue: Consumer<Record>,
    between: &Between,
    failures: &Receiver<Failure>,
    attendant: &mut dyn Attendant,
    hand_over: &mut dyn FnMut(Order),
) -> Vec<Failure> {
    let mut failed = Vec::new();
    loop {
        let ended = between.ended.load(Ordering::Acquire);
        while let Ok(record) = queue.pop() {
            attendant.see(&record);
        }
        for failure in failures.try_iter() {
            attendant.failed(&failure);
            failed.push(failure);
        }
        if ended {
            return failed;
        }
        attendant.orders().into_iter().for_each(&mut *hand_over);
        thread::sleep(Duration::from_millis(10));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_description::Description;

    #[test]
    fn a_simulation_that_panics_is_shown_as_failed() {
        let between = Between {
            simulated: Slot::default(),
            asked: Slot::default(),
            ended: AtomicBool::new(false),
            dropped: AtomicU64::new(0),
        };
        let task = SimulationTask::new(&Description::uia_single_boom().unwrap(), 0.2).unwrap();
        let rested = task.simulated();
        let mut timing = Timing::new(50_000).unwrap();
        // a zero period makes the task divide by zero and panic
        timing.period = 0;
        let simulating = Simulating { task, states: RingBuffer::new(1).1, timing, spin: 0 };
        let (fails, failures) = channel();
        hand_panics_on();
        simulate_guarded(simulating, &between, &fails);
        let shown = between.simulated.read().map(|(_, words)| from_words(&words).0);
        assert_eq!(shown, Some(Simulated { failed: true, ..rested }));
        let Ok(Failure::Simulation(why)) = failures.try_recv() else { panic!("nobody was told") };
        assert!(why.contains("divide by zero"), "{why}");
    }
}
