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

mod control_thread;
mod simulation_thread;

use crate::control_task::{ControlTask, Record};
use crate::desk::Desk;
use crate::failure::{Failure, hand_panics_on};
use crate::machine::Machine;
use crate::posix::{lock_memory, stay_awake, stolen};
use crate::real_time_thread::prepare;
use crate::session::{Attendant, Lookout, Order};
use crate::simulation_task::SimulationTask;
use crate::slot::Slot;
use crate::timing::Timing;
use crate::trouble::Tampering;
use control_thread::{Steering, steer_guarded};
use hydroboom_control::supervision::supervisor::Decision;
use rtrb::{Consumer, RingBuffer};
use simulation_thread::{ASKED, SIMULATED, Shown, Simulating, simulate_guarded, words};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;
use thiserror::Error;

/// Processor cores and spin times of the real-time tasks.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Number of the core of the simulation task.
    pub simulation_core: usize,
    /// Number of the core of the control task.
    pub control_core: usize,
    /// Time before a release of the simulation task that is spent polling the clock instead of sleeping \[ns\].
    pub simulation_spin: u64,
    /// Time before a release of the control task that is spent polling the clock instead of sleeping \[ns\].
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

/// Capacity of the queue of records to the log: about four seconds.
const QUEUE: usize = 4096;
/// Capacity of the queue of orders to a task.
const ORDERS: usize = 16;

/// Deadline statistics, losses and failures of a run in real time.
#[derive(Clone, Debug)]
pub struct RealTime {
    /// Deadline statistics of the simulation task.
    pub simulation: Timing,
    /// Deadline statistics of the control task.
    pub control: Timing,
    /// Real-time privileges that the system refused, each with the consequence.
    pub lost: Vec<String>,
    /// Time that the hypervisor took from the cores of simulation and control \[s\]. None if the kernel
    /// does not report it.
    pub stolen: Option<[f64; 2]>,
    /// Number of records dropped because the log was too slow.
    pub dropped: u64,
    /// Failed tasks in order of failure; empty if none failed.
    pub failures: Vec<Failure>,
    /// Last decision of the supervisor.
    pub end: Decision,
}

/// Reason why a run in real time cannot be carried out.
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
    asked: Slot<ASKED>,
    ended: AtomicBool,
    dropped: AtomicU64,
}

/// Tasks, machine and settings of a run.
pub struct Tasks {
    /// Control task in its initial state.
    pub control: ControlTask,
    /// Simulation task in its initial state.
    pub simulation: SimulationTask,
    /// Machine, real or virtual.
    pub machine: Box<dyn Machine>,
    /// Periods of simulation and control task \[s\].
    pub periods: (f64, f64),
    /// Cores and spin times of both tasks.
    pub placement: Placement,
}

/// Runs a session in real time until its end condition holds. The attendant receives every record in an ordinary
/// thread without a time limit. `tamper` applies the ordered faults to a virtual machine.
///
/// Privileges that the system refuses are no error: they are in [`RealTime::lost`]. If the attendant panics, the
/// session is ended by a controlled stop.
///
/// # Errors
///
/// - [`ExecutiveError::Memory`], before the run, without memory for the timing histograms.
/// - [`ExecutiveError::Thread`], after it, if a thread panicked outside its guarded task.
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
