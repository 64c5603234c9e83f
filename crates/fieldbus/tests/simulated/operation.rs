//! Start-up and cyclic operation.

use crate::bench::enabled;
use crate::bench::{Shared, SimulatedLink, bus, segment, table};
use assert_no_alloc::assert_no_alloc;
use hydroboom_control::command::Command;
use hydroboom_control::measurement::Validity;
use hydroboom_device_simulator::applications::VelocityUnit;
use hydroboom_fieldbus::bus::Bus;
use hydroboom_fieldbus::machine::MachineState;
use hydroboom_fieldbus::table::{Entry, Pdo, Sync};
use hydroboom_realtime::machine::Machine;
use std::cell::RefCell;
use std::rc::Rc;

/// At rest first, as commands count from there; then a motor speed \[rev/s\].
fn after_rest(sequence: u64, speed: f64) -> Command {
    if sequence == 1 { Command::default() } else { Command::released([speed]) }
}

#[test]
fn four_devices_go_to_op_and_exchange_with_the_right_working_counter_in_every_cycle() {
    for exchanges in [1, 2] {
        let (mut bus, _) = bus(table(|table| table.bus.exchanges = exchanges));
        let mut machine = bus.take_machine().unwrap();
        // drive 3, inputs 1, outputs 2
        assert_eq!(bus.working_counter(), 6);
        for sequence in 1..=500 {
            bus.measure();
            machine.write(sequence, &enabled(after_rest(sequence, 12.0)));
            bus.act();
        }
        let counters = bus.counters();
        assert_eq!((counters.cycles, counters.exchanges), (500, 500 * u64::from(exchanges)));
        assert_eq!((counters.lost, counters.low, counters.unexpected), (0, 0, 0));
        assert_eq!(machine.state(), MachineState::Enabled);
        // watchdogs of 20 ms in units of 100 us, where the table says so
        let watchdogs =
            bus.link_mut().segment.devices().iter().map(|d| d.controller.memory.u16(0x0420));
        assert_eq!(watchdogs.collect::<Vec<_>>(), [1000, 200, 1000, 200]);
        let axis = machine.read().unwrap().measurement.axes[0];
        assert!((axis.signals.motor_speed - 12.0).abs() < 1e-5, "{}", axis.signals.motor_speed);
        assert!((axis.signals.stroke - 0.25).abs() < 1e-5, "{}", axis.signals.stroke);
        assert!(axis.validity.to_array().iter().all(|v| *v == Validity::Good), "{axis:?}");
    }
}

#[test]
fn a_command_acts_as_many_periods_after_its_measurement_as_the_table_says() {
    for exchanges in [1, 2] {
        let (mut bus, _) = bus(table(|table| table.bus.exchanges = exchanges));
        let mut machine = bus.take_machine().unwrap();
        // the motor behind the drive has its speed at once, and shows it at the SYNC0 at which it was commanded
        let mut steps = Vec::new();
        for sequence in 1..=60 {
            bus.measure();
            let speed = machine.read().unwrap().measurement.axes[0].signals.motor_speed;
            steps.push(speed);
            let commanded = if sequence >= 50 { 8.0 } else { 0.0 };
            machine.write(sequence, &enabled(after_rest(sequence, commanded)));
            bus.act();
        }
        let at = steps.iter().position(|speed| *speed > 1.0).unwrap();
        // the command was the answer to measurement 50, which is at 49
        assert_eq!(at - 49, bus.table().bus.delay() as usize, "{exchanges} exchanges");
        // and so it is measured
        let delay = bus.delay().unwrap();
        assert_eq!(delay.total, f64::from(bus.table().bus.delay()), "{exchanges} exchanges");
        // by the reference clock: the second exchange, or the first, before the next SYNC0
        let bus_times = &bus.table().bus;
        let sent = if exchanges == 2 { bus_times.send } else { bus_times.exchange };
        let margin = bus.times().margin.value_at_quantile(0.5);
        assert!(margin.abs_diff(bus_times.period - sent) < 5_000, "{margin} ns");
    }
}

/// Control that computes while the bus task waits for the exchange of the outputs has its command in that exchange.
#[test]
fn a_command_is_taken_when_it_is_due() {
    for exchanges in [1, 2] {
        let (mut bus, _) = bus(table(|table| table.bus.exchanges = exchanges));
        let mut machine = bus.take_machine().unwrap();
        let steps = Rc::new(RefCell::new(Vec::new()));
        let seen = Rc::clone(&steps);
        let mut last = None;
        bus.link_mut().control = Some(Box::new(move || {
            let Some(incoming) = machine.read() else { return };
            let measurement = incoming.measurement;
            if last.replace(measurement.number) == Some(measurement.number) {
                return;
            }
            let mut seen = seen.borrow_mut();
            seen.push(measurement.axes[0].signals.motor_speed);
            let commanded = if seen.len() >= 50 { 8.0 } else { 0.0 };
            let sequence = seen.len() as u64;
            machine.write(sequence, &enabled(after_rest(sequence, commanded)));
        }));
        (0..60).for_each(|_| bus.cycle());
        let at = steps.borrow().iter().position(|speed| *speed > 1.0).unwrap();
        // the command was the answer to measurement 50, which is at 49
        assert_eq!(at - 49, bus.table().bus.delay() as usize, "{exchanges} exchanges");
    }
}

#[test]
fn nothing_is_allocated_in_a_cycle_nor_on_the_side_of_control() {
    let (mut bus, _) = bus(table(|_| {}));
    let mut machine = bus.take_machine().unwrap();
    // a frame is lost, too
    for sequence in 1..=200 {
        if sequence == 100 {
            bus.link_mut().segment.lose_frames(1);
        }
        assert_no_alloc(|| {
            bus.measure();
            machine.write(sequence, &enabled(after_rest(sequence, 5.0)));
            bus.act();
            machine.read().map(|incoming| incoming.measurement.number)
        });
    }
    assert_eq!((machine.state(), bus.counters().lost), (MachineState::Enabled, 1));
}

#[test]
fn a_drive_of_another_make_runs_too_increments_fixed_lists_with_gaps_and_sync1() {
    let unit = VelocityUnit::Increments { per_revolution: 1 << 20, gear: [1, 1], factor: [1, 1] };
    let link = SimulatedLink::new(segment(&Shared::default(), |_, drive| {
        drive.unit = unit;
        drive.is_mapping_fixed = true;
    }));
    let entries = |all: &[(u16, u8)]| -> Vec<Entry> {
        all.iter().map(|(index, bits)| Entry { index: *index, sub: 0, bits: *bits }).collect()
    };
    let mut table = table(|table| {
        let drive = &mut table.devices[1];
        drive.is_mapping_written = false;
        drive.sync = Sync::Sync01(1_000_000);
        drive.start_up.iter_mut().filter(|sdo| sdo.index < 0x2000).for_each(|sdo| sdo.value = 3);
        let outputs = entries(&[(0x6040, 16), (0x60ff, 32), (0x6060, 8), (0, 8)]);
        let inputs = entries(&[
            (0x6041, 16),
            (0x6064, 32),
            (0x606c, 32),
            (0x6061, 8),
            (0, 8),
            (0x603f, 16),
            (0x60fd, 32),
        ]);
        drive.outputs = vec![Pdo { list: 0x1600, entries: outputs }];
        drive.inputs = vec![Pdo { list: 0x1a00, entries: inputs }];
        for scale in [&mut table.commanded[0].scale, &mut table.measured[0].scale] {
            // its motor turns the other way round
            scale.factor = -unit.rev_per_s();
        }
    });
    // a file would say so by its entries; here places move by the position and the gaps
    table.measured[0].place.bit = 48;
    let row = &mut table.drives[0];
    row.mode_display.bit = 80;
    row.error.as_mut().unwrap().bit = 96;
    row.stop_circuit.as_mut().unwrap().place.bit = 112;
    let mut bus = Bus::start(table, link).unwrap();
    let mut machine = bus.take_machine().unwrap();
    for sequence in 1..=500 {
        bus.measure();
        machine.write(sequence, &enabled(after_rest(sequence, 3.5)));
        bus.act();
    }
    let counters = bus.counters();
    assert_eq!((machine.state(), counters.lost, counters.low), (MachineState::Enabled, 0, 0));
    let speed = machine.read().unwrap().measurement.axes[0].signals.motor_speed;
    assert!((speed - 3.5).abs() < 1e-6, "{speed}");
    // quick stop and fault by the drive's ramp, a lost connection is a fault
    assert_eq!(bus.facts()[1].reactions, [Some(2), Some(2), Some(1)]);
}

#[test]
fn a_cycle_record_has_the_process_data_of_every_device() {
    let (mut bus, _) = bus(table(|_| {}));
    let mut machine = bus.take_machine().unwrap();
    let mut records = bus.records();
    for sequence in 1..=500 {
        bus.measure();
        machine.write(sequence, &enabled(after_rest(sequence, 12.0)));
        bus.act();
    }
    let record = std::iter::from_fn(|| records.pop().ok()).last().unwrap();
    let table = bus.table();
    let images: Vec<_> = record.image.devices(table).collect();
    let names: Vec<&str> = images.iter().map(|(name, ..)| *name).collect();
    assert_eq!(names, table.devices.iter().map(|row| row.name.as_str()).collect::<Vec<_>>());
    for row in &table.commanded {
        let (_, outputs, _) = images[row.place.device];
        let value = row.scale.value(row.scale.kind.number(row.place.read(outputs)));
        let commanded = [12.0, 1.0][row.signal];
        assert!((value - commanded).abs() < 1e-4, "{value}, commanded {commanded}");
    }
    let signals = machine.read().unwrap().measurement.axes[0].signals.to_array();
    for row in table.measured.iter().filter(|row| row.signal < signals.len()) {
        let (_, _, inputs) = images[row.place.device];
        let value = row.scale.value(row.scale.kind.number(row.place.read(inputs)));
        assert_eq!(value, signals[row.signal], "signal {}", row.signal);
    }
}
