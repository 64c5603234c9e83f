//! The control cycle allocates no memory.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::supervisor::{Request, State};
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_machine_interface::datagram::{
    self, Body, Header, Hello, LONGEST, MOST_AXES, VERSION, decode, encode,
};
use hydroboom_machine_interface::session::Session;
use hydroboom_model::Start;
use hydroboom_realtime::bus_task::BusTask;
use hydroboom_realtime::control_task::{ControlTask, Period};
use hydroboom_realtime::course::Course;
use hydroboom_realtime::failure::guarded;
use hydroboom_realtime::machine::{Incoming, Machine, Outgoing};
use hydroboom_realtime::shared::Shared;
use hydroboom_realtime::simulation_task::SimulationTask;
use hydroboom_realtime::slot::Slot;
use hydroboom_realtime::timing::Timing;
use hydroboom_virtual_crane::VirtualCrane;
use std::net::{Ipv4Addr, UdpSocket};
use std::sync::Arc;
use std::time::Duration;

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

#[test]
fn simulation_control_and_exchange_allocate_nothing() {
    for strategy in [Strategy::SimulationFeedforwardClosedLoop, Strategy::ScheduledLqr] {
        allocate_nothing(strategy);
    }
}

/// Both sides of the local interface, with any datagram.
#[test]
fn the_bus_task_and_its_exchange_allocate_nothing() {
    let (mut bus, mut machine) = BusTask::open(0, 1e-3).unwrap();
    let peer = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    peer.connect((Ipv4Addr::LOCALHOST, bus.port())).unwrap();
    peer.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    let send = |header: &Header, body: &Body| {
        let mut bytes = [0; LONGEST];
        let length = encode(header, body, &mut bytes);
        peer.send(&bytes[..length]).unwrap();
    };
    let hello = Hello {
        peer: datagram::Peer::SimulatedMachine,
        period: 1_000_000,
        newest_version: VERSION,
        axes: 1,
        firmware: 0,
        ranges: [[[f64::NAN; 2]; 7]; MOST_AXES],
    };
    send(&Header::default(), &Body::Hello(hello));
    bus.receive(0);
    let mut bytes = [0; LONGEST];
    let length = peer.recv(&mut bytes).unwrap();
    let mut session = Session::new(decode(&bytes[..length]).unwrap().0.session);
    for k in 1..=1000_u64 {
        let clock = k * 1_000_000;
        let body = datagram::Measurement { sampled: clock, count: 1, ..Default::default() };
        send(&session.next_header(clock), &Body::Measurement(body));
        peer.send(&bytes[..(k % 100) as usize]).unwrap();
        assert_no_alloc(|| {
            assert_eq!(bus.receive(clock), 1);
            assert_eq!(machine.read().map(|incoming| incoming.measurement.number), Some(k));
            // the control task is lost from time to time
            let is_lost = k.is_multiple_of(10);
            if !is_lost {
                machine.write(k, &Outgoing::SAFE);
            }
            let looks = if is_lost { 3 } else { 1 };
            (0..looks).for_each(|look| bus.answer(clock + look * 1_000_000));
        });
        let length = peer.recv(&mut bytes).unwrap();
        session.accept(&bytes[..length]).unwrap();
    }
}

fn allocate_nothing(strategy: Strategy) {
    let model = Description::uia_single_boom().unwrap();
    // another payload than the model's, so that it is estimated and simulated
    let mut crane = Description::uia_virtual().unwrap();
    crane.set("payload.mass_kg=150").unwrap();
    let motion = crane.motion(model.numbers.fast);
    let mut start: Start = crane.start(motion.start);
    start.preload = 0.0;
    let mut machine = VirtualCrane::new(&crane, &start).unwrap();
    let path: Arc<dyn Trajectory> = Arc::new(motion);
    let course = Course::new(Arc::clone(&path));
    let mut control =
        ControlTask::new(&model, course, limits(&model, motion.speed).unwrap(), strategy);
    let mut simulation = SimulationTask::new(&model, motion.start).unwrap();
    let mut timing = Timing::new(1_000_000).unwrap();
    let slot = Slot::<4>::default();
    let path = std::env::temp_dir().join(format!("hydroboom-test-{}", std::process::id()));
    let _ = std::fs::remove_file(&path);
    let mut shared = Shared::create(&path).unwrap();
    std::fs::remove_file(&path).unwrap();

    let before = control.conditions();
    let mut moved = false;
    let mut state = State::Idle;
    for k in 0..10_000_u64 {
        // the machine is in another process
        shared.show(&Incoming::new(machine.measurement(), None));
        // guarded as the executive guards its tasks
        assert_eq!(assert_no_alloc(|| guarded(|| k)), Ok(k));
        let record = assert_no_alloc(|| {
            let incoming: Option<Incoming> = shared.read();
            let request = match state {
                State::Idle => Request::Enable,
                State::Ready => Request::Hold,
                State::Holding if k.is_multiple_of(1000) => Request::Start,
                _ => Request::None,
            };
            let record = control.period(&Period {
                incoming,
                simulated: Some(simulation.simulated()),
                request,
                strategy,
                elapsed: 1e-3,
                missed: 0,
                attended: true,
                clock_jumped: false,
                deadlines: None,
            });
            shared.write(k, &Outgoing::of(&record.decision));
            simulation.set_conditions(&control.conditions());
            for _ in 0..20 {
                if let Some(speed) = control.simulated_motor() {
                    simulation.step(speed);
                }
                slot.publish([simulation.simulated().steps, 0, 0, 0]);
            }
            timing.released(k % 2_000_000);
            timing.executed(k, k + 1, k);
            record
        });
        state = record.decision.state;
        moved |= record.course_time.is_some_and(|t| t > 3.0);
        machine.advance(&record.decision.command).unwrap();
    }
    assert!(moved, "it ended in {state:?}");
    assert!(before.differ(&control.conditions()) == strategy.estimates());
}
