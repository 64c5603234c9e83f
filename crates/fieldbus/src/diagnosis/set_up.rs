//! Set-up of the devices as in a run, up to SAFEOP, and the registers and objects that are read there.

use super::facts::{BusFacts, SetUp, SyncManager};
use super::listening::listen;
use super::scan;
use crate::check::{DeviceFacts, mismatches};
use crate::device_configuration::{configure, optional};
use crate::link::Link;
use crate::start_up::{Devices, MOST_DEVICES, identities_fit, identity, with_clocks};
use crate::table::Table;
use crate::time::now;
use crate::wire::Wire;
use ethercrab::subdevice_group::{NoDc, PreOp, SafeOp};
use ethercrab::{EtherCrabWireReadSized, RegisterAddress, SubDevice, SubDeviceRef};
use hydroboom_realtime::failure::{guarded, hand_panics_on};
use std::ops::Deref;

/// Unit of the watchdog divider (0x0400) \[ns\].
const DIVIDER_UNIT: u64 = 40;
/// Offset that is added to the divider.
const DIVIDER_OFFSET: u64 = 2;
/// Registers of the SYNC unit: control (0x0980) and activation (0x0981).
const SYNC_UNIT: u16 = 0x0980;
/// System time difference from the reference clock; its bit 31 is the sign.
const CLOCK_DIFFERENCE: u16 = 0x092c;
/// Sign bit of the difference: the own clock is behind the reference.
const IS_BEHIND: u32 = 0x8000_0000;
/// First register of the sync managers (ETG.1000.4).
const SYNC_MANAGERS: u16 = 0x0800;
/// Number of sync managers that are read.
const MOST_MANAGERS: u16 = 8;
/// Registers of a sync manager \[byte\].
const MANAGER_SIZE: u16 = 8;
/// Control byte of a sync manager: mask of mode and direction.
const MODE_AND_DIRECTION: u8 = 0x0f;
/// Buffered, written by the main device.
const OUTPUTS: u8 = 0x04;
/// Watchdog trigger enable.
const TRIGGERS_WATCHDOG: u8 = 0x40;

/// Brings the devices to SAFEOP, or as far as they go, and fills in the facts.
pub(crate) fn examine<L: Link>(wire: &mut Wire<L>, table: &Table, bus: &mut BusFacts) {
    // until their EEPROM is read
    let unnamed = |identity: Option<[u32; 3]>| DeviceFacts {
        name: "a device".into(),
        identity: identity.unwrap_or_default(),
        ..DeviceFacts::default()
    };
    bus.devices = bus.line.iter().map(|device| unnamed(device.identity)).collect();
    // a finding of its own: the main device has no room for them
    if bus.line.len() > MOST_DEVICES {
        return;
    }
    let main = wire.main;
    hand_panics_on();
    // ethercrab panics where the ports fit no topology that it knows
    let started = guarded(|| wire.run(main.init_single_group(now)));
    let group: Devices<PreOp, NoDc> = match started {
        Ok(Ok(group)) => group,
        Ok(Err(error)) => return record_refusal(wire, bus, error.to_string()),
        Err(panic) => return record_refusal(wire, bus, panic),
    };
    for (position, facts) in bus.devices.iter_mut().enumerate() {
        if let Ok(device) = group.subdevice(main, position) {
            *facts = identity(&device);
        }
    }
    // nothing is written to a device that is not the table's
    if group.len() != table.devices.len() || !identities_fit(table, &bus.devices) {
        return;
    }
    for (position, row) in table.devices.iter().enumerate() {
        let Ok(device) = group.subdevice(main, position) else { return };
        let is_drive = table.drives.iter().any(|drive| drive.device == position);
        match configure(wire, &device, row, is_drive) {
            Ok(facts) => bus.devices[position] = facts,
            Err((what, error)) => bus.failed.push((position, what, error.to_string())),
        }
        let has_outputs = row.output_bytes() > 0;
        bus.set_up.push(read_set_up(wire, &device, has_outputs));
    }
    if !bus.failed.is_empty() || !mismatches(table, &bus.devices).is_empty() {
        return;
    }
    into_safe_op(wire, group, table, bus);
}

/// Records why the devices did not go to PREOP, with their AL status codes.
fn record_refusal<L: Link>(wire: &mut Wire<L>, bus: &mut BusFacts, why: String) {
    bus.pre_op_refused = Some(why);
    scan::read_states(wire, &mut bus.line);
}

/// Sets up the clocks, brings the devices to SAFEOP, and exchanges frames there.
fn into_safe_op<L: Link>(
    wire: &mut Wire<L>,
    group: Devices<PreOp, NoDc>,
    table: &Table,
    bus: &mut BusFacts,
) {
    let main = wire.main;
    let group = match with_clocks(wire, group, table) {
        Ok(group) => group,
        Err(error) => {
            bus.clocks_refused = Some(error.to_string());
            return;
        }
    };
    for (position, set_up) in bus.set_up.iter_mut().enumerate() {
        let Ok(device) = group.subdevice(main, position) else { continue };
        set_up.dc_activation = wire.run(device.register_read(SYNC_UNIT)).ok();
        // the guard has to end with its statement: taking another one while it is held is a deadlock
        let outputs = device.outputs_raw().len();
        let inputs = device.inputs_raw().len();
        set_up.sizes = Some([outputs, inputs]);
    }
    let group: Devices<SafeOp> = match wire.run(group.into_safe_op(main)) {
        Ok(group) => group,
        Err(error) => {
            bus.safe_op_refused = Some(error.to_string());
            scan::read_states(wire, &mut bus.line);
            return;
        }
    };
    for (position, set_up) in (0..).zip(&mut bus.set_up) {
        set_up.output_managers = output_managers(wire, position);
    }
    bus.listening = listen(wire, &group, table);
    for (position, set_up) in (0..).zip(&mut bus.set_up) {
        let difference: Option<u32> = scan::read(wire, position, CLOCK_DIFFERENCE).ok();
        set_up.clock_difference = difference.map(|difference| {
            let size = i64::from(difference & !IS_BEHIND);
            if difference & IS_BEHIND != 0 { -size } else { size }
        });
    }
    scan::read_states(wire, &mut bus.line);
}

/// Watchdogs and objects of synchronisation, in PREOP.
fn read_set_up<L: Link, S: Deref<Target = SubDevice>>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    has_outputs: bool,
) -> SetUp {
    let mut register =
        |address: RegisterAddress| wire.run(device.register_read::<u16>(address)).ok();
    let divider = register(RegisterAddress::WatchdogDivider);
    let [process_data, pdi] = [RegisterAddress::SyncManagerWatchdog, RegisterAddress::PdiWatchdog]
        .map(|address| {
            let units = register(address)?;
            Some(DIVIDER_UNIT * (u64::from(divider?) + DIVIDER_OFFSET) * u64::from(units))
        });
    SetUp {
        delay: device.propagation_delay(),
        watchdog: process_data.filter(|_| has_outputs),
        pdi_watchdog: pdi,
        sync_types: [
            optional_object(wire, device, 0x1c32, 1),
            optional_object(wire, device, 0x1c33, 1),
        ],
        cycle: optional_object(wire, device, 0x1c32, 2),
        shortest_cycle: optional_object(wire, device, 0x1c32, 5),
        calc_and_copy: optional_object(wire, device, 0x1c32, 6),
        ..SetUp::default()
    }
}

/// Reads an optional object; none where the device does not have it, or no mailbox.
fn optional_object<L: Link, S: Deref<Target = SubDevice>, T: EtherCrabWireReadSized>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    index: u16,
    sub: u8,
) -> Option<T> {
    optional(wire, device, index, sub).ok().flatten()
}

/// Sync managers of outputs that are activated.
fn output_managers<L: Link>(wire: &mut Wire<L>, position: u16) -> Vec<SyncManager> {
    let mut found = Vec::new();
    for number in 0..MOST_MANAGERS {
        let register = SYNC_MANAGERS + MANAGER_SIZE * number;
        let Ok(bytes) = scan::read::<_, [u8; 8]>(wire, position, register) else { break };
        let [_, _, low, high, control, _, activation, _] = bytes;
        let is_on = activation & 1 != 0 && [low, high] != [0; 2];
        if is_on && control & MODE_AND_DIRECTION == OUTPUTS {
            found.push(SyncManager { number, triggers_watchdog: control & TRIGGERS_WATCHDOG != 0 });
        }
    }
    found
}
