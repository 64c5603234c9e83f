//! Distributed clock (ETG.1000.4): a local clock with an offset and a drift, held at the system time of the reference,
//! and the pulses SYNC0 and SYNC1.
//!
//! ```text
//! local time   t_l = t_0 + (1 + d) t + a           a: what the control loop has added
//! system time  t_s = t_l + offset
//! difference   e   = t_s - delay - received        then a <- a - g e
//! ```

use super::memory::Memory;
use super::registers::{
    RECEIVE_TIME, RECEIVE_TIME_UNIT, SYNC_ACTIVATION, SYNC_START, SYNC0_CYCLE, SYNC1_CYCLE,
    SYSTEM_TIME, SYSTEM_TIME_DELAY, SYSTEM_TIME_DIFFERENCE, SYSTEM_TIME_OFFSET,
};

/// Distributed clock of a device: local clock, control loop, and the pulses SYNC0 and SYNC1. "Bus time" is the time of
/// the simulation, which no device knows.
#[derive(Clone, Debug)]
pub struct DistributedClock {
    /// Local time at bus time zero \[ns\].
    pub start: u64,
    /// Drift against the bus time, positive if the clock is fast \[ppb\].
    pub drift_ppb: i64,
    /// Correction by the control loop \[ns\].
    correction: i64,
    /// Next SYNC0, system time \[ns\].
    next: Option<u64>,
    /// Whether SYNC0 is suppressed by an injected fault.
    pub is_sync0_suppressed: bool,
}

/// Share of a difference that the control loop takes back at each received time, as a divisor. Estimate: controllers
/// take back less than a hundredth, with filters of their own.
const GAIN: i64 = 16;

impl DistributedClock {
    /// Clock with a local time at bus time zero \[ns\] and a drift against the bus time \[ppb\].
    pub fn new(start: u64, drift_ppb: i64) -> Self {
        Self { start, drift_ppb, correction: 0, next: None, is_sync0_suppressed: false }
    }

    /// Local time at the bus time `now` \[ns\].
    pub fn local(&self, now: u64) -> u64 {
        let drift = (i128::from(now) * i128::from(self.drift_ppb) / 1_000_000_000) as i64;
        self.start.wrapping_add(now).wrapping_add_signed(drift.wrapping_add(self.correction))
    }

    /// System time at the bus time `now` \[ns\].
    pub fn system(&self, memory: &Memory, now: u64) -> u64 {
        self.local(now).wrapping_add(memory.u64(SYSTEM_TIME_OFFSET))
    }

    /// Writes system time (0x0910) and the time of the next SYNC0 (0x0990), both \[ns\], at the bus time `now` \[ns\].
    /// Without cyclic operation 0x0990 is unchanged.
    pub fn update_registers(&self, memory: &mut Memory, now: u64) {
        memory.set(SYSTEM_TIME, &self.system(memory, now).to_le_bytes());
        if let Some(next) = self.next {
            memory.set(SYNC_START, &next.to_le_bytes());
        }
    }

    /// Latches the local times at which a frame passed the ports 0 to 3. `ports` are the bus times \[ns\]; `None` for
    /// an unused port.
    ///
    /// Registers 0x0900 to 0x090F receive 32 bits for each port that is used, and 0x0918 the 64 bits of port 0, where
    /// the processing unit is.
    pub fn latch(&self, memory: &mut Memory, ports: [Option<u64>; 4]) {
        for (number, time) in (0..).zip(ports) {
            if let Some(time) = time {
                let local = self.local(time) as u32;
                memory.set(RECEIVE_TIME + 4 * number, &local.to_le_bytes());
            }
        }
        if let Some(first) = ports[0] {
            memory.set(RECEIVE_TIME_UNIT, &self.local(first).to_le_bytes());
        }
    }

    /// Control loop: follows a received system time of the reference clock, at the bus time `now` \[ns\]. `received`
    /// is little-endian with 4 or 8 bytes; a shorter one is ignored. Writes the difference into 0x092C.
    ///
    /// Each call takes back 1/16 of the difference and 1 ns, an estimate: real controllers take back less.
    pub fn correct(&mut self, memory: &mut Memory, received: &[u8], now: u64) {
        let own = self.system(memory, now).wrapping_sub(u64::from(memory.u32(SYSTEM_TIME_DELAY)));
        let difference = match received.len() {
            8.. => {
                let received = received.first_chunk().map_or(0, |b| u64::from_le_bytes(*b));
                own.wrapping_sub(received) as i64
            }
            4.. => {
                let received = received.first_chunk().map_or(0, |b| u32::from_le_bytes(*b));
                i64::from((own as u32).wrapping_sub(received) as i32)
            }
            _ => return,
        };
        let size = difference.unsigned_abs().min(0x7fff_ffff) as u32;
        let sign = if difference < 0 { 0x8000_0000 } else { 0 };
        memory.set(SYSTEM_TIME_DIFFERENCE, &(size | sign).to_le_bytes());
        let step = difference / GAIN + difference.signum();
        self.correction = self.correction.wrapping_sub(step);
    }

    /// Starts or stops cyclic operation by the registers, at the bus time `now` \[ns\]. Pulses begin at the start
    /// time, or never if it has passed or the cycle time of SYNC0 is 0.
    pub fn activate(&mut self, memory: &Memory, now: u64) {
        let start = memory.u64(SYNC_START);
        let is_on = memory.u8(SYNC_ACTIVATION) & 0x03 == 0x03;
        let has_cycle = memory.u32(SYNC0_CYCLE) > 0;
        self.next =
            Some(start).filter(|start| is_on && has_cycle && *start > self.system(memory, now));
    }

    /// Bus time of the next SYNC0 \[ns\], predicted at the bus time `now` \[ns\]; `None` without pulses.
    pub fn due(&self, memory: &Memory, now: u64) -> Option<u64> {
        let next = self.next.filter(|_| !self.is_sync0_suppressed)?;
        let until_next = next.wrapping_sub(self.system(memory, now)) as i64;
        let drift = (i128::from(until_next) * i128::from(self.drift_ppb) / 1_000_000_000) as i64;
        Some(now.saturating_add_signed(until_next - drift))
    }

    /// Moves the next SYNC0 on by its cycle time (0x09A0), after a pulse.
    pub fn advance_sync0(&mut self, memory: &Memory) {
        let cycle = u64::from(memory.u32(SYNC0_CYCLE));
        self.next = self.next.map(|next| next + cycle);
    }

    /// Whether SYNC0 pulses are generated.
    pub fn is_running(&self) -> bool {
        self.next.is_some() && !self.is_sync0_suppressed
    }

    /// Whether SYNC0 and SYNC1 are activated in the registers, and their cycle times \[ns\].
    pub fn settings(memory: &Memory) -> ([bool; 2], [u32; 2]) {
        let activation = memory.u8(SYNC_ACTIVATION);
        let cyclic = activation & 1 != 0;
        (
            [cyclic && activation & 2 != 0, cyclic && activation & 4 != 0],
            [memory.u32(SYNC0_CYCLE), memory.u32(SYNC1_CYCLE)],
        )
    }
}
