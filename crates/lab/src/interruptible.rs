//! Work in parts, on all cores, that may end before all of it is done.

use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Does `of` to each job, and tells `go_on` how many are done: once it says no, none is begun any more, and none is there of those.
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
