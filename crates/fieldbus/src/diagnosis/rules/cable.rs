//! Cables and plugs: no link, damaged frames, lost links, delays longer than those of a cable.
//!
//! Devices are taken to be connected in a line, each to those at the positions before and after it. In a tree or a ring
//! the cable that a finding names may be another one.

use super::name;
use crate::diagnosis::facts::{BusFacts, PORTS};
use crate::diagnosis::finding::{Finding, Stage};
use crate::table::Table;

/// Longest delay from one device to the next \[ns\]: 100 m of cable, and a device. Estimate: 0.55 us and 1 us.
const LONGEST_DELAY: u32 = 3_000;
/// Advice where frames are damaged.
const REPLACE_CABLE: &str = "replace the cable and its plugs, and keep it away from motor cables; between terminals of \
one block (E-bus) check the contacts and seating of the terminal";
/// Since when error counters count.
const SINCE: &str = "since power-on, or since a main device cleared the counters";

/// Findings of all cables, or that no device answers.
pub(super) fn findings(table: &Table, bus: &BusFacts) -> Vec<Finding> {
    if bus.line.is_empty() {
        return vec![Finding::error(
            Stage::Cable,
            "no device answers".into(),
            "check the supply of the first device and the cable to it, which has to be in its IN port",
        )];
    }
    let mut found = Vec::new();
    for position in 0..bus.line.len() {
        found.extend(damaged_frames(table, bus, position));
        found.extend(lost_links(table, bus, position));
        found.extend(delay(table, bus, position));
    }
    if bus.line.first().is_some_and(|first| !first.has_link(0)) {
        found.push(Finding::error(
            Stage::Cable,
            format!("frames do not enter {} by its first port", name(table, bus, 0)),
            "plug the cable from this computer into its IN port",
        ));
    }
    found
}

/// Where the cable at a port of a device leads, in a line of devices.
fn cable(table: &Table, bus: &BusFacts, position: usize, port: usize) -> String {
    let this = name(table, bus, position);
    match (port, position) {
        (0, 0) => format!("between this computer and {this}"),
        (0, _) => format!("between {} and {this}", name(table, bus, position - 1)),
        _ if position + 1 < bus.line.len() => {
            format!("between {this} and {}", name(table, bus, position + 1))
        }
        _ => format!("behind {this}"),
    }
}

/// The port with the highest count, and that count; none where all counts are 0.
fn port_with_most(count: impl Fn(usize) -> u8) -> Option<(usize, u8)> {
    (0..PORTS)
        .map(|port| (port, count(port)))
        .max_by_key(|(_, count)| *count)
        .filter(|(_, n)| *n > 0)
}

/// Damaged frames at the port with most of them (0x0300 to 0x030B): an error where they increase during the
/// diagnosis.
fn damaged_frames(table: &Table, bus: &BusFacts, position: usize) -> Option<Finding> {
    let device = &bus.line[position];
    let after = device.errors_after.unwrap_or(device.errors);
    let increment =
        port_with_most(|port| after.damaged(port).saturating_sub(device.errors.damaged(port)));
    if let Some((port, count)) = increment {
        return Some(Finding::error(
            Stage::Cable,
            format!(
                "frames are damaged on the cable {}: {count} were counted at port {port} during the diagnosis",
                cable(table, bus, position, port)
            ),
            REPLACE_CABLE,
        ));
    }
    port_with_most(|port| after.damaged(port)).map(|(port, count)| {
        Finding::warning(
            Stage::Cable,
            format!(
                "frames were damaged on the cable {}: {count} were counted at port {port} {SINCE}, none during \
                the diagnosis",
                cable(table, bus, position, port)
            ),
            "if the number grows from day to day, replace the cable and its plugs, or check the contacts and seating \
            of the terminal",
        )
    })
}

/// Lost links at the port with most of them (0x0310 to 0x0313): an error where they increased during the diagnosis.
fn lost_links(table: &Table, bus: &BusFacts, position: usize) -> Option<Finding> {
    let device = &bus.line[position];
    let after = device.errors_after.unwrap_or(device.errors);
    let [is, was] = [after.lost_links, device.errors.lost_links];
    if let Some((port, count)) = port_with_most(|port| is[port].saturating_sub(was[port])) {
        return Some(Finding::error(
            Stage::Cable,
            format!(
                "the link {} was lost {count} times during the diagnosis (port {port}, 0x0310)",
                cable(table, bus, position, port)
            ),
            "check its plugs and the supply of the devices at both ends",
        ));
    }
    port_with_most(|port| is[port]).map(|(port, count)| {
        Finding::warning(
            Stage::Cable,
            format!(
                "the link {} was lost {count} times {SINCE} (port {port}, 0x0310)",
                cable(table, bus, position, port)
            ),
            "if no plug was pulled and no neighbour switched off, check plugs and supply",
        )
    })
}

/// A propagation delay from the device before that only a switch or a media converter explains.
fn delay(table: &Table, bus: &BusFacts, position: usize) -> Option<Finding> {
    let delay = |position: usize| {
        let has_clock = bus.devices.get(position).is_some_and(|device| device.has_clock);
        bus.set_up.get(position).filter(|_| has_clock).map(|set_up| set_up.delay)
    };
    let before = delay(position.checked_sub(1)?)?;
    let link_delay = delay(position)?.saturating_sub(before);
    (link_delay > LONGEST_DELAY).then(|| {
        Finding::warning(
            Stage::Cable,
            format!(
                "a frame takes {:.1} us {}, which is longer than 100 m of cable cause",
                1e-3 * f64::from(link_delay),
                cable(table, bus, position, 0)
            ),
            "remove the switch or media converter there",
        )
    })
}
