//! Steps of commissioning, and what the operator is asked to do in them.

/// A step of commissioning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The machine reports its identity.
    Identity,
    /// Measurements at rest, drives without torque.
    Listening,
    /// The operator opens the stop circuit, and the machine reports that its drives are off.
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

    /// What happens in it, for the operator.
    pub fn text(self) -> &'static str {
        match self {
            Self::Identity => "the machine reports its identity",
            Self::Listening => "measurements at rest, drives without torque; nothing moves",
            Self::StopCircuit => {
                "the drives are enabled for the first time, at zero speed: the motor may jerk. Then press the \
                 emergency stop"
            }
            Self::Watchdog => {
                "the motor turns slowly, valve shut, and commands are withheld; the load must not move, and more than \
                 1 mm stops the step"
            }
            Self::Polarity => {
                "the motor turns slowly, valve shut; the load must not move, and more than 1 mm stops the step"
            }
            Self::Release => {
                "the pump takes the load over and lifts it; the step stops if the load has moved by 3 mm"
            }
            Self::Travel => "5 mm against the load and back at up to 10 mm/s",
            Self::Delay => "delay from sampling to actuation",
            Self::StopDistance => "an immediate stop from up to 10 mm/s",
        }
    }

    /// Its place in [`ALL`](Self::ALL), from 0.
    pub fn place(self) -> usize {
        self as usize
    }

    /// The step after it; none after the last one.
    pub fn next(self) -> Option<Self> {
        Self::ALL.get(self.place() + 1).copied()
    }
}

/// Request to the operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Prompt {
    /// Open the stop circuit by hand.
    OpenStopCircuit,
    /// Confirm that the stop circuit was the cause, close it, and reset the machine.
    CloseStopCircuit,
    /// Reset the machine after its watchdog has stopped it, and confirm.
    ResetAfterWatchdog,
    /// Reset the machine, which has a fault after a reset, and confirm.
    ResetAgain,
    /// Start the slow turn of the motor in which commands are withheld.
    StartWatchdog,
    /// Start the slow turn of the motor that raises the pump side's pressure.
    StartPolarity,
    /// Start the lift of the load; travel and stop follow it.
    StartRelease,
}

impl Prompt {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::OpenStopCircuit,
        Self::CloseStopCircuit,
        Self::ResetAfterWatchdog,
        Self::ResetAgain,
        Self::StartWatchdog,
        Self::StartPolarity,
        Self::StartRelease,
    ];

    /// Text for the operator; `code` is that of the fault that the machine reports, none where it reports no fault.
    pub fn text(self, code: Option<u16>) -> String {
        let fault = match code {
            Some(code) => format!("fault code {code}"),
            None => "no fault".into(),
        };
        let reset =
            "reset the machine if it asks for that, then press Enter: it resets the machine only";
        let start = "Enter starts, Ctrl-C aborts";
        match self {
            Self::OpenStopCircuit => {
                "open the stop circuit now: press the emergency stop that is at the machine".into()
            }
            Self::CloseStopCircuit => format!(
                "the drives are no longer enabled (the machine reports {fault}). Was the emergency stop the cause? If \
                 it was not, Ctrl-C aborts. If it was, close the circuit, {reset}"
            ),
            Self::ResetAfterWatchdog => format!(
                "the machine has stopped without commands, as expected (it reports {fault}). Now {reset}"
            ),
            Self::ResetAgain => format!(
                "after the reset the machine reports {fault}. Remove its cause, {reset}; Ctrl-C aborts"
            ),
            Self::StartWatchdog => {
                format!("the motor turns now, valve shut, and commands are then withheld: {start}")
            }
            Self::StartPolarity => format!("the motor turns now, valve shut: {start}"),
            Self::StartRelease => format!(
                "the load is lifted now, and moves by some millimetres until the end without another question: {start}"
            ),
        }
    }

    /// Whether the operator confirms it.
    pub fn is_confirmed(self) -> bool {
        self != Self::OpenStopCircuit
    }
}
