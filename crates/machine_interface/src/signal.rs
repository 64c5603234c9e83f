//! Signals of an axis that the interface carries, each with its name, and its unit in the name.

/// Measured signals of an axis, in their order in a datagram. Names end with the unit.
pub const MEASURED: [&str; 7] = [
    "stroke_m",
    "pressure_pump_a_pa",
    "pressure_a_pa",
    "pressure_b_pa",
    "pressure_pump_b_pa",
    "pressure_accumulator_pa",
    "motor_speed_rev_per_s",
];

/// Commanded signals of an axis, in their order in a datagram. Names end with the unit.
pub const COMMANDED: [&str; 2] = ["motor_speed_rev_per_s", "holding_valve"];

/// Validity of a measured signal, with its number in a datagram.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Validity {
    /// Measured at the datagram's sampling time.
    #[default]
    Good = 0,
    /// Not measured, or wire broken.
    Absent = 1,
    /// Outside the sensor's range.
    OutOfRange = 2,
    /// Measured earlier than the sampling time.
    Stale = 3,
}

impl Validity {
    /// Validity by its number in a datagram; `None` for an undefined number.
    pub fn of(number: u8) -> Option<Self> {
        [Self::Good, Self::Absent, Self::OutOfRange, Self::Stale]
            .into_iter()
            .find(|validity| *validity as u8 == number)
    }
}

/// State of the load-holding valve by its position switch, with its number in a datagram.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum ValveState {
    /// Unknown: without a position switch.
    #[default]
    Unknown = 0,
    /// Shut: the load is held.
    Shut = 1,
    /// Open: the load is released.
    Open = 2,
}

impl ValveState {
    /// State by its number in a datagram; `None` for an undefined number.
    pub fn of(number: u8) -> Option<Self> {
        [Self::Unknown, Self::Shut, Self::Open].into_iter().find(|state| *state as u8 == number)
    }
}

/// State of a machine, with its number in a datagram.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum MachineState {
    /// Unknown.
    #[default]
    Absent = 0,
    /// Starting up.
    Starting = 1,
    /// Measuring, with its drives without torque.
    Ready = 2,
    /// Drives follow commands.
    Enabled = 3,
    /// Fault, to be reset by a person at the machine.
    Fault = 4,
}

impl MachineState {
    /// State by its number in a datagram; `None` for an undefined number.
    pub fn of(number: u8) -> Option<Self> {
        [Self::Absent, Self::Starting, Self::Ready, Self::Enabled, Self::Fault]
            .into_iter()
            .find(|state| *state as u8 == number)
    }
}
