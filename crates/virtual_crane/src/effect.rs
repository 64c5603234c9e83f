//! What a real crane has and the published model leaves out, by name, to be switched off.

use hydroboom_description::schema::KEYS;
use hydroboom_description::{Description, DescriptionError};

/// One effect of the virtual crane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// More than three segments.
    Segments,
    /// Payload with inertia, off the boom's axis.
    PayloadShape,
    /// Base frame that gives way, bearings with play.
    Base,
    /// LuGre friction in place of the published law.
    Friction,
    /// Pump leakage that grows with pressure and speed.
    Slip,
    /// Torque lost in the pump.
    TorqueLosses,
    /// Flow ripple of the pump's pistons.
    Ripple,
    /// Lag and torque limit of the servo drive.
    Drive,
    /// Delay of the 3/2 valve and its pilot lines.
    Valve,
    /// Air that dissolves and comes out again.
    Air,
    /// Oil that is warmer or colder than its parameters.
    Temperature,
    /// Errors, noise, resolution and bandwidth of the sensors.
    Sensors,
    /// Delay of the fieldbus.
    Fieldbus,
}

impl Effect {
    /// All of them.
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

    /// Name at the command line.
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

    /// The effect with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|effect| effect.name() == name)
    }

    /// Keys that make it: a whole section, or a key. Off is their value where a file lacks them.
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

    /// Overrides beside those keys.
    fn overrides(self) -> &'static [&'static str] {
        match self {
            Self::Segments => &["boom.segments=3"],
            Self::PayloadShape => &["payload.y_mm=0", "payload.inertia_kgm2=0"],
            Self::Friction => &["friction.law=stribeck"],
            _ => &[],
        }
    }

    /// Switches the effect off.
    ///
    /// # Errors
    ///
    /// [`DescriptionError`] where the machine is not possible without it.
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
