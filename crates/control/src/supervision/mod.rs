//! Supervision: the state machine that releases, holds and stops the load, its limits, its fault
//! causes, and the monitors of measurements, drive, deadlines and delivered flow.

mod deadline_monitor;
mod drive_monitor;
mod fault;
mod flow_monitor;
mod frame;
mod limits;
mod oscillation_detector;
mod plausibility;
mod release;
mod supervisor;
mod waiting;

pub use deadline_monitor::{DeadlineMonitor, WINDOW as DEADLINE_WINDOW};
pub use drive_monitor::{DriveMonitor, DriveMonitorState, DriveVerdict};
pub use fault::{Cause, Reaction, Severity};
pub use flow_monitor::{
    FlowMonitor, FlowMonitorState, FlowReading, LEAST_WINDOW as FLOW_LEAST_WINDOW, Range,
    WINDOW_TIME as FLOW_WINDOW_TIME,
};
pub use frame::{
    Directive, Frame, FrameInput, FrameLimits, FrameMemory, FrameOutput, FrameState,
    STATUS_FALLBACK, STATUS_FAULT, frame_phase,
};
pub use limits::{Limits, Observation, ValveState};
pub use oscillation_detector::{OscillationDetector, OscillationState};
pub use plausibility::RUNAWAY;
pub use release::{Refusal, Release, ReleaseInput, ReleaseState, phase as release_phase};
pub use supervisor::{CONTROLLED_RAMP, Decision, Request, State, Supervisor};
pub use waiting::Waiting;
