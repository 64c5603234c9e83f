//! Process-data watchdog: it stops the outputs of a device where frames stop.

use super::name;
use crate::diagnosis::facts::BusFacts;
use crate::diagnosis::finding::{Finding, Stage};
use crate::table::Table;

/// Time of the watchdog after power-on \[ns\] (ETG.1000.4): a longer one was set later.
const DEFAULT_TIMEOUT: u64 = 100_000_000;

/// Findings of process-data watchdogs, and of sync managers that do not trigger them.
pub(super) fn findings(table: &Table, bus: &BusFacts) -> Vec<Finding> {
    let mut found = Vec::new();
    for (position, (row, set_up)) in table.devices.iter().zip(&bus.set_up).enumerate() {
        let Some(time) = set_up.watchdog else { continue };
        let this = name(table, bus, position);
        let set = format!("set watchdog_ms of {} in the table", row.name);
        if time == 0 {
            found.push(Finding::error(
                Stage::Watchdog,
                format!(
                    "the process-data watchdog of {this} is switched off (0x0420 is 0): its outputs hold \
                    their last values when frames stop"
                ),
                set,
            ));
        } else if row.watchdog.is_none() && time > DEFAULT_TIMEOUT {
            found.push(Finding::warning(
                Stage::Watchdog,
                format!(
                    "the process-data watchdog of {this} is {} ms: its outputs hold their last values \
                    for that time when frames stop",
                    time / 1_000_000
                ),
                set,
            ));
        }
        if let Some(manager) = set_up.output_managers.iter().find(|m| !m.triggers_watchdog) {
            let is_commanded = table.commanded.iter().any(|row| row.place.device == position);
            let finding = if is_commanded { Finding::error } else { Finding::warning };
            found.push(finding(
                Stage::Watchdog,
                format!(
                    "sync manager {} of {this} does not trigger the watchdog (bit 6 of its control byte): its \
                    outputs hold their last values when frames stop",
                    manager.number
                ),
                "read in its manual how its outputs react to missing frames, and whether its EEPROM can set this bit",
            ));
        }
    }
    found
}
