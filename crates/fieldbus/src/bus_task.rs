//! Bus task: a thread of its own that starts the bus, exchanges frames in step with SYNC0, and ends it.
//!
//! It sleeps until a frame is due, and while it waits for the answer. The control task has a [`FieldbusMachine`],
//! which uses atomics only. The devices' watchdogs expire where frames stop, so the thread that starts the devices
//! also runs the cycle.

use crate::bus::Bus;
use crate::check::DeviceFacts;
use crate::cycle_record::CycleRecord;
use crate::fault::Fault;
use crate::link::Link;
use crate::machine::FieldbusMachine;
use crate::start_up::{InitialState, StartError};
use crate::statistics::{Counters, Times};
use crate::table::Table;
use crate::time::now;
use hydroboom_realtime::failure::{guarded, hand_panics_on};
use hydroboom_realtime::machine::Delay;
use hydroboom_realtime::real_time_thread::prepare;
use rtrb::Consumer;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread::{self, JoinHandle};

/// Priority under SCHED_FIFO: between the simulation and the control task, whose core it shares.
pub(crate) const PRIORITY: i32 = 75;

/// Statistics of a bus, and its fault, at its end.
#[derive(Clone, Debug)]
pub struct BusReport {
    /// Counters of exchanges, losses and late frames.
    pub counters: Counters,
    /// Expected working counter of an exchange.
    pub working_counter: u16,
    /// Distributions of margins to SYNC0 and of round trips.
    pub times: Times,
    /// Delays from sampling; none where no command has acted.
    pub delay: Option<Delay>,
    /// The fault that stopped the machine, in a sentence with what to do.
    pub fault: Option<(Fault, String)>,
    /// The frames of the last two seconds before the fault, as pcapng; none without a fault.
    pub frames: Option<Vec<u8>>,
    /// Privileges that the system refused, and failures of the task.
    pub remarks: Vec<String>,
}

/// A bus that has started.
#[derive(Debug)]
pub struct Started {
    /// Thread of the bus task.
    pub thread: BusThread,
    /// The control task's side.
    pub machine: FieldbusMachine,
    /// Data that the devices reported at start-up.
    pub facts: Vec<DeviceFacts>,
    /// Records of its cycles.
    pub records: Consumer<CycleRecord>,
}

/// A bus in a thread of its own. Dropped, it ends the bus.
#[derive(Debug)]
pub struct BusThread {
    stop: Arc<AtomicBool>,
    /// None after it has ended.
    thread: Option<JoinHandle<Option<BusReport>>>,
}

/// Data that the thread of a bus hands over once it has started.
type HandOver = Result<(FieldbusMachine, Vec<DeviceFacts>, Consumer<CycleRecord>), StartError>;

impl BusThread {
    /// Starts the bus of a table on a link, in a thread on a core; returns once its devices have reached a state.
    ///
    /// # Errors
    ///
    /// - [`StartError::Mismatch`] where the devices are not those of the table, or not set up as it says.
    /// - [`StartError::Failed`] where a part of the start-up failed, or the thread panicked.
    pub fn start<L: Link + Send + 'static>(
        state: InitialState,
        table: Table,
        link: L,
        core: usize,
    ) -> Result<Started, StartError> {
        hand_panics_on();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let (started, answer) = channel();
        let thread = thread::spawn(move || run(state, table, link, core, &stopped, &started));
        match answer.recv() {
            Ok(Ok((machine, facts, records))) => {
                Ok(Started { thread: Self { stop, thread: Some(thread) }, machine, facts, records })
            }
            Ok(Err(error)) => Err(error),
            Err(_) => Err(StartError::Failed("the bus task ended by itself".into())),
        }
    }

    /// Whether its thread has ended by itself.
    pub fn has_ended(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Switches the drives off, brings the devices to INIT, and ends. No report where the task failed outside its
    /// cycle, or the bus did not start again after a reset.
    pub fn end(mut self) -> Option<BusReport> {
        self.join()
    }

    fn join(&mut self) -> Option<BusReport> {
        self.stop.store(true, Ordering::Release);
        self.thread.take()?.join().ok().flatten()
    }
}

impl Drop for BusThread {
    fn drop(&mut self) {
        self.join();
    }
}

/// The bus task; none where the bus did not start.
fn run<L: Link>(
    state: InitialState,
    table: Table,
    link: L,
    core: usize,
    stop: &AtomicBool,
    started: &Sender<HandOver>,
) -> Option<BusReport> {
    let mut remarks = prepare("the bus task", core, PRIORITY);
    let mut bus = match Bus::start_in(state, table, link) {
        Ok(bus) => bus,
        Err(error) => {
            // the send fails where the starting thread has ended
            let _ = started.send(Err(error));
            return None;
        }
    };
    let machine = bus.take_machine()?;
    let records = bus.records();
    let _ = started.send(Ok((machine, bus.facts().to_vec(), records)));
    loop {
        let cycle = guarded(|| {
            while !stop.load(Ordering::Acquire) && !bus.is_restart_due() {
                bus.cycle();
            }
            if !bus.is_restart_due() {
                bus.end();
            }
        });
        if let Err(why) = cycle {
            remarks.push(format!("the bus task failed, and the devices' watchdogs acted: {why}"));
            break;
        }
        if !bus.is_restart_due() {
            break;
        }
        bus = match bus.restart_by_a_person() {
            Ok(bus) => bus,
            Err(error) => {
                // the control task detects that measurements are missing
                eprintln!("the bus did not start again: {error}");
                return None;
            }
        };
    }
    Some(BusReport {
        counters: bus.counters(),
        working_counter: bus.working_counter(),
        times: bus.times().clone(),
        delay: bus.delay(),
        fault: bus.fault().zip(bus.fault_sentence()),
        frames: bus.fault().map(|_| bus.frames().pcapng(now())),
        remarks,
    })
}
