//! Simulated devices for EtherCAT on a network interface, as a table says, with the virtual crane behind them.
//!
//! ```sh
//! ip link add bus0 type veth peer name bus1     # a pair of interfaces that stand for the cable
//! sysctl -w net.ipv6.conf.bus0.disable_ipv6=1 net.ipv6.conf.bus1.disable_ipv6=1
//! ip link set bus0 up && ip link set bus1 up
//! cargo run --release -p hydroboom-fieldbus --example simulated_segment -- --interface bus1 --table bus.toml &
//! hydroboom run --machine ethercat:bus0 --bus bus.toml
//! ```
//!
//! A line `open` on standard input opens the stop circuit of all drives, and `close` closes it.

mod devices;
mod plant;

use hydroboom_description::Description;
use hydroboom_device_simulator::applications::SAFE_TORQUE_OFF;
use hydroboom_fieldbus::link::Link;
use hydroboom_fieldbus::raw_socket::RawSocket;
use hydroboom_fieldbus::table::Table;
use hydroboom_fieldbus::time::now;
use hydroboom_realtime::posix::{lock_memory, pin_to, run_first};
use hydroboom_virtual_crane::VirtualCrane;
use plant::Plant;
use std::cell::RefCell;
use std::process::ExitCode;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

const USAGE: &str = "usage: simulated_segment --interface INTERFACE --table FILE [--crane FILE] \
    [--set KEY=VALUE]... [--missed-cycles COUNT]";
/// Core and priority under SCHED_FIFO: after bus task and control task, whose core they share.
const CORE: usize = 0;
const PRIORITY: i32 = 60;
/// Time after which devices live on without a frame \[ns\].
const IDLE: u64 = 1_000_000;
/// Largest Ethernet frame \[byte\].
const LARGEST_FRAME: usize = 1536;

fn main() -> ExitCode {
    match run(std::env::args().skip(1)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("{why}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: impl Iterator<Item = String>) -> Result<(), String> {
    let (mut interface, mut file, mut crane_file, mut sets) = (None, None, None, Vec::new());
    // what devices bear by default; a computer that is busy with other work needs more
    let mut missed_limit = 4;
    let mut arguments = arguments;
    while let Some(name) = arguments.next() {
        let value = arguments.next().ok_or(USAGE)?;
        match name.as_str() {
            "--interface" => interface = Some(value),
            "--table" => file = Some(value),
            "--crane" => crane_file = Some(value),
            "--set" => sets.push(value),
            "--missed-cycles" => missed_limit = value.parse().map_err(|_| USAGE)?,
            _ => return Err(USAGE.into()),
        }
    }
    let (interface, file) = interface.zip(file).ok_or(USAGE)?;
    let read = |file: &str| std::fs::read_to_string(file).map_err(|e| format!("{file}: {e}"));
    let table = Table::parse(&file, &read(&file)?).map_err(|e| e.to_string())?;
    let mut crane = match &crane_file {
        Some(file) => Description::parse(file, &read(file)?).map_err(|e| e.to_string())?,
        None => Description::uia_virtual().map_err(|e| e.to_string())?,
    };
    // the bus has the delay
    sets.insert(0, "fieldbus.delay_cycles=0".into());
    for set in &sets {
        crane.set(set).map_err(|e| e.to_string())?;
    }
    let period = 1e-9 * table.bus.period as f64;
    if (crane.numbers.control_period - period).abs() > 1e-9 {
        return Err(format!(
            "{file}: its period is {period} s, and the crane's control period is {} s",
            crane.numbers.control_period
        ));
    }
    // the load held, the pump without pressure
    let mut start = crane.start(crane.numbers.motion_start);
    start.preload = 0.0;
    let crane = VirtualCrane::new(&crane, &start).map_err(|e| e.to_string())?;
    let plant = Rc::new(RefCell::new(Plant::new(crane)));
    let mut segment = devices::segment(&table, &plant, missed_limit)?;
    let mut socket = RawSocket::open_for_devices(&interface).map_err(|e| e.to_string())?;
    let granted = [lock_memory(), pin_to(CORE), run_first(PRIORITY)];
    for error in granted.into_iter().filter_map(Result::err) {
        eprintln!("not granted ({error}): answers may come late");
    }
    eprintln!("{} devices at {interface}", table.devices.len());
    let is_open = stop_circuit();
    let mut was_open = false;
    let mut frame = [0; LARGEST_FRAME];
    loop {
        match socket.receive(&mut frame, now() + IDLE) {
            Some(length) => {
                let frame = frame.get_mut(..length).unwrap_or_default();
                if segment.process(frame, now()) {
                    socket.send(frame);
                }
            }
            None => segment.advance(now()),
        }
        let now_open = is_open.load(Ordering::Relaxed);
        if std::mem::replace(&mut was_open, now_open) != now_open {
            for drive in &table.drives {
                let device = segment.devices_mut().get_mut(drive.device);
                let dictionary = device.map(|device| &mut device.dictionary);
                dictionary
                    .ok_or("the drive is not in the segment")?
                    .set_number(SAFE_TORQUE_OFF, i64::from(now_open));
            }
        }
        let mut plant = plant.borrow_mut();
        plant.simulate();
        if let Some(error) = &plant.broken {
            return Err(format!("the crane cannot go on: {error}"));
        }
    }
}

/// Whether the stop circuit is open, as a thread reads it from standard input.
fn stop_circuit() -> Arc<AtomicBool> {
    let is_open = Arc::new(AtomicBool::new(false));
    let switch = Arc::clone(&is_open);
    thread::spawn(move || {
        for line in std::io::stdin().lines().map_while(Result::ok) {
            match line.trim() {
                "open" => switch.store(true, Ordering::Relaxed),
                "close" => switch.store(false, Ordering::Relaxed),
                other => eprintln!("{other:?} is neither open nor close"),
            }
        }
    });
    is_open
}
