//! Progress of a learning experiment, and the request to stop it.

use crate::LabError;
use std::cell::Cell;

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
}

/// Control periods between two reports.
const OFTEN: usize = 100;

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn the_share_grows_and_a_no_ends_it() {
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
}
