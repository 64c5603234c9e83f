//! Progress of a learning experiment, and the request to stop it.

use crate::LabError;
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Progress over a number of simulations, reported within each.
pub(crate) struct Stages<'a> {
    /// Receives the share done; returns whether to continue.
    go_on: &'a (dyn Fn(f64) -> bool + Sync),
    count: f64,
    done: Cell<f64>,
}

impl<'a> Stages<'a> {
    /// Start of about `count` simulations.
    pub(crate) fn new(count: usize, go_on: &'a (dyn Fn(f64) -> bool + Sync)) -> Self {
        Self { go_on, count: count.max(1) as f64, done: Cell::new(0.0) }
    }

    /// Reports the share of the present simulation.
    ///
    /// # Errors
    ///
    /// [`LabError::Stopped`] if the experiment is to stop.
    pub(crate) fn within(&self, share: f64) -> Result<(), LabError> {
        let done = ((self.done.get() + share.min(1.0)) / self.count).min(1.0);
        if (self.go_on)(done) { Ok(()) } else { Err(LabError::Stopped) }
    }

    /// The same for `done` of `periods` control periods; reported every [`OFTEN`] periods.
    ///
    /// # Errors
    ///
    /// See [`within`](Self::within).
    pub(crate) fn within_run(&self, done: usize, periods: usize) -> Result<(), LabError> {
        match done.is_multiple_of(OFTEN) {
            true => self.within(done as f64 / periods.max(1) as f64),
            false => Ok(()),
        }
    }

    /// Completes the present simulation, which counts as `runs`.
    pub(crate) fn done(&self, runs: f64) {
        self.done.set(self.done.get() + runs);
    }

    /// The present simulation, for reports from several threads.
    pub(crate) fn watched(&self) -> Watched<'a> {
        let (go_on, count, done) = (self.go_on, self.count, self.done.get());
        Watched { go_on, count, done, most: Mutex::new(0.0), stop: Arc::default() }
    }
}

/// Computation that seldom reports by itself, beside which another thread asks whether to stop.
pub(crate) struct Watched<'a> {
    go_on: &'a (dyn Fn(f64) -> bool + Sync),
    count: f64,
    done: f64,
    /// Largest share reported so far.
    most: Mutex<f64>,
    /// Set once the computation is to stop.
    pub(crate) stop: Arc<AtomicBool>,
}

impl Watched<'_> {
    /// Reports a share of the computation, or the largest one so far; returns whether to continue.
    pub(crate) fn within(&self, share: f64) -> bool {
        let mut most = self.most.lock().unwrap_or_else(PoisonError::into_inner);
        *most = most.max(share.min(1.0));
        let goes_on = (self.go_on)(((self.done + *most) / self.count).min(1.0));
        if !goes_on {
            self.stop.store(true, Ordering::Relaxed);
        }
        goes_on
    }

    /// Runs a computation that ends soon after `stop` is set.
    pub(crate) fn run<T>(&self, work: impl FnOnce() -> T) -> T {
        let (ended, end) = mpsc::channel::<()>();
        std::thread::scope(|scope| {
            scope.spawn(move || {
                while end.recv_timeout(ASKED_EVERY) == Err(RecvTimeoutError::Timeout)
                    && self.within(0.0)
                {}
            });
            let found = work();
            // ends the thread at once; so does a panic, which drops it too
            drop(ended);
            found
        })
    }
}

/// Interval at which a computation is asked to stop.
const ASKED_EVERY: Duration = Duration::from_millis(100);

/// Control periods between two reports.
const OFTEN: usize = 100;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_increases_and_a_stop_request_ends_the_work() {
        let told = Mutex::new(Vec::new());
        let go_on = |share: f64| {
            told.lock().unwrap().push(share);
            share < 0.6
        };
        let stages = Stages::new(4, &go_on);
        stages.within_run(100, 200).unwrap();
        stages.within_run(101, 200).unwrap();
        stages.done(1.0);
        stages.within(0.5).unwrap();
        stages.done(1.0);
        assert!(matches!(stages.within(0.5), Err(LabError::Stopped)));
        assert_eq!(*told.lock().unwrap(), [0.125, 0.375, 0.625]);
    }

    /// The work never reports; the request reaches it by the flag, and shares do not fall.
    #[test]
    fn a_stop_request_reaches_work_that_reports_no_progress() {
        let told = Mutex::new(Vec::new());
        let go_on = |share: f64| {
            let mut told = told.lock().unwrap();
            told.push(share);
            told.len() < 3
        };
        let stages = Stages::new(2, &go_on);
        stages.done(1.0);
        let watched = stages.watched();
        assert!(watched.within(0.5));
        watched.run(|| {
            while !watched.stop.load(Ordering::Relaxed) {
                std::thread::yield_now();
            }
        });
        assert_eq!(*told.lock().unwrap(), [0.75; 3]);
    }
}
