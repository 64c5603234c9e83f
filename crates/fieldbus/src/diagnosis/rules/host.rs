//! Network card and interrupts of this computer: delays of an answer after the card has received it.

use crate::bus_task::PRIORITY;
use crate::diagnosis::finding::{Finding, Stage};
use crate::diagnosis::host::HostFacts;

/// Priority for the interrupt: above the bus task's and above the simulation's 80.
const INTERRUPT_PRIORITY: i32 = 85;

/// Findings of this computer, all of them warnings.
pub(super) fn findings(host: &HostFacts) -> Vec<Finding> {
    let HostFacts { interface, .. } = host;
    let mut found = Vec::new();
    let coalescing = match (host.rx_coalescing_us, host.is_adaptive) {
        // with 1 and 3 some cards choose a time by themselves, of up to 250 us (igb, e1000e)
        (Some(us), _) if us > 0 => Some(format!("its rx-usecs is {us}")),
        (_, Some(true)) => Some("its adaptive-rx is on".into()),
        _ => None,
    };
    if let Some(how) = coalescing {
        found.push(Finding::warning(
            Stage::Host,
            format!(
                "the network card of {interface} coalesces interrupts, which delays frames ({how})"
            ),
            format!("switch that off: ethtool -C {interface} adaptive-rx off rx-usecs 0"),
        ));
    }
    if let Some(ns) = host.gro_flush_timeout_ns.filter(|ns| *ns > 0) {
        found.push(Finding::warning(
            Stage::Host,
            format!("the kernel holds frames of {interface} for {} us to merge them", ns / 1000),
            format!("switch that off: echo 0 > /sys/class/net/{interface}/gro_flush_timeout"),
        ));
    }
    let is_low = |priority: &Option<i32>| priority.is_none_or(|priority| priority <= PRIORITY);
    if let Some(thread) = host.interrupts.iter().find(|thread| is_low(&thread.priority)) {
        let has = match thread.priority {
            Some(priority) => format!("has the priority {priority}"),
            None => "has no real-time priority".into(),
        };
        found.push(Finding::warning(
            Stage::Host,
            format!(
                "the interrupt of {interface} ({}) {has}, the bus task has {PRIORITY} and may keep it from \
                running",
                thread.name
            ),
            format!("raise it: chrt -f -p {INTERRUPT_PRIORITY} {}", thread.pid),
        ));
    }
    found
}
