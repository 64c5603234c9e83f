//! Signals of a crane model, and usual names of their columns.

use crate::dimension::Dimension;

/// Signal of a crane model. Values are in SI units: m, Pa (gauge pressure), rev/s; valves in shares or volts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Signal {
    /// Piston position \[m\].
    Stroke,
    /// Pressure on pump side A, p_PA \[Pa\].
    PressurePumpA,
    /// Pressure on the piston side, p_A \[Pa\].
    PressureA,
    /// Pressure on the rod side, p_B \[Pa\].
    PressureB,
    /// Pressure on pump side B, p_PB \[Pa\].
    PressurePumpB,
    /// Pressure in the accumulator, p_acc \[Pa\].
    PressureAccumulator,
    /// Motor speed, measured \[rev/s\].
    MotorSpeed,
    /// Motor speed, commanded \[rev/s\].
    MotorCommand,
    /// Load-holding valve \[-\]: 1 for open, 0 for shut.
    HoldingValve,
    /// Command of a proportional valve \[V\], or its share of the command for full spool travel \[-\].
    ValveCommand,
    /// Supply pressure of a proportional valve, p_P \[Pa\].
    PressureSupply,
    /// Tank-line pressure of a proportional valve, p_T \[Pa\].
    PressureTank,
}

impl Signal {
    /// All signals, in the order of the type.
    pub const ALL: [Self; 12] = [
        Self::Stroke,
        Self::PressurePumpA,
        Self::PressureA,
        Self::PressureB,
        Self::PressurePumpB,
        Self::PressureAccumulator,
        Self::MotorSpeed,
        Self::MotorCommand,
        Self::HoldingValve,
        Self::ValveCommand,
        Self::PressureSupply,
        Self::PressureTank,
    ];

    /// Signals of the crane in which model and log are compared: piston position and five pressures.
    pub const COMPARED: [Self; 6] = [
        Self::Stroke,
        Self::PressurePumpA,
        Self::PressureA,
        Self::PressureB,
        Self::PressurePumpB,
        Self::PressureAccumulator,
    ];

    /// Key in a mapping and in column names, as `pressure_a`.
    pub fn key(self) -> &'static str {
        match self {
            Self::Stroke => "stroke",
            Self::PressurePumpA => "pressure_pump_a",
            Self::PressureA => "pressure_a",
            Self::PressureB => "pressure_b",
            Self::PressurePumpB => "pressure_pump_b",
            Self::PressureAccumulator => "pressure_accumulator",
            Self::MotorSpeed => "motor_speed",
            Self::MotorCommand => "motor_command",
            Self::HoldingValve => "holding_valve",
            Self::ValveCommand => "valve_command",
            Self::PressureSupply => "pressure_supply",
            Self::PressureTank => "pressure_tank",
        }
    }

    /// Symbol in tables and figures, as `p_A`; the notation of the documents.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Stroke => "x_cyl",
            Self::PressurePumpA => "p_PA",
            Self::PressureA => "p_A",
            Self::PressureB => "p_B",
            Self::PressurePumpB => "p_PB",
            Self::PressureAccumulator => "p_acc",
            Self::MotorSpeed => "motor speed",
            Self::MotorCommand => "motor command",
            Self::HoldingValve => "valve",
            Self::ValveCommand => "valve command",
            Self::PressureSupply => "p_P",
            Self::PressureTank => "p_T",
        }
    }

    /// Display unit, and its size in SI units: mm and 1e-3, bar and 1e5, rpm and 1/60 (of rev/s), V and 1, or none
    /// ("-") and 1.
    pub fn shown(self) -> (&'static str, f64) {
        match self.dimension() {
            Dimension::Length => ("mm", 1e-3),
            Dimension::Pressure => ("bar", 1e5),
            Dimension::Rotation => ("rpm", 1.0 / 60.0),
            Dimension::Voltage => ("V", 1.0),
            _ => ("-", 1.0),
        }
    }

    /// Physical dimension of the signal, which its column's unit must have.
    pub fn dimension(self) -> Dimension {
        match self {
            Self::Stroke => Dimension::Length,
            Self::MotorSpeed | Self::MotorCommand => Dimension::Rotation,
            Self::HoldingValve => Dimension::Share,
            Self::ValveCommand => Dimension::Voltage,
            _ => Dimension::Pressure,
        }
    }

    /// Whether a column of this dimension can be the signal. A valve's command is a voltage, or the share of the
    /// command for full spool travel.
    pub fn accepts(self, dimension: Dimension) -> bool {
        dimension == self.dimension()
            || (self == Self::ValveCommand && dimension == Dimension::Share)
    }

    /// Signal of a key as written by [`key`](Self::key); none if there is no such signal.
    pub fn from_key(key: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|signal| signal.key() == key)
    }

    /// Usual column names, in small letters without separators; the most specific first.
    pub(crate) fn names(self) -> &'static [&'static str] {
        match self {
            Self::Stroke => &[
                "stroke",
                "xcyl",
                "pistonposition",
                "cylinderposition",
                "strokecyl",
                "s1",
                "position",
                "xp",
                "x",
            ],
            Self::PressurePumpA => &["pressurepumpa", "ppa", "pumpa", "ppumpa"],
            Self::PressureA => &["pressurea", "pa", "pcyla", "pistonpressure", "pistonside", "p1"],
            Self::PressureB => &["pressureb", "pb", "pcylb", "rodpressure", "rodside", "p2"],
            Self::PressurePumpB => &["pressurepumpb", "ppb", "pumpb", "ppumpb"],
            Self::PressureAccumulator => &["pressureaccumulator", "pacc", "accumulator", "accu"],
            Self::MotorSpeed => &[
                "motorspeed",
                "actualspeed",
                "speedact",
                "nmotor",
                "nact",
                "rpm",
                "speed",
                "n",
                "nm",
                "nmot",
            ],
            Self::MotorCommand => &[
                "commandmotorspeed",
                "motorcommand",
                "speedcommand",
                "speedset",
                "setspeed",
                "nset",
                "ncmd",
                "nref",
                "usm",
            ],
            Self::HoldingValve => {
                &["holdingvalve", "commandholdingvalve", "valve", "valveon", "y32", "solenoid"]
            }
            Self::ValveCommand => &[
                "valvecommand",
                "commandvalve",
                "spoolcommand",
                "u1controlsignal",
                "uvalve",
                "uv",
                "u1",
                "u",
            ],
            Self::PressureSupply => &["pressuresupply", "psupply", "supply", "pp", "ps"],
            Self::PressureTank => &["pressuretank", "ptank", "tank", "pt"],
        }
    }
}
