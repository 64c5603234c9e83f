//! Real-time tasks that fail: a panic is caught, what it said is kept, and nothing is printed in the cycle.
//!
//! The standard library prints a panic before it unwinds. To print may take longer than the machine's watchdog bears: a
//! screen may not take it, and a backtrace is looked up in the program's file (0.1 s). So what guarded work says is handed
//! on instead, and printed by an ordinary thread once the load is held.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::fmt;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

/// A task that failed, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Failure {
    /// The control task: the load is held, and no course can be run any more.
    Control(String),
    /// The simulation: the benchmark controller goes on without it.
    Simulation(String),
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Control(why) => write!(
                f,
                "the control task failed: {why}; the load is held, and no course can be run any more"
            ),
            Self::Simulation(why) => write!(
                f,
                "the simulation failed: {why}; the benchmark controller goes on without it"
            ),
        }
    }
}

thread_local! {
    /// Whether this thread is at guarded work.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
    /// What its last panic said.
    static SAID: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// From now on panics of guarded work are not printed. Those of all other threads are, as before.
pub fn hand_panics_on() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let print = panic::take_hook();
        panic::set_hook(Box::new(move |panic| match GUARDED.try_with(Cell::get) {
            Ok(true) => {
                let place = panic.location().map_or_else(String::new, |at| format!(" ({at})"));
                let said = format!("{}{place}", text(panic.payload()));
                // a thread that has no place for it any more has ended
                let _ = SAID.try_with(|last| last.replace(Some(said)));
            }
            _ => print(panic),
        }));
    });
}

/// Does something; what its panic said where it panicked. What the work changed is then half done. Allocates nothing
/// where nothing panics.
///
/// # Errors
///
/// What the panic said, and where it was.
pub fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    let before = GUARDED.replace(true);
    let done = panic::catch_unwind(AssertUnwindSafe(work));
    GUARDED.set(before);
    done.map_err(|payload| SAID.take().unwrap_or_else(|| text(&*payload).into()))
}

/// Unwinds a little, so that what unwinding takes is in memory when a task fails: the first time takes up to 0.6 ms, later
/// ones 0.05 ms.
pub fn unwind_once() {
    let _ = guarded(|| panic::resume_unwind(Box::new(())));
}

/// What a panic says.
fn text(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("a panic")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guarded_work_tells_why_it_failed_and_where() {
        hand_panics_on();
        assert_eq!(guarded(|| 7), Ok(7));
        let bounds = [1.0, 0.0];
        let said = guarded(|| 0.5_f64.max(bounds[usize::from(bounds[0] > 0.0) + 1])).unwrap_err();
        assert!(said.contains("the len is 2 but the index is 2"), "{said}");
        assert!(said.contains("failure.rs"), "{said}");
        // one after the other, and within each other
        let inner = guarded(|| guarded(|| panic!("the inner one")).unwrap_err()).unwrap();
        assert!(inner.starts_with("the inner one (") && inner.contains("failure.rs"), "{inner}");
    }
}
