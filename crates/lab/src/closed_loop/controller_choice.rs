//! Choice of the controller in a closed loop: a strategy or a baseline. This is the one list of all
//! controllers.

use crate::LabError;
use crate::baselines::Baseline;
use hydroboom_control::controller::Controller;
use hydroboom_control::feedback::published_strategy::PublishedStrategy;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;
use hydroboom_design::stability::{benchmark_stability, stability_of};
use serde::{Serialize, Serializer};

/// Controller of a closed loop: a strategy of the project, or a baseline for comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ControllerChoice {
    /// Control strategy of the project.
    Strategy(Strategy),
    /// Baseline, a published method for comparison.
    Baseline(Baseline),
}

impl ControllerChoice {
    /// All strategies, in the order in which they are listed in tables.
    pub fn strategies() -> Vec<Self> {
        Strategy::ALL.map(Self::Strategy).to_vec()
    }

    /// All strategies, then all baselines designed for a model.
    ///
    /// # Errors
    ///
    /// See [`Baseline::all`].
    pub fn all(model: &Description) -> Result<Vec<Self>, LabError> {
        let mut all = Self::strategies();
        all.extend(Baseline::all(model)?.map(Self::Baseline));
        Ok(all)
    }

    /// Index among all controllers, from 0, for the order of tables: strategies first, then baselines.
    pub fn place(self) -> usize {
        let names = Strategy::ALL.iter().map(|strategy| strategy.name()).chain(Baseline::NAMES);
        names.take_while(|name| *name != self.name()).count()
    }

    /// Controller for a machine described by the model.
    ///
    /// # Errors
    ///
    /// [`LabError::Design`] if the scheduled LQR cannot be designed for the model; for baselines those of
    /// [`Baseline::controller`].
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

    /// Whether its closed loops on a crane, linearised at positions over the stroke, are stable. None for baselines
    /// other than a retuned benchmark, and if a loop cannot be computed.
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

    /// Name in tables and JSON, as `scheduled-lqr`.
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
