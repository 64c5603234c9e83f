//! Controller: the only interface of a control law, in simulation and in real time.

use crate::command::Command;
use crate::measurement::{AXES, Measurement};
use crate::reference::preview::Preview;
use hydroboom_math::record;

record! {
    /// State of one axis of a simulated crane, as controllers use it.
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

/// State of the crane that is simulated in parallel to the machine, at the time of the measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SimulatedState {
    /// State of each axis.
    pub axes: [AxisState<f64>; AXES],
}

/// Status of a controller after an update.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ControllerStatus {
    /// Motor speeds \[rev/s\] of the crane simulated in parallel to the machine, for the next control period; `None`
    /// if the controller uses no simulated crane.
    pub simulated_motor_speeds: Option<[f64; AXES]>,
    /// Whether the command depends on measurements.
    pub is_closed_loop: bool,
    /// Number of control periods since the start in which the optimisation problem of a predictive controller had no
    /// solution, and an earlier command was repeated; 0 for other controllers.
    pub periods_without_solution: u64,
}

/// Controller of a machine: measurement and reference in, command out, once a control period. It allocates nothing
/// after its construction, and does not panic.
pub trait Controller: Send {
    /// Starts control of a machine at rest with the load released. `delay_cycles` is the known delay of the fieldbus
    /// \[control periods\], for measurements and for commands each.
    fn start(&mut self, measurement: &Measurement, delay_cycles: u32);

    /// Command for the next control period. `preview` is the reference around the present; `simulated` the state of
    /// the crane simulated in parallel, `None` if there is none or it is not valid.
    fn update(
        &mut self,
        measurement: &Measurement,
        preview: &Preview<f64>,
        simulated: Option<&SimulatedState>,
    ) -> Command;

    /// Status after the last update.
    fn status(&self) -> ControllerStatus;
}
