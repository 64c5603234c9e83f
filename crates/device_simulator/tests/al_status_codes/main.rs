//! Each state change that a drive refuses, and each reason for which it leaves OP, with its AL status code.

mod bare_main_device;

use bare_main_device::{BWR, BareMainDevice, FRMW, LRW, STATION};
use hydroboom_device_simulator::Segment;
use hydroboom_device_simulator::al_status_code::AlStatusCode::{self, *};
use hydroboom_device_simulator::applications::{
    DriveSettings, IdealMotor, ServoDrive, VelocityUnit,
};
use hydroboom_device_simulator::controller::DistributedClock;
use hydroboom_device_simulator::device::{Fault, Identity, Settings, State, Synchronisation};
use hydroboom_device_simulator::object_dictionary::Abort;

/// Cycle \[ns\].
const CYCLE: u64 = 1_000_000;
/// Bytes of process data after power-on.
const OUTPUTS: u16 = 7;
const INPUTS: u16 = 17;

fn drive_with(change: impl FnOnce(&mut Settings)) -> BareMainDevice {
    let identity = Identity { vendor: 0x0fff, product: 2, revision: 1, serial: 7 };
    let mut settings = Settings::new("drive", identity).with_mailbox();
    settings.synchronisation =
        Synchronisation { has_sync0: true, has_sync1: true, ..Default::default() };
    change(&mut settings);
    let drive = DriveSettings {
        unit: VelocityUnit::PrefixedRpm(-3),
        increments: 65536,
        deceleration: 100.0,
        is_mapping_fixed: false,
    };
    let clock = DistributedClock::new(0, 0);
    let device = ServoDrive::device(settings, drive, clock, Box::new(IdealMotor::default()));
    BareMainDevice::new(Segment::new(vec![device]))
}

fn drive() -> BareMainDevice {
    drive_with(|_| {})
}

/// Up to PREOP.
fn in_preop(mut main: BareMainDevice) -> BareMainDevice {
    main.mailboxes();
    assert_eq!(main.request(2), (State::PreOp, None));
    main
}

/// Sync managers and FMMUs for process data of the lengths that are mapped.
fn map(main: &mut BareMainDevice) {
    main.sync_manager(2, 0x1100, OUTPUTS, 0x64);
    main.sync_manager(3, 0x1180, INPUTS, 0x20);
    let fmmu = |logical: u8, length: u16, physical: u16, kind: u8| {
        let ([a, b], [c, d]) = (length.to_le_bytes(), physical.to_le_bytes());
        [logical, 0, 0, 0, a, b, 0, 7, c, d, 0, kind, 1, 0, 0, 0]
    };
    main.write(0x0600, &fmmu(0, OUTPUTS, 0x1100, 2));
    main.write(0x0610, &fmmu(OUTPUTS as u8, INPUTS, 0x1180, 1));
}

/// SYNC0 each cycle, from a few cycles from now on.
fn synchronise(main: &mut BareMainDevice, activation: u8, cycles: [u32; 2]) {
    main.write(0x09a0, &[cycles[0].to_le_bytes(), cycles[1].to_le_bytes()].concat());
    let start = (main.now / CYCLE + 5) * CYCLE;
    main.write(0x0990, &start.to_le_bytes());
    main.write(0x0981, &[activation]);
}

/// Process data once, half a cycle after SYNC0; the inputs.
fn exchange(main: &mut BareMainDevice, outputs: &[u8]) -> Vec<u8> {
    main.now = (main.now / CYCLE + 1) * CYCLE + CYCLE / 2 - 20_000;
    let data = [outputs, &vec![0; usize::from(INPUTS)]].concat();
    let (data, count) = main.send(LRW, [0; 4], &data);
    assert_eq!(count, 3);
    data[usize::from(OUTPUTS)..].to_vec()
}

/// Into OP, free running or by SYNC0.
fn in_operation(has_sync0: bool) -> BareMainDevice {
    let mut main = in_preop(drive());
    map(&mut main);
    if has_sync0 {
        main.download(0x1c32, 1, &[2, 0]).expect("taken");
        synchronise(&mut main, 3, [CYCLE as u32, 0]);
    }
    assert_eq!(main.request(4), (State::SafeOp, None));
    main.write(0x0120, &[8, 0]);
    for _ in 0..10 {
        exchange(&mut main, &[0; 7]);
    }
    assert_eq!(main.state(), (State::Op, None));
    main
}

#[test]
fn invalid_states_and_mailboxes_are_refused_with_their_codes() {
    // straight into OP; a number that is no state; bootstrap
    for (state, code) in [(8, InvalidStateChange), (7, UnknownState), (3, BootstrapNotSupported)] {
        assert_eq!(drive().request(state), (State::Init, Some(code)));
    }
    // mailboxes that are not what the EEPROM states, or none
    for (start, length, control) in [(0x1000, 64, 0x26), (0x1001, 128, 0x26), (0x1000, 128, 0x22)] {
        let mut main = drive();
        main.mailboxes();
        main.sync_manager(0, start, length, control);
        assert_eq!(main.request(2), (State::Init, Some(InvalidMailbox)));
    }
    // an error stays until it is acknowledged
    let mut main = drive();
    main.request(2);
    main.mailboxes();
    assert_eq!(main.request(2), (State::Init, Some(InvalidMailbox)));
    assert_eq!(main.request(0x12), (State::PreOp, None));
}

/// A fault of a configuration, made in PREOP.
type Configuration = fn(&mut BareMainDevice);

#[test]
fn a_wrong_configuration_of_process_data_is_refused_with_its_code() {
    let wrong: [(AlStatusCode, Configuration); 8] = [
        (InvalidSyncManager, |main| main.sync_manager(2, 0x1100, OUTPUTS, 0x60)),
        (InvalidSyncManager, |main| main.sync_manager(3, 0x1180, INPUTS, 0x64)),
        (InvalidOutputConfiguration, |main| main.sync_manager(2, 0x1100, OUTPUTS + 1, 0x64)),
        (InvalidInputConfiguration, |main| main.sync_manager(3, 0x1180, INPUTS - 1, 0x20)),
        (InvalidInputConfiguration, |main| main.sync_manager(3, 0x1184, INPUTS, 0x20)),
        // a list that is not there; an object of the other direction
        (InvalidOutputMapping, |main| main.download(0x1c12, 1, &[0x01, 0x16]).expect("taken")),
        (InvalidOutputMapping, |main| {
            main.download(0x1600, 1, &0x6041_0010_u32.to_le_bytes()).expect("taken");
        }),
        (InvalidInputMapping, |main| {
            main.download(0x1a00, 1, &0x6040_0010_u32.to_le_bytes()).expect("taken");
        }),
    ];
    for (number, (code, configure)) in wrong.into_iter().enumerate() {
        let mut main = in_preop(drive());
        map(&mut main);
        configure(&mut main);
        assert_eq!(main.request(4), (State::PreOp, Some(code)), "{number}");
    }
}

#[test]
fn a_wrong_watchdog_or_synchronisation_is_refused_with_its_code() {
    let wants_watchdog = || {
        let mut main =
            in_preop(drive_with(|settings| settings.longest_watchdog = Some(100_000_000)));
        map(&mut main);
        main
    };
    let mut main = wants_watchdog();
    assert_eq!(main.request(4), (State::SafeOp, None));
    // off, too long, and not fed by the sync manager
    let off: Configuration = |main| assert!(main.write(0x0420, &[0, 0]));
    let long: Configuration = |main| assert!(main.write(0x0420, &1001_u16.to_le_bytes()));
    let unfed: Configuration = |main| main.sync_manager(2, 0x1100, OUTPUTS, 0x24);
    for configure in [off, long, unfed] {
        let mut main = wants_watchdog();
        configure(&mut main);
        assert_eq!(main.request(4), (State::PreOp, Some(InvalidWatchdog)));
    }

    let cycle = CYCLE as u32;
    for (kind, activation, cycles, expected) in [
        (2, 0x03, [cycle, 0], None),
        (3, 0x07, [cycle, cycle / 2], None),
        // SYNC1 alone; and 0x1C32 left at free run
        (2, 0x05, [cycle, 0], Some(InvalidSyncConfiguration)),
        (0, 0x03, [cycle, 0], Some(InvalidSyncConfiguration)),
        (2, 0x03, [100_000, 0], Some(InvalidSyncCycle)),
        (2, 0x03, [cycle + 1, 0], Some(InvalidSync0Cycle)),
        (3, 0x07, [cycle, cycle + 1], Some(InvalidSync1Cycle)),
    ] {
        let mut main = in_preop(drive());
        map(&mut main);
        main.download(0x1c32, 1, &[kind, 0]).expect("taken");
        synchronise(&mut main, activation, cycles);
        let state = if expected.is_some() { State::PreOp } else { State::SafeOp };
        assert_eq!(main.request(4), (state, expected), "{kind} {activation:#x} {cycles:?}");
    }
    let mut main =
        in_preop(drive_with(|settings| settings.synchronisation.supports_free_run = false));
    map(&mut main);
    assert_eq!(main.request(4), (State::PreOp, Some(FreeRunNotSupported)));
}

#[test]
fn operation_needs_outputs_and_sync0() {
    let mut main = in_preop(drive());
    map(&mut main);
    assert_eq!(main.request(4), (State::SafeOp, None));
    main.request(8);
    main.wait(300_000_000);
    assert_eq!(main.state(), (State::SafeOp, Some(NoValidOutputs)));
    // a start that has passed brings no SYNC0
    let mut main = in_preop(drive());
    map(&mut main);
    main.download(0x1c32, 1, &[2, 0]).expect("taken");
    main.write(0x09a0, &(CYCLE as u32).to_le_bytes());
    main.write(0x0990, &1_u64.to_le_bytes());
    main.write(0x0981, &[3]);
    assert_eq!(main.request(4), (State::SafeOp, None));
    main.write(0x0120, &[8, 0]);
    for _ in 0..300 {
        exchange(&mut main, &[0; 7]);
    }
    assert_eq!(main.state(), (State::SafeOp, Some(NoSynchronisation)));
}

#[test]
fn operation_ends_by_watchdog_late_frames_and_missing_sync0() {
    // silence: the watchdog's time after the last outputs, no cycle earlier
    let mut main = in_operation(false);
    main.wait(99_900_000);
    assert_eq!(main.state(), (State::Op, None));
    main.wait(200_000);
    assert_eq!(main.state(), (State::SafeOp, Some(SyncManagerWatchdog)));
    assert_eq!(main.read(0x0440, 1)[0] & 1, 0);
    assert_eq!(main.read(0x0442, 1)[0], 1);

    // frames that come within the set-up time before SYNC0
    let mut main = in_operation(true);
    for _ in 0..10 {
        main.now = (main.now / CYCLE + 2) * CYCLE - 25_000;
        main.send(LRW, [0; 4], &[0; 24]);
    }
    main.wait(CYCLE);
    assert_eq!(main.state(), (State::SafeOp, Some(SynchronisationError)));

    // one late frame is forgiven
    let mut main = in_operation(true);
    main.now = (main.now / CYCLE + 2) * CYCLE - 25_000;
    main.send(LRW, [0; 4], &[0; 24]);
    for _ in 0..10 {
        exchange(&mut main, &[0; 7]);
    }
    assert_eq!(main.state(), (State::Op, None));

    let mut main = in_operation(true);
    let now = main.now;
    main.segment.devices_mut()[0].inject(Fault::Sync0Missing, now);
    for _ in 0..10 {
        exchange(&mut main, &[0; 7]);
    }
    assert_eq!(main.state(), (State::SafeOp, Some(FatalSynchronisationError)));
}

#[test]
fn the_mailbox_takes_values_and_refuses_with_an_abort_code() {
    let mut main = in_preop(drive());
    assert_eq!(main.upload(0x1018, 1), Ok(vec![0xff, 0x0f, 0, 0]));
    assert_eq!(main.upload(0x1008, 0), Ok(b"drive".to_vec()));
    assert_eq!(main.download(0x605a, 0, &[1, 0]), Ok(()));
    assert_eq!(main.upload(0x605a, 0), Ok(vec![1, 0]));
    for (index, sub, value, abort) in [
        (0x1018, 1, &[0; 4][..], Abort::ReadOnly),
        (0x605a, 0, &[0; 4], Abort::TooLong),
        (0x605a, 0, &[0], Abort::TooShort),
        (0x5000, 0, &[0], Abort::NoObject),
        (0x1018, 9, &[0], Abort::NoSubindex),
        (0x6060, 0, &[1], Abort::ValueRange),
    ] {
        assert_eq!(main.download(index, sub, value), Err(abort as u32), "{index:#x}:{sub}");
    }
    // a value that was refused is not kept
    assert_eq!(main.upload(0x6060, 0), Ok(vec![0]));
    let now = main.now;
    main.segment.devices_mut()[0].inject(Fault::SdoAbort((0x1018, 1), Abort::WrongState), now);
    assert_eq!(main.upload(0x1018, 1), Err(Abort::WrongState as u32));
    // complete access is not there
    assert_eq!(main.transfer(&[0x50, 0x18, 0x10, 0, 0, 0, 0, 0])[0], 0x80);
    // a mailbox that is not read stays full
    main.segment.devices_mut()[0].inject(Fault::MailboxNotServed, now);
    assert!(main.write(0x1000, &[0; 128]));
    main.wait(10_000_000);
    assert!(!main.write(0x1000, &[0; 128]));
}

#[test]
fn a_drive_uses_its_stated_unit_and_stops_without_outputs() {
    let mut main = in_operation(true);
    let outputs = |word: u16, millirpm: i32| {
        let ([a, b], [c, d, e, f]) = (word.to_le_bytes(), millirpm.to_le_bytes());
        [a, b, c, d, e, f, 9]
    };
    for word in [0x06, 0x07, 0x0f] {
        for _ in 0..3 {
            exchange(&mut main, &outputs(word, 0));
        }
    }
    let position = |inputs: &[u8]| i32::from_le_bytes([inputs[2], inputs[3], inputs[4], inputs[5]]);
    // 600 rpm for 0.1 s is one revolution
    let inputs = exchange(&mut main, &outputs(0x0f, 600_000));
    assert_eq!(u16::from_le_bytes([inputs[0], inputs[1]]) & 0x6f, 0x27);
    let first = position(&exchange(&mut main, &outputs(0x0f, 600_000)));
    for _ in 0..100 {
        exchange(&mut main, &outputs(0x0f, 600_000));
    }
    let last = position(&exchange(&mut main, &outputs(0x0f, 600_000)));
    // two latched readings, 101 cycles apart
    assert_eq!(last - first, (65536.0_f64 * 10.0 * 0.101).round() as i32);
    // silence: five missed cycles are too many; then 10 rev/s at 100 rev/s^2 take 0.1 s and half a revolution
    main.wait(10_000_000);
    assert_eq!(main.state(), (State::SafeOp, Some(SynchronisationError)));
    main.wait(200_000_000);
    let drive = &main.segment.devices()[0].dictionary;
    let status = drive.unsigned((0x6041, 0));
    assert_eq!(status & 0x6f, 0x08, "a fault that stays: {status:#x}");
    assert_eq!(drive.unsigned((0x603f, 0)), 0x7500);
    let turned = (drive.signed((0x6064, 0)) - i64::from(last)) as f64 / 65536.0;
    let by_cycles = |cycles: f64| 10.0 * cycles * 1e-3 + 0.5;
    assert!(by_cycles(4.5) < turned && turned < by_cycles(7.5), "{turned} rev");
}

#[test]
fn clocks_follow_the_reference_clock_and_receive_times_give_delays() {
    let identity = Identity::default();
    let device = |drift| {
        let mut settings = Settings::new("drive", identity).with_mailbox();
        settings.synchronisation.has_sync0 = true;
        let drive = DriveSettings {
            unit: VelocityUnit::PrefixedRpm(-3),
            increments: 65536,
            deceleration: 100.0,
            is_mapping_fixed: false,
        };
        let clock = DistributedClock::new(777_777, drift);
        ServoDrive::device(settings, drive, clock, Box::new(IdealMotor::default()))
    };
    let segment = Segment::new(vec![device(0), device(30_000)]).with_delays(&[100, 800]);
    let mut main = BareMainDevice::new(segment);
    main.send(BWR, [0, 0, 0, 0x09], &[0; 4]);
    let times = main.read(0x0900, 8);
    let port = |k: usize| u32::from_le_bytes([times[k], times[k + 1], times[k + 2], times[k + 3]]);
    assert_eq!(port(4) - port(0), 2 * 800);

    let difference = |main: &BareMainDevice| {
        let system = |k: usize| {
            let controller = &main.segment.devices()[k].controller;
            controller.clock.system(&controller.memory, main.now) as i64
        };
        system(1) - system(0)
    };
    let [low, high] = STATION.to_le_bytes();
    for _ in 0..2000 {
        main.now = (main.now / CYCLE + 1) * CYCLE;
        main.send(FRMW, [low, high, 0x10, 0x09], &[0; 8]);
    }
    // a drift of 30 ppm is 30 ns a cycle, of which the loop leaves what its gain takes back a cycle
    let left = difference(&main).abs();
    assert!(left < 1_000, "{left} ns");
    main.wait(1_000_000_000);
    let alone = difference(&main).abs();
    assert!(alone > 25_000, "{alone} ns without a reference");
}
