//! Effects of real cranes beyond the published model, by name, so that each can be switched off.

use hydroboom_description::schema::KEYS;
use hydroboom_description::{Description, DescriptionError};

/// Effect of a real crane beyond the published model, which can be switched off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// More than three segments.
    Segments,
    /// Payload with inertia, off the boom's axis.
    PayloadShape,
    /// Compliance of the base frame, and bearing play.
    Base,
    /// LuGre friction in place of the published law.
    Friction,
    /// Pump leakage that increases with pressure and speed.
    Slip,
    /// Torque losses of the pump.
    TorqueLosses,
    /// Flow ripple of the pump's pistons.
    Ripple,
    /// Lag and torque limit of the servo drive.
    Drive,
    /// Delay of the 3/2 valve and its pilot lines.
    Valve,
    /// Dissolved air, with hysteresis.
    Air,
    /// Oil temperature other than the reference temperature.
    Temperature,
    /// Offset, noise, resolution and bandwidth of the sensors.
    Sensors,
    /// Delay of the fieldbus.
    Fieldbus,
}

impl Effect {
    /// All effects.
    pub const ALL: [Self; 13] = [
        Self::Segments,
        Self::PayloadShape,
        Self::Base,
        Self::Friction,
        Self::Slip,
        Self::TorqueLosses,
        Self::Ripple,
        Self::Drive,
        Self::Valve,
        Self::Air,
        Self::Temperature,
        Self::Sensors,
        Self::Fieldbus,
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Segments => "segments",
            Self::PayloadShape => "payload-shape",
            Self::Base => "base",
            Self::Friction => "friction",
            Self::Slip => "slip",
            Self::TorqueLosses => "torque-losses",
            Self::Ripple => "ripple",
            Self::Drive => "drive",
            Self::Valve => "valve",
            Self::Air => "air",
            Self::Temperature => "temperature",
            Self::Sensors => "sensors",
            Self::Fieldbus => "fieldbus",
        }
    }

    /// Parses a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|effect| effect.name() == name)
    }

    /// Keys of the effect: whole sections or single keys. Their defaults switch it off.
    fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Segments | Self::PayloadShape | Self::Friction => &[],
            Self::Base => &["base."],
            Self::Slip => &["pump.slip_"],
            Self::TorqueLosses => &["pump.torque_loss"],
            Self::Ripple => &["pump.ripple_percent"],
            Self::Drive => &["drive."],
            Self::Valve => &["switching_valve."],
            Self::Air => &["oil.air_shift_bar"],
            Self::Temperature => &["temperature."],
            Self::Sensors => &["sensors."],
            Self::Fieldbus => &["fieldbus."],
        }
    }

    /// Further overrides that switching off needs.
    fn overrides(self) -> &'static [&'static str] {
        match self {
            Self::Segments => &["boom.segments=3"],
            Self::PayloadShape => &["payload.y_mm=0", "payload.inertia_kgm2=0"],
            Self::Friction => &["friction.law=stribeck"],
            _ => &[],
        }
    }

    /// Switches the effect off in a description.
    ///
    /// # Errors
    ///
    /// [`DescriptionError`] if the crane is not valid without it. Keys that were set before the failure stay changed.
    pub fn remove_from(self, description: &mut Description) -> Result<(), DescriptionError> {
        for key in KEYS {
            let path = key.path();
            let concerned = self.keys().iter().any(|start| path.starts_with(start));
            if let Some(value) = key.absent.filter(|_| concerned) {
                description.set(&format!("{path}={value}"))?;
            }
        }
        self.overrides().iter().try_for_each(|assignment| description.set(assignment))
    }
}
