//! The model made right: keys moved until it shows what was measured.
//!
//! What is minimised is `Σ ((log − model)/σ)² + Σ ((ln θ − ln θ_0)/s)²`: differences of all signals of all logs, each
//! against what its sensor and the model's own shortcomings leave (σ), and each key against what is known of it (s, from its
//! provenance). Where each log starts from is free too, within what sensors err by: a pump side that starts a tenth of
//! a bar wrong would be explained by something else. So are delay and offset of each channel ([`Nuisance`]). Levenberg and Marquardt's method with exact slopes; σ is found anew
//! once from what the first round leaves.

mod certainty;
mod determination;
mod layout;
mod nuisance;
mod pitch;
mod profile;
mod residual;
mod samples;
mod search;
mod watch;

pub use determination::Determination;
pub use nuisance::{Allowed, Effect, Nuisance};
pub use profile::{LIMIT, Profile, profile};
pub use watch::Progress;

use crate::error::IdentifyError;
use crate::experiment::{COMPARED, Experiment};
use crate::free::Free;
use crate::oscillation_features::OscillationFeatures;
use crate::prediction::{Prediction, predict_from};
use crate::structural_limit::limit_of;
use certainty::{Certainty, Considered};
use determination::Common;
use hydroboom_description::Description;
use layout::{Layout, PER_LOG};
use nalgebra::DVector;
use pitch::Pitch;
use residual::{Deviations, Leaves, deviations, has_lack_of_fit, residuals};
use samples::Samples;
use search::{Ends, Known, Search};
use watch::Watch;

/// One key after tuning.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuned {
    /// The key.
    pub key: Free,
    /// Its value before and after, in SI units.
    pub value: (f64, f64),
    /// What was known of it beforehand: deviation of ln θ.
    pub prior: f64,
    /// Deviation of ln θ now, what was known included.
    pub deviation: f64,
    /// Deviation of ln θ from the logs alone, with the other keys as well known as they were, free or not; infinite where the logs
    /// say nothing.
    pub from_logs: f64,
    /// The same if all keys that are not free were exact.
    pub others_exact: f64,
    /// Whether the logs determine it, and why not.
    pub determination: Determination,
    /// What it is traded against most, a key or a channel's delay or offset, and the correlation with it.
    pub partner: Option<(String, f64)>,
}

/// What a motor speed on straight lines between a log's samples may be wrong by, as a deviation of ln θ: no log tells more.
const RESOLVED: f64 = 3e-5;

impl Tuned {
    /// Whether the logs determine it.
    pub fn is_determined(&self) -> bool {
        self.determination == Determination::Determined
    }

    /// What the model leaves out that is found in it instead, where the logs show that the model is not the true one: then it is biased.
    pub fn biased(&self) -> Option<&'static str> {
        match self.determination {
            Determination::Biased(reason) => Some(reason),
            _ => None,
        }
    }

    /// The interval, in SI units, that holds the true value in nineteen cases of twenty, if the model is the true one.
    pub fn interval(&self) -> (f64, f64) {
        let factor = (1.96 * self.deviation.hypot(RESOLVED)).exp();
        (self.value.1 / factor, self.value.1 * factor)
    }
}

/// Delay or offset of a log's channel after tuning.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// The log.
    pub log: String,
    /// What it is.
    pub nuisance: Nuisance,
    /// Its value, in its unit.
    pub value: f64,
    /// Its deviation, in its unit, what was known included.
    pub deviation: f64,
    /// The key that it is traded against most, and the correlation with it.
    pub partner: Option<(String, f64)>,
}

impl Channel {
    /// The interval, in its unit, that holds the true value in nineteen cases of twenty.
    pub fn interval(&self) -> (f64, f64) {
        (self.value - 1.96 * self.deviation, self.value + 1.96 * self.deviation)
    }

    /// Whether it ended at a limit of what is allowed of it: more would be found there if it might go on, and the keys take that.
    pub fn is_at_limit(&self) -> bool {
        determination::is_at_limit(self.value, self.nuisance.allowed().range)
    }

    /// Whether zero is outside its interval.
    pub fn is_off(&self) -> bool {
        self.value.abs() > 1.96 * self.deviation
    }
}

/// RMS differences of a log's signals before and after, in SI units; none where a signal was not measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Improvement {
    /// The log.
    pub log: String,
    /// Before and after, in the order of [`COMPARED`].
    pub rms: [Option<(f64, f64)>; COMPARED.len()],
}

impl Improvement {
    /// Differences of a log to two predictions.
    pub fn new(experiment: &Experiment, before: &Prediction, after: &Prediction) -> Self {
        let rms = |prediction: &Prediction, signal: usize| {
            let errors = residuals(experiment, prediction, signal);
            let count = errors.len();
            (count > 0)
                .then(|| (errors.iter().map(|e| e.1 * e.1).sum::<f64>() / count as f64).sqrt())
        };
        let both = |s: usize| Some((rms(before, s)?, rms(after, s)?));
        Self { log: experiment.name.clone(), rms: std::array::from_fn(both) }
    }
}

/// What tuning came to.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The description with its keys moved.
    pub description: Description,
    /// The keys.
    pub tuned: Vec<Tuned>,
    /// Delay and offset of each channel of each log, but for those that were fixed.
    pub channels: Vec<Channel>,
    /// Correlations of the keys, what was known included.
    pub correlation: Vec<Vec<f64>>,
    /// Correlations of each key with each of the [`channels`](Self::channels).
    pub channel_correlation: Vec<Vec<f64>>,
    /// The logs.
    pub improvements: Vec<Improvement>,
    /// What the model shows under each log's inputs, before and after.
    pub predictions: (Vec<Prediction>, Vec<Prediction>),
    /// How often the model was run.
    pub evaluations: usize,
    /// Whether the search ended because nothing more was to be gained.
    pub has_converged: bool,
    /// Where the search ended, and what it was held against there.
    end: End,
}

impl Fit {
    /// Delays and offsets of the machine's sensors, which belong to another log of it too, in their units: the mean of the logs that were tuned to, each weighed by
    /// its inverse variance (Cochran, Biometrics 10, 1954, 101-129).
    ///
    /// They are what the keys were found with, and drawn to zero as far as the logs do not tell them. To leave out those that are not significantly other than zero
    /// would keep keys that were traded against them, and jump with their intervals (a pre-test estimator: Judge and Bock, The Statistical Implications of Pre-Test
    /// and Stein-Rule Estimators in Econometrics, 1978).
    pub fn sensors(&self) -> Vec<(Nuisance, f64)> {
        nuisance::means(&self.channels)
    }

    /// What the tuned model shows on a log that was not used, through the same machine's [`sensors`](Self::sensors).
    ///
    /// # Errors
    ///
    /// [`IdentifyError`] when the model cannot be run.
    pub fn on_another_log(&self, experiment: &Experiment) -> Result<Prediction, IdentifyError> {
        let [mut delays, mut offsets] = [[0.0; COMPARED.len()]; 2];
        for (nuisance, value) in self.sensors() {
            let to = match nuisance.effect {
                Effect::Delay => &mut delays,
                Effect::Offset => &mut offsets,
            };
            if let Some(place) = COMPARED.iter().position(|signal| *signal == nuisance.signal) {
                to[place] = value * nuisance.allowed().size;
            }
        }
        let channel = experiment.initial_channels();
        let starts = std::array::from_fn(|k| channel[k].map_or(0.0, |place| -offsets[place]));
        let mut shown = predict_from(&self.description, experiment, &starts)?;
        nuisance::all_delayed(&mut shown, &delays, experiment.interval());
        for row in &mut shown {
            row.iter_mut().zip(offsets).for_each(|(value, offset)| *value += offset);
        }
        Ok(shown)
    }
}

/// Where a search ended.
#[derive(Clone, Debug)]
struct End {
    at: Vec<f64>,
    deviations: Vec<Deviations>,
    certainty: Certainty,
}

/// What is asked of a search.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The model to begin with.
    pub model: &'a Description,
    /// The logs.
    pub experiments: &'a [Experiment],
    /// The keys to move.
    pub free: &'a [Free],
    /// Delays and offsets of channels that stay zero; all others are free.
    pub fixed: &'a [Nuisance],
    /// Where an earlier search was, as its [`Progress`] told; none to begin at the model.
    pub resume: Option<&'a [f64]>,
    /// Generations of a global search (CMA-ES) before the local one: as wide as what is known of the keys leaves
    /// open. It is for a model that is far off; usually none are needed.
    pub generations: usize,
}

impl<'a> Task<'a> {
    fn layout(&self) -> Layout<'a> {
        Layout {
            model: self.model,
            experiments: self.experiments,
            free: self.free,
            fixed: self.fixed,
        }
    }

    /// What is known of the keys, and of each log's starts and channels.
    fn known(&self) -> Known {
        let mut mean: Vec<f64> = self.free.iter().map(|key| key.value(self.model).ln()).collect();
        let mut deviation: Vec<f64> =
            self.free.iter().map(|key| key.prior_deviation(self.model)).collect();
        let of_logs = PER_LOG * self.experiments.len();
        mean.extend(std::iter::repeat_n(0.0, of_logs));
        deviation.extend(std::iter::repeat_n(1.0, of_logs));
        Known { mean, deviation }
    }

    /// The logs in longer steps: good enough to find where a search ends.
    fn coarse(&self) -> Vec<Experiment> {
        self.experiments.iter().map(Experiment::coarse).collect()
    }
}

/// Moves keys of a model until it shows what the logs do. `go_on` is told how far the search has come, and says whether
/// to go on.
///
/// # Errors
///
/// [`IdentifyError`] when the model cannot be run where it begins, or the search was stopped.
pub fn fit(task: &Task<'_>, go_on: &dyn Fn(&Progress<'_>) -> bool) -> Result<Fit, IdentifyError> {
    let known = task.known();
    let layout = task.layout();
    let longer = task.coarse();
    let before = layout.predictions(&known.mean)?;
    let watch = Watch::new(go_on);
    let mut at = DVector::from_column_slice(task.resume.unwrap_or(&known.mean));
    if at.len() != known.mean.len() {
        return Err(IdentifyError::Resume { moved: known.mean.len(), saved: at.len() });
    }
    // first the pitch, where log and model ring differently: compared sample by sample they would be out of phase
    let there = layout.predictions(at.as_slice())?;
    let forks: Vec<Option<OscillationFeatures>> = task
        .experiments
        .iter()
        .zip(&there)
        .map(|(e, p)| OscillationFeatures::new(e, p, task.generations > 0))
        .collect();
    let all = Nuisance::named("all")?;
    if forks.iter().any(Option::is_some) {
        let sum = Pitch { forks: &forks };
        // no channel's delay or offset changes a pitch
        let keys = Layout { fixed: &all, ..layout };
        let search = Search::new(keys, sum, &known, at, &watch);
        let ends = Ends { sum: 1e-4, place: 1e-4, patience: 3 };
        at = search.searched(task.generations).minimised(ends).0.at;
    }
    let there = layout.predictions(at.as_slice())?;
    let mut held_against = deviations(task.experiments, &there, Leaves::Unknown);
    // the first round in longer steps. Delays and offsets of channels make valleys of their own where the model is far off: a search without
    // them may come farther, though it has less to move
    let first = Layout { experiments: &longer, ..layout };
    let mut rounds = vec![first];
    if (0..longer.len()).any(|log| layout.nuisances(log).next().is_some()) {
        rounds.push(Layout { fixed: &all, ..first });
    }
    let mut least = f64::INFINITY;
    let begun = at;
    at = begun.clone();
    for round in rounds {
        let sum = Samples::new(round.experiments, &held_against);
        let (found, _) = searched(Search::new(round, sum, &known, begun.clone(), &watch))?;
        let terms = found.terms(&found.at).unwrap_or_else(|| vec![f64::INFINITY]);
        let sum: f64 = terms.iter().map(|term| term * term).sum();
        if sum < least {
            (at, least) = (found.at, sum);
        }
    }
    // the second with what the first left as deviations
    let there = layout.predictions(at.as_slice())?;
    let left = deviations(task.experiments, &there, Leaves::AsNow);
    let sum = Samples::new(layout.experiments, &left);
    let (found, has_converged) = searched(Search::new(layout, sum, &known, at, &watch))?;
    at = found.at;
    let mut kept = found.sum.kept.into_inner();
    let after = layout.predictions(at.as_slice())?;
    held_against = deviations(task.experiments, &after, Leaves::AsNow);
    let held = Considered::of(task);
    let information =
        layout.information(at.as_slice(), &held_against, &mut kept, &known, &held.keys)?;
    let certainty =
        Certainty::new(information, known.deviation.iter().chain(&held.deviation).copied());
    let improvements = task.experiments.iter().zip(before.iter().zip(&after));
    let improvements = improvements.map(|(e, (before, after))| Improvement::new(e, before, after));
    let evaluations = watch.borrow().runs();
    let channels = channels(&layout, at.as_slice(), &certainty);
    let mut pairs = task.experiments.iter().zip(&after);
    let shows_more = pairs.any(|(experiment, shown)| has_lack_of_fit(experiment, shown));
    Ok(Fit {
        description: layout.moved(at.as_slice()),
        tuned: tuned(
            &layout,
            &known,
            at.as_slice(),
            &certainty,
            &held,
            &Common::new(task.experiments, &after, &channels, has_converged),
            shows_more,
        ),
        channels,
        correlation: certainty.correlation(task.free.len()),
        channel_correlation: with_channels(&layout, &certainty),
        improvements: improvements.collect(),
        predictions: (before, after),
        evaluations,
        has_converged,
        end: End { at: at.as_slice().to_vec(), deviations: held_against, certainty },
    })
}

/// A search at its end, and whether nothing more was to be gained. It may not end early: a ringing log has flat valleys.
fn searched<'a, 'w>(
    search: Search<'a, 'w, Samples<'a>>,
) -> Result<(Search<'a, 'w, Samples<'a>>, bool), IdentifyError> {
    let watch = search.watch;
    watch.borrow_mut().begin();
    let found = search.minimised(Ends { sum: 1e-6, place: 1e-5, patience: 6 });
    if watch.borrow().is_stopped() {
        return Err(IdentifyError::Stopped);
    }
    Ok(found)
}

/// What is to be said of each key.
fn tuned(
    layout: &Layout<'_>,
    known: &Known,
    at: &[f64],
    certainty: &Certainty,
    considered: &Considered,
    common: &Common,
    shows_more: bool,
) -> Vec<Tuned> {
    let nuisances = (0..layout.experiments.len()).flat_map(|log| layout.nuisances(log));
    let keys = layout.free.iter().map(|key| key.path()).enumerate();
    let held = considered.keys.iter().enumerate();
    let all: Vec<(usize, String)> = keys
        .chain(nuisances.map(|(place, nuisance)| (place, nuisance.path())))
        .chain(held.map(|(k, key)| (layout.size() + k, format!("{}, not free", key.path()))))
        .collect();
    let of = |(k, key): (usize, &Free)| {
        let (prior, deviation) = (known.deviation[k], certainty.deviation(k));
        let alone = certainty.alone(k);
        let found = Tuned {
            key: *key,
            value: (known.mean[k].exp(), at[k].exp()),
            prior,
            deviation,
            from_logs: alone.deviation,
            others_exact: alone.exact,
            determination: Determination::Determined,
            partner: partner(k, &all, certainty),
        };
        let limit = limit_of(*key, &layout.model.numbers);
        let determination = common.of(&found, limit.filter(|_| shows_more));
        Tuned { determination, ..found }
    };
    layout.free.iter().enumerate().map(of).collect()
}

/// What is to be said of each channel.
fn channels(layout: &Layout<'_>, at: &[f64], certainty: &Certainty) -> Vec<Channel> {
    let keys: Vec<(usize, String)> = layout.free.iter().map(|key| key.path()).enumerate().collect();
    let of = |log: usize| {
        let keys = &keys;
        layout.nuisances(log).map(move |(place, nuisance)| {
            let deviation = nuisance.allowed().deviation;
            Channel {
                log: layout.experiments[log].name.clone(),
                nuisance,
                value: at[place] * deviation,
                deviation: certainty.deviation(place) * deviation,
                partner: partner(place, keys, certainty),
            }
        })
    };
    (0..layout.experiments.len()).flat_map(of).collect()
}

/// Correlations of each key with each log's delays and offsets, in the order of [`channels`].
fn with_channels(layout: &Layout<'_>, certainty: &Certainty) -> Vec<Vec<f64>> {
    let logs = 0..layout.experiments.len();
    let places: Vec<usize> =
        logs.flat_map(|log| layout.nuisances(log)).map(|(place, _)| place).collect();
    let of_key = |key| places.iter().map(|place| certainty.correlation_of(key, *place)).collect();
    (0..layout.free.len()).map(of_key).collect()
}

/// Which of several one is traded against most.
fn partner(place: usize, all: &[(usize, String)], certainty: &Certainty) -> Option<(String, f64)> {
    let others = all.iter().filter(|(other, _)| *other != place);
    let others =
        others.map(|(other, name)| (name.clone(), certainty.correlation_of(place, *other)));
    others.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
}
