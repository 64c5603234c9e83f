//! Pace: send times of frames, from the phase of the devices' SYNC0 against this computer's clock.

use crate::table::BusSettings;

/// Divisor of the deviation by which each frame corrects the estimate of SYNC0. It filters the jitter of sending; a
/// clock drift of 100 ppm leaves an error of 0.8 us at a period of 1 ms.
const GAIN: i64 = 8;

/// Estimate of SYNC0 by this computer's clock, from the devices' system time (0x0910) that each frame brings back.
///
/// SYNC0 is where the system time is a multiple of the period. A first-order filter follows it, which tracks the drift
/// of the clocks: estimate <- prediction + (measured - prediction) / 8, with measured = send time - system time modulo
/// period.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    /// Cycle of SYNC0 \[ns\].
    period: u64,
    /// First exchange after SYNC0 \[ns\].
    exchange: u64,
    /// Last SYNC0 before the newest frame, by this computer's clock \[ns\]; none before the first answer.
    sync0: Option<u64>,
    /// That SYNC0 by the devices' system time \[ns\].
    pub(crate) system: u64,
    /// When the newest frame was sent \[ns\].
    sent: u64,
}

impl Pace {
    /// No estimate yet; exchanges are due a period after the newest frame then.
    pub(crate) fn new(bus: &BusSettings) -> Self {
        Self { period: bus.period, exchange: bus.exchange, sync0: None, system: 0, sent: 0 }
    }

    /// Corrects the estimate by the send time of a frame \[ns\] and the devices' system time that it brought back
    /// \[ns\]; none where it was lost, and the estimate is kept.
    pub(crate) fn update(&mut self, sent: u64, system: Option<u64>) {
        self.sent = sent;
        if let Some(system) = system {
            let phase = system % self.period;
            let measured = sent.saturating_sub(phase);
            self.system = system - phase;
            self.sync0 = Some(match self.sync0 {
                None => measured,
                Some(before) => {
                    let periods =
                        (measured.wrapping_sub(before) as i64 as f64 / self.period as f64).round();
                    let expected = before.wrapping_add_signed(periods as i64 * self.period as i64);
                    let deviation = measured.wrapping_sub(expected) as i64;
                    expected.wrapping_add_signed(deviation / GAIN)
                }
            });
        }
    }

    /// Last SYNC0 before a time \[ns\].
    fn sync0_before(&self, time: u64) -> u64 {
        match self.sync0 {
            // the filtered estimate may lie after the time
            Some(sync0) => {
                let after = (time.wrapping_sub(sync0) as i64).rem_euclid(self.period as i64);
                time.wrapping_sub(after as u64)
            }
            None => time,
        }
    }

    /// When the first exchange of the next cycle is due \[ns\], after the cycle in which the newest frame was sent.
    pub(crate) fn next_exchange(&self) -> u64 {
        self.sync0_before(self.sent) + self.period + self.exchange
    }

    /// Deadline for the answer to a frame that was sent at a time \[ns\]: a margin before the second exchange, or
    /// before the end of the period.
    pub(crate) fn answer_deadline(&self, sent: u64, bus: &BusSettings, margin: u64) -> u64 {
        let begin = self.sync0_before(sent);
        let next =
            if bus.exchanges == 2 && sent < begin + bus.send { bus.send } else { bus.period };
        (begin + next).saturating_sub(margin).max(sent + margin)
    }

    /// A time after the SYNC0 of the cycle in which the newest frame was sent \[ns\].
    pub(crate) fn in_cycle(&self, after: u64) -> u64 {
        self.sync0_before(self.sent) + after
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
            pace.update(sent, (cycle % 50 != 7).then(|| system(sent)));
            // error that a gain of 1/8 leaves of a drift of 100 ns a period, and of a period without an answer
            assert!(from_sync0(pace.in_cycle(0)) < 2_000, "cycle {cycle}");
            time = pace.next_exchange();
            assert!(time > sent + BUS.exchange, "cycle {cycle}");
        }
    }

    #[test]
    fn a_frame_sent_at_sync0_belongs_to_an_adjacent_cycle() {
        let mut pace = Pace::new(&BUS);
        pace.update(10_000_000, Some(system(10_000_000)));
        let sync0 = pace.in_cycle(0) + 50 * BUS.period;
        for off in (0..12_000).step_by(500) {
            let sent = sync0 + off - 6_000;
            let mut pace = pace;
            pace.update(sent, Some(system(sent)));
            assert!(from_sync0(pace.in_cycle(0)) < 6_000, "{off}");
            let next = pace.next_exchange() - sent;
            assert!((BUS.exchange..BUS.period + 2 * BUS.exchange).contains(&next), "{off}: {next}");
        }
    }
}
