//! Inputs and outputs of the frame, and the codes of its status.

use hydroboom_math::record;

record! {
    /// Inputs of the frame in a control period.
    pub struct FrameInput<T> {
        /// 1: the drive is switched on and the load may be released; 0: the load is held at once
        #[unit = "0/1"]
        pub enable: T,
        /// 1: controlled stop, then the load is held
        #[unit = "0/1"]
        pub hold: T,
        /// A rise to 1 requests the release of the held load
        #[unit = "0/1"]
        pub start: T,
        /// A rise to 1 leaves a fault once all its causes have gone
        #[unit = "0/1"]
        pub reset_fault: T,
        /// Measured state of the load-holding valve: 1 open, 0 shut, -1 without a position switch
        #[unit = "1"]
        pub valve_state: T,
        /// Reference of the piston position, x_ref
        #[unit = "m"]
        pub reference_position: T,
        /// Reference of the piston velocity, v_ref
        #[unit = "m/s"]
        pub reference_velocity: T,
        /// Measured piston position
        #[unit = "m"]
        pub stroke: T,
        /// Measured gauge pressure on pump side A
        #[unit = "Pa"]
        pub pressure_pump_a: T,
        /// Measured gauge pressure on the piston side
        #[unit = "Pa"]
        pub pressure_a: T,
        /// Measured gauge pressure on the rod side
        #[unit = "Pa"]
        pub pressure_b: T,
        /// Measured gauge pressure on pump side B
        #[unit = "Pa"]
        pub pressure_pump_b: T,
        /// Motor speed measured by the drive
        #[unit = "rev/s"]
        pub motor_speed_read: T,
    }
}

record! {
    /// Outputs of the frame in a control period.
    pub struct FrameOutput<T> {
        /// Commanded motor speed, n_ref
        #[unit = "rev/s"]
        pub motor_speed: T,
        /// Load-holding valve: 1 energised, 0 not
        #[unit = "0/1"]
        pub holding_valve: T,
        /// Status: 0 idle, 1 holding, 2 releasing, 3 opening, 4 controlling, 5 stopping, 10 controlling with fallback
        /// gains, 100 and the number of a fault's cause
        #[unit = "code"]
        pub status: T,
        /// Offset of the followed reference from the given one
        #[unit = "m"]
        pub reference_offset: T,
        /// Amplitude of a sustained oscillation at rest; 0 where there is none
        #[unit = "m"]
        pub oscillation_amplitude: T,
        /// Frequency of a sustained oscillation at rest; 0 where there is none
        #[unit = "Hz"]
        pub oscillation_frequency: T,
    }
}

/// Status while the controller uses its fallback gains.
pub const STATUS_FALLBACK: f64 = 10.0;
/// Status of a fault, to which the number of its [cause](crate::supervision::fault::Cause::number) is added.
pub const STATUS_FAULT: f64 = 100.0;
