//! Delay from a piston position to the effect of the resulting command: sensors, fieldbus, control period,
//! dead time of the drive.
//!
//! A measurement of period k arrives c cycles later. Its command arrives c cycles after that and acts in
//! the following period. The lag of the position sensor counts as dead time, an approximation for signals
//! slow compared with its bandwidth. The lag of the drive does not count: with a known reference the
//! command is advanced by it.

use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::known_delay;
use std::f64::consts::TAU;

/// Components of the delay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Delay {
    /// Control period \[s\].
    pub period: f64,
    /// Delay of the fieldbus in each direction \[cycles\].
    pub fieldbus_cycles: u32,
    /// Lag of the position sensor \[s\].
    pub sensor_lag: f64,
    /// Dead time of the drive \[s\].
    pub dead_time: f64,
}

impl Delay {
    /// Delays of a crane file; those of equipment that the file does not have are zero.
    pub fn of(crane: &Description) -> Self {
        let n = &crane.numbers;
        let bandwidth = n.sensor_bandwidth;
        Self {
            period: n.control_period,
            fieldbus_cycles: if n.fieldbus_delay > 0.0 { known_delay(crane) } else { 0 },
            sensor_lag: if bandwidth > 0.0 { 1.0 / (TAU * bandwidth) } else { 0.0 },
            dead_time: n.drive_dead_time,
        }
    }

    /// Total delay \[control periods\], not rounded.
    pub fn periods(&self) -> f64 {
        2.0 * f64::from(self.fieldbus_cycles)
            + 1.0
            + (self.sensor_lag + self.dead_time) / self.period
    }

    /// Delay from new information to the motor \[whole control periods\]: the fieldbus to the drive and the drive's
    /// dead time.
    pub fn command_periods(&self) -> usize {
        // a quotient of decimal fractions may lie just below a whole number
        self.fieldbus_cycles as usize + (self.dead_time / self.period + 1e-9) as usize
    }

    /// Total delay \[s\].
    pub fn time(&self) -> f64 {
        self.periods() * self.period
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two cycles in each direction, one control period, half a period of the sensor, one and a half
    /// periods of the drive.
    #[test]
    fn all_parts_of_the_delay_add_up() {
        let delay =
            Delay { period: 1e-3, fieldbus_cycles: 2, sensor_lag: 0.5e-3, dead_time: 1.5e-3 };
        assert!((delay.periods() - 7.0).abs() < 1e-12 && (delay.time() - 7e-3).abs() < 1e-15);
        // two cycles to the drive and the whole period of its dead time
        assert_eq!(delay.command_periods(), 3);
        let mut crane = Description::uia_virtual().unwrap();
        let before = Delay::of(&crane).periods();
        crane.numbers.drive_dead_time = 3e-3;
        assert!((Delay::of(&crane).periods() - before - 3.0).abs() < 1e-9);
        // an ideal machine has the control period alone
        assert_eq!(Delay::of(&Description::uia_single_boom().unwrap()).periods(), 1.0);
    }
}
