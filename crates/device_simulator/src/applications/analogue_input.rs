//! Analogue inputs of 4 to 20 mA, each with a status word: below and beyond the range, wire break.

use super::{add_identity, add_process_data};
use crate::al_status_code::AlStatusCode;
use crate::application::Application;
use crate::controller::DistributedClock;
use crate::device::{Device, Settings};
use crate::object_dictionary::{Mapping, ObjectAccess, ObjectDictionary};

/// Source of the input currents of an analogue input, 4 to 20 mA; 0 mA for a broken wire.
pub trait CurrentSource {
    /// Advances the source to the time `now` \[ns\].
    fn advance(&mut self, now: u64);
    /// Input current of a channel, counted from 0 \[mA\].
    fn current(&self, channel: usize) -> f64;
}

/// Application of an analogue input device: for each channel a status word and counts, 0 to 32767 for 4 to 20 mA.
pub struct AnalogueInput {
    /// Currents of the channels.
    source: Box<dyn CurrentSource>,
    /// Number of channels.
    channels: usize,
}

impl std::fmt::Debug for AnalogueInput {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("AnalogueInput").field("channels", &self.channels).finish_non_exhaustive()
    }
}

/// Counts of 20 mA; 4 mA are none.
const FULL_SCALE: f64 = 32767.0;
/// Currents between which a reading is in range \[mA\] (NAMUR NE 43: 3.8 to 20.5).
const RANGE: [f64; 2] = [3.8, 20.5];
/// Current below which a wire is broken \[mA\] (NAMUR NE 43).
const WIRE_BREAK_CURRENT: f64 = 3.6;

/// First index of the channels' objects: status in subindex 1, value in subindex 17.
const FIRST: u16 = 0x6000;

impl AnalogueInput {
    /// Analogue input device with a number of channels n from 0, each with status 0x60n0:01 and value 0x60n0:11, both
    /// of 16 bits. Range and wire break are by NAMUR NE 43: 3.8 to 20.5 mA, below 3.6 mA.
    pub fn device(
        settings: Settings,
        channels: usize,
        clock: DistributedClock,
        source: Box<dyn CurrentSource>,
    ) -> Device {
        let settings = Settings { outputs: None, ..settings };
        let mut dictionary = ObjectDictionary::default();
        add_identity(&mut dictionary, &settings, 0x012c_1389);
        let mut entries = Vec::new();
        for channel in 0..channels as u16 {
            let index = FIRST + 0x10 * channel;
            for (sub, bytes) in [(1, 2), (17, 2)] {
                let value = vec![0; bytes];
                dictionary.add((index, sub), &value, ObjectAccess::ReadOnly, Mapping::Inputs);
                entries.push((index, sub, 16));
            }
        }
        let access = ObjectAccess::ReadOnly;
        add_process_data(&mut dictionary, [0x1c13, 0x1a00], &entries, access);
        dictionary.add((0x1c12, 0), &[0], access, Mapping::None);
        Device::new(settings, clock, dictionary, Box::new(Self { source, channels }))
    }
}

/// Bit of the status word: below the range.
const UNDERRANGE: i64 = 0x0001;
/// Above the range.
const OVERRANGE: i64 = 0x0002;
/// Error: the value is not valid.
const ERROR: i64 = 0x0040;
/// Wire break.
const WIRE_BREAK: i64 = 0x0080;

impl Application for AnalogueInput {
    fn advance(&mut self, _: &mut ObjectDictionary, now: u64) {
        self.source.advance(now);
    }

    fn outputs(&mut self, _: &mut ObjectDictionary, _: u64) {}

    fn inputs(&mut self, dictionary: &mut ObjectDictionary, _: u64) {
        for channel in 0..self.channels {
            let current = self.source.current(channel);
            let status = match current {
                _ if current < WIRE_BREAK_CURRENT || current.is_nan() => {
                    UNDERRANGE | ERROR | WIRE_BREAK
                }
                _ if current < RANGE[0] => UNDERRANGE,
                _ if current > RANGE[1] => OVERRANGE | ERROR,
                _ => 0,
            };
            let share = (current - 4.0) / 16.0;
            let counts = (FULL_SCALE * share).round().clamp(-FULL_SCALE, FULL_SCALE);
            let index = FIRST + 0x10 * channel as u16;
            dictionary.set_number((index, 1), status);
            dictionary.set_number((index, 17), counts as i64);
        }
    }

    fn outputs_are_lost(&mut self, _: &mut ObjectDictionary, _: u64, _: Option<AlStatusCode>) {}
}
