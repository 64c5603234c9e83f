//! Command: what a controller sends to a machine in a control period.

use crate::measurement::AXES;
use hydroboom_math::record;

record! {
    /// Command for one axis: motor speed and load-holding valve.
    pub struct AxisCommand<T> {
        /// Commanded motor speed
        #[unit = "rev/s"]
        pub motor_speed: T,
        /// 3/2 valve: 1 energised (load released), 0 not (load held)
        #[unit = "1"]
        pub holding_valve: T,
    }
}

/// Command of a control period, for all axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Command for each axis.
    pub axes: [AxisCommand<f64>; AXES],
}

impl Command {
    /// Command with the load released and motor speeds \[rev/s\], one per axis.
    pub fn released(motor_speeds: [f64; AXES]) -> Self {
        Self {
            axes: motor_speeds.map(|motor_speed| AxisCommand { motor_speed, holding_valve: 1.0 }),
        }
    }
}
