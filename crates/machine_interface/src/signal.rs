//! Signals of an axis that the interface carries, each with its name, and its unit in the name.

/// Signals that a machine sends of each axis, in their order in a datagram.
pub const MEASURED: [&str; 7] = [
    "stroke_m",
    "pressure_pump_a_pa",
    "pressure_a_pa",
    "pressure_b_pa",
    "pressure_pump_b_pa",
    "pressure_accumulator_pa",
    "motor_speed_rev_per_s",
];

/// Signals that a machine takes of each axis, in their order in a datagram.
pub const COMMANDED: [&str; 2] = ["motor_speed_rev_per_s", "holding_valve"];

/// Whether a signal may be used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Validity {
    /// A measured value of the datagram's sampling time.
    #[default]
    Good = 0,
    /// Not measured, or wire break.
    Absent = 1,
    /// Outside the sensor's range.
    OutOfRange = 2,
    /// Older than the sampling time.
    Stale = 3,
}

impl Validity {
    /// Of its number.
    pub fn of(number: u8) -> Option<Self> {
        [Self::Good, Self::Absent, Self::OutOfRange, Self::Stale]
            .into_iter()
            .find(|validity| *validity as u8 == number)
    }
}

/// State of the load-holding valve, where the machine reads it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum ValveState {
    /// Not read.
    #[default]
    Unknown = 0,
    /// Shut: the load is held.
    Shut = 1,
    /// Open.
    Open = 2,
}

impl ValveState {
    /// Of its number.
    pub fn of(number: u8) -> Option<Self> {
        [Self::Unknown, Self::Shut, Self::Open].into_iter().find(|state| *state as u8 == number)
    }
}

/// State of a machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum MachineState {
    /// Nothing is known of it.
    #[default]
    Absent = 0,
    /// It starts.
    Starting = 1,
    /// It measures, and its drives are without torque.
    Ready = 2,
    /// Its drives follow commands.
    Enabled = 3,
    /// A fault, which a person resets at the machine.
    Fault = 4,
}

impl MachineState {
    /// Of its number.
    pub fn of(number: u8) -> Option<Self> {
        [Self::Absent, Self::Starting, Self::Ready, Self::Enabled, Self::Fault]
            .into_iter()
            .find(|state| *state as u8 == number)
    }
}
