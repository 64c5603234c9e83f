//! Why nothing is exported.

use hydroboom_description::BuildError;
use hydroboom_design::DesignError;
use hydroboom_model::{SimulationError, StepBound};
use hydroboom_plant::PlantError;
use thiserror::Error;

/// Why nothing is exported.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The description gives no crane, or no state of rest to start from.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// No controller could be designed.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// No machine for the test bench.
    #[error(transparent)]
    Machine(#[from] PlantError),
    /// The machine of the test bench broke.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The crane is none that is exported.
    #[error(
        "the boom has {found} coordinates; cranes of 3 segments are exported (boom.segments = 3, and no elastic base)"
    )]
    Segments {
        /// Coordinates that it has.
        found: usize,
    },
    /// A constant that the language has no number for.
    #[error("{block}: {value} is a constant of it, and the language has no such number")]
    Constant {
        /// The block.
        block: String,
        /// The constant.
        value: f64,
    },
    /// Something depends on what it must not.
    #[error("{block}: {result} depends on a number that is no input, state or parameter of it")]
    Foreign {
        /// The block.
        block: String,
        /// What of it.
        result: String,
    },
    /// A prefix that is no beginning of a name in C.
    #[error(
        "`{found}` is no prefix: it has 1 to {longest} ASCII letters, digits and underscores and begins with a letter, such as my_"
    )]
    Prefix {
        /// What was asked for.
        found: String,
        /// Characters allowed.
        longest: usize,
    },
    /// The crane file's step is longer than the published scheme is stable with.
    #[error(
        "controller.simulation_period_us = {step_us:.1} us is above the published scheme's limit {bound} for this crane, {limit_us:.1} us (`hydroboom check` shows it); lower it"
    )]
    Step {
        /// The step \[us\].
        step_us: f64,
        /// The limit \[us\].
        limit_us: f64,
        /// Which limit it is.
        bound: StepBound,
    },
}
