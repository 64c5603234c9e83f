//! The executive in real time: simulation and control, each a thread on a core of its own.
//!
//! In the cycle nothing is allocated, locked or logged, and no system call is made but for the
//! clock and the wait. Overruns are counted. The control task leaves out the periods it missed, and the
//! supervisor faults after too many in a row; the simulation catches up within a bound, beyond which it is
//! left behind and the benchmark takes over.

use crate::control_task::{ControlTask, Period, Record};
use crate::desk::Desk;
use crate::machine::Machine;
use crate::operator::Operator;
use crate::posix::{lock_memory, now, pin_to, run_first, stay_awake, thread_time, wait_until};
use crate::simulation_task::{Simulated, SimulationTask};
use crate::slot::Slot;
use crate::timing::Timing;
use hydroboom_control::{Decision, Measured};
use rtrb::{Consumer, Producer, RingBuffer};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;
use thiserror::Error;

/// Where and how the tasks run.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Core of the simulation.
    pub simulation_core: usize,
    /// Core of the control task.
    pub control_core: usize,
    /// Time that is spun and not slept before a release of the simulation \[ns\].
    pub simulation_spin: u64,
    /// The same of the control task \[ns\].
    pub control_spin: u64,
}

impl Default for Placement {
    fn default() -> Self {
        Self { simulation_core: 1, control_core: 0, simulation_spin: 25_000, control_spin: 60_000 }
    }
}

/// Priorities under SCHED_FIFO: the simulation first, because it is the shorter.
const SIMULATION_PRIORITY: i32 = 80;
const CONTROL_PRIORITY: i32 = 70;

/// Steps that the simulation makes up for at once, at most: a tenth of a second.
const CATCH_UP: u64 = 2000;
/// A release so late means that the clock has jumped, or the machine slept \[ns\].
const CLOCK_JUMP: u64 = 1_000_000_000;
/// Records on their way to the log, at most: four seconds.
const QUEUE: usize = 4096;

/// What a run in real time came to.
#[derive(Clone, Debug)]
pub struct RealTime {
    /// Deadlines of the simulation.
    pub simulation: Timing,
    /// Deadlines of the control task.
    pub control: Timing,
    /// What the system did not grant, and what that costs.
    pub lost: Vec<String>,
    /// Records that the log was too slow for.
    pub dropped: u64,
    /// What was decided last.
    pub end: Decision,
}

/// Why there was no run.
#[derive(Debug, Error)]
pub enum ExecutiveError {
    /// No memory for the histograms.
    #[error("no memory for the timing histograms")]
    Memory,
    /// A thread ended by a panic, which is a bug.
    #[error("a real-time thread ended by itself")]
    Thread,
}

/// Between both tasks.
struct Between {
    /// Steps taken, stroke, load pressure, whether it failed.
    simulated: Slot<4>,
    /// Whether it shall move, and with which pump speed.
    pump: Slot<2>,
    ended: AtomicBool,
    dropped: AtomicU64,
}

/// Runs one course in real time. `observe` is shown every record, in an ordinary thread; it may be as
/// slow as it likes.
///
/// # Errors
///
/// [`ExecutiveError`] when it cannot begin.
pub fn run(
    control: ControlTask,
    simulation: SimulationTask,
    machine: Box<dyn Machine>,
    desk: &Desk,
    periods: (f64, f64),
    placement: &Placement,
    mut observe: impl FnMut(&Record),
) -> Result<RealTime, ExecutiveError> {
    let nanoseconds = |seconds: f64| (seconds * 1e9).round() as u64;
    let (simulation_period, control_period) = (nanoseconds(periods.0), nanoseconds(periods.1));
    let timing = |period| Timing::new(period).ok_or(ExecutiveError::Memory);
    let (simulation_timing, control_timing) = (timing(simulation_period)?, timing(control_period)?);
    let between = Between {
        simulated: Slot::default(),
        pump: Slot::default(),
        ended: AtomicBool::new(false),
        dropped: AtomicU64::new(0),
    };
    show(&between, &simulation.simulated());
    let (producer, consumer) = RingBuffer::new(QUEUE);
    let mut lost = Vec::new();
    if let Err(error) = lock_memory() {
        lost.push(format!("memory is not locked ({error}): a page may be missing in the cycle"));
    }
    let awake = stay_awake();
    if let Err(error) = &awake {
        lost.push(format!("the processor may sleep deeply ({error}): tasks are released later"));
    }
    let between = &between;
    thread::scope(|scope| {
        let simulation = scope.spawn(move || {
            let lost = prepare("the simulation", placement.simulation_core, SIMULATION_PRIORITY);
            (simulate(simulation, between, simulation_timing, placement.simulation_spin), lost)
        });
        let control = scope.spawn(move || {
            let lost = prepare("the control task", placement.control_core, CONTROL_PRIORITY);
            let spin = placement.control_spin;
            let done = steer(control, machine, desk, between, producer, control_timing, spin);
            between.ended.store(true, Ordering::Release);
            (done, lost)
        });
        collect(consumer, between, &mut observe);
        let ended = |_| ExecutiveError::Thread;
        let ((control, end), lost_by_control) = control.join().map_err(ended)?;
        let (simulation, lost_by_simulation) = simulation.join().map_err(ended)?;
        lost.extend(lost_by_simulation);
        lost.extend(lost_by_control);
        let dropped = between.dropped.load(Ordering::Relaxed);
        Ok(RealTime { simulation, control, lost, dropped, end })
    })
}

/// Makes the calling thread a real-time one as far as the system lets it; what it did not.
fn prepare(task: &str, core: usize, priority: i32) -> Vec<String> {
    let mut lost = Vec::new();
    if let Err(error) = pin_to(core) {
        lost.push(format!("{task} is not pinned to core {core} ({error}): it may wander"));
    }
    if let Err(error) = run_first(priority) {
        lost.push(format!("{task} has no real-time priority ({error}): others may come first"));
    }
    lost
}

fn show(between: &Between, simulated: &Simulated) {
    between.simulated.publish([
        simulated.steps,
        simulated.measured.stroke.to_bits(),
        simulated.measured.load_pressure.to_bits(),
        u64::from(simulated.failed),
    ]);
}

/// The simulation's cycle.
fn simulate(mut task: SimulationTask, between: &Between, mut timing: Timing, spin: u64) -> Timing {
    let first = now();
    let mut release = first;
    let mut pump = None;
    while !between.ended.load(Ordering::Acquire) {
        release += timing.period;
        wait_until(release, spin);
        let late = now() - release;
        timing.released(late);
        // what was missed is made up for
        let missed = late / timing.period;
        let steps = 1 + missed.min(CATCH_UP);
        release += missed * timing.period;
        for _ in 0..steps {
            let clock = now();
            let before = thread_time();
            if let Some((_, words)) = between.pump.read() {
                pump = (words[0] == 1).then(|| f64::from_bits(words[1]));
            }
            if let Some(speed) = pump {
                task.step(speed);
                show(between, &task.simulated());
            }
            let on_processor = thread_time() - before;
            timing.executed(on_processor, now() - clock, clock - first);
        }
    }
    timing
}

/// The control task's cycle, until the load is held and nothing more is to be done.
fn steer(
    mut task: ControlTask,
    mut machine: Box<dyn Machine>,
    desk: &Desk,
    between: &Between,
    mut log: Producer<Record>,
    mut timing: Timing,
    spin: u64,
) -> (Timing, Decision) {
    let mut operator = Operator::new(false);
    let first = now();
    let mut release = first;
    let mut overruns = 0_u32;
    let mut sequence = 0;
    let mut done_for = 0;
    loop {
        release += timing.period;
        wait_until(release, spin);
        let late = now() - release;
        timing.released(late);
        let missed = late / timing.period;
        overruns = if missed > 0 { overruns.saturating_add(missed as u32) } else { 0 };
        release += missed * timing.period;

        let clock = now();
        let before = thread_time();
        operator.start = desk.is_started();
        operator.stop = desk.is_stopped();
        operator.emergency |= desk.take_emergency();
        let simulated = between.simulated.read().map(|(_, words)| Simulated {
            steps: words[0],
            measured: Measured {
                stroke: f64::from_bits(words[1]),
                load_pressure: f64::from_bits(words[2]),
            },
            failed: words[3] != 0,
        });
        let record = task.period(&Period {
            incoming: machine.read(),
            simulated,
            request: operator.request(),
            strategy: desk.strategy(),
            overruns,
            attended: true,
            clock_jumped: late > CLOCK_JUMP,
        });
        operator.see(&record.decision);
        sequence += 1;
        machine.write(sequence, &record.decision.command);
        let pump = task.simulated_motor();
        between.pump.publish([u64::from(pump.is_some()), pump.unwrap_or(0.0).to_bits()]);
        if log.push(record).is_err() {
            between.dropped.fetch_add(1, Ordering::Relaxed);
        }
        let on_processor = thread_time() - before;
        timing.executed(on_processor, now() - clock, clock - first);

        // a stopped motor and a shut valve have to reach the machine too
        let at_rest = record.decision.command.motor_speed == 0.0
            && record.decision.command.holding_valve == 0.0;
        done_for = if operator.is_done() && at_rest { done_for + 1 } else { 0 };
        if done_for > 200 {
            return (timing, record.decision);
        }
    }
}

/// Takes the records out of the queue, until both tasks have ended.
fn collect(mut queue: Consumer<Record>, between: &Between, observe: &mut dyn FnMut(&Record)) {
    loop {
        let ended = between.ended.load(Ordering::Acquire);
        while let Ok(record) = queue.pop() {
            observe(&record);
        }
        if ended {
            return;
        }
        thread::sleep(Duration::from_millis(20));
    }
}
