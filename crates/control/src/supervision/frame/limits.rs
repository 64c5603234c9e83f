//! Limits of the frame.

use hydroboom_math::record;

record! {
    /// Limits of the frame, from a crane file.
    pub struct FrameLimits<T> {
        /// Control period
        #[unit = "s"]
        pub period: T,
        /// Length of the stroke
        #[unit = "m"]
        pub stroke: T,
        /// Distance from the end stops that a moving piston keeps
        #[unit = "m"]
        pub end_margin: T,
        /// Largest speed of the piston
        #[unit = "m/s"]
        pub speed: T,
        /// Largest pressure
        #[unit = "Pa"]
        pub pressure: T,
        /// Largest movement of a held load
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
        /// Way of a controlled stop for each speed, with what swings on
        #[unit = "s"]
        pub stopping_time: T,
        /// Time for which measurements that are not plausible are borne once enabled
        #[unit = "s"]
        pub wait_time: T,
        /// Time for which a load is observed until it is still: a period of the load mode
        #[unit = "s"]
        pub still_time: T,
        /// Piston speed below which a load is still
        #[unit = "m/s"]
        pub still_speed: T,
        /// Time after which a signal that repeats itself is stuck; 0 where sensors have no noise
        #[unit = "s"]
        pub stuck: T,
        /// Largest step of the position from one reading to the next that is no motion
        #[unit = "m"]
        pub position_step: T,
        /// Largest step of a pressure from one reading to the next
        #[unit = "Pa"]
        pub pressure_step: T,
        /// Largest disagreement of pump-side and cylinder pressure behind an open valve
        #[unit = "Pa"]
        pub pressure_agreement: T,
        /// Time for which it must last
        #[unit = "s"]
        pub agreement_time: T,
        /// Time from the valve's command until it has switched at the latest
        #[unit = "s"]
        pub valve_time: T,
    }
}
