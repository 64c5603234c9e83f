//! Table 6 of the paper: differences, crane minus simulation, of the virtual crane from the published model.

use crate::output;
use hydroboom_lab::calibrate::differences;
use hydroboom_lab::motion_test::Run;
use hydroboom_lab::paper;
use serde::Serialize;

/// Difference of one signal between two runs under the same input, beside that of the paper's crane from its
/// simulation. RMS and value of largest magnitude are in the signal's unit.
#[derive(Serialize)]
pub struct ModelError {
    signal: &'static str,
    unit: &'static str,
    paper_rms: f64,
    rms: f64,
    paper_peak: f64,
    peak: f64,
}

/// Rows of Table 6 from a run of the published model and one of the crane, both under velocity feedforward.
pub fn model_errors(simulated: &Run, crane: &Run) -> Vec<ModelError> {
    paper::TABLE_6
        .iter()
        .zip(differences(simulated, crane))
        .map(|((signal, unit, paper_peak, paper_rms), (rms, peak))| ModelError {
            signal,
            unit,
            paper_rms: *paper_rms,
            rms,
            paper_peak: *paper_peak,
            peak,
        })
        .collect()
}

impl ModelError {
    fn cells(&self) -> Vec<String> {
        let number = |v: f64| format!("{v:.3}");
        let [a, b, c, d] = [self.paper_rms, self.rms, self.paper_peak, self.peak].map(number);
        vec![self.signal.into(), self.unit.into(), a, b, c, d]
    }
}

/// Table 6, "paper | here".
pub fn table(errors: &[ModelError]) -> String {
    let cells: Vec<Vec<String>> = errors.iter().map(ModelError::cells).collect();
    let header = ["signal", "unit", "RMS paper", "RMS here", "peak paper", "peak here"];
    output::table(&header, &cells)
}
