//! Where people ask: what is asked for crosses to the real-time threads without a lock.

use crate::posix::now;
use hydroboom_control::Strategy;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};

/// Switches that any thread may turn.
#[derive(Debug)]
pub struct Desk {
    start: AtomicBool,
    stop: AtomicBool,
    emergency: AtomicBool,
    reset: AtomicBool,
    closing: AtomicBool,
    strategy: AtomicUsize,
    /// Until when somebody attends \[ns of the monotonic clock\].
    attended_until: AtomicU64,
}

/// Somebody attends for good.
const ALWAYS: u64 = u64::MAX;

impl Desk {
    /// A desk with a strategy chosen, attended, and nothing else.
    pub fn new(strategy: Strategy) -> Self {
        let desk = Self {
            start: AtomicBool::new(false),
            stop: AtomicBool::new(false),
            emergency: AtomicBool::new(false),
            reset: AtomicBool::new(false),
            closing: AtomicBool::new(false),
            strategy: AtomicUsize::new(0),
            attended_until: AtomicU64::new(ALWAYS),
        };
        desk.choose(strategy);
        desk
    }

    /// Lets a motion begin.
    pub fn start(&self) {
        // the course that was sent before is there when this is seen
        self.start.store(true, Ordering::Release);
    }

    /// Brings all to rest.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Holds the load at once.
    pub fn emergency_stop(&self) {
        self.emergency.store(true, Ordering::Relaxed);
    }

    /// After a fault: watches the machine again.
    pub fn reset(&self) {
        self.reset.store(true, Ordering::Relaxed);
    }

    /// Brings all to rest, and ends.
    pub fn close(&self) {
        self.closing.store(true, Ordering::Relaxed);
    }

    /// Changes the strategy, also during the motion.
    pub fn choose(&self, strategy: Strategy) {
        self.strategy.store(strategy as usize, Ordering::Relaxed);
    }

    /// The strategy asked for.
    pub fn strategy(&self) -> Strategy {
        Strategy::ALL[self.strategy.load(Ordering::Relaxed) % Strategy::ALL.len()]
    }

    /// Somebody attends for so long from now \[s\]; a shorter time given later holds.
    pub fn attend(&self, seconds: f64) {
        let until = now().saturating_add((seconds.max(0.0) * 1e9) as u64);
        self.attended_until.store(until, Ordering::Relaxed);
    }

    /// Whether somebody attends.
    pub fn is_attended(&self) -> bool {
        let until = self.attended_until.load(Ordering::Relaxed);
        until == ALWAYS || now() < until
    }

    /// Whether all shall end.
    pub fn is_closing(&self) -> bool {
        self.closing.load(Ordering::Relaxed)
    }

    pub(crate) fn take_start(&self) -> bool {
        self.start.swap(false, Ordering::Acquire)
    }

    pub(crate) fn take_stop(&self) -> bool {
        self.stop.swap(false, Ordering::Relaxed)
    }

    pub(crate) fn take_emergency(&self) -> bool {
        self.emergency.swap(false, Ordering::Relaxed)
    }

    pub(crate) fn take_reset(&self) -> bool {
        self.reset.swap(false, Ordering::Relaxed)
    }
}
