//! True quantities of a virtual crane.

use hydroboom_model::Outputs;

/// True quantities without sensor errors and delay, for evaluation only; no controller may use them.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    /// Outputs of the plant model; pressures are gauge.
    pub outputs: Outputs<f64>,
    /// Motor speed \[rev/s\].
    pub motor_speed: f64,
    /// Load torque of the pump on the motor, positive where it brakes positive speed \[N·m\].
    pub motor_torque: f64,
    /// Position of the load-holding valves' pilots \[1\]: 0 shut, 1 open.
    pub pilot: f64,
    /// Oil temperature \[°C\].
    pub oil_temperature: f64,
    /// Power dissipated as heat \[W\].
    pub heat: f64,
    /// Transition pressure p_c1 of the piston side's oil, with its temperature and dissolved air \[Pa\].
    pub transition_pressure: f64,
}

impl Truth {
    /// Names of the quantities beyond the plant's outputs.
    pub const NAMES: [&str; 5] =
        ["motor_speed", "motor_torque_nm", "pilot", "oil_temperature_c", "heat_w"];
    /// Units of these quantities; empty where the name ends with the unit.
    pub const UNITS: [&str; 5] = ["rev/s", "", "", "", ""];

    /// Meanings of these quantities.
    pub const MEANINGS: [&str; 5] = [
        "Motor speed",
        "Load torque of the pump on the motor",
        "Position of the load-holding valves' pilots, 0 to 1",
        "Oil temperature",
        "Power dissipated as heat",
    ];

    /// Values of the quantities beyond the plant's outputs, in the order of [`NAMES`](Self::NAMES).
    pub fn beside_outputs(&self) -> [f64; 5] {
        [self.motor_speed, self.motor_torque, self.pilot, self.oil_temperature, self.heat]
    }
}
