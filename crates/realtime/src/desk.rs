//! Where people ask: what is asked for crosses to the real-time threads without a lock.

use hydroboom_control::Strategy;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Switches that any thread may turn.
#[derive(Debug)]
pub struct Desk {
    start: AtomicBool,
    stop: AtomicBool,
    emergency: AtomicBool,
    strategy: AtomicUsize,
}

impl Desk {
    /// A desk with a strategy chosen, and nothing else.
    pub fn new(strategy: Strategy) -> Self {
        let desk = Self {
            start: AtomicBool::new(false),
            stop: AtomicBool::new(false),
            emergency: AtomicBool::new(false),
            strategy: AtomicUsize::new(0),
        };
        desk.choose(strategy);
        desk
    }

    /// Lets the motion begin.
    pub fn start(&self) {
        self.start.store(true, Ordering::Relaxed);
    }

    /// Brings all to rest.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Holds the load at once.
    pub fn emergency_stop(&self) {
        self.emergency.store(true, Ordering::Relaxed);
    }

    /// Changes the strategy, also during the motion.
    pub fn choose(&self, strategy: Strategy) {
        self.strategy.store(strategy as usize, Ordering::Relaxed);
    }

    /// The strategy asked for.
    pub fn strategy(&self) -> Strategy {
        Strategy::ALL[self.strategy.load(Ordering::Relaxed) % Strategy::ALL.len()]
    }

    pub(crate) fn is_started(&self) -> bool {
        self.start.load(Ordering::Relaxed)
    }

    pub(crate) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    pub(crate) fn take_emergency(&self) -> bool {
        self.emergency.swap(false, Ordering::Relaxed)
    }
}
