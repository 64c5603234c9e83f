//! Delivered flow of this machine: limits of the supervision by its recorded baseline, and the record of one.

use super::Run;
use super::attendant::RunAttendant;
use crate::output;
use hydroboom_control::supervision::limits::Limits;
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_realtime::flow_baseline::FlowBaseline;
use miette::{IntoDiagnostic, Result};

impl Run {
    /// Limits of the crane, its delivered flow against the baseline where one is named.
    ///
    /// # Errors
    ///
    /// If the crane has no limits of supervision, or the baseline cannot be read or is of another crane.
    pub(super) fn limits(&self, model: &Description) -> Result<Limits> {
        let mut limits = limits(model, model.numbers.fast).into_diagnostic()?;
        if let Some(path) = &self.baseline {
            let baseline = FlowBaseline::read(model, path).into_diagnostic()?;
            limits.flow = baseline.narrowed(limits.flow);
        }
        Ok(limits)
    }

    /// Records the baseline of delivered flow from the last course, unless that was stopped by a fault.
    ///
    /// # Errors
    ///
    /// If the course does not determine a baseline.
    pub(super) fn record_flow_baseline(
        &self,
        model: &Description,
        attendant: &RunAttendant,
    ) -> Result<()> {
        let Some(path) = &self.record_baseline else { return Ok(()) };
        let fault = attendant.results.last().and_then(|result| result.fault);
        if let (Some(fault), _) | (None, Some(fault)) =
            (fault, attendant.session().fault().map(|fault| fault.cause.code()))
        {
            output::note(&format!("no baseline: the course was stopped by {fault}"));
            return Ok(());
        }
        let monitor = limits(model, model.numbers.fast).into_diagnostic()?.flow;
        let baseline =
            FlowBaseline::of_course(model, &monitor, &attendant.records).into_diagnostic()?;
        if !output::file(path, baseline.text().as_bytes()) {
            return Ok(());
        }
        output::note(&format!(
            "baseline of delivered flow: gain {:.4}, leakage {:.2} times the described, residual {:.2} mm: {}",
            baseline.gain,
            baseline.leakage,
            baseline.residual * 1e3,
            path.display()
        ));
        Ok(())
    }
}
