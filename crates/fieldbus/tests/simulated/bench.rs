//! A bus in simulated time: the devices of the table in the documentation, with the virtual crane or nothing behind
//! them, in this thread.

use assert_no_alloc::permit_alloc;
use hydroboom_control::command::{AxisCommand, Command};
use hydroboom_device_simulator::Segment;
use hydroboom_device_simulator::applications::{
    AnalogueInput, CurrentSource, DigitalOutput, DriveSettings, Motor, ServoDrive, VelocityUnit,
    coupler,
};
use hydroboom_device_simulator::controller::DistributedClock;
use hydroboom_device_simulator::device::{
    Area, Device, Fault, Identity, Settings, Synchronisation,
};
use hydroboom_device_simulator::mailbox::Emergency;
use hydroboom_fieldbus::bus::Bus;
use hydroboom_fieldbus::link::Link;
use hydroboom_fieldbus::table::Table;
use hydroboom_fieldbus::time::{now, simulate};
use hydroboom_realtime::machine::Outgoing;
use hydroboom_virtual_crane::VirtualCrane;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// The page with the table that users are shown.
const PAGE: &str = include_str!("../../../../docs/reference/ethercat-table.md");

/// The text of the table on the page.
pub fn example() -> &'static str {
    let (_, rest) = PAGE.split_once("```toml\n").expect("the page has a table");
    rest.split_once("```").expect("it ends").0
}

/// The table on the page, changed.
pub fn table(change: impl FnOnce(&mut Table)) -> Table {
    let mut table =
        Table::parse("ethercat-table.md", example()).expect("the page's table is right");
    change(&mut table);
    table
}

/// A command that drives are to follow.
pub fn enabled(command: Command) -> Outgoing {
    Outgoing { command, is_enabled: true }
}

/// What is behind the devices.
#[derive(Default)]
pub struct Behind {
    /// The crane; without one the motor has the commanded speed at once and pressures stand still.
    pub crane: Option<VirtualCrane>,
    /// What drive and valve do now.
    pub command: AxisCommand<f64>,
    /// Channels whose wire is broken.
    pub broken: Vec<usize>,
}

impl Behind {
    /// A control period of the crane.
    pub fn advance(&mut self) {
        let command = self.command;
        self.crane.as_mut().expect("there is a crane").advance(&command).expect("it holds");
    }

    /// Signals at the channels of the analogue inputs: position, pressures.
    fn signal(&self, channel: usize) -> f64 {
        match &self.crane {
            Some(crane) => crane.signals().to_array()[channel],
            None => [0.25, 20e5, 70e5, 5e5, 6e5, 7e5][channel],
        }
    }
}

pub type Shared = Rc<RefCell<Behind>>;

struct Shaft(Shared);

impl Motor for Shaft {
    fn command(&mut self, speed: Option<f64>) {
        self.0.borrow_mut().command.motor_speed = speed.unwrap_or(0.0);
    }

    fn advance(&mut self, _: u64) {}

    fn speed(&self) -> f64 {
        let behind = self.0.borrow();
        behind
            .crane
            .as_ref()
            .map_or(behind.command.motor_speed, |crane| crane.signals().motor_speed)
    }

    fn angle(&self) -> f64 {
        0.0
    }
}

/// Lowest and highest value of each transmitter, at 4 and 20 mA.
pub const TRANSMITTERS: [[f64; 2]; 6] =
    [[0.0, 0.5], [-1e5, 249e5], [-1e5, 249e5], [-1e5, 249e5], [-1e5, 249e5], [-1e5, 249e5]];

struct Transmitters(Shared);

impl CurrentSource for Transmitters {
    fn advance(&mut self, _: u64) {}

    fn current(&self, channel: usize) -> f64 {
        let behind = self.0.borrow();
        let [low, high] = TRANSMITTERS[channel];
        if behind.broken.contains(&channel) {
            0.0
        } else {
            4.0 + 16.0 * (behind.signal(channel) - low) / (high - low)
        }
    }
}

fn settings(name: &str, product: u32) -> Settings {
    Settings::new(name, Identity { vendor: 0x0fff, product, revision: 1, serial: 7 })
}

/// The line of the devices of the page's table.
pub fn segment(behind: &Shared, change: impl FnOnce(&mut Settings, &mut DriveSettings)) -> Segment {
    Segment::new(devices(behind, change))
}

/// The devices of the page's table, in their order.
pub fn devices(
    behind: &Shared,
    change: impl FnOnce(&mut Settings, &mut DriveSettings),
) -> Vec<Device> {
    let by_sync0 = Synchronisation { has_sync0: true, has_sync1: true, ..Default::default() };
    let mut drive = Settings { synchronisation: by_sync0, ..settings("drive", 2).with_mailbox() };
    let mut about = DriveSettings {
        unit: VelocityUnit::PrefixedRpm(-3),
        increments: 65536,
        deceleration: 100.0,
        is_mapping_fixed: false,
    };
    change(&mut drive, &mut about);
    let mut inputs = Settings { synchronisation: by_sync0, ..settings("inputs", 3).with_mailbox() };
    inputs.inputs = Some(Area { sync_manager: 3, start: 0x1180, length: 64 });
    // clocks that begin anywhere and drift by up to 50 ppm
    let clock = DistributedClock::new;
    let valve = Rc::clone(behind);
    vec![
        coupler(settings("coupler", 1), clock(5_000, 0)),
        ServoDrive::device(
            drive,
            about,
            clock(77_000_000, 50_000),
            Box::new(Shaft(Rc::clone(behind))),
        ),
        AnalogueInput::device(
            inputs,
            6,
            clock(1, -30_000),
            Box::new(Transmitters(Rc::clone(behind))),
        ),
        DigitalOutput::device(
            settings("outputs", 4),
            8,
            clock(123, 10_000),
            Box::new(move |bits| valve.borrow_mut().command.holding_valve = f64::from(bits & 1)),
        ),
    ]
}

/// Time that a frame is under way \[ns\].
const FLIGHT: u64 = 12_000;

/// A link to simulated devices, on which frames may be late or come twice.
pub struct SimulatedLink {
    pub segment: Segment,
    answers: VecDeque<(u64, Vec<u8>)>,
    /// Frames that are to be late by a time \[ns\].
    pub late: Option<(u32, u64)>,
    /// Frames that are to come twice.
    pub twice: u32,
    /// Frames whose exchange of process data is to come back with a working counter that is too low by one.
    pub low: u32,
    /// Emergency that the drive sends as soon as an SDO request reaches it.
    pub emergency: Option<u16>,
    /// A control task, which runs while the bus task waits.
    pub control: Option<Box<dyn FnMut()>>,
}

impl SimulatedLink {
    pub fn new(segment: Segment) -> Self {
        simulate(1_000_000_000);
        Self {
            segment,
            answers: VecDeque::new(),
            late: None,
            twice: 0,
            low: 0,
            emergency: None,
            control: None,
        }
    }
}

impl Link for SimulatedLink {
    fn send(&mut self, frame: &[u8]) -> bool {
        permit_alloc(|| self.pass(frame));
        true
    }

    fn receive(&mut self, frame: &mut [u8], until: u64) -> Option<usize> {
        if self.answers.front().is_none_or(|(arrival, _)| *arrival > until.max(now())) {
            self.wait(until);
            return None;
        }
        let (arrival, bytes) = self.answers.pop_front()?;
        simulate(now().max(arrival));
        let length = bytes.len();
        frame[..length].copy_from_slice(&bytes);
        permit_alloc(|| drop(bytes));
        Some(length)
    }

    fn wait(&mut self, until: u64) {
        simulate(now().max(until));
        permit_alloc(|| self.segment.advance(now()));
        if let Some(control) = &mut self.control {
            control();
        }
    }
}

impl SimulatedLink {
    /// A frame goes through the devices; its answer is on its way then.
    fn pass(&mut self, frame: &[u8]) {
        let mut frame = frame.to_vec();
        // a write to the drive's mailbox: FPWR to station 0x1001, address 0x1000
        let is_request = frame[16] == 5 && frame[18..22] == [0x01, 0x10, 0x00, 0x10];
        if let Some(code) = self.emergency.take_if(|_| is_request) {
            let message = Emergency { code, register: 1 };
            self.segment.devices_mut()[1].inject(Fault::Emergency(message), now());
        }
        if self.segment.process(&mut frame, now()) {
            let mut arrival = now() + FLIGHT;
            if let Some((count, time)) = &mut self.late {
                arrival += *time;
                *count -= 1;
                if *count == 0 {
                    self.late = None;
                }
            }
            if self.low > 0 {
                self.low -= 1;
                lower_working_counter(&mut frame);
            }
            if self.twice > 0 {
                self.twice -= 1;
                self.answers.push_back((arrival, frame.clone()));
            }
            self.answers.push_back((arrival, frame));
            self.answers.make_contiguous().sort_by_key(|(arrival, _)| *arrival);
        }
    }
}

/// Takes one off the working counter of the logical datagram in a frame.
fn lower_working_counter(frame: &mut [u8]) {
    let mut at = 16;
    while at + 12 <= frame.len() {
        let field = u16::from_le_bytes([frame[at + 6], frame[at + 7]]);
        let end = at + 10 + usize::from(field & 0x7ff);
        if frame[at] == 12 {
            frame[end] -= 1;
        }
        if field & 0x8000 == 0 {
            return;
        }
        at = end + 2;
    }
}

/// A bus in OP, nothing behind its devices.
pub fn bus(table: Table) -> (Bus<SimulatedLink>, Shared) {
    let behind = Shared::default();
    let link = SimulatedLink::new(segment(&behind, |_, _| {}));
    (Bus::start(table, link).expect("it starts"), behind)
}
