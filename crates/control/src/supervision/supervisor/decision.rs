//! States of the supervisor, requests of an operator, and decision of a control period.

use crate::command::AxisCommand;
use crate::supervision::fault::Cause;
use crate::supervision::waiting::Waiting;

/// State of the supervisor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Initial state: nothing requested, motor at zero, valve shut.
    Idle,
    /// Machine observed: measurements are plausible, motor at zero, valve shut.
    Ready,
    /// Load held by the shut valves; before a motion the pump takes it over.
    Holding,
    /// Valves open, controller active.
    Moving,
    /// Controlled stop, then the load is held.
    Stopping,
    /// Fault: the load is held until a person resets.
    Fault,
}

impl State {
    /// All states.
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

    /// State with this name; `None` for an unknown name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.name() == name)
    }
}

/// Request of an operator, or of a program on his behalf.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Request {
    /// No request.
    #[default]
    None,
    /// Observe the machine.
    Enable,
    /// Switch the drive on, with the load held.
    Hold,
    /// Release the load and start the course.
    Start,
    /// Controlled stop, then hold the load.
    Stop,
    /// Hold the load at once.
    EmergencyStop,
    /// Leave a fault: observe the machine again.
    Reset,
}

/// Output of the supervisor in a control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision {
    /// Command to the machine.
    pub command: AxisCommand<f64>,
    /// State of the supervisor.
    pub state: State,
    /// Cause of the fault in [`State::Fault`], else `None`.
    pub cause: Option<Cause>,
    /// Whether the controller is active; the course then advances.
    pub controls: bool,
    /// Whether a release of the load is under way.
    pub releasing: bool,
    /// Condition that the state waits for.
    pub waiting: Waiting,
    /// Time for which it has waited for this condition \[s\].
    pub waited: f64,
    /// Amplitude \[m\] and frequency \[Hz\] of a sustained oscillation found since the controller became active, else
    /// `None`.
    pub oscillation: Option<[f64; 2]>,
}

impl Decision {
    /// Decision of an idle machine: valve shut, motor at zero.
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

    /// Whether the command is: motor at zero, load held.
    pub fn is_at_rest(&self) -> bool {
        self.command == HELD
    }

    /// Whether the machine's drives are enabled: from Holding on, until a stop has ended.
    pub fn is_enabled(&self) -> bool {
        let acts = matches!(self.state, State::Holding | State::Moving | State::Stopping);
        acts || !self.is_at_rest()
    }
}

/// Motor at zero, load held.
pub(super) const HELD: AxisCommand<f64> = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };
