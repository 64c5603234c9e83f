//! Real-time thread: its core, its priority, and a panic that unwinds instead of ending the process.

use crate::failure::unwind_once;
use crate::posix::{pin_to, run_first};

/// Pins the calling thread to a core and gives it a priority of 1 to 99 under SCHED_FIFO. A panic of the thread
/// unwinds from then on. Returns a sentence for each privilege that the system refused; `task` names the thread in it.
pub fn prepare(task: &str, core: usize, priority: i32) -> Vec<String> {
    unwind_once();
    let mut refused = Vec::new();
    if let Err(error) = pin_to(core) {
        refused.push(format!(
            "{task} is not pinned to core {core} ({error}): it may move to another core"
        ));
    }
    if let Err(error) = run_first(priority) {
        refused.push(format!(
            "{task} has no real-time priority ({error}): other threads may preempt it"
        ));
    }
    refused
}
