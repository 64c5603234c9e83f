//! The bus over a pair of network interfaces in a network namespace of its own: both ends in this process, in real
//! time.
//!
//! Each test starts itself anew in such a namespace, which goes with it. Where that, or raw sockets, are not allowed,
//! it is skipped, and says why.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_control::command::Command;
use hydroboom_description::Description;
use hydroboom_fieldbus::bus::Bus;
use hydroboom_fieldbus::link::Link;
use hydroboom_fieldbus::machine::MachineState;
use hydroboom_fieldbus::raw_socket::{ETHERTYPE, RawSocket};
use hydroboom_fieldbus::table::Table;
use hydroboom_fieldbus::time::now;
use hydroboom_realtime::machine::{Machine, Outgoing};
use hydroboom_realtime::posix::{pin_to, run_first};
use hydroboom_virtual_crane::VirtualCrane;
use plant::Plant;
use std::cell::RefCell;
use std::process::Command as Process;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

mod allocations;
mod course;
#[path = "../../examples/simulated_segment/devices.rs"]
mod devices;
mod diagnosis;
#[path = "../../examples/simulated_segment/plant.rs"]
mod plant;

const PAGE: &str = include_str!("../../../../docs/reference/ethercat-table.md");
/// Says to a test that it is in its namespace.
const INSIDE: &str = "HYDROBOOM_IN_A_NAMESPACE";
/// Cycles that the devices may miss: computers that test are busy with other work, too.
const MISSED_LIMIT: u32 = 100;
/// Both ends of the cable.
const BUS: &str = "bus0";
const DEVICES: &str = "bus1";

/// Whether this is a test's namespace; else the test is started in one, and this is not it.
fn is_in_its_namespace(test: &str) -> bool {
    if std::env::var_os(INSIDE).is_some() {
        return true;
    }
    // whoever is not root is so in a user namespace of its own
    let kind = if hydroboom_realtime::posix::effective_user() == 0 { "-nm" } else { "-Urnm" };
    let pair = ["ip", "link", "add", BUS, "type", "veth", "peer", "name", DEVICES];
    let tried = Process::new("unshare").arg(kind).args(pair).output();
    let skipped = match tried {
        Err(error) => Some(format!("unshare: {error}")),
        Ok(tried) if !tried.status.success() => {
            Some(String::from_utf8_lossy(&tried.stderr).trim().into())
        }
        Ok(_) => None,
    };
    if let Some(why) = skipped {
        println!("skipped: no pair of network interfaces in a namespace of its own here ({why})");
        return false;
    }
    let program = std::env::current_exe().unwrap();
    let mut inside = Process::new("unshare");
    inside
        .arg(kind)
        .arg(program)
        .args([test, "--exact", "--nocapture", "--include-ignored"])
        .env(INSIDE, "1");
    assert!(inside.status().unwrap().success(), "{test} failed in its namespace");
    false
}

/// Runs `ip` with words.
fn ip(words: &str) -> bool {
    Process::new("ip").args(words.split_whitespace()).output().unwrap().status.success()
}

/// The pair, switched on, without the chatter of networks.
fn lay_cable() {
    assert!(ip(&format!("link add {BUS} type veth peer name {DEVICES}")));
    for end in [BUS, DEVICES] {
        assert!(ip(&format!("link set {end} addrgenmode none")));
        assert!(ip(&format!("link set {end} up")));
    }
    for end in [BUS, DEVICES] {
        assert!(soon(|| RawSocket::open_for_devices(end).is_ok()));
    }
}

/// Whether something is so soon: the system notes a link that comes or goes a while later.
fn soon(is_so: impl FnMut() -> bool) -> bool {
    std::iter::repeat_with(is_so).take(1000).any(|is_so| {
        if !is_so {
            thread::sleep(Duration::from_millis(5));
        }
        is_so
    })
}

/// The page's table without its coupler: drive, inputs, outputs.
fn table_of_three() -> Table {
    let (_, rest) = PAGE.split_once("```toml\n").unwrap();
    let text = rest.split_once("```").unwrap().0;
    let (bus, devices) = text.split_once("[[device]]").unwrap();
    let (_coupler, others) = devices.split_once("[[device]]").unwrap();
    Table::parse("three devices", &format!("{bus}[[device]]{others}")).unwrap()
}

/// Plays the devices of a table until it is stopped; their states then.
fn play(table: &Table, stop: &AtomicBool, is_ready: &AtomicBool) -> Vec<String> {
    let mut crane = Description::uia_virtual().unwrap();
    crane.set("fieldbus.delay_cycles=0").unwrap();
    let mut start = crane.start(crane.numbers.motion_start);
    start.preload = 0.0;
    let crane = VirtualCrane::new(&crane, &start).unwrap();
    let plant = Rc::new(RefCell::new(Plant::new(crane)));
    let mut segment = devices::segment(table, &plant, MISSED_LIMIT).unwrap();
    let mut socket = RawSocket::open_for_devices(DEVICES).unwrap();
    let _ = pin_to(0).and_then(|()| run_first(60));
    is_ready.store(true, Ordering::Release);
    let mut frame = [0; 1536];
    while !stop.load(Ordering::Acquire) {
        match socket.receive(&mut frame, now() + 1_000_000) {
            Some(length) => {
                if segment.process(&mut frame[..length], now()) {
                    socket.send(&frame[..length]);
                }
            }
            None => segment.advance(now()),
        }
        plant.borrow_mut().simulate();
    }
    assert!(plant.borrow().broken.is_none());
    segment.devices().iter().map(|device| format!("{:?}", device.state())).collect()
}

#[test]
fn three_devices_go_to_op_over_a_network_interface_exchange_for_two_seconds_and_go_to_init() {
    if !is_in_its_namespace(
        "three_devices_go_to_op_over_a_network_interface_exchange_for_two_seconds_and_go_to_init",
    ) {
        return;
    }
    const CYCLES: u64 = 2000;
    lay_cable();
    let table = table_of_three();
    let (stop, is_ready) = (AtomicBool::new(false), AtomicBool::new(false));
    thread::scope(|scope| {
        let devices = scope.spawn(|| play(&table, &stop, &is_ready));
        while !is_ready.load(Ordering::Acquire) {
            thread::yield_now();
        }
        let _ = run_first(75);
        let mut bus = Bus::start(table.clone(), RawSocket::open(BUS).unwrap()).unwrap();
        // what is logged is handed on in the cycle, too
        let records = bus.records();
        let mut machine = bus.take_machine().unwrap();
        let mut was_enabled = false;
        for sequence in 1..=CYCLES {
            // slowly, with the load held: the drive turns against a shut valve
            let speed = if sequence == 1 { 0.0 } else { 0.01 };
            let mut command = Command::default();
            command.axes[0].motor_speed = speed;
            let before = allocations::count();
            bus.measure();
            machine.read();
            machine.write(sequence, &Outgoing { command, is_enabled: true });
            bus.act();
            assert_eq!(allocations::count(), before, "nothing is allocated in a cycle");
            was_enabled |= machine.state() == MachineState::Enabled;
        }
        let (counters, state) = (bus.counters(), machine.state());
        let [margin, round_trip] = [&bus.times().margin, &bus.times().round_trip].map(|times| {
            [0.01, 0.5, 0.99].map(|share| times.value_at_quantile(share) as f64 * 1e-3)
        });
        println!("{counters:?}, margin to SYNC0 {margin:?} us, round trip {round_trip:?} us");
        // each cycle that there was room for
        assert_eq!(records.slots() as u64 + counters.records_lost, CYCLES);
        bus.end();
        stop.store(true, Ordering::Release);
        let states = devices.join().unwrap();
        // who answers takes part, however late this computer is
        assert_eq!(counters.low, 0);
        // a stall of this computer, which devices and bus found, is told; nothing else is a fault
        let is_stalled = counters.lost + counters.late_begins > 0;
        assert!(is_stalled || state == MachineState::Enabled, "{:?}", bus.fault_sentence());
        assert!(is_stalled || was_enabled, "{state:?}, {:?}", bus.fault_sentence());
        assert_eq!(states, ["(Init, None)"; 3]);
    });
}

#[test]
fn an_interface_that_is_not_the_buss_own_is_refused_with_what_to_do() {
    if !is_in_its_namespace("an_interface_that_is_not_the_buss_own_is_refused_with_what_to_do") {
        return;
    }
    let refused = |parts: &[&str]| {
        let mut told = String::new();
        let is_told = soon(|| {
            told = RawSocket::open(BUS).map_or_else(|error| error.to_string(), |_| "opened".into());
            parts.iter().all(|part| told.contains(part))
        });
        assert!(is_told, "{parts:?} are not in: {told}");
    };
    lay_cable();
    assert!(ip(&format!("link set {BUS} down")));
    refused(&["switched off", "ip link set bus0 up"]);
    assert!(ip(&format!("link set {BUS} up")) && ip(&format!("link set {DEVICES} down")));
    refused(&["no link", "cable"]);
    assert!(ip(&format!("link set {DEVICES} up")));
    assert!(ip(&format!("addr add 10.1.2.3/24 dev {BUS}")));
    refused(&["10.1.2.3", "ip addr flush dev bus0"]);
    assert!(ip(&format!("route add default via 10.1.2.1 dev {BUS}")));
    refused(&["default route"]);
    assert!(ip(&format!("addr flush dev {BUS}")));
    assert!(soon(|| RawSocket::open(BUS).is_ok()));
    let own = RawSocket::open(BUS).unwrap();
    refused(&["another process"]);
    drop(own);
    // another main device, or its answers; this computer may be slow to send them
    let stop = AtomicBool::new(false);
    let told = thread::scope(|scope| {
        scope.spawn(|| {
            let mut other = RawSocket::open_for_devices(DEVICES).unwrap();
            let mut frame = [0xff; 60];
            frame[12..14].copy_from_slice(&ETHERTYPE.to_be_bytes());
            while !stop.load(Ordering::Acquire) {
                other.send(&frame);
                other.wait(now() + 1_000_000);
            }
        });
        let told = (0..100).find_map(|_| RawSocket::open(BUS).err());
        stop.store(true, Ordering::Release);
        told
    });
    let told = told.unwrap().to_string();
    assert!(told.contains("frames for EtherCAT already"), "{told}");
    // what the system tells of interfaces in its own file system is that of another namespace until it is mounted anew
    let mounted = Process::new("mount").args(["-t", "sysfs", "none", "/sys"]).status().unwrap();
    if !mounted.success() || !ip("link add bridge0 type bridge") {
        println!("skipped: no bridge here");
        return;
    }
    assert!(RawSocket::open("bridge0").unwrap_err().to_string().contains("is a bridge"));
    assert!(ip(&format!("link set {BUS} master bridge0")));
    refused(&["belongs to a bridge", "nomaster"]);
}
