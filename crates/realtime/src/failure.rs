//! Failures of real-time tasks: a panic is caught and its message kept, without output in the cycle.
//!
//! The standard library prints a panic before it unwinds. Printing can take longer than the machine's
//! watchdog time: a terminal may block, and a backtrace reads the program's debug information (0.1 s). The
//! message of a guarded task is therefore stored, and an ordinary thread prints it after the load is held.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::fmt;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

/// Real-time task that panicked, with the panic message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Failure {
    /// Control task: the load is held, and no further course can run.
    Control(String),
    /// Simulation: the benchmark controller continues without it.
    Simulation(String),
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Control(why) => write!(
                f,
                "the control task failed: {why}; the load is held, and no further course can be run"
            ),
            Self::Simulation(why) => write!(
                f,
                "the simulation failed: {why}; the benchmark controller continues without it"
            ),
        }
    }
}

thread_local! {
    /// Whether this thread runs guarded work.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
    /// Message of its last panic.
    static SAID: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Stores the panic messages of guarded work instead of printing them. Panics of all other threads are
/// printed as before.
pub fn hand_panics_on() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let print = panic::take_hook();
        panic::set_hook(Box::new(move |panic| match GUARDED.try_with(Cell::get) {
            Ok(true) => {
                let place = panic.location().map_or_else(String::new, |at| format!(" ({at})"));
                let said = format!("{}{place}", text(panic.payload()));
                // an error means that the thread's storage has been destroyed: the thread is ending
                let _ = SAID.try_with(|last| last.replace(Some(said)));
            }
            _ => print(panic),
        }));
    });
}

/// Runs `work` and catches a panic. After a panic its changes are incomplete. Allocates no memory unless it
/// panics.
///
/// # Errors
///
/// Panic message with its source location.
pub fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    let before = GUARDED.replace(true);
    let done = panic::catch_unwind(AssertUnwindSafe(work));
    GUARDED.set(before);
    done.map_err(|payload| SAID.take().unwrap_or_else(|| text(&*payload).into()))
}

/// Unwinds once, so that the code and tables for unwinding are in memory before a task fails. The first
/// time takes up to 0.6 ms, later ones 0.05 ms.
pub fn unwind_once() {
    let _ = guarded(|| panic::resume_unwind(Box::new(())));
}

/// Message of a panic.
fn text(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("a panic")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guarded_work_reports_why_and_where_it_failed() {
        hand_panics_on();
        assert_eq!(guarded(|| 7), Ok(7));
        let bounds = [1.0, 0.0];
        let message =
            guarded(|| 0.5_f64.max(bounds[usize::from(bounds[0] > 0.0) + 1])).unwrap_err();
        assert!(message.contains("the len is 2 but the index is 2"), "{message}");
        assert!(message.contains("failure.rs"), "{message}");
        // one after the other, and nested
        let inner = guarded(|| guarded(|| panic!("the inner one")).unwrap_err()).unwrap();
        assert!(inner.starts_with("the inner one (") && inner.contains("failure.rs"), "{inner}");
    }
}
