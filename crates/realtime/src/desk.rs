//! Operator desk: passes requests of the operator to the real-time threads without a lock.
//!
//! A start and a reset are requests of the operator who is present. Each carries the [`Generation`] in
//! which it was made. The generation changes with the operator and with an emergency stop, which makes
//! earlier requests void, also those still in transit between threads.

use crate::posix::now;
use hydroboom_control::strategy::Strategy;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};

/// Counter that identifies the operator and the last emergency stop. It increases when the role is taken,
/// given back or lost, and with every emergency stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Generation(u64);

/// Requests of the operator to the real-time tasks, as atomics that any thread may set.
#[derive(Debug)]
pub struct Desk {
    /// Generation of a pending start; [`NOTHING`] if there is none.
    start: AtomicU64,
    /// Validity of the pending start \[s\], as bits of an `f64`.
    start_within: AtomicU64,
    stop: AtomicBool,
    emergency: AtomicBool,
    /// Generation of a pending reset; [`NOTHING`] if there is none.
    reset: AtomicU64,
    closing: AtomicBool,
    /// Whether nothing is ever asked of the machine.
    listens: AtomicBool,
    strategy: AtomicUsize,
    generation: AtomicU64,
    /// Time until which an operator is present \[ns of the monotonic clock\].
    attended_until: AtomicU64,
}

/// An operator is present without a time limit.
const ALWAYS: u64 = u64::MAX;
/// No request; generations are greater.
const NOTHING: u64 = 0;

impl Desk {
    /// Validity of a start request \[s\]. It leaves the session's thread time to prepare the course, and
    /// expires while the operator still watches.
    pub const START_WITHIN: f64 = 1.0;

    /// Desk with a control strategy and no request. The person who started the program counts as present without a
    /// time limit.
    pub fn new(strategy: Strategy) -> Self {
        let desk = Self {
            start: AtomicU64::new(NOTHING),
            start_within: AtomicU64::new(0),
            stop: AtomicBool::new(false),
            emergency: AtomicBool::new(false),
            reset: AtomicU64::new(NOTHING),
            closing: AtomicBool::new(false),
            listens: AtomicBool::new(false),
            strategy: AtomicUsize::new(0),
            generation: AtomicU64::new(NOTHING + 1),
            attended_until: AtomicU64::new(ALWAYS),
        };
        desk.choose(strategy);
        desk
    }

    /// From now on no request is made of the machine: its drives stay without torque.
    pub fn listen_only(&self) {
        self.listens.store(true, Ordering::Release);
    }

    /// Whether no request is made of the machine.
    pub fn listens(&self) -> bool {
        self.listens.load(Ordering::Acquire)
    }

    /// Present generation; a request made in an earlier one is void.
    pub fn generation(&self) -> Generation {
        Generation(self.generation.load(Ordering::Acquire))
    }

    /// Takes the operator's role and marks the operator as present for `seconds` from now. Returns the new generation.
    pub fn take_role(&self, seconds: f64) -> Generation {
        let before = self.generation.fetch_add(1, Ordering::AcqRel);
        self.attend(seconds);
        Generation(before + 1)
    }

    /// Gives the operator's role back, or marks it as lost: no operator is present.
    pub fn leave_role(&self) {
        self.attend(0.0);
        self.generation.fetch_add(1, Ordering::AcqRel);
    }

    /// Marks the operator as present for `seconds` from now. A later call replaces the time, also by a
    /// shorter one. A negative or NaN time counts as 0: no operator is present.
    pub fn attend(&self, seconds: f64) {
        let until = now().saturating_add((seconds.max(0.0) * 1e9) as u64);
        self.attended_until.store(until, Ordering::Release);
    }

    /// Whether an operator is present: the time since the last sign of presence has not expired.
    pub fn is_attended(&self) -> bool {
        let until = self.attended_until.load(Ordering::Acquire);
        until == ALWAYS || now() < until
    }

    /// Requests a start of the course in the present generation.
    pub fn start(&self) {
        // false if the operator changed in between: then the start is void
        let _ = self.start_in(self.generation(), Self::START_WITHIN);
    }

    /// Requests a reset after a fault in the present generation.
    pub fn reset(&self) {
        let _ = self.reset_in(self.generation());
    }

    /// Requests a start of the course that is valid for `within` seconds, at most [`Desk::START_WITHIN`]. False
    /// without effect if `generation` is no longer the present one.
    pub fn start_in(&self, generation: Generation, within: f64) -> bool {
        let holds = generation == self.generation();
        if holds {
            self.start_within.store(within.to_bits(), Ordering::Relaxed);
            // the release order makes the validity stored before visible together with the generation
            self.start.store(generation.0, Ordering::Release);
        }
        holds
    }

    /// Requests a controlled stop of the motion.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Requests an emergency stop, which makes earlier requests void.
    pub fn emergency_stop(&self) {
        // a thread that sees the new generation sees the emergency stop at the latest one period later
        self.emergency.store(true, Ordering::Release);
        self.generation.fetch_add(1, Ordering::AcqRel);
    }

    /// Requests a reset after a fault. False without effect if `generation` is no longer the present one.
    pub fn reset_in(&self, generation: Generation) -> bool {
        let holds = generation == self.generation();
        if holds {
            self.reset.store(generation.0, Ordering::Release);
        }
        holds
    }

    /// Requests a controlled stop and the end of the session.
    pub fn close(&self) {
        self.closing.store(true, Ordering::Relaxed);
    }

    /// Requests a control strategy, also during a motion.
    pub fn choose(&self, strategy: Strategy) {
        self.strategy.store(strategy as usize, Ordering::Relaxed);
    }

    /// Control strategy requested last.
    pub fn strategy(&self) -> Strategy {
        Strategy::ALL[self.strategy.load(Ordering::Relaxed) % Strategy::ALL.len()]
    }

    /// Whether the end of the session was requested.
    pub fn is_closing(&self) -> bool {
        self.closing.load(Ordering::Relaxed)
    }

    /// Takes the pending start: its generation and validity \[s\].
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

    /// Takes the pending reset.
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
    fn each_change_of_operator_and_emergency_stop_adds_a_generation() {
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
    fn leaving_ends_attendance_and_keeps_an_emergency_stop_until_taken() {
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
