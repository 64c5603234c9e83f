//! Which controller closes the loop: a strategy that is offered, or a baseline. Here is the one list of them all.

use crate::LabError;
use crate::baselines::Baseline;
use hydroboom_control::controller::Controller;
use hydroboom_control::feedback::published_strategy::PublishedStrategy;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;
use hydroboom_design::stability::{benchmark_stability, stability_of};
use serde::{Serialize, Serializer};

/// A controller, by its name and its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ControllerChoice {
    /// A strategy that is offered.
    Strategy(Strategy),
    /// A baseline, that is only compared with.
    Baseline(Baseline),
}

impl ControllerChoice {
    /// All strategies, in their order.
    pub fn strategies() -> Vec<Self> {
        Strategy::ALL.map(Self::Strategy).to_vec()
    }

    /// All strategies, then all baselines as designed for a model.
    ///
    /// # Errors
    ///
    /// As of [`Baseline::all`].
    pub fn all(model: &Description) -> Result<Vec<Self>, LabError> {
        let mut all = Self::strategies();
        all.extend(Baseline::all(model)?.map(Self::Baseline));
        Ok(all)
    }

    /// Its place among all of them.
    pub fn place(self) -> usize {
        let names = Strategy::ALL.iter().map(|strategy| strategy.name()).chain(Baseline::NAMES);
        names.take_while(|name| *name != self.name()).count()
    }

    /// The controller for a machine of which the model is known.
    ///
    /// # Errors
    ///
    /// [`LabError`] when it cannot be designed for the model.
    pub(crate) fn controller(self, model: &Description) -> Result<Box<dyn Controller>, LabError> {
        Ok(match self {
            Self::Strategy(Strategy::ScheduledLqr) => Box::new(scheduled_lqr_controller(model)?),
            Self::Strategy(strategy) => Box::new(PublishedStrategy::new(
                strategy,
                model.benchmark(),
                model.cylinder().area_ratio(),
            )),
            Self::Baseline(baseline) => baseline.controller(model)?,
        })
    }

    /// Whether the loops that it steers through around a crane are stable, linearised over the stroke; none of a baseline that is not the benchmark with other gains, and
    /// where a loop cannot be computed.
    pub fn has_stable_loops(self, model: &Description, crane: &Description) -> Option<bool> {
        match self {
            Self::Strategy(strategy) => {
                let loops = stability_of(&[strategy], model, crane).ok()?;
                Some(loops.iter().filter(|of| of.is_of(strategy)).all(|of| of.stable))
            }
            Self::Baseline(
                Baseline::RetunedBenchmark(gains) | Baseline::ShapedBenchmark(gains),
            ) => Some(benchmark_stability(&gains.put(model), Some(crane)).ok()?.stable),
            Self::Baseline(_) => None,
        }
    }

    /// Name in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Strategy(strategy) => strategy.name(),
            Self::Baseline(baseline) => baseline.name(),
        }
    }
}

impl From<Strategy> for ControllerChoice {
    fn from(strategy: Strategy) -> Self {
        Self::Strategy(strategy)
    }
}

impl From<Baseline> for ControllerChoice {
    fn from(baseline: Baseline) -> Self {
        Self::Baseline(baseline)
    }
}

impl Serialize for ControllerChoice {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.name())
    }
}
