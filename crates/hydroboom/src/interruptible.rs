//! Progress of a long computation; Ctrl-C ends it with the results so far.

use crate::output;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Result};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Exit code after a second Ctrl-C, as of shells: 128 + SIGINT.
const EXIT_CODE: i32 = 130;

/// Interval of progress lines if standard error is no terminal.
const LINE_INTERVAL: Duration = Duration::from_secs(15);

/// Progress of a computation of a number of parts: a bar at a terminal, otherwise lines; it is ended by Ctrl-C.
pub struct Interruptible {
    bar: ProgressBar,
    /// Name of the parts.
    parts: String,
    begun: Instant,
    /// Time of the last progress line.
    last_line: Mutex<Instant>,
    /// Whether Ctrl-C was pressed.
    pressed: Arc<AtomicBool>,
}

impl Interruptible {
    /// Computation of `count` parts, named `parts` in the bar. From now on Ctrl-C is stored; a second one
    /// ends the process.
    ///
    /// # Errors
    ///
    /// If the signal handler cannot be installed.
    pub fn new(count: u64, parts: &str) -> Result<Self> {
        let pressed = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&pressed);
        ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::Relaxed) {
                std::process::exit(EXIT_CODE);
            }
        })
        .into_diagnostic()?;
        let style = format!(
            "{{bar:40}} {{pos}} of {{len}} {parts}, {{eta}} left; Ctrl-C ends with what is done"
        );
        let style = ProgressStyle::with_template(&style).into_diagnostic()?;
        let (bar, parts) = (ProgressBar::new(count).with_style(style), parts.into());
        let begun = Instant::now();
        Ok(Self { bar, parts, begun, last_line: Mutex::new(begun), pressed })
    }

    /// Counts a completed part; returns whether to continue.
    pub fn one_more(&self) -> bool {
        self.bar.inc(1);
        self.print_line(self.bar.position() as f64 / self.bar.length().unwrap_or(1).max(1) as f64);
        !self.pressed.load(Ordering::Relaxed)
    }

    /// Sets the share done, 0 to 1 \[-\]; returns whether to continue.
    pub fn done(&self, share: f64) -> bool {
        self.bar.set_position((share * self.bar.length().unwrap_or(0) as f64) as u64);
        self.print_line(share);
        !self.pressed.load(Ordering::Relaxed)
    }

    /// Prints a progress line if no bar is drawn.
    fn print_line(&self, share: f64) {
        // another thread is printing the same line
        let Ok(mut last_line) = self.last_line.try_lock() else { return };
        if !self.bar.is_hidden() || last_line.elapsed() < LINE_INTERVAL {
            return;
        }
        *last_line = Instant::now();
        let length = self.bar.length().unwrap_or(0);
        output::note(&progress(share, length, &self.parts, self.begun.elapsed()));
    }
}

/// Progress line: share done, time passed, and, from 1 % on, an estimate of the time left.
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

/// Number of results out of those requested: "17 of 200", or "200".
pub fn of_requested(done: usize, requested: usize) -> String {
    match done == requested {
        true => format!("{done}"),
        false => format!("{done} of {requested}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_progress_line_states_the_share_done_and_the_time_left() {
        let after = |share| progress(share, 24, "cranes", Duration::from_secs(30));
        assert_eq!(after(0.25), "25 % of 24 cranes done after 30 s, about 90 s left");
        assert_eq!(after(0.0), "0 % of 24 cranes done after 30 s");
        assert_eq!(
            progress(1.0, 100, "%", Duration::from_secs(9)),
            "100 % done after 9 s, about 0 s left"
        );
    }
}
