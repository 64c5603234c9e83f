//! EtherCAT state machine (ESM, ETG.1000.6): which transitions are allowed, and the checks of each.

use super::settings::{Area, MAILBOX_CONTROL, MODE_AND_DIRECTION, PROCESS_DATA_CONTROL, Settings};
use crate::al_status_code::AlStatusCode;
use crate::controller::{DistributedClock, Memory, SyncManager, Watchdog};
use crate::object_dictionary::{ObjectDictionary, mapped_bytes};

/// State of the EtherCAT state machine (ESM), with its number in AL control and AL status.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    /// INIT: no mailbox, no process data.
    Init = 1,
    /// PREOP: mailbox.
    PreOp = 2,
    /// SAFEOP: mailbox and inputs; outputs are in their safe state.
    SafeOp = 4,
    /// OP: mailbox, inputs and outputs.
    Op = 8,
}

impl State {
    /// State by its number in AL control.
    ///
    /// # Errors
    ///
    /// [`AlStatusCode::BootstrapNotSupported`] for bootstrap (3), [`AlStatusCode::UnknownState`] for numbers without a
    /// state.
    pub fn of(number: u8) -> Result<Self, AlStatusCode> {
        match number {
            1 => Ok(Self::Init),
            2 => Ok(Self::PreOp),
            4 => Ok(Self::SafeOp),
            8 => Ok(Self::Op),
            3 => Err(AlStatusCode::BootstrapNotSupported),
            _ => Err(AlStatusCode::UnknownState),
        }
    }
}

/// Whether the state machine has a transition: one state up, or any number down.
fn is_allowed(from: State, to: State) -> bool {
    to <= from
        || matches!(
            (from, to),
            (State::Init, State::PreOp)
                | (State::PreOp, State::SafeOp)
                | (State::SafeOp, State::Op)
        )
}

/// Checks whether a device may change from one state to another.
///
/// # Errors
///
/// AL status code with which the device refuses the change:
/// - [`AlStatusCode::InvalidStateChange`] for a change up by more than one state;
/// - from INIT to PREOP: [`AlStatusCode::InvalidMailbox`], mailboxes other than those of the EEPROM;
/// - from PREOP to SAFEOP: a mapping, sync manager, watchdog or SYNC setting that the device does not allow.
pub fn check(
    from: State,
    to: State,
    memory: &Memory,
    settings: &Settings,
    dictionary: &ObjectDictionary,
) -> Result<(), AlStatusCode> {
    if !is_allowed(from, to) {
        return Err(AlStatusCode::InvalidStateChange);
    }
    match (from, to) {
        (State::Init, State::PreOp) => mailboxes(memory, settings),
        (State::PreOp, State::SafeOp) => {
            process_data(memory, settings, dictionary)?;
            watchdog(memory, settings)?;
            synchronisation(memory, settings, dictionary)
        }
        _ => Ok(()),
    }
}

/// Sync managers of the mailboxes have to be those that the EEPROM states; else AL status code 0x0016.
fn mailboxes(memory: &Memory, settings: &Settings) -> Result<(), AlStatusCode> {
    let Some(areas) = settings.mailbox else { return Ok(()) };
    for (area, control) in areas.into_iter().zip(MAILBOX_CONTROL) {
        let manager = SyncManager::of(memory, area.sync_manager);
        let fits = manager.is_enabled
            && manager.start == area.start
            && manager.length == area.length
            && manager.control & MODE_AND_DIRECTION == control & MODE_AND_DIRECTION;
        if !fits {
            return Err(AlStatusCode::InvalidMailbox);
        }
    }
    Ok(())
}

/// The mapping has to be allowed, and sync managers have to have its length; else 0x0024, 0x0025, 0x0017, 0x001D or
/// 0x001E.
fn process_data(
    memory: &Memory,
    settings: &Settings,
    dictionary: &ObjectDictionary,
) -> Result<(), AlStatusCode> {
    let outputs = (
        0x1c12,
        settings.outputs,
        PROCESS_DATA_CONTROL[0],
        AlStatusCode::InvalidOutputMapping,
        AlStatusCode::InvalidOutputConfiguration,
    );
    let inputs = (
        0x1c13,
        settings.inputs,
        PROCESS_DATA_CONTROL[1],
        AlStatusCode::InvalidInputMapping,
        AlStatusCode::InvalidInputConfiguration,
    );
    for (assignment, area, control, mapping, configuration) in [outputs, inputs] {
        let Some(area) = area else { continue };
        let bytes = dictionary.mapped(assignment).map(|e| mapped_bytes(&e)).map_err(|_| mapping)?;
        if bytes > usize::from(area.length) {
            return Err(mapping);
        }
        buffer(memory, area, control, bytes, configuration)?;
    }
    Ok(())
}

/// Checks a sync manager for process data of a length `bytes` \[byte\]; `mismatch` is the AL status code of a wrong
/// address or length.
fn buffer(
    memory: &Memory,
    area: Area,
    control: u8,
    bytes: usize,
    mismatch: AlStatusCode,
) -> Result<(), AlStatusCode> {
    let manager = SyncManager::of(memory, area.sync_manager);
    if bytes == 0 {
        return if manager.is_enabled && manager.length > 0 { Err(mismatch) } else { Ok(()) };
    }
    if !manager.is_enabled || manager.control & MODE_AND_DIRECTION != control & MODE_AND_DIRECTION {
        return Err(AlStatusCode::InvalidSyncManager);
    }
    if manager.start != area.start || usize::from(manager.length) != bytes {
        return Err(mismatch);
    }
    Ok(())
}

/// A watchdog that the device requires has to run, within its longest time; else 0x001F.
fn watchdog(memory: &Memory, settings: &Settings) -> Result<(), AlStatusCode> {
    let Some(longest) = settings.longest_watchdog else { return Ok(()) };
    let is_triggered = settings
        .outputs
        .is_some_and(|area| SyncManager::of(memory, area.sync_manager).triggers_watchdog());
    match Watchdog::time(memory) {
        Some(time) if is_triggered && time <= longest => Ok(()),
        _ => Err(AlStatusCode::InvalidWatchdog),
    }
}

/// Synchronisation type of outputs (ETG.1020): 0 free run, 1 by the sync manager event, 2 by SYNC0, 3 by SYNC1.
const SYNCHRONISATION_TYPE: (u16, u8) = (0x1c32, 1);

/// SYNC0 and SYNC1 have to be supported, with supported cycles; else 0x0027, 0x0030, 0x0035 (shorter than the
/// shortest cycle), 0x0036 (no multiple of it) or 0x0037.
fn synchronisation(
    memory: &Memory,
    settings: &Settings,
    dictionary: &ObjectDictionary,
) -> Result<(), AlStatusCode> {
    let supported = settings.synchronisation;
    let ([sync0, sync1], [cycle0, cycle1]) = DistributedClock::settings(memory);
    if !sync0 && !sync1 {
        return if supported.supports_free_run {
            Ok(())
        } else {
            Err(AlStatusCode::FreeRunNotSupported)
        };
    }
    if !sync0 || !supported.has_sync0 || sync1 && !supported.has_sync1 {
        return Err(AlStatusCode::InvalidSyncConfiguration);
    }
    if dictionary.object(SYNCHRONISATION_TYPE).is_ok() {
        let expected = if sync1 { 3 } else { 2 };
        if dictionary.unsigned(SYNCHRONISATION_TYPE) != expected {
            return Err(AlStatusCode::InvalidSyncConfiguration);
        }
    }
    if cycle0 < supported.base_cycle {
        return Err(AlStatusCode::InvalidSyncCycle);
    }
    if cycle0 % supported.base_cycle != 0 {
        return Err(AlStatusCode::InvalidSync0Cycle);
    }
    // SYNC1 comes a time after SYNC0 that is shorter than its cycle, or a multiple of it
    if sync1 && cycle1 > cycle0 && cycle1 % cycle0 != 0 {
        return Err(AlStatusCode::InvalidSync1Cycle);
    }
    Ok(())
}
