//! Phases of the frame, and the transitions between them.

use super::frame_phase;
use hydroboom_math::Real;

/// The phase before, one mask for each.
pub(super) struct Phases<T: Real> {
    pub(super) idle: T::Mask,
    pub(super) holding: T::Mask,
    pub(super) releasing: T::Mask,
    pub(super) opening: T::Mask,
    pub(super) controlling: T::Mask,
    pub(super) stopping: T::Mask,
    pub(super) fault: T::Mask,
}

impl<T: Real> Phases<T> {
    pub(super) fn of(phase: T) -> Self {
        let is = |value: f64| T::lit(value - 0.5).lt(phase) & phase.lt(T::lit(value + 0.5));
        Self {
            idle: is(frame_phase::IDLE),
            holding: is(frame_phase::HOLDING),
            releasing: is(frame_phase::RELEASING),
            opening: is(frame_phase::OPENING),
            controlling: is(frame_phase::CONTROLLING),
            stopping: is(frame_phase::STOPPING),
            fault: is(frame_phase::FAULT),
        }
    }
}

/// Requests to the frame in a control period.
#[derive(Clone, Copy)]
pub(super) struct Requests<T: Real> {
    /// The drive is switched on.
    pub(super) enabled: T::Mask,
    /// The load is to be held.
    pub(super) holds: T::Mask,
    /// A start is asked for.
    pub(super) starts: T::Mask,
    /// A reset of the fault is asked for.
    pub(super) resets: T::Mask,
}

/// Conditions of the transitions from one phase to the next.
pub(super) struct Transitions<T: Real> {
    /// Measurements are plausible.
    pub(super) is_plausible: T::Mask,
    pub(super) requests: Requests<T>,
    /// The release has proven that the pump carries the load.
    pub(super) proven: T::Mask,
    /// The valve has had its time to open: the controller begins.
    pub(super) begins: T::Mask,
    /// A controlled stop is under way.
    pub(super) stops: T::Mask,
    /// A fault is left by a reset.
    pub(super) leaves: T::Mask,
    /// A fault occurs, or a more severe one.
    pub(super) fails: T::Mask,
}

impl<T: Real> Transitions<T> {
    /// The next phase: progress, then what is asked for, then what is wrong.
    pub(super) fn next_phase(&self, at: &Phases<T>, phase: T) -> T {
        let Self { is_plausible, requests, proven, begins, stops, leaves, fails } = *self;
        let Requests { enabled, holds, starts, .. } = requests;
        let to = |is: T::Mask, phase: f64, next: T| T::select(is, T::lit(phase), next);
        let mut next = phase;
        next = to(at.idle & is_plausible, frame_phase::HOLDING, next);
        next = to(at.holding & starts, frame_phase::RELEASING, next);
        next = to(proven, frame_phase::OPENING, next);
        next = to(begins, frame_phase::CONTROLLING, next);
        next = to(at.stopping & !stops, frame_phase::HOLDING, next);
        next = to((at.holding | at.releasing) & holds, frame_phase::HOLDING, next);
        next = to((at.opening | at.controlling) & holds, frame_phase::STOPPING, next);
        next = to(leaves, frame_phase::HOLDING, next);
        next = to(!enabled & (!at.fault | leaves), frame_phase::IDLE, next);
        next = to(fails, frame_phase::FAULT, next);
        next
    }
}
