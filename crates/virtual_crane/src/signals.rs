//! What nobody sees of a virtual crane.

use hydroboom_model::Outputs;

/// What no data acquisition would see.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    /// The crane itself.
    pub outputs: Outputs<f64>,
    /// Motor speed \[rev/s\].
    pub motor_speed: f64,
    /// Torque the pump asks of the motor \[N·m\].
    pub motor_torque: f64,
    /// Position of the pilots, 0 to 1.
    pub pilot: f64,
    /// Oil temperature \[°C\].
    pub oil_temperature: f64,
    /// Power lost as heat \[W\].
    pub heat: f64,
    /// Pressure at which the oil on the piston side stiffens, by its temperature and dissolved air \[Pa\].
    pub transition_pressure: f64,
}

impl Truth {
    /// Names of what stands beside the outputs.
    pub const NAMES: [&str; 5] =
        ["motor_speed", "motor_torque_nm", "pilot", "oil_temperature_c", "heat_w"];
    /// Their units, where the name does not say.
    pub const UNITS: [&str; 5] = ["rev/s", "", "", "", ""];

    /// What they mean.
    pub const MEANINGS: [&str; 5] = [
        "Motor speed",
        "Torque the pump asks of the motor",
        "Position of the load-holding valves' pilots, 0 to 1",
        "Oil temperature",
        "Power lost as heat",
    ];

    /// What stands beside the outputs, in the order of [`NAMES`](Self::NAMES).
    pub fn beside_outputs(&self) -> [f64; 5] {
        [self.motor_speed, self.motor_torque, self.pilot, self.oil_temperature, self.heat]
    }
}
