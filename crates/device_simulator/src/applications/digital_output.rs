//! Digital outputs: a bit each, off where outputs are lost.

use super::add_process_data;
use crate::al_status_code::AlStatusCode;
use crate::application::Application;
use crate::controller::DistributedClock;
use crate::device::{Area, Device, Settings};
use crate::object_dictionary::{Mapping, ObjectAccess, ObjectDictionary};

/// Receiver of the output states, called with one bit per channel, channel 0 in bit 0.
pub type OutputCallback = Box<dyn FnMut(u32)>;

/// Application of a digital output device.
pub struct DigitalOutput {
    /// Receiver of the output states.
    callback: OutputCallback,
    /// Number of channels, at most 32.
    channels: u8,
}

impl std::fmt::Debug for DigitalOutput {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DigitalOutput").field("channels", &self.channels).finish_non_exhaustive()
    }
}

/// First index of the channels' objects.
const FIRST: u16 = 0x7000;

impl DigitalOutput {
    /// Digital output device with a number of channels, without a mailbox; more than 32 count as 32.
    pub fn device(
        settings: Settings,
        channels: u8,
        clock: DistributedClock,
        callback: OutputCallback,
    ) -> Device {
        let channels = channels.min(32);
        let outputs = Some(Area { sync_manager: 0, start: 0x1000, length: 4 });
        let settings = Settings { mailbox: None, outputs, inputs: None, ..settings };
        let mut dictionary = ObjectDictionary::default();
        let access = ObjectAccess::ReadOnly;
        let mut entries = Vec::new();
        for channel in 0..u16::from(channels) {
            let index = FIRST + 0x10 * channel;
            dictionary.add((index, 1), &[0], access, Mapping::Outputs);
            entries.push((index, 1, 1));
        }
        add_process_data(&mut dictionary, [0x1c12, 0x1600], &entries, access);
        dictionary.add((0x1c13, 0), &[0], access, Mapping::None);
        Device::new(settings, clock, dictionary, Box::new(Self { callback, channels }))
    }
}

impl Application for DigitalOutput {
    fn advance(&mut self, _: &mut ObjectDictionary, _: u64) {}

    fn outputs(&mut self, dictionary: &mut ObjectDictionary, _: u64) {
        let bit = |k: u8| dictionary.unsigned((FIRST + 0x10 * u16::from(k), 1)) as u32 & 1;
        (self.callback)((0..self.channels).fold(0, |bits, k| bits | bit(k) << k));
    }

    fn inputs(&mut self, _: &mut ObjectDictionary, _: u64) {}

    fn outputs_are_lost(&mut self, _: &mut ObjectDictionary, _: u64, _: Option<AlStatusCode>) {
        (self.callback)(0);
    }
}
