//! Work that takes long: a bar says how far it is, and Ctrl-C ends it with what is done.

use crate::output;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Result};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Exit code of a process that Ctrl-C has ended, as shells give it.
const ENDED: i32 = 130;

/// Where standard error is no terminal, a line says so often how far the work is.
const SAID_EVERY: Duration = Duration::from_secs(15);

/// Work of so many parts.
pub struct Interruptible {
    bar: ProgressBar,
    parts: String,
    begun: Instant,
    /// When it was said last how far the work is.
    said: Mutex<Instant>,
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
        let (bar, parts) = (ProgressBar::new(count).with_style(style), parts.into());
        let begun = Instant::now();
        Ok(Self { bar, parts, begun, said: Mutex::new(begun), pressed })
    }

    /// One more part is done: whether to go on.
    pub fn one_more(&self) -> bool {
        self.bar.inc(1);
        self.say(self.bar.position() as f64 / self.bar.length().unwrap_or(1).max(1) as f64);
        !self.pressed.load(Ordering::Relaxed)
    }

    /// This share of all is done: whether to go on.
    pub fn done(&self, share: f64) -> bool {
        self.bar.set_position((share * self.bar.length().unwrap_or(0) as f64) as u64);
        self.say(share);
        !self.pressed.load(Ordering::Relaxed)
    }

    /// Says how far the work is, where no bar is drawn.
    fn say(&self, share: f64) {
        // whoever else is about to say it says the same
        let Ok(mut said) = self.said.try_lock() else { return };
        if !self.bar.is_hidden() || said.elapsed() < SAID_EVERY {
            return;
        }
        *said = Instant::now();
        let length = self.bar.length().unwrap_or(0);
        output::note(&progress(share, length, &self.parts, self.begun.elapsed()));
    }
}

/// How far work is whose share is done, as a line.
fn progress(share: f64, count: u64, parts: &str, passed: Duration) -> String {
    let percent = 100.0 * share.clamp(0.0, 1.0);
    let passed = passed.as_secs_f64();
    let left = match share > 0.01 {
        true => format!(", about {:.0} s left", passed * (1.0 - share).max(0.0) / share),
        false => String::new(),
    };
    let of = match parts {
        "%" | "percent" => String::new(),
        parts => format!(" of {count} {parts}"),
    };
    format!("{percent:.0} %{of} done after {passed:.0} s{left}")
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_how_far_the_work_is_and_what_is_left_of_it() {
        let after = |share| progress(share, 24, "cranes", Duration::from_secs(30));
        assert_eq!(after(0.25), "25 % of 24 cranes done after 30 s, about 90 s left");
        assert_eq!(after(0.0), "0 % of 24 cranes done after 30 s");
        assert_eq!(
            progress(1.0, 100, "%", Duration::from_secs(9)),
            "100 % done after 9 s, about 0 s left"
        );
    }
}
