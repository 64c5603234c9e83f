//! Work that takes long: a bar says how far it is, and Ctrl-C ends it with what is done.

use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of a process that Ctrl-C has ended, as shells give it.
const ENDED: i32 = 130;

/// Work of so many parts.
pub struct Interruptible {
    bar: ProgressBar,
    /// Whether Ctrl-C has been pressed.
    pressed: Arc<AtomicBool>,
}

impl Interruptible {
    /// `count` parts, which the bar calls `parts`. From now on Ctrl-C is remembered; a second one ends the process.
    ///
    /// # Errors
    ///
    /// When the system does not let it be heard.
    pub fn new(count: u64, parts: &str) -> Result<Self> {
        let pressed = Arc::new(AtomicBool::new(false));
        let heard = Arc::clone(&pressed);
        ctrlc::set_handler(move || {
            if heard.swap(true, Ordering::Relaxed) {
                std::process::exit(ENDED);
            }
        })
        .into_diagnostic()?;
        let style = format!(
            "{{bar:40}} {{pos}} of {{len}} {parts}, {{eta}} left; Ctrl-C ends with what is done"
        );
        let style = ProgressStyle::with_template(&style).into_diagnostic()?;
        Ok(Self { bar: ProgressBar::new(count).with_style(style), pressed })
    }

    /// One more part is done: whether to go on.
    pub fn one_more(&self) -> bool {
        self.bar.inc(1);
        !self.pressed.load(Ordering::Relaxed)
    }

    /// This share of all is done: whether to go on.
    pub fn done(&self, share: f64) -> bool {
        self.bar.set_position((share * self.bar.length().unwrap_or(0) as f64) as u64);
        !self.pressed.load(Ordering::Relaxed)
    }
}

impl Drop for Interruptible {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// How many of those that were asked for are done: "17 of 200", or "200".
pub fn of_asked(done: usize, asked: usize) -> String {
    match done == asked {
        true => format!("{done}"),
        false => format!("{done} of {asked}"),
    }
}
