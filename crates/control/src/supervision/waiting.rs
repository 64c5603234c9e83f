//! What a state waits for.

use super::fault::Cause;
use super::release::phase;

/// What a state waits for, said to people.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Waiting {
    /// Somebody enables the machine.
    Enable,
    /// What is wrong with the measurements goes away.
    Measurements(Cause),
    /// An operator takes the role.
    Operator,
    /// The load comes to rest.
    StillLoad,
    /// The drive is to be switched on.
    Hold,
    /// The machine reports that its drives follow.
    Drives,
    /// The operator starts a course.
    Start,
    /// The position is observed before the pump turns.
    Observation,
    /// The pump lifts the load.
    Lift,
    /// The lifted load stays where it is.
    Settling,
    /// The load-holding valve opens.
    ValveOpening,
    /// The course ends.
    CourseEnd,
    /// The load is brought to rest.
    Standstill,
    /// An operator resets, with everything well.
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

    /// As a person reads it, after "waits for".
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
