//! Comparison of a segment of a log with the model: differences, faults of signals, verdict, and changes of keys.

use crate::difference_text::{self, Context};
use hydroboom_description::Description;
use hydroboom_identify::{
    Difference, Experiment, Isolated, Judgement, LIMITS, Prediction, Remedy, SignalFault,
    complaints, isolate, remedies, verdict,
};
use hydroboom_measurement::Signal;
use miette::{IntoDiagnostic, Result};

/// Difference of one signal with its description.
pub struct Finding {
    /// Difference log − model.
    pub difference: Difference,
    /// Fault of the signal's sensor that explains the difference; none without one.
    pub sensor: Option<SignalFault>,
    /// Description of the difference.
    pub text: String,
}

/// Comparison of a segment of a log with the model.
pub struct SegmentComparison {
    /// The segment, with its remarks.
    pub experiment: Experiment,
    /// Response of the model as the log is.
    pub prediction: Prediction,
    /// Differences of the measured signals.
    pub findings: Vec<Finding>,
    /// Isolated faults of signals.
    pub faults: Vec<SignalFault>,
    /// Descriptions of delayed inputs.
    pub delayed_inputs: Vec<String>,
    /// Verdict after correction of the isolated faults; none if there are none.
    pub corrected_verdict: Option<Vec<Judgement>>,
    /// Changes of keys that would reduce the differences.
    pub remedies: Vec<Remedy>,
    /// Text on these changes; none if none are asked for.
    pub advice: Option<String>,
    /// Verdict on the log as it is.
    pub verdict: Vec<Judgement>,
}

impl SegmentComparison {
    /// Compares a segment of a log with the model of a crane.
    ///
    /// # Errors
    ///
    /// If the model cannot be simulated.
    pub fn new(crane: &Description, mut experiment: Experiment) -> Result<Self> {
        let Isolated { prediction, found: differences, faults, corrected, left: remaining } =
            isolate(crane, &experiment).into_diagnostic()?;
        let (_, remedies) = remedies(crane, &corrected).into_diagnostic()?;
        let pressures = prediction.iter().flat_map(|row| row.iter().skip(1).copied());
        experiment
            .remarks
            .extend(difference_text::remark_on_validity(pressures.fold(0.0, f64::max)));
        experiment.remarks.extend(remark_on_accumulator(crane, &experiment));
        let all = complaints(&differences);
        let context = Context {
            differences: &differences,
            complaints: &all,
            faults: &faults,
            remaining: &remaining,
        };
        let findings = differences.iter().map(|d| Finding {
            difference: d.clone(),
            sensor: faults.iter().find(|fault| fault.signal == d.signal).cloned(),
            text: difference_text::text(d, &context),
        });
        let findings = findings.collect();
        let advice = difference_text::advice(
            &complaints(&remaining),
            &remedies,
            difference_text::asks_for_keys(&remaining),
        );
        let is_corrected = faults.iter().any(SignalFault::is_isolable);
        Ok(Self {
            experiment,
            findings,
            delayed_inputs: faults.iter().filter_map(difference_text::input_delay).collect(),
            corrected_verdict: is_corrected.then(|| verdict(&remaining)),
            remedies,
            advice,
            verdict: verdict(&differences),
            prediction,
            faults,
        })
    }
}

/// Remark on an initial accumulator pressure that differs from the crane file's, unless another low-side
/// pressure explains it.
fn remark_on_accumulator(crane: &Description, experiment: &Experiment) -> Option<String> {
    let others = [Signal::PressureB, Signal::PressurePumpB];
    let begun = experiment.begun(Signal::PressureAccumulator)?;
    let off = begun - crane.numbers.working_pressure;
    let is_alone = others.iter().all(|signal| !experiment.is_measured(*signal));
    (is_alone && off.abs() > LIMITS.least_pressure).then(|| {
        format!(
            "p_acc begins {:+.2} bar off accumulator.working_bar. Without p_B or p_PB an offset of its sensor cannot be distinguished from another \
             precharge or filling. The model begins with the measured pressure",
            off * 1e-5
        )
    })
}
