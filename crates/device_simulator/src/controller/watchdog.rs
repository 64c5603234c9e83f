//! Process-data watchdog: expires where no whole frame of outputs came within its time.

use super::memory::Memory;
use super::registers::{
    WATCHDOG_COUNTER, WATCHDOG_DIVIDER, WATCHDOG_PROCESS_DATA, WATCHDOG_STATUS,
};

/// State of the watchdog.
#[derive(Clone, Copy, Debug, Default)]
pub struct Watchdog {
    /// When outputs came last \[ns\]; none before the first.
    fed: Option<u64>,
    expired: bool,
}

impl Watchdog {
    /// Time of the watchdog \[ns\]; none where it is switched off by a zero.
    pub fn time(memory: &Memory) -> Option<u64> {
        let unit = 40 * (u64::from(memory.u16(WATCHDOG_DIVIDER)) + 2);
        Some(unit * u64::from(memory.u16(WATCHDOG_PROCESS_DATA))).filter(|time| *time > 0)
    }

    /// Outputs came.
    pub fn feed(&mut self, memory: &mut Memory, now: u64) {
        (self.fed, self.expired) = (Some(now), false);
        memory.set(WATCHDOG_STATUS, &[1, 0]);
    }

    /// When it expires \[ns\], if it runs.
    pub fn due(&self, memory: &Memory) -> Option<u64> {
        match (self.fed, self.expired) {
            (Some(fed), false) => Some(fed + Self::time(memory)?),
            _ => None,
        }
    }

    /// Lets it expire.
    pub fn expire(&mut self, memory: &mut Memory) {
        self.expired = true;
        let count = memory.u8(WATCHDOG_COUNTER).saturating_add(1);
        memory.set(WATCHDOG_STATUS, &[0, 0]);
        memory.set(WATCHDOG_COUNTER, &[count]);
    }

    /// Stops it, as a state without outputs does; the register shows that it has expired until outputs come again.
    pub fn stop(&mut self) {
        *self = Self::default();
    }
}
