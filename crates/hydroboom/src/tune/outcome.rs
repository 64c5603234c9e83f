//! Results of tuning: the fit, its validation on data that were not fitted, and remarks.

use super::hold_out::Fold;
use hydroboom_description::Description;
use hydroboom_identify::{
    Determination, Experiment, Fit, HeldOut, IdentifyError, Improvement, Judgement, Profile,
    Stretch, Tuned, differences, held_out, predict, verdict,
};

/// Results of tuning.
pub struct Outcome<'a> {
    /// Crane before tuning.
    pub crane: &'a Description,
    /// Segments of the logs, in the order of the options.
    pub experiments: Vec<Experiment>,
    /// Fit of the keys to the logs, without held-out stretches unless they are held out in turn.
    pub fit: Fit,
    /// Hold-out validation on each stretch, in each log that contains it.
    pub held_out: Vec<HeldOut>,
    /// Searches that held out one stretch after the other; empty if they were held out together.
    pub folds: Vec<Fold>,
    /// Profile likelihoods that were asked for.
    pub profiles: Vec<Profile>,
    /// Residuals of the segments of the test logs before and after the fit.
    pub tests: Vec<Improvement>,
    /// SHA-256 of each log, in hexadecimal digits.
    pub digests: Vec<String>,
    /// SHA-256 of each experiment's log; a log may have several segments.
    pub experiment_digests: Vec<String>,
    /// Remarks on logs and fit.
    pub notes: Vec<String>,
}

impl Outcome<'_> {
    /// Verdict on the tuned model for each experiment, by its name.
    pub fn verdicts(&self) -> impl Iterator<Item = (&str, Vec<Judgement>)> {
        verdicts(&self.experiments, &self.fit)
    }

    /// Remark on the sensor parameters that are applied to test logs; none without test logs.
    pub fn remark_on_test_logs(&self) -> Option<&'static str> {
        (!self.tests.is_empty()).then_some(match self.fit.sensors().is_empty() {
            true => "On logs that were not used no delay or offset is applied: all are fixed.",
            false => {
                "On logs that were not used the tuned model has the same sensors, with the delays and offsets above."
            }
        })
    }
}

/// Verdict on the fitted model for each experiment, by its name.
fn verdicts<'a>(
    experiments: &'a [Experiment],
    fit: &'a Fit,
) -> impl Iterator<Item = (&'a str, Vec<Judgement>)> {
    let pairs = experiments.iter().zip(&fit.predictions.1);
    pairs.map(|(e, prediction)| (e.name.as_str(), verdict(&differences(e, prediction))))
}

/// Whether the fitted model is within all limits for all experiments.
pub fn is_right(experiments: &[Experiment], fit: &Fit) -> bool {
    verdicts(experiments, fit).all(|(_, judgements)| judgements.iter().all(Judgement::is_right))
}

/// Prediction errors of the fitted model on a held-out stretch, in each experiment that contains it.
pub fn hold_out_validation<'a>(
    experiments: &'a [Experiment],
    fit: &'a Fit,
    stretch: Stretch,
) -> impl Iterator<Item = HeldOut> + 'a {
    let pairs = experiments.iter().zip(&fit.predictions.1);
    pairs.filter_map(move |(experiment, prediction)| held_out(experiment, prediction, stretch))
}

/// Residuals of an experiment that was not fitted, before and after the fit. The sensors of the same machine keep their
/// delays and offsets.
///
/// # Errors
///
/// [`IdentifyError`] if a simulation fails.
pub fn test_log_improvement(
    before: &Description,
    fit: &Fit,
    experiment: &Experiment,
) -> Result<Improvement, IdentifyError> {
    let (a, b) = (predict(before, experiment)?, fit.on_another_log(experiment)?);
    Ok(Improvement::new(experiment, &a, &b))
}

/// Determination of a key in a word for tables.
pub fn determination(tuned: &Tuned) -> &'static str {
    match tuned.determination {
        Determination::Biased(_) => "BIASED",
        Determination::Determined => "yes",
        _ => "NO",
    }
}

/// Keys that are neither determined nor biased, with the reasons.
pub fn undetermined_keys(fit: &Fit) -> impl Iterator<Item = (&Tuned, String)> {
    let unbiased = fit.tuned.iter().filter(|tuned| tuned.biased().is_none());
    unbiased.filter_map(|tuned| Some((tuned, tuned.determination.reason()?)))
}

/// Keys whose value is that of an equivalent model, with the omitted effects that bias them.
pub fn biased_keys(fit: &Fit) -> impl Iterator<Item = (&Tuned, &'static str)> {
    fit.tuned.iter().filter_map(|tuned| Some((tuned, tuned.biased()?)))
}
