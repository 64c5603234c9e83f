//! Losses, margins and jitter of the frames in SAFEOP.

use crate::diagnosis::facts::BusFacts;
use crate::diagnosis::finding::{Finding, Severity, Stage};
use crate::table::Table;

/// Whether more frames are late or lost than the table allows, and no damaged cable explains it.
pub(super) fn is_delayed(bus: &BusFacts, others: &[Finding]) -> bool {
    bus.listening.is_some_and(|listening| {
        listening.has_too_many_late || listening.has_too_many_lost && !has_damaged_cable(others)
    })
}

/// Whether a cable damages frames now.
fn has_damaged_cable(others: &[Finding]) -> bool {
    let is_cable =
        |other: &Finding| other.severity == Severity::Error && other.stage == Stage::Cable;
    others.iter().any(is_cable)
}

/// Findings of the frames; `others` were found before.
pub(super) fn findings(table: &Table, bus: &BusFacts, others: &[Finding]) -> Vec<Finding> {
    let Some(listening) = &bus.listening else { return Vec::new() };
    let mut found = Vec::new();
    let us = |ns: u64| format!("{:.0}", 1e-3 * ns as f64);
    if listening.lost > 0 && !has_damaged_cable(others) {
        let finding = if listening.has_too_many_lost { Finding::error } else { Finding::warning };
        found.push(finding(
            Stage::Timing,
            format!(
                "{} of {} frames did not come back in time, and no device counted a damaged frame",
                listening.lost, listening.exchanges
            ),
            "check the load of this computer (hydroboom doctor) and the cable to the first device"
                .to_string(),
        ));
    }
    if listening.wrong_working_counter > 0 {
        let finding = if listening.wrong_working_counter > u64::from(table.bus.lost_max) {
            Finding::error
        } else {
            Finding::warning
        };
        found.push(finding(
            Stage::Timing,
            format!(
                "{} of {} frames came back with the working counter {}, expected by the table {}",
                listening.wrong_working_counter,
                listening.exchanges,
                listening.last_wrong_working_counter,
                listening.working_counter
            ),
            "a device did not process its data: check its cable and supply".to_string(),
        ));
    }
    if listening.late_outputs > 0 {
        let finding = if listening.has_too_many_late { Finding::error } else { Finding::warning };
        found.push(finding(
            Stage::Timing,
            format!(
                "{} of {} outputs came after the SYNC0 at which they were to be applied (this computer sends up \
                to {} us late)",
                listening.late_outputs,
                listening.cycles,
                us(listening.late_by.max)
            ),
            "send earlier (bus.send_us), and check what delays this computer (hydroboom doctor)"
                .to_string(),
        ));
    }
    // the control period begins when the first answer has to be there
    let time_to_control = table.bus.control().saturating_sub(table.bus.exchange);
    if listening.round_trip.p99 > time_to_control {
        found.push(Finding::warning(
            Stage::Timing,
            format!(
                "1 % of frames take more than {} us: the control task starts {} us after the first exchange, and \
                then uses the previous period's measurement",
                us(listening.round_trip.p99),
                us(time_to_control)
            ),
            "check what delays this computer (hydroboom doctor), or send later (bus.send_us)",
        ));
    }
    found
}
