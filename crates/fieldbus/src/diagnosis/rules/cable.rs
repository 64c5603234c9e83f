//! Cables and plugs: no link, damaged frames, links that go away, delays that no cable has.

use super::name;
use crate::diagnosis::facts::{BusFacts, PORTS};
use crate::diagnosis::finding::{Finding, Stage};
use crate::table::Table;

/// Longest delay from one device to the next \[ns\]: 100 m of cable, and a device. Estimate: 0.55 us and 1 us.
const LONGEST_DELAY: u32 = 3_000;
/// What damages frames.
const MEND: &str = "replace the cable and its plugs, and keep it away from the motor's";

pub(super) fn findings(table: &Table, bus: &BusFacts) -> Vec<Finding> {
    if bus.line.is_empty() {
        return vec![Finding::error(
            Stage::Cable,
            "no device answers".into(),
            "look at the cable to the first device, which belongs into its socket IN, and at its supply",
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
            "plug the cable from this computer into its socket IN",
        ));
    }
    found
}

/// Where the cable at a port of a device leads.
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

/// The port with the highest count, counted while this looked, or else since power-on.
fn most(count: impl Fn(usize) -> u8) -> Option<(usize, u8)> {
    (0..PORTS)
        .map(|port| (port, count(port)))
        .max_by_key(|(_, count)| *count)
        .filter(|(_, n)| *n > 0)
}

fn damaged_frames(table: &Table, bus: &BusFacts, position: usize) -> Option<Finding> {
    let device = &bus.line[position];
    let after = device.errors_after.unwrap_or(device.errors);
    let grown = most(|port| after.damaged(port).saturating_sub(device.errors.damaged(port)));
    if let Some((port, count)) = grown {
        return Some(Finding::error(
            Stage::Cable,
            format!(
                "frames are damaged on the cable {}: {count} were counted at port {port} while this looked",
                cable(table, bus, position, port)
            ),
            MEND,
        ));
    }
    most(|port| after.damaged(port)).map(|(port, count)| {
        Finding::warning(
            Stage::Cable,
            format!(
                "frames were damaged on the cable {}: {count} were counted at port {port} since power-on, \
                none while this looked",
                cable(table, bus, position, port)
            ),
            "where the number grows from day to day, replace the cable and its plugs",
        )
    })
}

fn lost_links(table: &Table, bus: &BusFacts, position: usize) -> Option<Finding> {
    let device = &bus.line[position];
    let after = device.errors_after.unwrap_or(device.errors);
    let [is, was] = [after.lost_links, device.errors.lost_links];
    if let Some((port, count)) = most(|port| is[port].saturating_sub(was[port])) {
        return Some(Finding::error(
            Stage::Cable,
            format!(
                "the link {} went away {count} times while this looked (port {port}, 0x0310)",
                cable(table, bus, position, port)
            ),
            "look at its plugs and at the supply on both sides",
        ));
    }
    most(|port| is[port]).map(|(port, count)| {
        Finding::warning(
            Stage::Cable,
            format!(
                "the link {} was lost {count} times since power-on (port {port}, 0x0310)",
                cable(table, bus, position, port)
            ),
            "where nobody pulled a plug or switched its other side off, look at plugs and supply",
        )
    })
}

/// A delay from the device before that only a switch or a converter makes.
fn delay(table: &Table, bus: &BusFacts, position: usize) -> Option<Finding> {
    let delay = |position: usize| {
        let has_clock = bus.devices.get(position).is_some_and(|device| device.has_clock);
        bus.set_up.get(position).filter(|_| has_clock).map(|shown| shown.delay)
    };
    let before = delay(position.checked_sub(1)?)?;
    let way = delay(position)?.saturating_sub(before);
    (way > LONGEST_DELAY).then(|| {
        Finding::warning(
            Stage::Cable,
            format!(
                "a frame takes {:.1} us {}, which is longer than 100 m of cable make",
                1e-3 * f64::from(way),
                cable(table, bus, position, 0)
            ),
            "take the switch or converter there out",
        )
    })
}
