//! Limits of the frame.

use hydroboom_math::record;

record! {
    /// Limits of the frame around an exported controller, from a crane file.
    pub struct FrameLimits<T> {
        /// Control period
        #[unit = "s"]
        pub period: T,
        /// Length of the stroke
        #[unit = "m"]
        pub stroke: T,
        /// Smallest distance of a moving piston from the end stops
        #[unit = "m"]
        pub end_margin: T,
        /// Largest speed of the piston
        #[unit = "m/s"]
        pub speed: T,
        /// Largest pressure
        #[unit = "Pa"]
        pub pressure: T,
        /// Largest displacement of a held load
        #[unit = "m"]
        pub creep: T,
        /// Largest tracking error
        #[unit = "m"]
        pub tracking: T,
        /// Largest motor speed
        #[unit = "rev/s"]
        pub motor_speed: T,
        /// Largest change of motor speed
        #[unit = "rev/s²"]
        pub motor_slew: T,
        /// Duration of a controlled stop
        #[unit = "s"]
        pub stop_time: T,
        /// Stopping distance of a controlled stop per piston speed, including the load's oscillation
        #[unit = "s"]
        pub stopping_time: T,
        /// Time for which implausible measurements are tolerated once enabled
        #[unit = "s"]
        pub wait_time: T,
        /// Observation time until a load counts as still: a period of the load mode
        #[unit = "s"]
        pub still_time: T,
        /// Piston speed below which the load counts as still
        #[unit = "m/s"]
        pub still_speed: T,
        /// Time after which an unchanged signal counts as stuck; 0 where sensors have no noise
        #[unit = "s"]
        pub stuck: T,
        /// Largest step of the position between two measurements beyond its motion
        #[unit = "m"]
        pub position_step: T,
        /// Largest step of a pressure between two measurements
        #[unit = "Pa"]
        pub pressure_step: T,
        /// Largest disagreement of pump-side and cylinder pressure behind an open valve
        #[unit = "Pa"]
        pub pressure_agreement: T,
        /// Duration of such a disagreement until it is a fault
        #[unit = "s"]
        pub agreement_time: T,
        /// Longest time from the valve's command until it has switched
        #[unit = "s"]
        pub valve_time: T,
    }
}
