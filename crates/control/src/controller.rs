//! Controller: the only interface of a control law, in simulation and in real time.

use crate::command::Command;
use crate::measurement::{AXES, Measurement};
use crate::reference::preview::Preview;
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

/// Status of a controller after an update.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ControllerStatus {
    /// Motor speeds \[rev/s\] that drive the crane simulated beside the machine in the coming control period; none where the
    /// controller uses no simulated crane.
    pub simulated_motor_speeds: Option<[f64; AXES]>,
    /// Whether the command depends on measurements.
    pub is_closed_loop: bool,
    /// Control periods since the start in which a predictive controller's program had no solution, and an
    /// earlier command was repeated.
    pub periods_without_solution: u64,
}

/// A controller. It has parameters and a state between control periods; it allocates nothing after it was
/// made, and does not panic.
pub trait Controller: Send {
    /// Begins control of a machine at rest with the load released. The fieldbus delays a measurement by `delay_cycles` control periods, and a
    /// command by as many, as far as is known.
    fn start(&mut self, measurement: &Measurement, delay_cycles: u32);

    /// The command for the coming control period. `preview` is the reference around now; `simulated` the crane that is simulated
    /// beside the machine, none where there is none, or where it is not valid.
    fn update(
        &mut self,
        measurement: &Measurement,
        preview: &Preview<f64>,
        simulated: Option<&SimulatedState>,
    ) -> Command;

    /// The state after the last update.
    fn status(&self) -> ControllerStatus;
}
