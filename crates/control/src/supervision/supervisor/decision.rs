//! States of the supervisor, requests of a person, and what is decided in a control period.

use crate::command::AxisCommand;
use crate::supervision::fault::Cause;
use crate::supervision::waiting::Waiting;

/// What the machine is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Nothing has been asked for; nothing acts.
    Idle,
    /// Readings are plausible; nothing acts.
    Ready,
    /// The load hangs on its valves; before a motion the pump takes it over.
    Holding,
    /// The valves are open, the controller moves the load.
    Moving,
    /// The load is brought to rest, then held.
    Stopping,
    /// Something was wrong; the load is held until a person resets.
    Fault,
}

impl State {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Idle, Self::Ready, Self::Holding, Self::Moving, Self::Stopping, Self::Fault];

    /// Name in logs and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Idle => "Idle",
            Self::Ready => "Ready",
            Self::Holding => "Holding",
            Self::Moving => "Moving",
            Self::Stopping => "Stopping",
            Self::Fault => "Fault",
        }
    }

    /// The state of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.name() == name)
    }
}

/// What a person, or the program for him, asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Request {
    /// Nothing.
    #[default]
    None,
    /// Watch the machine.
    Enable,
    /// Switch the drive on, load held.
    Hold,
    /// Release the load and move.
    Start,
    /// Come to rest and hold.
    Stop,
    /// Hold at once.
    EmergencyStop,
    /// After a fault: watch the machine again.
    Reset,
}

/// What is to be sent, and what the machine is doing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision {
    /// What to send.
    pub command: AxisCommand<f64>,
    /// What the machine is doing.
    pub state: State,
    /// Why it is in [`State::Fault`].
    pub cause: Option<Cause>,
    /// Whether the controller has the load: then its course runs.
    pub controls: bool,
    /// Whether a release is under way: the pump proves that it carries the load.
    pub releasing: bool,
    /// What the state waits for.
    pub waiting: Waiting,
    /// For how long it has waited for that \[s\].
    pub waited: f64,
    /// Amplitude \[m\] and frequency \[Hz\] of a sustained oscillation that was found while the controller has had
    /// the load.
    pub oscillation: Option<[f64; 2]>,
}

impl Decision {
    /// Of a machine that nothing has been asked of: valve shut, motor at zero.
    pub const IDLE: Self = Self {
        command: HELD,
        state: State::Idle,
        cause: None,
        controls: false,
        releasing: false,
        waiting: Waiting::Enable,
        waited: 0.0,
        oscillation: None,
    };

    /// Whether motor and valve are commanded to rest.
    pub fn is_at_rest(&self) -> bool {
        self.command == HELD
    }

    /// Whether the machine's drives are to follow: from Holding on, and until a stop has ended.
    pub fn is_enabled(&self) -> bool {
        let acts = matches!(self.state, State::Holding | State::Moving | State::Stopping);
        acts || !self.is_at_rest()
    }
}

/// Motor at zero, load held.
pub(super) const HELD: AxisCommand<f64> = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };
