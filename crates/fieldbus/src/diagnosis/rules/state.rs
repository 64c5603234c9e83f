//! States: devices that refuse one, left one, or had an error before, with their AL status codes.

use super::name;
use crate::al_status_code::explanation;
use crate::diagnosis::facts::BusFacts;
use crate::diagnosis::finding::{Finding, Stage};
use crate::table::Table;

/// Error bit of the AL status.
const HAS_ERROR: u16 = 0x10;

/// Findings of AL status (0x0130) and AL status code (0x0134) of each device, before and after the diagnosis.
pub(super) fn findings(table: &Table, bus: &BusFacts) -> Vec<Finding> {
    let mut found = Vec::new();
    let requested = match (&bus.pre_op_refused, &bus.safe_op_refused) {
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
            let explanation = explanation(code);
            found.push(Finding::error(
                Stage::State,
                format!(
                    "{this} {verb} {requested}: {} (AL status code 0x{code:04X})",
                    explanation.cause
                ),
                explanation.advice,
            ));
        } else if device.state & HAS_ERROR != 0 && device.code != 0 {
            let explanation = explanation(device.code);
            found.push(Finding::warning(
                Stage::State,
                format!(
                    "{this} had an error before the diagnosis, and has none now: {} (AL status code 0x{:04X})",
                    explanation.cause, device.code
                ),
                explanation.advice,
            ));
        }
    }
    let why = bus.pre_op_refused.as_ref().or(bus.safe_op_refused.as_ref());
    if let Some(why) = why.filter(|_| found.iter().all(|found| found.stage != Stage::State)) {
        found.push(Finding::error(
            Stage::State,
            format!(
                "the devices did not go to {requested}, and none reports an AL status code ({why})"
            ),
            "switch their supply off and on, then repeat the diagnosis",
        ));
    }
    found
}
