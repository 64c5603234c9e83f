//! Diagnosis of a bus: facts are read from devices, cables and network card; findings follow from them, causes before
//! their effects.
//!
//! ```text
//! scan        before anything is changed: ports, error counters, states, identities
//! set-up      INIT to PREOP, and what the table writes: objects, watchdogs, clocks
//! listening   SAFEOP: frames as in operation, so that margins, round trips and losses are those of a run
//! rules       facts -> findings, a function without a bus
//! ```
//!
//! Devices go to SAFEOP at most: outputs stay safe, drives without torque; their supply stays live. They are in INIT
//! afterwards.

mod facts;
mod finding;
mod host;
mod listening;
mod rules;
mod scan;
mod set_up;

pub use facts::{BusFacts, ErrorCounters, LineDevice, Listening, Percentiles, SetUp, SyncManager};
pub use finding::{Finding, Severity, Stage};
pub use host::{HostFacts, InterruptThread};
pub use rules::findings;

use crate::frame_ring::FrameRing;
use crate::link::Link;
use crate::start_up::to_init;
use crate::table::Table;
use crate::wire::Wire;
use ethercrab::{MainDeviceConfig, RetryBehaviour};
use hydroboom_realtime::real_time_thread::prepare;
use std::thread;

/// Retries of a lost frame: the diagnosis measures losses, and must not end at the first one.
const RETRIES: usize = 5;

/// Findings, and the facts that they follow from.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// Findings, errors first, in the order of stages: causes before their effects; empty where nothing is wrong.
    pub findings: Vec<Finding>,
    /// Facts of the bus.
    pub bus: BusFacts,
    /// Facts of this computer.
    pub host: HostFacts,
}

/// Reads the bus of a table on a link, and judges it with the facts of this computer.
///
/// # Errors
///
/// A sentence where ethercrab's main device could not be created.
pub fn diagnose<L: Link>(table: &Table, link: L, host: HostFacts) -> Result<Diagnosis, String> {
    let config = MainDeviceConfig {
        retry_behaviour: RetryBehaviour::Count(RETRIES),
        ..MainDeviceConfig::default()
    };
    let mut wire = Wire::new(link, config, FrameRing::of(table))
        .map_err(|error| format!("the main device could not be created: {error}"))?;
    let mut bus = BusFacts { line: scan::read_line(&mut wire), ..BusFacts::default() };
    if !bus.line.is_empty() {
        set_up::examine(&mut wire, table, &mut bus);
        scan::read_again(&mut wire, &mut bus.line);
        to_init(&mut wire, table.bus.period);
    }
    Ok(Diagnosis { findings: findings(table, &bus, &host), bus, host })
}

/// [`diagnose`] in a thread on a core with the priority of the bus task, so that its times are those of a run.
///
/// # Errors
///
/// A sentence where ethercrab's main device could not be created, or the thread panicked.
pub fn diagnose_in_real_time<L: Link + Send + 'static>(
    table: Table,
    link: L,
    mut host: HostFacts,
    core: usize,
) -> Result<Diagnosis, String> {
    let task = thread::spawn(move || {
        host.remarks.extend(prepare("the diagnosis", core, crate::bus_task::PRIORITY));
        diagnose(&table, link, host)
    });
    task.join().unwrap_or_else(|_| Err("the diagnosis ended by itself".into()))
}
