//! Physical dimensions of units.

/// Physical dimension of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// Length.
    Length,
    /// Speed.
    Speed,
    /// Acceleration.
    Acceleration,
    /// Pressure.
    Pressure,
    /// Rotational speed, or rate of an angle.
    Rotation,
    /// Angle.
    Angle,
    /// Time.
    Time,
    /// Frequency, for example of an inverter: motor speed is frequency over pole pairs.
    Frequency,
    /// Voltage, for example of a valve's command.
    Voltage,
    /// Electric current.
    Current,
    /// Dimensionless: a share or a switch.
    Share,
    /// Temperature.
    Temperature,
    /// Volume flow.
    Flow,
    /// Volume.
    Volume,
    /// Force.
    Force,
    /// Torque.
    Torque,
    /// Mass.
    Mass,
    /// Power.
    Power,
}

impl Dimension {
    /// Name of the dimension with its article, as "a pressure", for messages.
    pub fn words(self) -> &'static str {
        match self {
            Self::Length => "a length",
            Self::Speed => "a speed",
            Self::Acceleration => "an acceleration",
            Self::Pressure => "a pressure",
            Self::Rotation => "a rotational speed",
            Self::Angle => "an angle",
            Self::Time => "a time",
            Self::Frequency => "a frequency",
            Self::Voltage => "a voltage",
            Self::Current => "a current",
            Self::Share => "a share",
            Self::Temperature => "a temperature",
            Self::Flow => "a flow",
            Self::Volume => "a volume",
            Self::Force => "a force",
            Self::Torque => "a torque",
            Self::Mass => "a mass",
            Self::Power => "a power",
        }
    }
}
