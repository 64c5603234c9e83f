//! Network card and interrupts of this computer: what holds an answer up after it has come.

use crate::bus_task::PRIORITY;
use crate::diagnosis::finding::{Finding, Stage};
use crate::diagnosis::host::HostFacts;

/// Longest time that a card may gather frames before it interrupts \[us\].
const LONGEST_GATHERING: u64 = 5;

pub(super) fn findings(host: &HostFacts) -> Vec<Finding> {
    let HostFacts { interface, .. } = host;
    let mut found = Vec::new();
    if let Some(us) = host.gathering_us.filter(|us| *us > LONGEST_GATHERING) {
        found.push(Finding::warning(
            Stage::Host,
            format!(
                "the network card of {interface} gathers frames for {us} us before it interrupts"
            ),
            format!("ethtool -C {interface} adaptive-rx off rx-usecs 0"),
        ));
    } else if host.is_adaptive == Some(true) {
        found.push(Finding::warning(
            Stage::Host,
            format!("the network card of {interface} gathers frames for a time that it adapts"),
            format!("ethtool -C {interface} adaptive-rx off rx-usecs 0"),
        ));
    }
    if let Some(ns) = host.flush_after_ns.filter(|ns| *ns > 0) {
        found.push(Finding::warning(
            Stage::Host,
            format!("the kernel holds frames of {interface} for {} us to merge them", ns / 1000),
            format!("echo 0 > /sys/class/net/{interface}/gro_flush_timeout"),
        ));
    }
    let slow = |priority: &Option<i32>| priority.is_none_or(|priority| priority <= PRIORITY);
    if let Some(thread) = host.interrupts.iter().find(|thread| slow(&thread.priority)) {
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
            format!("chrt -f -p {} {}", PRIORITY + 5, thread.pid),
        ));
    }
    found
}
