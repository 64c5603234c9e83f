//! Requests of the operator at the terminal: Ctrl-C, and Enter.

use crate::output;
use hydroboom_realtime::desk::Desk;
use miette::{IntoDiagnostic, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Handles Ctrl-C from now on: the first one stops and ends the run, the second one holds the load at once.
///
/// # Errors
///
/// If the signal handler cannot be installed.
pub fn handle_ctrl_c(desk: &Arc<Desk>) -> Result<()> {
    let desk = Arc::clone(desk);
    let mut is_pressed = false;
    ctrlc::set_handler(move || {
        if std::mem::replace(&mut is_pressed, true) {
            output::note("emergency stop");
            desk.emergency_stop();
        } else {
            output::note("stopping; Ctrl-C again for an emergency stop");
            desk.close();
        }
    })
    .into_diagnostic()
}

/// Waits for Enter in a thread of its own, and then sets the flag that releases the planned courses. The end of
/// standard input releases nothing.
pub fn release_at_enter(released: Arc<AtomicBool>) {
    output::note("the load is held; Enter starts the motion, Ctrl-C ends");
    std::thread::spawn(move || {
        let mut line = String::new();
        if std::io::stdin().read_line(&mut line).is_ok_and(|count| count > 0) {
            released.store(true, Ordering::Relaxed);
        }
    });
}
