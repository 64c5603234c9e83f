//! Wrong buses, of which the first sentence names the cause; right ones, of which nothing is said.

use crate::bench::{Shared, SimulatedLink, devices, example, table};
use hydroboom_device_simulator::al_status_code::AlStatusCode;
use hydroboom_device_simulator::applications::{DigitalOutput, VelocityUnit, coupler};
use hydroboom_device_simulator::controller::DistributedClock;
use hydroboom_device_simulator::controller::registers::{
    ERROR_COUNTERS, FEATURES, WATCHDOG_PROCESS_DATA,
};
use hydroboom_device_simulator::device::{Fault, Identity, Settings};
use hydroboom_device_simulator::object_dictionary::Abort;
use hydroboom_device_simulator::{Device, Segment};
use hydroboom_fieldbus::diagnosis::{
    BusFacts, Diagnosis, Finding, HostFacts, LineDevice, Listening, Severity, Stage, diagnose,
    findings,
};
use hydroboom_fieldbus::table::{Sync, Table};

/// A bus: how its table, its devices and its line differ from the page's.
struct Case {
    table: Table,
    devices: Vec<Device>,
    /// Devices that are connected.
    connected: usize,
}

impl Case {
    fn new() -> Self {
        Self::with_drive(|_| {})
    }

    fn with_drive(change: impl FnOnce(&mut Settings)) -> Self {
        let devices = devices(&Shared::default(), |settings, _| change(settings));
        Self { table: table(|_| {}), connected: usize::MAX, devices }
    }

    fn diagnosis(self) -> Diagnosis {
        let mut segment = Segment::new(self.devices);
        segment.connect(self.connected);
        diagnose(&self.table, SimulatedLink::new(segment), HostFacts::default()).unwrap()
    }

    /// The first sentence has some parts, and is of a severity.
    fn first(self, severity: Severity, parts: &[&str]) {
        let found = self.diagnosis().findings;
        let first = found.first().expect("something is found");
        assert_eq!(first.severity, severity, "{found:#?}");
        let sentence = first.to_string();
        assert_eq!(sentence.lines().count(), 1, "{sentence}");
        for part in parts {
            assert!(sentence.contains(part), "{part} is not in: {sentence}; {found:#?}");
        }
    }

    fn error(self, parts: &[&str]) {
        self.first(Severity::Error, parts);
    }

    fn warning(self, parts: &[&str]) {
        self.first(Severity::Warning, parts);
    }
}

#[test]
fn of_a_right_bus_nothing_is_said() {
    let diagnosis = Case::new().diagnosis();
    assert_eq!(diagnosis.findings, []);
    let seen = diagnosis.bus.listening.unwrap();
    // what the page's table and the link of the tests make of times
    assert_eq!((seen.exchanges, seen.lost, seen.late_outputs), (1000, 0, 0));
    assert!((95_000..105_000).contains(&seen.phase.p50), "{seen:?}");
    assert!((295_000..305_000).contains(&seen.margin.p50), "{seen:?}");
}

#[test]
fn of_a_right_bus_with_one_exchange_nothing_is_said() {
    let mut case = Case::new();
    case.table.bus.exchanges = 1;
    case.table.bus.period = 2_000_000;
    assert_eq!(case.diagnosis().findings, []);
}

/// By SYNC1, with its own watchdog, and with the reference clock, as there is no coupler before it.
#[test]
fn of_a_right_bus_that_begins_with_a_drive_by_sync1_nothing_is_said() {
    let mut case = Case::with_drive(|settings| settings.longest_watchdog = Some(100_000_000));
    case.devices.remove(0);
    let (bus, devices) = example().split_once("[[device]]").unwrap();
    let (_coupler, others) = devices.split_once("[[device]]").unwrap();
    case.table = Table::parse("no coupler", &format!("{bus}[[device]]{others}")).unwrap();
    let drive = &mut case.table.devices[0];
    (drive.sync, drive.watchdog) = (Sync::Sync01(1_000_000), None);
    drive.start_up.iter_mut().filter(|sdo| sdo.index == 0x1c32).for_each(|sdo| sdo.value = 3);
    assert_eq!(case.diagnosis().findings, []);
}

#[test]
fn devices_that_are_missing_are_named_with_the_place_of_the_break() {
    let case = Case { connected: 0, ..Case::new() };
    case.error(&["no device answers", "supply"]);
    let case = Case { connected: 3, ..Case::new() };
    case.error(&["outputs (position 3) is missing", "(position 2) has no link behind it"]);
    let mut case = Case::new();
    case.devices.remove(2);
    case.error(&["inputs (position 2) is missing", "3 devices answer, the table has 4"]);
}

#[test]
fn devices_that_are_not_the_tables_are_named() {
    let mut case = Case::new();
    let identity = Identity { vendor: 0x0fff, product: 5, revision: 1, serial: 7 };
    let clock = DistributedClock::new(9, 0);
    let other = Settings::new("stranger", identity);
    case.devices.insert(3, DigitalOutput::device(other, 8, clock, Box::new(|_| {})));
    case.error(&["stranger", "at position 3", "product 0x00000005", "not in the table"]);

    let mut case = Case::new();
    case.devices.swap(1, 2);
    case.error(&["different order", "position 1 is inputs, position 2 is drive"]);

    let case = Case::with_drive(|settings| settings.identity.product = 9);
    case.error(&["position 1 is drive", "product 0x00000009", "the table has drive"]);

    let case = Case::with_drive(|settings| settings.identity.revision = 7);
    case.error(&["position 1", "revision 0x00000007", "0x00000001 to 0x00000003", "widen"]);
}

#[test]
fn more_devices_than_a_bus_may_have_are_counted_with_the_limit() {
    let with_couplers = |count: usize| {
        let mut case = Case::new();
        let identity = Identity { vendor: 0x0fff, product: 1, revision: 1, serial: 7 };
        let more = (0..count)
            .map(|_| coupler(Settings::new("coupler", identity), DistributedClock::new(9, 0)));
        case.devices.extend(more);
        case
    };
    // 16 are examined, and compared with the table
    with_couplers(12).error(&["not in the table", "16 devices answer, the table has 4"]);
    with_couplers(13).error(&[
        "17 devices answer, the table has 4",
        "allows 16 on a bus",
        "network interface of their own",
    ]);
    with_couplers(70).error(&["64 or more devices answer"]);
}

#[test]
fn process_data_and_units_that_differ_are_named() {
    let mut case = Case::new();
    case.table.devices[2].inputs[0].entries.pop();
    case.error(&["inputs of inputs (position 2) are", "0x1C13", "the table has"]);

    let mut case = Case::new();
    case.devices =
        devices(&Shared::default(), |_, drive| drive.unit = VelocityUnit::PrefixedRpm(0));
    case.error(&["one unit of 0x60FF of drive (position 1)", "0x60A9"]);

    let mut case = Case::new();
    case.devices[1].inject(Fault::SdoAbort((0x1c32, 1), Abort::ReadOnly), 0);
    case.error(&["start-up SDO 0x1C32:01", "drive (position 1)", "read only"]);
}

#[test]
fn a_watchdog_that_does_not_stop_outputs_is_named() {
    let with_watchdog = |units: u16| {
        let mut case = Case::new();
        case.table.devices[3].watchdog = None;
        let memory = &mut case.devices[3].controller.memory;
        memory.set(WATCHDOG_PROCESS_DATA, &units.to_le_bytes());
        case
    };
    with_watchdog(0).error(&["watchdog of outputs (position 3) is switched off", "watchdog_ms"]);
    with_watchdog(20_000).warning(&["watchdog of outputs (position 3) is 2000 ms"]);
}

#[test]
fn synchronisation_that_the_device_does_not_have_or_is_not_set_up_for_is_named() {
    let mut case = Case::new();
    case.devices[2].controller.memory.set(FEATURES, &[0]);
    case.error(&["inputs (position 2) has no distributed clock"]);

    let mut case = Case::with_drive(|settings| settings.synchronisation.has_sync1 = false);
    case.table.devices[1].sync = Sync::Sync01(1_000_000);
    case.error(&["drive (position 1)", "AssignActivate 0x0300", "requires 0x0700"]);

    // the device refuses SAFEOP for it, which is the effect
    let mut case = Case::new();
    case.table.devices[1].start_up.retain(|value| value.index != 0x1c32);
    let found = case.diagnosis().findings;
    let stages: Vec<Stage> = found.iter().map(|finding| finding.stage).collect();
    assert_eq!(stages, [Stage::Synchronisation, Stage::State], "{found:#?}");
    let sentence = found[0].to_string();
    assert!(sentence.contains("0x1C32:01 of drive (position 1) is 0 (free run)"), "{sentence}");
    assert!(sentence.contains("write 2 into 0x1C32:01"), "{sentence}");
}

#[test]
fn a_damaged_cable_is_named_before_what_it_makes_of_the_bus() {
    let mut case = Case::new();
    case.devices[2].inject(Fault::DamagedCable { port: 0, frames_per_error: 50 }, 0);
    let diagnosis = case.diagnosis();
    let sentence = diagnosis.findings[0].to_string();
    let parts = ["frames are damaged", "between drive (position 1) and inputs (position 2)"];
    assert!(parts.iter().all(|part| sentence.contains(part)), "{sentence}");
    // the other devices count them as forwarded only: no other cable is suspected
    let is_cable = |finding: &&Finding| finding.stage == Stage::Cable;
    assert_eq!(diagnosis.findings.iter().filter(is_cable).count(), 1, "{diagnosis:#?}");
    let errors = diagnosis.bus.line[3].errors_after.unwrap();
    assert_eq!((errors.invalid_frames, errors.receive_errors), ([0; 4], [0; 4]));
    assert!(errors.forwarded[0] > 0);

    let mut case = Case::new();
    case.devices[0].inject(Fault::DamagedCable { port: 1, frames_per_error: 50 }, 0);
    case.error(&["frames are damaged", "between coupler (position 0) and drive (position 1)"]);

    let counted = |register: u16, count: u8| {
        let mut case = Case::new();
        case.devices[1].controller.memory.set(ERROR_COUNTERS + register, &[count]);
        case
    };
    counted(0, 9)
        .warning(&["9 were counted at port 0 since power-on, or since", "drive (position 1)"]);
    counted(0x10, 3).warning(&["lost 3 times since power-on, or since", "drive (position 1)"]);
}

#[test]
fn a_device_with_an_error_is_named_with_its_al_status_code() {
    let case = Case::with_drive(|settings| settings.synchronisation.base_cycle = 300_000);
    case.error(&["drive (position 1) refuses SAFEOP", "0x0036", "bus.period_us"]);

    // its EEPROM has a longer mailbox than its firmware
    let mut case = Case::new();
    case.devices[1].controller.eeprom.content[2 * 0x19] += 8;
    case.error(&["drive (position 1) refuses PREOP", "0x0016", "EEPROM"]);

    let mut case = Case::new();
    case.devices[1].inject(Fault::StateDrop(AlStatusCode::SyncManagerWatchdog), 0);
    case.warning(&["drive (position 1) had an error before", "0x001B"]);
}

#[test]
fn late_frames_are_laid_to_the_network_card_where_it_gathers_them() {
    let late = Listening { cycles: 500, exchanges: 1000, late_outputs: 90, ..Listening::default() };
    let late = Listening { has_too_many_late: true, ..late };
    let line = vec![LineDevice { ports: 0x5611, ..LineDevice::default() }];
    let bus = BusFacts { line, listening: Some(late), ..BusFacts::default() };
    let of = |host: &HostFacts| -> Vec<(Severity, Stage)> {
        let found = findings(&table(|_| {}), &bus, host);
        found.iter().map(|finding| (finding.severity, finding.stage)).collect()
    };
    let interface = String::from("eth1");
    let card = HostFacts { interface, rx_coalescing_us: Some(50), ..HostFacts::default() };
    let late = (Severity::Error, Stage::Timing);
    assert_eq!(of(&card), [(Severity::Error, Stage::Host), late]);
    assert_eq!(of(&HostFacts::default()), [late]);
    let quick = HostFacts { rx_coalescing_us: Some(0), is_adaptive: Some(false), ..card };
    assert_eq!(of(&quick), [late]);
}
