//! Steps of commissioning, and what a person is asked to do in them.

/// A step of commissioning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The machine reports its identity.
    Identity,
    /// Measurements at rest, drives without torque.
    Listening,
    /// A person opens the stop circuit, and the machine reports it.
    StopCircuit,
    /// The machine's watchdog stops the motor where commands are withheld.
    Watchdog,
    /// A slow turn of the motor with the valve shut raises the pressure of the pump side that carries the load.
    Polarity,
    /// The pump takes the load over, and the valve opens.
    Release,
    /// A short travel up and down against the pump's volume: sign and scale.
    Travel,
    /// Delay from sampling to actuation.
    Delay,
    /// Stopping distance of the piston after an immediate stop.
    StopDistance,
}

impl Step {
    /// All of them, in their order.
    pub const ALL: [Self; 9] = [
        Self::Identity,
        Self::Listening,
        Self::StopCircuit,
        Self::Watchdog,
        Self::Polarity,
        Self::Release,
        Self::Travel,
        Self::Delay,
        Self::StopDistance,
    ];

    /// Name in records and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Identity => "identity",
            Self::Listening => "listening",
            Self::StopCircuit => "stop-circuit",
            Self::Watchdog => "watchdog",
            Self::Polarity => "polarity",
            Self::Release => "release",
            Self::Travel => "travel",
            Self::Delay => "delay",
            Self::StopDistance => "stop-distance",
        }
    }

    /// What happens in it, for the person at the machine.
    pub fn text(self) -> &'static str {
        match self {
            Self::Identity => "the machine reports its identity",
            Self::Listening => "measurements at rest, drives without torque; nothing moves",
            Self::StopCircuit => "the stop circuit is opened by hand; nothing moves",
            Self::Watchdog => {
                "the motor turns slowly, valve shut, and commands are withheld; the load does not move"
            }
            Self::Polarity => "the motor turns slowly, valve shut; the load does not move",
            Self::Release => "the pump takes the load over; the load is lifted by at most 3 mm",
            Self::Travel => "5 mm against the load and back at 10 mm/s",
            Self::Delay => "delay from sampling to actuation",
            Self::StopDistance => "an immediate stop from 10 mm/s",
        }
    }

    /// Its place in [`ALL`](Self::ALL).
    pub fn place(self) -> usize {
        self as usize
    }

    /// The one after it.
    pub fn next(self) -> Option<Self> {
        Self::ALL.get(self.place() + 1).copied()
    }
}

/// What a person is asked to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Prompt {
    /// Open the stop circuit by hand.
    OpenStopCircuit,
    /// Close the stop circuit, reset the machine, and confirm.
    CloseStopCircuit,
    /// Reset the machine after its watchdog has stopped it, and confirm.
    ResetAfterWatchdog,
}

impl Prompt {
    /// All of them.
    pub const ALL: [Self; 3] =
        [Self::OpenStopCircuit, Self::CloseStopCircuit, Self::ResetAfterWatchdog];

    /// Text for the person.
    pub fn text(self) -> &'static str {
        match self {
            Self::OpenStopCircuit => {
                "open the stop circuit now: press the emergency stop that is at the machine"
            }
            Self::CloseStopCircuit => {
                "the opening was detected. Close the circuit, reset the machine if it asks for that, then press Enter"
            }
            Self::ResetAfterWatchdog => {
                "the watchdog has stopped the machine, as expected. Reset it if it asks for that, then press Enter"
            }
        }
    }

    /// Whether a person confirms it.
    pub fn is_confirmed(self) -> bool {
        self != Self::OpenStopCircuit
    }
}
