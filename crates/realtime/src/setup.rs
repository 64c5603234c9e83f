//! Error of setting up a session.

use hydroboom_design::DesignError;
use hydroboom_plant::PlantError;
use thiserror::Error;

/// Reason why the tasks of a session cannot be set up.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SetupError {
    /// A crane cannot be built.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// There are no supervision limits for the crane.
    #[error("supervision of this crane: {0}")]
    Design(#[from] DesignError),
}
