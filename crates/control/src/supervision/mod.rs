//! Supervision: the state machine that releases, holds and stops the load, its limits, its fault
//! causes, and the monitors of measurements, drive, deadlines and delivered flow; and the frame that
//! does the same around an exported controller.

pub mod deadline_monitor;
pub mod drive_monitor;
pub mod fault;
pub mod flow_monitor;
pub mod frame;
pub mod framed;
pub mod framed_scheduled_lqr;
pub mod limits;
pub mod oscillation_detector;
pub mod plausibility;
pub mod release;
pub mod supervisor;
pub mod waiting;
