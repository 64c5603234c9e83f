//! Controller: the one interface between a control law and whatever runs it, in simulation or in real time.

use crate::measurement::AXES;
use hydroboom_math::record;

record! {
    /// State of one axis of a simulated crane, as far as controllers use it.
    pub struct AxisState<T> {
        /// Piston position
        #[unit = "m"]
        pub stroke: T,
        /// Piston velocity
        #[unit = "m/s"]
        pub velocity: T,
        /// Load pressure, p_L = p_A − (A_r/A_p) p_B
        #[unit = "Pa"]
        pub load_pressure: T,
    }
}

/// State of the crane that is simulated beside the machine, at the time of the measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SimulatedState {
    /// Each axis.
    pub axes: [AxisState<f64>; AXES],
}
