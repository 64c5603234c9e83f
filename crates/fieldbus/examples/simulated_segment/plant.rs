//! What is behind the devices: a virtual crane, which goes on a control period at each SYNC0.

use hydroboom_control::command::AxisCommand;
use hydroboom_virtual_crane::VirtualCrane;

/// A virtual crane and the outputs of the devices.
pub struct Plant {
    /// The crane.
    pub crane: VirtualCrane,
    /// What the devices' outputs say now.
    pub command: AxisCommand<f64>,
    /// What acts in the period that began at the last SYNC0, until that is simulated.
    acting: Option<AxisCommand<f64>>,
    /// When that was \[ns\].
    latched: Option<u64>,
    /// Why the crane cannot go on.
    pub broken: Option<String>,
}

impl Plant {
    /// With the load held.
    pub fn new(crane: VirtualCrane) -> Self {
        let command = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };
        Self { crane, command, acting: None, latched: None, broken: None }
    }

    /// SYNC0 at a time \[ns\], of any of the devices: a period ends, and the next begins with the outputs that were
    /// taken over.
    pub fn latch(&mut self, now: u64) {
        let half = (0.5e9 * self.crane.period()) as u64;
        if self.latched.is_some_and(|latched| now < latched + half) {
            return;
        }
        self.simulate();
        self.latched = Some(now);
        self.acting = Some(self.command);
    }

    /// Simulates the period that began at the last SYNC0, which is soon enough before the next one.
    pub fn simulate(&mut self) {
        if let Some(command) = self.acting.take().filter(|_| self.broken.is_none()) {
            self.broken = self.crane.advance(&command).err().map(|error| error.to_string());
        }
    }
}
