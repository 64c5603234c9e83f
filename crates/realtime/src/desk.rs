//! Where people ask: what is asked for crosses to the real-time threads without a lock.
//!
//! A start and a reset are requests of the operator who is present. Each carries the [`Generation`] in which it
//! was made, which changes with the operator and with an emergency stop: what was asked for before is void then,
//! also where it is still on its way through another thread.

use crate::posix::now;
use hydroboom_control::strategy::Strategy;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};

/// Which operator, and since which emergency stop: grows whenever the role is taken, given back or lost, and
/// with every emergency stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Generation(u64);

/// Switches that any thread may turn.
#[derive(Debug)]
pub struct Desk {
    /// Generation of a start that is asked for; [`NOTHING`] when none is.
    start: AtomicU64,
    /// For how long that start holds \[s\], as bits.
    start_within: AtomicU64,
    stop: AtomicBool,
    emergency: AtomicBool,
    /// Generation of a reset that is asked for; [`NOTHING`] when none is.
    reset: AtomicU64,
    closing: AtomicBool,
    strategy: AtomicUsize,
    generation: AtomicU64,
    /// Until when somebody attends \[ns of the monotonic clock\].
    attended_until: AtomicU64,
}

/// Somebody attends for good.
const ALWAYS: u64 = u64::MAX;
/// No request; generations begin above it.
const NOTHING: u64 = 0;

impl Desk {
    /// A start that is not taken up within this time of being asked for is dropped \[s\]: long enough for a
    /// session's thread to prepare the course, short enough that whoever asked still looks on.
    pub const START_WITHIN: f64 = 1.0;

    /// A desk with a strategy chosen, attended for good by whoever started the program, and nothing else.
    pub fn new(strategy: Strategy) -> Self {
        let desk = Self {
            start: AtomicU64::new(NOTHING),
            start_within: AtomicU64::new(0),
            stop: AtomicBool::new(false),
            emergency: AtomicBool::new(false),
            reset: AtomicU64::new(NOTHING),
            closing: AtomicBool::new(false),
            strategy: AtomicUsize::new(0),
            generation: AtomicU64::new(NOTHING + 1),
            attended_until: AtomicU64::new(ALWAYS),
        };
        desk.choose(strategy);
        desk
    }

    /// The generation in which a request is made now.
    pub fn generation(&self) -> Generation {
        Generation(self.generation.load(Ordering::Acquire))
    }

    /// Somebody takes the operator's role, and attends for so long from now \[s\].
    pub fn take_role(&self, seconds: f64) -> Generation {
        let before = self.generation.fetch_add(1, Ordering::AcqRel);
        self.attend(seconds);
        Generation(before + 1)
    }

    /// The operator's role is given back, or was lost: nobody attends.
    pub fn leave_role(&self) {
        self.attend(0.0);
        self.generation.fetch_add(1, Ordering::AcqRel);
    }

    /// The operator attends for so long from now \[s\]; a shorter time given later holds.
    pub fn attend(&self, seconds: f64) {
        let until = now().saturating_add((seconds.max(0.0) * 1e9) as u64);
        self.attended_until.store(until, Ordering::Release);
    }

    /// Whether somebody attends.
    pub fn is_attended(&self) -> bool {
        let until = self.attended_until.load(Ordering::Acquire);
        until == ALWAYS || now() < until
    }

    /// Whoever attends now asks that a motion begin.
    pub fn start(&self) {
        // who is replaced in between has not asked
        let _ = self.start_in(self.generation(), Self::START_WITHIN);
    }

    /// Whoever attends now asks that, after a fault, the machine be watched again.
    pub fn reset(&self) {
        let _ = self.reset_in(self.generation());
    }

    /// Asks that a motion begin, within a time \[s\] of at most [`Desk::START_WITHIN`]. False, and nothing is
    /// asked for, where the request is of an earlier generation.
    pub fn start_in(&self, generation: Generation, within: f64) -> bool {
        let holds = generation == self.generation();
        if holds {
            self.start_within.store(within.to_bits(), Ordering::Relaxed);
            // the time that was stored before is there when this is seen
            self.start.store(generation.0, Ordering::Release);
        }
        holds
    }

    /// Brings all to rest.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Holds the load at once; what was asked for before is void.
    pub fn emergency_stop(&self) {
        // who sees the new generation sees the stop, at the latest a period later
        self.emergency.store(true, Ordering::Release);
        self.generation.fetch_add(1, Ordering::AcqRel);
    }

    /// Asks that, after a fault, the machine be watched again. False, and nothing is asked for, where the
    /// request is of an earlier generation.
    pub fn reset_in(&self, generation: Generation) -> bool {
        let holds = generation == self.generation();
        if holds {
            self.reset.store(generation.0, Ordering::Release);
        }
        holds
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

    /// Whether all shall end.
    pub fn is_closing(&self) -> bool {
        self.closing.load(Ordering::Relaxed)
    }

    /// A start that was asked for, and for how long it holds \[s\].
    pub(crate) fn take_start(&self) -> Option<(Generation, f64)> {
        match self.start.swap(NOTHING, Ordering::Acquire) {
            NOTHING => None,
            generation => {
                let within = f64::from_bits(self.start_within.load(Ordering::Relaxed));
                Some((Generation(generation), within))
            }
        }
    }

    pub(crate) fn take_stop(&self) -> bool {
        self.stop.swap(false, Ordering::Relaxed)
    }

    pub(crate) fn take_emergency(&self) -> bool {
        self.emergency.swap(false, Ordering::Acquire)
    }

    /// A reset that was asked for.
    pub(crate) fn take_reset(&self) -> Option<Generation> {
        let generation = self.reset.swap(NOTHING, Ordering::Acquire);
        (generation != NOTHING).then_some(Generation(generation))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn desk() -> Desk {
        Desk::new(Strategy::BenchmarkClosedLoop)
    }

    #[test]
    fn the_generation_grows_with_every_change_of_the_operator_and_every_emergency_stop() {
        let desk = desk();
        let mut seen = vec![desk.generation()];
        desk.attend(10.0);
        assert_eq!(desk.generation(), seen[0], "who attends on is the same operator");
        let take = || {
            desk.take_role(10.0);
        };
        let leave = || desk.leave_role();
        let stop = || desk.emergency_stop();
        let changes: [&dyn Fn(); 4] = [&take, &leave, &take, &stop];
        for change in changes {
            change();
            assert!(!seen.contains(&desk.generation()));
            seen.push(desk.generation());
        }
    }

    #[test]
    fn a_request_of_an_earlier_generation_is_not_taken() {
        let desk = desk();
        let first = desk.take_role(10.0);
        let second = desk.take_role(10.0);
        assert!(!desk.start_in(first, 1.0) && !desk.reset_in(first));
        assert_eq!((desk.take_start(), desk.take_reset()), (None, None));
        assert!(desk.start_in(second, 0.5) && desk.reset_in(second));
        assert_eq!((desk.take_start(), desk.take_reset()), (Some((second, 0.5)), Some(second)));
        assert_eq!((desk.take_start(), desk.take_reset()), (None, None), "taken once");
    }

    #[test]
    fn who_leaves_attends_no_more_and_an_emergency_stop_is_kept_until_it_is_taken() {
        let desk = desk();
        assert!(desk.is_attended());
        desk.leave_role();
        assert!(!desk.is_attended());
        desk.emergency_stop();
        desk.take_role(10.0);
        desk.leave_role();
        assert!(desk.take_emergency() && !desk.take_emergency());
    }
}
