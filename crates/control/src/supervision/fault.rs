//! What can be wrong with a machine, and what to do about it.

/// Why the supervisor brought the machine to its safe state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// A reading is not a number.
    NotANumber,
    /// No new reading for too long: machine, fieldbus or its process.
    MachineLost,
    /// The piston position is outside what the cylinder has.
    PositionImplausible,
    /// The piston position changed faster than any piston can.
    PositionJumped,
    /// A signal has not changed at all for too long.
    SensorStuck,
    /// A signal scatters far more than its sensor does.
    SensorNoisy,
    /// A pressure is outside what its transducer or physics allow.
    PressureImplausible,
    /// A pressure changed faster than the oil allows.
    PressureJumped,
    /// A pressure is above the limit.
    OverPressure,
    /// The piston is too near an end of its stroke, and moves towards it.
    EndOfStroke,
    /// The piston is too far from where it should be.
    TrackingError,
    /// The piston moves faster than it was ever asked to.
    Runaway,
    /// The load moves although it is held.
    LoadNotHeld,
    /// The drive does not turn as it is told.
    DriveNotFollowing,
    /// The pump side does not reach the load's pressure.
    NoPreload,
    /// Too many deadlines were missed in a row.
    Overruns,
    /// Nobody has attended the machine for too long.
    OperatorLost,
    /// Somebody pressed the button.
    EmergencyStop,
    /// The controller asked for a speed that is not a number.
    ControllerInvalid,
    /// The clock went back, or far ahead.
    ClockJumped,
}

impl Cause {
    /// All of them.
    pub const ALL: [Self; 20] = [
        Self::NotANumber,
        Self::MachineLost,
        Self::PositionImplausible,
        Self::PositionJumped,
        Self::SensorStuck,
        Self::SensorNoisy,
        Self::PressureImplausible,
        Self::PressureJumped,
        Self::OverPressure,
        Self::EndOfStroke,
        Self::TrackingError,
        Self::Runaway,
        Self::LoadNotHeld,
        Self::DriveNotFollowing,
        Self::NoPreload,
        Self::Overruns,
        Self::OperatorLost,
        Self::EmergencyStop,
        Self::ControllerInvalid,
        Self::ClockJumped,
    ];

    /// Code in logs and messages.
    pub fn code(self) -> &'static str {
        match self {
            Self::NotANumber => "not-a-number",
            Self::MachineLost => "machine-lost",
            Self::PositionImplausible => "position-implausible",
            Self::PositionJumped => "position-jumped",
            Self::SensorStuck => "sensor-stuck",
            Self::SensorNoisy => "sensor-noisy",
            Self::PressureImplausible => "pressure-implausible",
            Self::PressureJumped => "pressure-jumped",
            Self::OverPressure => "over-pressure",
            Self::EndOfStroke => "end-of-stroke",
            Self::TrackingError => "tracking-error",
            Self::Runaway => "runaway",
            Self::LoadNotHeld => "load-not-held",
            Self::DriveNotFollowing => "drive-not-following",
            Self::NoPreload => "no-preload",
            Self::Overruns => "overruns",
            Self::OperatorLost => "operator-lost",
            Self::EmergencyStop => "emergency-stop",
            Self::ControllerInvalid => "controller-invalid",
            Self::ClockJumped => "clock-jumped",
        }
    }

    /// What a person should look at.
    pub fn advice(self) -> &'static str {
        match self {
            Self::NotANumber => {
                "a reading is not a number: look at the fieldbus mapping and the sensor"
            }
            Self::MachineLost => "no new readings: is the machine's process or its bus alive?",
            Self::PositionImplausible => {
                "position outside the stroke: look at the encoder and its zero"
            }
            Self::PositionJumped => "position jumped: look at the encoder's cable and supply",
            Self::SensorStuck => {
                "a signal stands still to the last digit: look at its cable and input"
            }
            Self::SensorNoisy => "a signal scatters: look at its cable, shield and supply",
            Self::PressureImplausible => "a pressure is outside its transducer's range: look at it",
            Self::PressureJumped => "a pressure jumped: look at transducer, hose and line",
            Self::OverPressure => {
                "pressure above the limit: is the load too heavy, or a valve shut?"
            }
            Self::EndOfStroke => "piston near its stop: look at the course and the controller",
            Self::TrackingError => "piston far from its reference: look at pump, valves and load",
            Self::Runaway => "piston too fast: has a line burst, or the load fallen off?",
            Self::LoadNotHeld => "the load creeps while held: look at the load-holding valves",
            Self::DriveNotFollowing => "drive does not follow: look at its state and its limits",
            Self::NoPreload => "no pressure on the pump side: look at pump, drive and lines",
            Self::Overruns => "deadlines missed: run `hydroboom doctor`",
            Self::OperatorLost => "nobody attends: connect again, then reset",
            Self::EmergencyStop => "emergency stop: find out why, then reset",
            Self::ControllerInvalid => "the controller failed: look at the log",
            Self::ClockJumped => "the clock jumped: look at the machine's time source",
        }
    }

    /// Whether position, pressures and drive can still be trusted, so that the load may be brought to
    /// rest before it is held. If not it is held at once.
    pub fn stops_softly(self) -> bool {
        matches!(
            self,
            Self::TrackingError
                | Self::EndOfStroke
                | Self::Overruns
                | Self::OperatorLost
                | Self::OverPressure
        )
    }
}
