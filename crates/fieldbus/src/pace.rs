//! Pace: when frames are sent, by SYNC0 of the devices as this computer's clock sees it.

use crate::table::BusSettings;

/// Share of a deviation by which the estimate of SYNC0 is corrected at each frame, as a divisor: what frames are late
/// by is smoothed, and clocks that drift by 100 ppm leave 0.8 us at a period of 1 ms.
const GAIN: i64 = 8;

/// Phase of SYNC0, estimated from the system time that came with each frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    period: u64,
    exchange: u64,
    /// A SYNC0 by this computer's clock \[ns\], the last before the newest frame; none before the first.
    sync0: Option<u64>,
    /// That SYNC0 by the devices' system time \[ns\].
    pub(crate) system: u64,
    /// When the newest frame was sent \[ns\].
    sent: u64,
}

impl Pace {
    pub(crate) fn new(bus: &BusSettings) -> Self {
        Self { period: bus.period, exchange: bus.exchange, sync0: None, system: 0, sent: 0 }
    }

    /// A frame was sent at a time \[ns\], and came back with the devices' system time \[ns\], or was lost.
    pub(crate) fn see(&mut self, sent: u64, system: Option<u64>) {
        self.sent = sent;
        if let Some(system) = system {
            let phase = system % self.period;
            let seen = sent.saturating_sub(phase);
            self.system = system - phase;
            self.sync0 = Some(match self.sync0 {
                None => seen,
                Some(before) => {
                    let periods =
                        (seen.wrapping_sub(before) as i64 as f64 / self.period as f64).round();
                    let expected = before.wrapping_add_signed(periods as i64 * self.period as i64);
                    let deviation = seen.wrapping_sub(expected) as i64;
                    expected.wrapping_add_signed(deviation / GAIN)
                }
            });
        }
    }

    /// SYNC0 before a time \[ns\].
    fn before(&self, time: u64) -> u64 {
        match self.sync0 {
            // the estimate may lie after the time by what it is smoothed
            Some(sync0) => {
                let after = (time.wrapping_sub(sync0) as i64).rem_euclid(self.period as i64);
                time.wrapping_sub(after as u64)
            }
            None => time,
        }
    }

    /// When the first exchange of the next cycle is due \[ns\], after the cycle in which the newest frame was sent.
    pub(crate) fn next_exchange(&self) -> u64 {
        self.before(self.sent) + self.period + self.exchange
    }

    /// Until when the answer to a frame is waited for that was sent at a time \[ns\]: until a margin before what
    /// comes next in the period.
    pub(crate) fn answer_end(&self, sent: u64, bus: &BusSettings, margin: u64) -> u64 {
        let begin = self.before(sent);
        let next =
            if bus.exchanges == 2 && sent < begin + bus.send { bus.send } else { bus.period };
        (begin + next).saturating_sub(margin).max(sent + margin)
    }

    /// A time after the SYNC0 of the cycle in which the newest frame was sent \[ns\].
    pub(crate) fn in_cycle(&self, after: u64) -> u64 {
        self.before(self.sent) + after
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BUS: BusSettings = BusSettings::OF_TESTS;

    /// System time of devices whose clocks run faster by 100 ppm \[ns\].
    fn system(time: u64) -> u64 {
        5_000_300_000 + time + time / 10_000
    }

    /// How far a time is from a SYNC0 \[ns\].
    fn from_sync0(time: u64) -> u64 {
        let phase = system(time) % BUS.period;
        phase.min(BUS.period - phase)
    }

    #[test]
    fn sync0_is_followed_despite_late_frames() {
        let mut pace = Pace::new(&BUS);
        let mut time = 10_000_000;
        for cycle in 0..2000 {
            let sent = time + [0, 40_000, 5_000, 90_000][cycle % 4];
            pace.see(sent, (cycle % 50 != 7).then(|| system(sent)));
            // what a gain of 1/8 leaves of 100 ns a period, and of a period without an answer
            assert!(from_sync0(pace.in_cycle(0)) < 2_000, "cycle {cycle}");
            time = pace.next_exchange();
            assert!(time > sent + BUS.exchange, "cycle {cycle}");
        }
    }

    #[test]
    fn a_frame_sent_at_sync0_belongs_to_an_adjacent_cycle() {
        let mut pace = Pace::new(&BUS);
        pace.see(10_000_000, Some(system(10_000_000)));
        let sync0 = pace.in_cycle(0) + 50 * BUS.period;
        for off in (0..12_000).step_by(500) {
            let sent = sync0 + off - 6_000;
            let mut pace = pace;
            pace.see(sent, Some(system(sent)));
            assert!(from_sync0(pace.in_cycle(0)) < 6_000, "{off}");
            let next = pace.next_exchange() - sent;
            assert!((BUS.exchange..BUS.period + 2 * BUS.exchange).contains(&next), "{off}: {next}");
        }
    }
}
