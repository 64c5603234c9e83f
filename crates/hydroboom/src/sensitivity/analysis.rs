//! Local and global sensitivity of the outputs of a machine to its keys.

use super::scheduled_lqr;
use crate::interruptible::Interruptible;
use crate::output;
use hydroboom_description::Description;
use hydroboom_description::schema::KEYS;
use hydroboom_identify::Free;
use hydroboom_sensitivity::{Case, Local, Output, Sobol, Study, at_ends, end_values, local, sobol};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Result};

/// Results of the analysis. Keys and outputs are named by their indices in `local` and `outputs`.
pub struct Analysis {
    /// Machine, motion, and outputs with derivatives.
    pub case: Case,
    /// Outputs of the case, then those that are only recomputed by simulation.
    pub outputs: Vec<Output>,
    /// Outputs of the described machine \[SI\].
    pub values: Vec<f64>,
    /// Keys with their local sensitivities; none for outputs that are only recomputed.
    pub local: Vec<Local>,
    /// Keys, and their values at both ends of their ranges, low and high \[SI\].
    ends: Vec<(Free, [f64; 2])>,
    /// All outputs with each key at these values \[SI\]; none where no such machine exists, or it cannot follow.
    outputs_at_ends: Vec<[Option<Vec<f64>>; 2]>,
    /// Sobol indices by output, and number of complete simulation rows; none without a global study.
    pub global: Option<(Vec<Sobol>, usize)>,
}

impl Analysis {
    /// Derivatives of the outputs of a case by the free keys, and the outputs at both ends of their ranges.
    ///
    /// # Errors
    ///
    /// If an output of the described machine cannot be computed.
    pub fn new(
        crane: &Description,
        case: Case,
        outputs: Vec<Output>,
        free: &[Free],
    ) -> Result<Self> {
        let bar = ProgressBar::new(free.len().div_ceil(4) as u64).with_style(
            ProgressStyle::with_template("{bar:40} {pos} of {len} slopes, {eta} left")
                .into_diagnostic()?,
        );
        let (values, local) = local(&case, free, &|| bar.inc(1)).into_diagnostic()?;
        bar.finish_and_clear();
        let ends: Vec<(Free, [f64; 2])> =
            local.iter().map(|l| (l.key, end_values(crane, l.key, l.known))).collect();
        let bar = ProgressBar::new(ends.len() as u64);
        let outputs_at_ends = at_ends(&case, &ends, &|| bar.inc(1));
        bar.finish_and_clear();
        Ok(Self { case, outputs, values, local, ends, outputs_at_ends, global: None })
    }

    /// Adds outputs under the scheduled LQR, which are recomputed by simulation along the motion at a speed \[m/s\].
    ///
    /// # Errors
    ///
    /// If the described machine cannot be simulated.
    pub fn add_rerun_outputs(
        &mut self,
        crane: &Description,
        speed: f64,
        outputs: &[Output],
    ) -> Result<()> {
        let own = scheduled_lqr::rerun(crane, &crane.numbers, speed).into_diagnostic()?;
        let others = scheduled_lqr::at_ends(crane, &self.ends, speed);
        let of = |both: [f64; 2]| {
            outputs
                .iter()
                .map(move |output| both[usize::from(matches!(output, Output::Pressure(_)))])
        };
        self.values.extend(of(own));
        for (known, added) in self.outputs_at_ends.iter_mut().zip(others) {
            for (known, added) in known.iter_mut().zip(added) {
                // a machine that one of them cannot control has no outputs at all
                *known = known.take().zip(added).map(|(mut all, both)| {
                    all.extend(of(both));
                    all
                });
            }
        }
        self.outputs.extend(outputs.iter().copied());
        Ok(())
    }

    /// Adds Sobol indices of the outputs with derivatives.
    ///
    /// # Errors
    ///
    /// If fewer than two rows of the study could be simulated.
    pub fn add_indices(&mut self, free: &[Free], study: Study) -> Result<()> {
        let work = Interruptible::new(study.rows as u64, "rows")?;
        let global = sobol(&self.case, free, study, &|| work.one_more());
        self.global = Some(global.into_diagnostic()?);
        Ok(())
    }

    /// Output with a key at one end of its range (0: low, 1: high) \[SI\].
    pub fn at_end(&self, key: usize, end: usize, output: usize) -> Option<f64> {
        self.outputs_at_ends[key][end].as_ref().map(|outputs| outputs[output])
    }

    /// Largest change of an output by a key within its range \[SI\].
    pub fn change(&self, key: usize, output: usize) -> f64 {
        let change =
            |end| self.at_end(key, end, output).map_or(0.0, |v| (v - self.values[output]).abs());
        change(0).max(change(1))
    }

    /// Relative sensitivity of an output to a key \[% per %\]; none for an output without derivatives.
    pub fn slope(&self, key: usize, output: usize) -> Option<f64> {
        self.local[key].slopes.get(output).map(|slope| slope / self.values[output])
    }

    /// Value of a key at one end of its range, in its unit.
    pub fn end(&self, key: usize, end: usize) -> f64 {
        KEYS[self.local[key].key.place].to_unit(self.ends[key].1[end])
    }

    /// The same as text, with five significant digits.
    pub fn end_text(&self, key: usize, end: usize) -> String {
        let value = self.end(key, end);
        output::number(format!("{value:.4e}").parse().unwrap_or(value))
    }

    /// Keys ranked by their change of an output, the largest first.
    pub fn ranked(&self, output: usize) -> Vec<usize> {
        let mut list: Vec<usize> = (0..self.local.len()).collect();
        list.sort_by(|a, b| self.change(*b, output).total_cmp(&self.change(*a, output)));
        list
    }

    /// Sobol indices of an output; none without a global study, and for an output without derivatives.
    pub fn indices(&self, output: usize) -> Option<&Sobol> {
        self.global.as_ref().and_then(|(indices, _)| indices.get(output))
    }
}
