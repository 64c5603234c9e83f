//! What goes between a controller and a machine.

use hydroboom_math::record;

record! {
    /// What a controller sends.
    pub struct Command<T> {
        /// Motor speed asked for
        #[unit = "rev/s"]
        pub motor_speed: T,
        /// 3/2 valve: 1 energised (load released), 0 not (load held)
        #[unit = "1"]
        pub holding_valve: T,
    }
}

record! {
    /// What a real crane's data acquisition would see.
    pub struct Reading<T> {
        /// Piston position
        #[unit = "m"]
        pub stroke: T,
        /// Pressure on pump side A
        #[unit = "Pa"]
        pub pressure_pump_a: T,
        /// Pressure on the piston side
        #[unit = "Pa"]
        pub pressure_a: T,
        /// Pressure on the rod side
        #[unit = "Pa"]
        pub pressure_b: T,
        /// Pressure on pump side B
        #[unit = "Pa"]
        pub pressure_pump_b: T,
        /// Pressure in the accumulator
        #[unit = "Pa"]
        pub pressure_accumulator: T,
        /// Motor speed, from the drive's encoder
        #[unit = "rev/s"]
        pub motor_speed: T,
    }
}
