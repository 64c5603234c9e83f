//! Process-data watchdog (ETG.1000.4, registers 0x0400, 0x0420, 0x0440): expires where no complete outputs came within
//! its time.

use super::memory::Memory;
use super::registers::{
    WATCHDOG_COUNTER, WATCHDOG_DIVIDER, WATCHDOG_PROCESS_DATA, WATCHDOG_STATUS,
};

/// Process-data watchdog.
#[derive(Clone, Copy, Debug, Default)]
pub struct Watchdog {
    /// When outputs came last \[ns\]; none before the first.
    last_trigger: Option<u64>,
    /// Whether it has expired since then.
    expired: bool,
}

impl Watchdog {
    /// Watchdog time by the registers \[ns\]: 40 ns (divider + 2) times 0x0420; `None` if it is zero, switched off.
    pub fn time(memory: &Memory) -> Option<u64> {
        let unit = 40 * (u64::from(memory.u16(WATCHDOG_DIVIDER)) + 2);
        Some(unit * u64::from(memory.u16(WATCHDOG_PROCESS_DATA))).filter(|time| *time > 0)
    }

    /// Restarts the watchdog after complete outputs at the time `now` \[ns\].
    pub fn trigger(&mut self, memory: &mut Memory, now: u64) {
        (self.last_trigger, self.expired) = (Some(now), false);
        memory.set(WATCHDOG_STATUS, &[1, 0]);
    }

    /// Time of expiration \[ns\]; `None` if the watchdog does not run.
    pub fn due(&self, memory: &Memory) -> Option<u64> {
        match (self.last_trigger, self.expired) {
            (Some(last_trigger), false) => Some(last_trigger + Self::time(memory)?),
            _ => None,
        }
    }

    /// Expires: updates status and counter registers.
    pub fn expire(&mut self, memory: &mut Memory) {
        self.expired = true;
        let count = memory.u8(WATCHDOG_COUNTER).saturating_add(1);
        memory.set(WATCHDOG_STATUS, &[0, 0]);
        memory.set(WATCHDOG_COUNTER, &[count]);
    }

    /// Stops the watchdog, as in a state without outputs; the status register shows expiration until outputs come
    /// again.
    pub fn stop(&mut self) {
        *self = Self::default();
    }
}
