//! Parallel map over jobs that can be stopped early.

use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Applies `of` to each job on all cores. `go_on` receives the number of completed jobs. Once it returns
/// false, no further job is started, and its result is none.
pub(crate) fn as_long_as<J: Sync, R: Send>(
    jobs: &[J],
    go_on: &(dyn Fn(usize) -> bool + Sync),
    of: impl Fn(&J) -> R + Sync,
) -> Vec<Option<R>> {
    let (done, ended) = (AtomicUsize::new(0), AtomicBool::new(false));
    let one = |job: &J| {
        if ended.load(Ordering::Relaxed) {
            return None;
        }
        let one = of(job);
        if !go_on(done.fetch_add(1, Ordering::Relaxed) + 1) {
            ended.store(true, Ordering::Relaxed);
        }
        Some(one)
    };
    jobs.par_iter().map(one).collect()
}
