//! Errors of design and analysis.

use hydroboom_model::SimulationError;
use hydroboom_plant::PlantError;
use thiserror::Error;

/// Reason why a controller cannot be designed or analysed.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum DesignError {
    /// The description gives no crane in equilibrium.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The simulation of the crane has stopped.
    #[error("simulating the design: {0}")]
    Simulation(SimulationError),
    /// The eigenvalues of a matrix cannot be computed.
    #[error("eigenvalues: {0}")]
    Eigenvalues(String),
    /// The reduced model cannot be fitted.
    #[error("the reduced model cannot be fitted: {0}")]
    NoFit(String),
    /// The search for gains found further worst cases after its last exchange.
    #[error(
        "the search for gains of the benchmark for payloads of {low_kg:.0} to {high_kg:.0} kg has not converged: after {exchanges} worst cases \
         there is still another. Choose a narrower range of payloads"
    )]
    NotConverged {
        /// Number of worst cases added to the search.
        exchanges: u32,
        /// Smallest payload of the range \[kg\].
        low_kg: f64,
        /// Largest payload of the range \[kg\].
        high_kg: f64,
    },
    /// No gains keep the required margins.
    #[error(
        "no gains of the benchmark keep the largest sensitivity below {sensitivity_peak} for payloads of {low_kg:.0} to {high_kg:.0} kg \
         over the stroke. Try a narrower range of payloads or a larger benchmark_design.sensitivity_peak"
    )]
    NoGains {
        /// Largest allowed peak of the sensitivity function, M_s \[1\].
        sensitivity_peak: f64,
        /// Smallest payload of the range \[kg\].
        low_kg: f64,
        /// Largest payload of the range \[kg\].
        high_kg: f64,
    },
    /// The linearised crane has no load mode: its responses are not finite, or no mass on a hydraulic spring fits
    /// them.
    #[error("at {stroke_mm:.0} mm the linearised crane cannot be used: {reason}")]
    NoMode {
        /// Piston position \[mm\].
        stroke_mm: f64,
        /// What the analysis found instead.
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
