//! Conditions that the supervisor's states wait for.

use super::fault::Cause;
use super::release::phase;

/// Condition that a state of the supervisor waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Waiting {
    /// An operator enables the machine.
    Enable,
    /// The measurements become plausible; the cause says which are not.
    Measurements(Cause),
    /// An operator takes control.
    Operator,
    /// The load comes to rest.
    StillLoad,
    /// The drive is switched on.
    Hold,
    /// The machine reports that its drives are enabled.
    Drives,
    /// The operator starts a course.
    Start,
    /// The position has been observed before the pump turns.
    Observation,
    /// The pump has lifted the load.
    Lift,
    /// The lifted load has settled.
    Settling,
    /// The load-holding valve has opened.
    ValveOpening,
    /// The course has ended.
    CourseEnd,
    /// The load has come to rest after a stop.
    Standstill,
    /// An operator resets, after all causes have gone.
    Reset,
}

impl Waiting {
    /// During a release, by its phase.
    pub(super) fn of_release(at: f64) -> Self {
        if at < phase::FILLING {
            Self::Observation
        } else if at < phase::SETTLING {
            Self::Lift
        } else {
            Self::Settling
        }
    }

    /// Condition as text, after "waits for".
    pub fn text(self) -> &'static str {
        match self {
            Self::Enable => "enable",
            Self::Measurements(cause) => cause.advice(),
            Self::Operator => "an operator",
            Self::StillLoad => "the load to come to rest",
            Self::Hold => "the drive to be switched on",
            Self::Drives => "the machine to report that its drives follow",
            Self::Start => "a start",
            Self::Observation => "the position to be steady",
            Self::Lift => "the pump to lift the load",
            Self::Settling => "the lifted load to stay in place",
            Self::ValveOpening => "the load-holding valve to open",
            Self::CourseEnd => "the end of the course",
            Self::Standstill => "the load to be brought to rest",
            Self::Reset => "a reset by an operator",
        }
    }
}
