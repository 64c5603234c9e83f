//! Facts of this computer: coalescing of its network card, and priority of the card's interrupt.
//!
//! Sources: `/sys/class/net`, `/proc/interrupts`, `/proc/PID/stat`, and `ethtool -c`, as the card's own coalescing is
//! in no file. What cannot be read is a remark, and is no finding.

use crate::interface::sysfs_directory;
use nix::net::if_::if_nametoindex;
use std::fs;
use std::path::Path;
use std::process::Command;

/// A thread of the kernel that handles an interrupt.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InterruptThread {
    /// Its process ID.
    pub pid: u32,
    /// Its name, as irq/35-eth1.
    pub name: String,
    /// Its priority under SCHED_FIFO or SCHED_RR, 1 to 99; none without one.
    pub priority: Option<i32>,
}

/// Facts of this computer.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HostFacts {
    /// The network interface.
    pub interface: String,
    /// Receive coalescing of the card (rx-usecs): time from a frame to the interrupt \[us\].
    pub rx_coalescing_us: Option<u64>,
    /// Whether the card adapts that time (adaptive-rx).
    pub is_adaptive: Option<bool>,
    /// Time that the kernel waits for frames to merge (gro_flush_timeout) \[ns\].
    pub gro_flush_timeout_ns: Option<u64>,
    /// Threads of its interrupts; none where the kernel handles them without threads.
    pub interrupts: Vec<InterruptThread>,
    /// What could not be read, and privileges that were refused.
    pub remarks: Vec<String>,
}

impl HostFacts {
    /// Reads the facts for a network interface, by its name. What cannot be read is none, with a remark; it never
    /// fails.
    pub fn read(interface: &str) -> Self {
        let mut facts = Self { interface: interface.into(), ..Self::default() };
        let folder = if_nametoindex(interface)
            .ok()
            .and_then(|index| sysfs_directory(interface, index as usize));
        let Some(folder) = folder else {
            let remark = "/sys/class/net does not show it (another network namespace?): coalescing and interrupt \
                          priority were not read";
            facts.remarks.push(format!("{interface}: {remark}"));
            return facts;
        };
        facts.gro_flush_timeout_ns = fs::read_to_string(folder.join("gro_flush_timeout"))
            .ok()
            .and_then(|text| text.trim().parse().ok());
        if !folder.join("device").exists() {
            facts.remarks.push(format!(
                "{interface} is a virtual interface: it has neither coalescing nor an interrupt"
            ));
            return facts;
        }
        match Command::new("ethtool").args(["-c", interface]).output() {
            Ok(output) if output.status.success() => {
                let output = String::from_utf8_lossy(&output.stdout);
                (facts.rx_coalescing_us, facts.is_adaptive) = coalescing(&output);
            }
            _ => facts.remarks.push(format!(
                "coalescing of the network card was not read: read it with ethtool -c {interface}"
            )),
        }
        let interrupts = fs::read_to_string("/proc/interrupts").unwrap_or_default();
        let mut numbers = numbers_of(&interrupts, interface);
        numbers.extend(names_in(&folder.join("device/msi_irqs")));
        numbers.sort();
        numbers.dedup();
        facts.interrupts = threads(&numbers);
        facts
    }
}

/// Receive coalescing time \[us\], and whether it is adaptive, from the output of `ethtool -c`.
fn coalescing(output: &str) -> (Option<u64>, Option<bool>) {
    let after = |key: &str| {
        output.lines().find_map(|line| line.trim().strip_prefix(key)?.split_whitespace().next())
    };
    let us = after("rx-usecs:").and_then(|us| us.parse().ok());
    // Adaptive RX: off  TX: off
    let is_adaptive = after("Adaptive RX:").and_then(|state| match state {
        "on" => Some(true),
        "off" => Some(false),
        _ => None,
    });
    (us, is_adaptive)
}

/// Numbers of the interrupts of an interface in `/proc/interrupts`: lines whose last words name it, alone or with its
/// queue, as eth1-rx-0.
fn numbers_of(interrupts: &str, interface: &str) -> Vec<String> {
    let names_it = |word: &str| {
        word.strip_prefix(interface).is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
    };
    let number = |line: &str| {
        let (number, rest) = line.split_once(':')?;
        let mut words = rest.split(|c: char| c.is_whitespace() || c == ',');
        words.any(names_it).then(|| number.trim().to_string())
    };
    interrupts.lines().filter_map(number).collect()
}

/// Names of the entries of a folder; none where it cannot be read.
fn names_in(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter_map(|entry| entry.file_name().into_string().ok()).collect()
}

/// The kernel's threads of the interrupts with these numbers.
fn threads(numbers: &[String]) -> Vec<InterruptThread> {
    let of = |pid: String| {
        let read = |file: &str| fs::read_to_string(Path::new("/proc").join(&pid).join(file)).ok();
        let name = read("comm")?.trim().to_string();
        let (number, _) = name.strip_prefix("irq/")?.split_once('-')?;
        numbers.iter().any(|known| known == number).then_some(())?;
        let priority = priority(&read("stat")?);
        Some(InterruptThread { pid: pid.parse().ok()?, name, priority })
    };
    names_in(Path::new("/proc"))
        .into_iter()
        .filter(|name| name.bytes().all(|digit| digit.is_ascii_digit()))
        .filter_map(of)
        .collect()
}

/// Real-time priority in `/proc/PID/stat`: its field 40, of policies 1 and 2 in field 41 (proc_pid_stat(5)).
fn priority(stat: &str) -> Option<i32> {
    // the name in parentheses may have blanks
    let (_, after) = stat.rsplit_once(')')?;
    let fields: Vec<&str> = after.split_whitespace().collect();
    let (priority, policy) = (fields.get(37)?.parse().ok()?, *fields.get(38)?);
    matches!(policy, "1" | "2").then_some(priority)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coalescing_is_read_of_what_ethtool_says() {
        let output = "Coalesce parameters for eth1:\nAdaptive RX: off  TX: off\nstats-block-usecs: n/a\n\n\
                    rx-usecs: 3\nrx-frames: 0\nrx-usecs-irq: 9\n";
        assert_eq!(coalescing(output), (Some(3), Some(false)));
        assert_eq!(coalescing("Adaptive RX: on  TX: on\nrx-usecs: n/a\n"), (None, Some(true)));
        assert_eq!(coalescing("netlink error: Operation not supported\n"), (None, None));
    }

    #[test]
    fn interrupts_of_an_interface_are_those_that_name_it_and_not_one_with_a_longer_name() {
        let table = "           CPU0       CPU1\n  24:   1   0  PCI-MSI 1048576-edge      eth1-rx-0\n \
                     25:   1   0  PCI-MSI 1048577-edge      eth10\n 26:   0   7  PCI-MSI 1-edge  ahci, eth1\n";
        assert_eq!(numbers_of(table, "eth1"), ["24", "26"]);
    }

    #[test]
    fn the_priority_of_a_thread_is_that_of_a_real_time_policy_only() {
        let stat = |priority: u32, policy: u32| {
            let rest = vec!["0"; 36].join(" ");
            format!("91 (irq/24 (eth1)) S {rest} {priority} {policy} 0 0")
        };
        assert_eq!(priority(&stat(50, 1)), Some(50));
        assert_eq!(priority(&stat(0, 0)), None);
        assert_eq!(priority("91 (irq"), None);
    }
}
