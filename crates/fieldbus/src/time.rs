//! Time of the bus: the system's monotonic clock, or a simulated one, which a thread sets for itself.
//!
//! It is the time driver of `ethercrab` without its `std` feature (crate `embassy-time-driver`); a binary can have
//! only one. So that the same binary runs in real and in simulated time, the driver asks the calling thread: tests in
//! threads of their own do not disturb each other. Futures are polled by hand until they are ready, so that a waker
//! is never used; the nearest time that a future waits for is kept.

use embassy_time_driver::{Driver, TICK_HZ, time_driver_impl};
use hydroboom_realtime::posix;
use std::cell::Cell;
use std::task::Waker;

/// Length of the driver's tick \[ns\].
const TICK: u64 = 1_000_000_000 / TICK_HZ;

thread_local! {
    /// Simulated time of this thread \[ns\]; none: the system's clock.
    static SIMULATED: Cell<Option<u64>> = const { Cell::new(None) };
    /// The nearest time that a future of this thread waits for \[ns\].
    static NEXT_TIMER: Cell<u64> = const { Cell::new(u64::MAX) };
}

/// Time \[ns\]: of the system's monotonic clock, or as this thread simulates it.
pub fn now() -> u64 {
    SIMULATED.get().unwrap_or_else(posix::now)
}

/// Sets the simulated time of this thread \[ns\]; the thread no longer reads the system's clock.
pub fn simulate(time: u64) {
    SIMULATED.set(Some(time));
}

/// Forgets what futures wait for, before they are polled.
pub(crate) fn forget_timers() {
    NEXT_TIMER.set(u64::MAX);
}

/// The nearest time that a polled future waits for \[ns\]; the largest number where none waits.
pub(crate) fn next_timer() -> u64 {
    NEXT_TIMER.get()
}

/// Time driver of `ethercrab`: the time of the calling thread.
struct BusTime;

impl Driver for BusTime {
    fn now(&self) -> u64 {
        now() / TICK
    }

    fn schedule_wake(&self, at: u64, _: &Waker) {
        NEXT_TIMER.set(NEXT_TIMER.get().min(at.saturating_mul(TICK)));
    }
}

time_driver_impl!(static DRIVER: BusTime = BusTime);
