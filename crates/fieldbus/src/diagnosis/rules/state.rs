//! States: devices that refuse one, left one, or had an error before, with their AL status codes.

use super::name;
use crate::diagnosis::facts::BusFacts;
use crate::diagnosis::finding::{Finding, Stage};
use crate::start_up::al_text;
use crate::table::Table;

/// Error bit of the AL status.
const HAS_ERROR: u16 = 0x10;

pub(super) fn findings(table: &Table, bus: &BusFacts) -> Vec<Finding> {
    let mut found = Vec::new();
    let wanted = match (&bus.pre_op_refused, &bus.safe_op_refused) {
        (Some(_), _) => "PREOP",
        _ => "SAFEOP",
    };
    for (position, device) in bus.line.iter().enumerate() {
        let this = name(table, bus, position);
        let after = device.state_after.filter(|[state, code]| state & HAS_ERROR != 0 && *code != 0);
        if let Some([_, code]) = after {
            let verb = match bus.listening {
                Some(_) => "left",
                None => "refuses",
            };
            found.push(Finding::error(
                Stage::State,
                format!("{this} {verb} {wanted}: {} (AL status code 0x{code:04X})", al_text(code)),
                advice(code),
            ));
        } else if device.state & HAS_ERROR != 0 && device.code != 0 {
            found.push(Finding::warning(
                Stage::State,
                format!(
                    "{this} had an error before the diagnosis, and has none now: {} (AL status code 0x{:04X})",
                    al_text(device.code),
                    device.code
                ),
                advice(device.code),
            ));
        }
    }
    let why = bus.pre_op_refused.as_ref().or(bus.safe_op_refused.as_ref());
    if let Some(why) = why.filter(|_| found.iter().all(|found| found.stage != Stage::State)) {
        found.push(Finding::error(
            Stage::State,
            format!(
                "the devices did not go to {wanted}, and none reports an AL status code ({why})"
            ),
            "switch their supply off and on, then repeat the diagnosis",
        ));
    }
    found
}

/// What to do about an AL status code (ETG.1000.6, ETG.1020).
fn advice(code: u16) -> &'static str {
    match code {
        0x0014 => "load firmware into it",
        0x0016 => "its EEPROM does not fit its firmware: load both of one release",
        0x0017 | 0x001d | 0x001e => "compare the sizes of its PDOs with the table",
        0x001a | 0x002c | 0x0032 | 0x0034 => {
            "check the margins of frames before SYNC0, then what delays this computer (hydroboom doctor)"
        }
        0x001b => {
            "the main device stopped sending: its program ended or was delayed, or a cable was pulled"
        }
        0x001f => "set watchdog_ms of the table to what its manual asks for",
        0x0020 => "switch its supply off and on",
        0x0024 | 0x0025 => "map what its manual allows",
        0x0027 => "set sync = \"sync0\": it does not run free",
        0x0028 | 0x0030 => "set sync, 0x1C32:01 and 0x1C33:01 as its manual asks for",
        0x002d => {
            "it received no SYNC0: check that sync in the table is the mode that it is set up for"
        }
        0x002e | 0x0035 | 0x0036 | 0x0037 => "set bus.period_us to a cycle that it supports",
        0x0050 | 0x0051 => {
            "its EEPROM cannot be read: switch its supply off and on; if that does not help, have it repaired"
        }
        _ => "see its manual for the code",
    }
}
