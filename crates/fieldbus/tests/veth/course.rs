//! By hand, for half a minute each: a course of the virtual crane at 120 mm/s in real time, over the interfaces, and
//! over shared memory in its place.
//!
//! ```sh
//! cargo test --release -p hydroboom-fieldbus --test veth -- --ignored --nocapture
//! ```

use crate::allocations::count;
use crate::{BUS, is_in_its_namespace, lay_cable, play, table_of_three};
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_fieldbus::bus_task::{BusThread, Started};
use hydroboom_fieldbus::link::Link;
use hydroboom_fieldbus::raw_socket::RawSocket;
use hydroboom_fieldbus::start_up::InitialState;
use hydroboom_realtime::control_task::{ControlTask, Record};
use hydroboom_realtime::course::Course;
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::executive::{self, Placement, RealTime, Tasks};
use hydroboom_realtime::host::host;
use hydroboom_realtime::machine::{Incoming, Machine, Outgoing};
use hydroboom_realtime::session::{Attendant, Ending, Lookout, Order, Session};
use hydroboom_realtime::shared::Shared;
use hydroboom_realtime::simulation_task::SimulationTask;
use hydroboom_virtual_crane::VirtualCrane;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;

const STRATEGY: Strategy = Strategy::ScheduledLqr;
/// Windows of each kind, in turn.
const WINDOWS: usize = 3;

/// Allocations of a task since it was looked at first.
#[derive(Clone, Default)]
struct Allocations {
    begin: Option<u64>,
    all: Arc<AtomicU64>,
}

impl Allocations {
    /// Looks from the task's own thread.
    fn look(&mut self) {
        let now = count();
        self.all.store(now - *self.begin.get_or_insert(now), Ordering::Relaxed);
    }
}

/// A machine whose control task is counted.
struct CountedMachine(Box<dyn Machine>, Allocations);

impl Machine for CountedMachine {
    fn read(&mut self) -> Option<Incoming> {
        self.1.look();
        self.0.read()
    }

    fn write(&mut self, sequence: u64, outgoing: &Outgoing) {
        self.0.write(sequence, outgoing);
    }

    fn release(&self, due: u64) -> u64 {
        self.0.release(due)
    }
}

/// A link whose bus task is counted from when it is armed.
struct CountedLink(RawSocket, Allocations, Arc<AtomicBool>);

impl Link for CountedLink {
    fn send(&mut self, frame: &[u8]) -> bool {
        self.0.send(frame)
    }

    fn receive(&mut self, frame: &mut [u8], until: u64) -> Option<usize> {
        self.0.receive(frame, until)
    }

    fn wait(&mut self, until: u64) {
        if self.2.load(Ordering::Acquire) {
            self.1.look();
        }
        self.0.wait(until);
    }
}

/// Begins one course, and closes once its load is held.
struct Once {
    session: Session,
    desk: Arc<Desk>,
    path: Course,
    is_begun: bool,
    has_run: bool,
    sum: f64,
    count: u32,
    execution: Vec<u64>,
    /// State as it was printed last.
    shown: String,
}

impl Attendant for Once {
    fn see(&mut self, record: &Record) {
        self.session.see(record);
        let decision = &record.decision;
        let now = format!("{:?}, {:?}, {:?}", decision.state, decision.waiting, record.status);
        if now != self.shown {
            println!("  {:.3} s {now}", record.time);
            self.shown = now;
        }
        if let Some(error) = record.error() {
            self.has_run = true;
            self.sum += error * error;
            self.count += 1;
            // that of the period before
            self.execution.extend(record.deadlines.map(|d| d.control_execution));
        } else if self.has_run && self.session.is_ready() || self.session.fault().is_some() {
            self.desk.close();
        }
    }

    fn orders(&mut self) -> Vec<Order> {
        let now = self.session.last().map_or(0.0, |record| record.time);
        if self.is_begun || now < 0.5 || !self.session.is_ready() {
            return self.session.orders();
        }
        self.is_begun = true;
        self.desk.start();
        vec![Order::Course(self.path.clone())]
    }
}

/// One course on a machine.
fn course(machine: Box<dyn Machine>, name: &str) -> RealTime {
    let model = Description::uia_single_boom().unwrap();
    let n = &model.numbers;
    let path = Course::new(Arc::new(model.motion(n.fast)));
    let desk = Arc::new(Desk::new(STRATEGY));
    let mut once = Once {
        session: Session::new(&model),
        desk: Arc::clone(&desk),
        path: path.clone(),
        is_begun: false,
        has_run: false,
        sum: 0.0,
        count: 0,
        execution: Vec::new(),
        shown: String::new(),
    };
    let allocations = Allocations::default();
    let machine = Box::new(CountedMachine(machine, allocations.clone()));
    let tasks = Tasks {
        control: ControlTask::new(&model, path, limits(&model, n.fast).unwrap(), STRATEGY),
        simulation: SimulationTask::new(&model, n.motion_start).unwrap(),
        machine,
        periods: (n.simulation_period, n.control_period),
        placement: Placement::default(),
    };
    let lookout = Lookout { desk: &desk, attendant: &mut once, ending: Ending::OnceClosed };
    let real_time = executive::run(tasks, lookout, &mut |_| ()).unwrap();
    let fault = once.session.fault().map(|fault| (fault.time, fault.cause));
    once.execution.sort_unstable();
    let share = |share: f64| once.execution.get((share * once.execution.len() as f64) as usize);
    println!(
        "{name}: {} periods of a course, RMS error {:.2} mm, execution of control median {:.1?} p99 {:.1?} ns, {} \
         missed, {} allocations in the control task, delay {:?}, fault {fault:?}, not granted {:?}",
        once.count,
        1e3 * (once.sum / f64::from(once.count.max(1))).sqrt(),
        share(0.5),
        share(0.99),
        real_time.control.missed,
        allocations.all.load(Ordering::Relaxed),
        once.session.last().and_then(|record| record.link).and_then(|link| link.delay),
        real_time.lost,
    );
    real_time
}

/// A course over the interfaces.
fn over_the_bus() {
    // a computer that is busy with other work loses frames
    let mut table = table_of_three();
    table.bus.lost_max = 50;
    table.devices.iter_mut().for_each(|device| device.watchdog = Some(200_000_000));
    let (stop, is_ready) = (AtomicBool::new(false), AtomicBool::new(false));
    thread::scope(|scope| {
        let devices = scope.spawn(|| play(&table, &stop, &is_ready));
        while !is_ready.load(Ordering::Acquire) {
            thread::yield_now();
        }
        let (allocations, is_armed) = (Allocations::default(), Arc::new(AtomicBool::new(false)));
        let socket = RawSocket::open(BUS).unwrap();
        let link = CountedLink(socket, allocations.clone(), Arc::clone(&is_armed));
        let Started { thread, machine, .. } = BusThread::start(
            InitialState::Op,
            table.clone(),
            link,
            Placement::default().control_core,
        )
        .unwrap();
        is_armed.store(true, Ordering::Release);
        course(Box::new(machine), "over the bus");
        let allocated = allocations.all.load(Ordering::Relaxed);
        let report = thread.end().unwrap();
        let shares = [0.001, 0.01, 0.5, 0.99, 0.999];
        let us = |times: &hydroboom_fieldbus::statistics::Histogram| {
            shares.map(|share| times.value_at_quantile(share) as f64 * 1e-3)
        };
        println!(
            "  {:?}\n  margin to SYNC0 {:.1?} us, round trip {:.1?} us at {shares:?}; {allocated} allocations in the \
             bus task; delay {:?}; {:?}; {:?}",
            report.counters,
            us(&report.times.margin),
            us(&report.times.round_trip),
            report.delay,
            report.fault,
            report.remarks
        );
        stop.store(true, Ordering::Release);
        println!("  devices at the end: {:?}", devices.join().unwrap());
    });
}

/// The same course over shared memory: no bus and no frames.
fn without_a_bus() {
    let mut crane = Description::uia_virtual().unwrap();
    crane.set("fieldbus.delay_cycles=1").unwrap();
    let mut start = crane.start(crane.numbers.motion_start);
    start.preload = 0.0;
    let machine = VirtualCrane::new(&crane, &start).unwrap();
    let path = std::env::temp_dir().join(format!("hydroboom-veth-{}", std::process::id()));
    let _ = std::fs::remove_file(&path);
    let own = Shared::create(&path).unwrap();
    let other = Shared::open(&path).unwrap();
    // it ends by itself once nobody commands it
    thread::spawn(move || host(machine, &crane, &other));
    course(Box::new(own), "without a bus");
    std::fs::remove_file(&path).unwrap();
}

#[test]
#[ignore = "three minutes in real time: by hand"]
fn a_course_over_the_interfaces_beside_one_without_a_bus() {
    if !is_in_its_namespace("course::a_course_over_the_interfaces_beside_one_without_a_bus") {
        return;
    }
    lay_cable();
    for _ in 0..WINDOWS {
        over_the_bus();
        without_a_bus();
    }
}
