//! Memory of the frame from one control period to the next, and its phases.

use crate::supervision::drive_monitor::DriveMonitorState;
use crate::supervision::oscillation_detector::OscillationState;
use crate::supervision::release::ReleaseState;
use hydroboom_math::record;

record! {
    /// State of the frame without that of its monitors.
    pub struct FrameMemory<T> {
        /// Phase: 0 idle, 1 holding, 2 releasing, 3 opening, 4 controlling, 5 stopping, 6 fault
        #[unit = "1"]
        pub phase: T,
        /// Number of the fault's cause; 0 where there is none
        #[unit = "1"]
        pub cause: T,
        /// Time in this phase
        #[unit = "s"]
        pub since: T,
        /// Motor speed commanded
        #[unit = "rev/s"]
        pub motor_speed: T,
        /// Commanded load-holding valve: 1 energised, 0 not
        #[unit = "1"]
        pub holding_valve: T,
        /// Time since the valve was last commanded to switch
        #[unit = "s"]
        pub valve_since: T,
        /// 1 while a controlled stop is under way: the valve is still open
        #[unit = "1"]
        pub stops: T,
        /// Motor speed as read when the stop began
        #[unit = "rev/s"]
        pub stop_from: T,
        /// Time since the stop began
        #[unit = "s"]
        pub stop_since: T,
        /// Input `start` of the previous control period
        #[unit = "1"]
        pub start: T,
        /// Input `reset_fault` of the previous control period
        #[unit = "1"]
        pub reset: T,
        /// 1 after the first control period
        #[unit = "1"]
        pub has_begun: T,
        /// Periods in which a measurement was not plausible, each forgotten within ten plausible ones
        #[unit = "1"]
        pub bad: T,
        /// 1 where the position was not plausible
        #[unit = "1"]
        pub bad_position: T,
        /// 1 where a pressure was not plausible
        #[unit = "1"]
        pub bad_pressure: T,
        /// Periods in which the reference was not plausible, each forgotten within ten plausible ones
        #[unit = "1"]
        pub bad_reference: T,
        /// Last good piston position
        #[unit = "m"]
        pub stroke: T,
        /// Last good pressure on pump side A
        #[unit = "Pa"]
        pub pressure_pump_a: T,
        /// Last good pressure on the piston side
        #[unit = "Pa"]
        pub pressure_a: T,
        /// Last good pressure on the rod side
        #[unit = "Pa"]
        pub pressure_b: T,
        /// Last good pressure on pump side B
        #[unit = "Pa"]
        pub pressure_pump_b: T,
        /// Last good motor speed as read
        #[unit = "rev/s"]
        pub motor_speed_read: T,
        /// Last good reference position
        #[unit = "m"]
        pub reference_position: T,
        /// Last good reference velocity
        #[unit = "m/s"]
        pub reference_velocity: T,
        /// Time for which the position has repeated itself
        #[unit = "s"]
        pub stroke_repeated: T,
        /// Time for which the pressure on pump side A has repeated itself
        #[unit = "s"]
        pub pressure_pump_a_repeated: T,
        /// Time for which the pressure on the piston side has repeated itself
        #[unit = "s"]
        pub pressure_a_repeated: T,
        /// Time for which the pressure on the rod side has repeated itself
        #[unit = "s"]
        pub pressure_b_repeated: T,
        /// Time for which the pressure on pump side B has repeated itself
        #[unit = "s"]
        pub pressure_pump_b_repeated: T,
        /// Low-pass filtered piston velocity
        #[unit = "m/s"]
        pub velocity: T,
        /// Time since the frame was enabled
        #[unit = "s"]
        pub enabled_for: T,
        /// Integral of the piston position over the present observation window, a period of the load mode
        #[unit = "m·s"]
        pub held_sum: T,
        /// Time since the start of the present observation window
        #[unit = "s"]
        pub held_time: T,
        /// Mean piston position over the previous observation window
        #[unit = "m"]
        pub held_mean: T,
        /// Number of observation windows completed in this phase
        #[unit = "1"]
        pub held_windows: T,
        /// Time for which the load has been still
        #[unit = "s"]
        pub still_for: T,
        /// Position at which the load is held, or was when the valve was energised
        #[unit = "m"]
        pub held_at: T,
        /// Time for which the pressures of pump side and cylinder have disagreed behind an open valve
        #[unit = "s"]
        pub disagreeing: T,
        /// Time in a fault since all causes have gone
        #[unit = "s"]
        pub well_for: T,
        /// Offset of the followed reference from the given one
        #[unit = "m"]
        pub offset: T,
        /// 1 after a sustained oscillation: the controller uses its fallback gains
        #[unit = "1"]
        pub falls_back: T,
    }
}

/// State of the frame and its monitors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameState<T> {
    /// Phase, last commands and measurements, counters.
    pub memory: FrameMemory<T>,
    /// State of the drive monitor.
    pub drive: DriveMonitorState<T>,
    /// State of the release.
    pub release: ReleaseState<T>,
    /// State of the oscillation detector.
    pub oscillation: OscillationState<T>,
}

/// Values of the frame's phase.
pub mod frame_phase {
    /// Not enabled: motor at zero, valve shut.
    pub const IDLE: f64 = 0.0;
    /// Load held by the shut load-holding valves.
    pub const HOLDING: f64 = 1.0;
    /// Release under way: the pump is run until it demonstrably carries the load.
    pub const RELEASING: f64 = 2.0;
    /// Load-holding valve commanded open; it is given its switching time.
    pub const OPENING: f64 = 3.0;
    /// Controller active.
    pub const CONTROLLING: f64 = 4.0;
    /// Controlled stop under way.
    pub const STOPPING: f64 = 5.0;
    /// Fault: load held until a reset.
    pub const FAULT: f64 = 6.0;
}
