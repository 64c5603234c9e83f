//! Coupler: a device without process data, whose controller follows the requested state by itself.

use crate::al_status_code::AlStatusCode;
use crate::application::Application;
use crate::controller::DistributedClock;
use crate::device::{Device, Settings};
use crate::object_dictionary::ObjectDictionary;

/// An application that does nothing.
#[derive(Clone, Copy, Debug)]
struct NoApplication;

/// Bus coupler with these settings and this clock.
pub fn coupler(settings: Settings, clock: DistributedClock) -> Device {
    let settings = Settings {
        mailbox: None,
        outputs: None,
        inputs: None,
        has_device_emulation: true,
        ..settings
    };
    Device::new(settings, clock, ObjectDictionary::default(), Box::new(NoApplication))
}

impl Application for NoApplication {
    fn advance(&mut self, _: &mut ObjectDictionary, _: u64) {}

    fn outputs(&mut self, _: &mut ObjectDictionary, _: u64) {}

    fn inputs(&mut self, _: &mut ObjectDictionary, _: u64) {}

    fn outputs_are_lost(&mut self, _: &mut ObjectDictionary, _: u64, _: Option<AlStatusCode>) {}
}
