//! Command: what a controller sends to a machine in a control period.

use crate::measurement::AXES;
use hydroboom_math::record;

record! {
    /// Command of one axis.
    pub struct AxisCommand<T> {
        /// Commanded motor speed
        #[unit = "rev/s"]
        pub motor_speed: T,
        /// 3/2 valve: 1 energised (load released), 0 not (load held)
        #[unit = "1"]
        pub holding_valve: T,
    }
}

/// Commands of all axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Each axis.
    pub axes: [AxisCommand<f64>; AXES],
}

impl Command {
    /// Released axes, driven at these motor speeds \[rev/s\].
    pub fn released(motor_speeds: [f64; AXES]) -> Self {
        Self {
            axes: motor_speeds.map(|motor_speed| AxisCommand { motor_speed, holding_valve: 1.0 }),
        }
    }
}
