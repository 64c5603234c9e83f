//! A segment: devices in a line, through which a frame goes and comes back.

use crate::device::Device;
use crate::frame::for_each_datagram;

/// EtherCAT segment: devices in a line, the first next to the main device.
#[derive(Debug, Default)]
pub struct Segment {
    /// Devices in the order of their positions.
    devices: Vec<Device>,
    /// Propagation delay to each device from the one before \[ns\].
    delays: Vec<u64>,
    /// Number of connected devices; those behind a broken cable are not.
    connected: usize,
    /// Number of frames that are still to be lost.
    lost: u32,
}

/// Delay of a frame through a device \[ns\], typical for MII ports. Estimate.
pub const TYPICAL_DELAY: u64 = 550;

impl Segment {
    /// Line of devices with typical delays.
    pub fn new(devices: Vec<Device>) -> Self {
        let mut segment = Self {
            delays: vec![TYPICAL_DELAY; devices.len()],
            connected: devices.len(),
            devices,
            lost: 0,
        };
        segment.set_links();
        segment
    }

    /// Sets the propagation delay to each device from the one before \[ns\], the first from the main device. Devices
    /// without an entry keep [`TYPICAL_DELAY`]; entries beyond the last device are ignored.
    pub fn with_delays(mut self, delays: &[u64]) -> Self {
        self.delays.iter_mut().zip(delays).for_each(|(to, from)| *to = *from);
        self
    }

    /// Devices, from the first to the last.
    pub fn devices(&self) -> &[Device] {
        &self.devices
    }

    /// Devices, mutable to inject faults.
    pub fn devices_mut(&mut self) -> &mut [Device] {
        &mut self.devices
    }

    /// Sets the number of connected devices: breaks the cable behind them, or mends it with the number of all. A
    /// larger number counts as all.
    pub fn connect(&mut self, devices: usize) {
        self.connected = devices.min(self.devices.len());
        self.set_links();
    }

    /// Loses the next `count` frames on their way back.
    pub fn lose_frames(&mut self, count: u32) {
        self.lost = count;
    }

    /// Writes the links of the ports of all devices.
    fn set_links(&mut self) {
        let last = self.connected.saturating_sub(1);
        for (number, device) in self.devices.iter_mut().enumerate() {
            device.controller.set_links(number == last);
        }
    }

    /// Advances all devices to the time `now` \[ns\], without a frame.
    pub fn advance(&mut self, now: u64) {
        self.devices.iter_mut().for_each(|device| device.advance(now));
    }

    /// Passes a frame through the devices and back, from the time `now` \[ns\]. Returns false if nothing comes back:
    /// an incomplete EtherCAT frame, no device, or a lost or damaged frame.
    pub fn process(&mut self, frame: &mut [u8], now: u64) -> bool {
        let connected = &mut self.devices[..self.connected];
        let arrivals: Vec<u64> = self
            .delays
            .iter()
            .scan(now, |time, delay| {
                *time += delay;
                Some(*time)
            })
            .take(self.connected)
            .collect();
        let Some(turnaround) = arrivals.last().copied() else { return false };
        let (mut is_complete, mut is_damaged) = (false, false);
        for (number, (device, arrival)) in connected.iter_mut().zip(&arrivals).enumerate() {
            device.advance(*arrival);
            let is_last = number + 1 == arrivals.len();
            // the frame comes back from the last device as late as it went there
            let return_time = (!is_last).then(|| 2 * turnaround - arrival);
            device.controller.ports = [Some(*arrival), return_time, None, None];
            // a damaged frame goes on, and nobody takes anything from it
            if is_damaged {
                device.controller.count_forwarded_frame(0);
                continue;
            }
            is_damaged = !device.receives_undamaged(0);
            if is_damaged {
                continue;
            }
            let is_accepted = device.accepts_frame();
            is_complete = for_each_datagram(frame, |datagram| {
                if is_accepted {
                    device.process_datagram(datagram, *arrival);
                }
            });
            if !is_complete {
                return false;
            }
        }
        // back from the last device, by the ports behind which others are
        for device in connected.iter_mut().rev().skip(1) {
            if is_damaged {
                device.controller.count_forwarded_frame(1);
            } else {
                is_damaged = !device.receives_undamaged(1);
            }
        }
        // those behind a broken cable live on
        self.devices[self.connected..].iter_mut().for_each(|device| device.advance(now));
        if self.lost > 0 {
            self.lost -= 1;
            return false;
        }
        is_complete && !is_damaged
    }
}
