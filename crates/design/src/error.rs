//! What can go wrong in a design.

use hydroboom_model::SimulationError;
use hydroboom_plant::PlantError;
use thiserror::Error;

/// Why there is no such controller.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum DesignError {
    /// There is no such crane to be controlled.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The crane's simulation stopped.
    #[error("simulating the design: {0}")]
    Simulation(SimulationError),
    /// Eigenvalues that cannot be computed.
    #[error("eigenvalues: {0}")]
    Eigenvalues(String),
    /// A reduced model that cannot be fitted.
    #[error("the reduced model cannot be fitted: {0}")]
    NoFit(String),
    /// A crane whose boom does not ring on its oil.
    #[error("at {stroke_mm:.0} mm the crane has no mode in which boom and oil ring: {reason}")]
    NoMode {
        /// Piston position.
        stroke_mm: f64,
        /// What was found in its place.
        reason: String,
    },
}
