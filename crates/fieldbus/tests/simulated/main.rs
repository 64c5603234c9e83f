//! The bus against simulated devices, in one thread and in simulated time.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use assert_no_alloc::AllocDisabler;

/// Ends the tests where something is allocated in what may not.
#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

mod bench;
mod commissioning;
mod crane;
mod diagnosis;
mod faults;
mod operation;
mod safe_op;
mod start_up;
mod stopping;
