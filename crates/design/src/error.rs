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
    /// Gains whose worst case is still another one after all exchanges.
    #[error(
        "the search for gains of the benchmark for payloads of {low_kg:.0} to {high_kg:.0} kg has not converged: after {exchanges} worst cases \
         there is still another. Choose a narrower range of payloads"
    )]
    NotConverged {
        /// Worst cases that were added to the search.
        exchanges: u32,
        /// Smallest payload.
        low_kg: f64,
        /// Largest payload.
        high_kg: f64,
    },
    /// Gains that keep the margins do not exist.
    #[error(
        "no gains of the benchmark keep the largest sensitivity below {sensitivity_peak} for payloads of {low_kg:.0} to {high_kg:.0} kg \
         over the stroke. Try a narrower range of payloads or a larger benchmark_design.sensitivity_peak"
    )]
    NoGains {
        /// Largest sensitivity that is allowed.
        sensitivity_peak: f64,
        /// Smallest payload.
        low_kg: f64,
        /// Largest payload.
        high_kg: f64,
    },
    /// A linearised crane whose responses are not finite, that no mass on its oil describes, or whose load does not oscillate.
    #[error("at {stroke_mm:.0} mm the linearised crane cannot be used: {reason}")]
    NoMode {
        /// Piston position.
        stroke_mm: f64,
        /// What was found in its place.
        reason: String,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_that_has_not_converged_names_its_payloads_and_a_remedy() {
        let error = DesignError::NotConverged { exchanges: 12, low_kg: 20.0, high_kg: 90.0 };
        let message = error.to_string();
        for part in
            ["payloads of 20 to 90 kg", "not converged", "12 worst cases", "a narrower range"]
        {
            assert!(message.contains(part), "{part}: {message}");
        }
    }
}
