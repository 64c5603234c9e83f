//! Conditions that a start waits for, as text.

use hydroboom_control::supervision::supervisor::{Decision, State};
use hydroboom_control::supervision::waiting::Waiting;

/// Condition that must be met before a course can start, worded to follow "waits for"; none if a course can
/// start now. `attended`: whether an operator is present.
pub fn start_waits_for(decision: &Decision, attended: bool) -> Option<&'static str> {
    match decision.state {
        State::Idle => Some("plausible readings of the machine"),
        State::Fault => Some("a reset"),
        _ if !attended => Some("an operator"),
        State::Ready => Some("the load to be still"),
        State::Holding if decision.releasing => Some("the end of the release under way"),
        State::Holding if decision.waiting == Waiting::Drives => Some(Waiting::Drives.text()),
        State::Holding => None,
        State::Moving => Some("the end of the course"),
        State::Stopping => Some("the load to come to rest"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_course_can_be_started_by_an_operator_over_a_held_load_only() {
        let decision = |state, releasing| Decision { state, releasing, ..Decision::IDLE };
        for state in State::ALL {
            let waits = start_waits_for(&decision(state, false), true);
            assert_eq!(waits.is_none(), state == State::Holding, "{state:?}: {waits:?}");
            assert!(start_waits_for(&decision(state, false), false).is_some(), "{state:?}");
        }
        assert!(start_waits_for(&decision(State::Holding, true), true).is_some());
    }
}
