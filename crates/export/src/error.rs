//! Errors of the export.

use hydroboom_description::BuildError;
use hydroboom_design::DesignError;
use hydroboom_model::{SimulationError, StepBound};
use hydroboom_plant::PlantError;
use thiserror::Error;

/// Reason why a block cannot be exported.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The description gives no valid crane, or no equilibrium to start from.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// No controller can be designed.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// The machine of the test bench cannot be built.
    #[error(transparent)]
    Machine(#[from] PlantError),
    /// The simulation of the test bench's machine failed.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The crane does not have three segments, or has an elastic base.
    #[error(
        "the boom has {found} coordinates; cranes of 3 segments are exported (boom.segments = 3, and no elastic base)"
    )]
    Segments {
        /// Number of coordinates found.
        found: usize,
    },
    /// A constant that the target language cannot represent.
    #[error("{block}: {value} is a constant of it, and the language has no such number")]
    Constant {
        /// Name of the block.
        block: String,
        /// Value of the constant.
        value: f64,
    },
    /// A result depends on a quantity outside its block.
    #[error("{block}: {result} depends on a number that is no input, state or parameter of it")]
    Foreign {
        /// Name of the block.
        block: String,
        /// Name of the result.
        result: String,
    },
    /// A prefix that cannot begin a name in C.
    #[error(
        "`{found}` is no prefix: it has 1 to {longest} ASCII letters, digits and underscores and begins with a letter, such as my_"
    )]
    Prefix {
        /// Requested prefix.
        found: String,
        /// Largest number of characters.
        longest: usize,
    },
    /// The crane file's step is above the stability limit of the published scheme.
    #[error(
        "controller.simulation_period_us = {step_us:.1} us is above the published scheme's limit {bound} for this crane, {limit_us:.1} us (`hydroboom check` shows it); lower it"
    )]
    Step {
        /// Step of the crane file \[us\].
        step_us: f64,
        /// Stability limit \[us\].
        limit_us: f64,
        /// Dynamics that determine the limit.
        bound: StepBound,
    },
}
