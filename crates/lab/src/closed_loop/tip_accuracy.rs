//! Accuracy of the estimated tip position on virtual cranes, without and with a survey of each crane,
//! compared with other methods.
//!
//! The estimator uses the model's crane file and, after a survey, the parameters fitted to it. It runs
//! beside the controller in closed loop. The truth is the virtual crane's state at the time of the
//! measurement. Errors are those of the tip's height over the whole course: mean error (bias) and RMS about
//! it.

mod height_map;
mod observer;
mod rest_table;
mod survey_noise;

pub use survey_noise::NoiseFloor;

use crate::LabError;
use crate::closed_loop::controller_choice::ControllerChoice;
use crate::closed_loop::monte_carlo::{Member, Percentiles, member, widened};
use crate::closed_loop::scenario::{Course, CourseChoice};
use crate::closed_loop::simulation::{Case, WIDTH, simulate_cases};
use crate::interruptible::as_long_as;
use crate::virtual_survey::SurveyOrder;
use hydroboom_control::feedback::scheduled_lqr_controller::ScheduledLqrController;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;
use observer::{Errors, Observer, Run, TipEstimators};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rest_table::RestTable;
use serde::Serialize;
use std::ops::Range;

/// Interval between two evaluations of the errors \[s\].
const INSTANT: f64 = 0.01;

/// Method that computes the position of the boom's tip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Rigid boom at the measured piston position.
    Rigid,
    /// Model of the crane file at rest with estimated piston position and payload.
    Published,
    /// (a) Tip estimator without a survey.
    Unsurveyed,
    /// Baseline: regression of four coefficients on stroke and payload, fitted to the same survey.
    Map,
    /// (b) Tip estimator after the survey.
    Surveyed,
}

impl Method {
    /// All methods, in the order of tables.
    pub const ALL: [Self; 5] =
        [Self::Rigid, Self::Published, Self::Unsurveyed, Self::Map, Self::Surveyed];

    /// Name in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rigid => "rigid boom",
            Self::Published => "model of the crane file at rest",
            Self::Unsurveyed => "(a) estimator, nothing surveyed",
            Self::Map => "map of four numbers, surveyed",
            Self::Surveyed => "(b) estimator, surveyed",
        }
    }
}

/// Errors of the tip's height with one method over the family.
#[derive(Clone, Debug, Serialize)]
pub struct MethodRow {
    /// Name of the method, as of [`Method::name`].
    pub method: &'static str,
    /// Magnitude of the mean error of a crane \[mm\], over the family.
    pub bias_mm: Percentiles,
    /// RMS error about the mean of a crane \[mm\], over the family.
    pub rms_about_mm: Percentiles,
    /// RMS error of a crane \[mm\], over the family.
    pub rms_mm: Percentiles,
    /// Mean standard deviation that the method states \[mm\]; none if it states none.
    pub deviation_mm: Option<f64>,
    /// Share of instants \[%\] with an error within two standard deviations, over all cranes; none if the method
    /// states none.
    pub coverage_percent: Option<f64>,
}

/// Heights of the tip at one instant of a course, for a figure.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct TipInstant {
    /// Time of the measurement \[s\].
    pub time_s: f64,
    /// Height of the tip of a rigid boom at the true piston position \[m\].
    pub rigid_y_m: f64,
    /// True height of the tip \[m\].
    pub true_y_m: f64,
    /// Height of the tip by each method, in the order of [`Method::ALL`] \[m\].
    pub estimated_y_m: [f64; Method::ALL.len()],
    /// Standard deviation that each method states \[m\]; zero if it states none.
    pub deviation_y_m: [f64; Method::ALL.len()],
}

/// Result of the study of the tip's accuracy over a family.
#[derive(Clone, Debug, Serialize)]
pub struct TipAccuracy {
    /// Numbers of those cranes in the family that completed the course.
    pub cranes: Vec<u64>,
    /// Cranes that could not complete the course, with the reason; they do not count.
    pub failed: Vec<String>,
    /// Errors by method, in the order of [`Method::ALL`].
    pub methods: Vec<MethodRow>,
    /// Errors that the noise of the survey alone causes.
    pub survey_noise: NoiseFloor,
    /// Number of the crane drawn in the figure: the one of median RMS error after a survey; 0 if none completed.
    pub drawn: u64,
    /// Instants of the drawn crane's course; empty if no crane completed it.
    #[serde(skip)]
    pub course: Vec<TipInstant>,
}

/// Family of cranes for the study of the tip's accuracy, and its survey.
#[derive(Clone, Debug)]
pub struct TipFamily {
    /// Numbers of the cranes in the family.
    pub cranes: Range<u64>,
    /// Seed of the family's random parameters.
    pub seed: u64,
    /// Whether stiffness of beam and base, dead volumes, sensors and fieldbus vary too.
    pub is_widened: bool,
    /// Standard deviation of each surveyed coordinate \[m\].
    pub survey_deviation: f64,
}

/// Surveys each crane of a family and runs the tip estimator beside a controller along a course. `go_on`
/// receives the share done and returns whether to continue; otherwise the cranes completed so far count.
///
/// # Errors
///
/// - [`LabError::Description`] if a crane of the family cannot exist;
/// - [`LabError::Plant`] if a crane has no state of rest at a surveyed pose;
/// - [`LabError::Survey`] if the model has no tip estimator, or nothing can be fitted to a survey;
/// - [`LabError::Design`] if the state estimator cannot be designed for the model;
/// - [`LabError::Scenario`] if the course has an unknown name.
pub fn tip_accuracy(
    model: &Description,
    nominal: &Description,
    controller: ControllerChoice,
    course: &CourseChoice,
    family: &TipFamily,
    go_on: &(dyn Fn(f64) -> bool + Sync),
) -> Result<TipAccuracy, LabError> {
    let draw = if family.is_widened { widened } else { member };
    let numbers: Vec<u64> = family.cranes.clone().collect();
    let mut all: Vec<(Member, TipEstimators)> = Vec::with_capacity(numbers.len());
    for number in &numbers {
        let one = draw(nominal, family.seed, *number)?;
        let order = SurveyOrder {
            loads: [0.0, model.numbers.payload],
            deviation: family.survey_deviation,
            seed: family.seed.rotate_left(17) ^ number.wrapping_mul(0xa076_1d64_78bd_642f),
        };
        let known = TipEstimators::new(model, &one.crane, &order)?;
        all.push((one, known));
    }
    let estimator = scheduled_lqr_controller(model)?;
    let at_rest = RestTable::new(model)?;
    let groups: Vec<&[(Member, TipEstimators)]> = all.chunks(WIDTH).collect();
    let share = |done: usize| go_on(done as f64 / groups.len().max(1) as f64);
    let one = |group: &&[(Member, TipEstimators)]| {
        simulate_group(model, &estimator, &at_rest, controller, group, course)
    };
    let done = as_long_as(&groups, &share, one)
        .into_iter()
        .map(Option::transpose)
        .collect::<Result<Vec<_>, LabError>>()?;
    let (mut finished, mut failed) = (Vec::new(), Vec::new());
    for ((numbers, group), runs) in numbers.chunks(WIDTH).zip(&groups).zip(done) {
        let Some(runs) = runs else { continue };
        for ((number, (_, known)), run) in numbers.iter().zip(*group).zip(runs) {
            match run {
                Ok(run) => finished.push((*number, known, run)),
                Err(error) => failed.push(format!("crane {number}: {error}")),
            }
        }
    }
    let methods = Method::ALL.map(|method| {
        let errors = || finished.iter().map(|(.., run)| &run.errors[method as usize]);
        let sum = |of: fn(&Errors) -> f64| errors().map(of).sum::<f64>();
        let tells = matches!(method, Method::Unsurveyed | Method::Surveyed);
        let mean = |of: fn(&Errors) -> f64| tells.then(|| sum(of) / sum(|e| e.count));
        MethodRow {
            method: method.name(),
            bias_mm: Percentiles::of(errors().map(|e| e.bias().abs())),
            rms_about_mm: Percentiles::of(errors().map(Errors::rms_about)),
            rms_mm: Percentiles::of(errors().map(Errors::rms)),
            deviation_mm: mean(|e| e.deviations),
            coverage_percent: mean(|e| 100.0 * e.within),
        }
    });
    let mut random = Pcg64Mcg::seed_from_u64(family.seed);
    let left: Vec<(f64, f64)> = finished
        .iter()
        .flat_map(|(_, known, run)| run.slopes.left_by_noise(&known.noise, &mut random))
        .collect();
    let mut by_error: Vec<usize> = (0..finished.len()).collect();
    let rms = |k: usize| finished[k].2.errors[Method::Surveyed as usize].rms();
    by_error.sort_by(|a, b| rms(*a).total_cmp(&rms(*b)));
    let median = by_error.get(by_error.len() / 2).and_then(|k| finished.get(*k));
    Ok(TipAccuracy {
        drawn: median.map_or(0, |(number, ..)| *number),
        course: median.map_or_else(Vec::new, |(.., run)| run.course.clone()),
        cranes: finished.iter().map(|(number, ..)| *number).collect(),
        failed,
        methods: methods.into(),
        survey_noise: NoiseFloor::of(&left),
    })
}

/// Up to [`WIDTH`] cranes along a course.
fn simulate_group(
    model: &Description,
    estimator: &ScheduledLqrController,
    at_rest: &RestTable,
    controller: ControllerChoice,
    group: &[(Member, TipEstimators)],
    choice: &CourseChoice,
) -> Result<Vec<Result<Run, String>>, LabError> {
    let courses: Vec<Box<dyn Course>> =
        group.iter().map(|(member, _)| choice.of(&member.crane)).collect::<Result<_, _>>()?;
    let cases: Vec<Case<'_>> = group
        .iter()
        .zip(&courses)
        .map(|((member, _), course)| Case {
            crane: &member.crane,
            controller,
            course: course.as_ref(),
        })
        .collect();
    let mut observers: Vec<Observer<'_>> = group
        .iter()
        .map(|(member, known)| Observer::new(*estimator, known, at_rest, model, &member.crane))
        .collect();
    let ends = simulate_cases(model, &cases, |lane, sample| observers[lane].see(sample));
    Ok(observers
        .into_iter()
        .zip(ends)
        .map(|(observer, end)| end.map(|()| observer.run).map_err(|error| error.to_string()))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::strategy::Strategy;

    /// Cranes of varying stiffness that were not used for tuning. The bounds have their coverage, and the
    /// survey reduces the error to what its noise allows.
    #[test]
    fn tip_bounds_have_their_coverage_and_a_survey_reduces_the_error() {
        let model = Description::uia_single_boom().unwrap();
        let nominal = Description::uia_virtual().unwrap();
        let family =
            TipFamily { cranes: 0..8, seed: 404, is_widened: true, survey_deviation: 1e-3 };
        let course = CourseChoice::Motion(nominal.numbers.fast);
        let controller = Strategy::ScheduledLqr.into();
        let found =
            tip_accuracy(&model, &nominal, controller, &course, &family, &|_| true).unwrap();
        let row = |method: Method| &found.methods[method as usize];
        assert_eq!((found.cranes.len(), found.failed.len()), (8, 0));
        for method in [Method::Unsurveyed, Method::Surveyed] {
            let coverage = row(method).coverage_percent.unwrap();
            assert!(coverage >= 90.0, "{}: {coverage} %", method.name());
        }
        let surveyed = row(Method::Surveyed);
        assert!(surveyed.bias_mm.median < 1.0, "{:?}", surveyed.bias_mm);
        assert!(surveyed.rms_about_mm.median < 0.3, "{:?}", surveyed.rms_about_mm);
        assert!(surveyed.rms_mm.median < row(Method::Map).rms_mm.median);
    }
}
