//! Accuracy of the estimated tip position on virtual cranes, without and with a survey of each crane,
//! compared with other methods.
//!
//! The estimator uses the model's crane file and, after a survey, the parameters fitted to it. It runs
//! beside the controller in closed loop. The truth is the virtual crane's state at the time of the
//! measurement. Errors are those of the tip's height over the whole course: mean error (bias) and RMS about
//! it.

use crate::closed_loop::controller_choice::ControllerChoice;
use crate::closed_loop::monte_carlo::{Member, Percentiles, member, widened};
use crate::closed_loop::sample::Sample;
use crate::closed_loop::scenario::{Course, CourseChoice};
use crate::closed_loop::simulation::{Case, WIDTH, simulate_cases};
use crate::interruptible::as_long_as;
use crate::virtual_survey::{SurveyOrder, virtual_survey};
use crate::{LabError, plant};
use hydroboom_control::estimation::tip::{
    PARAMETERS, TipEstimator, TipLoad, TipMemory, TipParameters,
};
use hydroboom_control::feedback::scheduled_lqr_controller::ScheduledLqrController;
use hydroboom_control::measurement::Measurement;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;
use hydroboom_design::tip::tip_estimator;
use hydroboom_design::tip_survey::{SurveyError, SurveyFit, TipSurvey};
use hydroboom_math::Real;
use hydroboom_model::Scheme;
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use std::collections::VecDeque;
use std::ops::Range;

/// Interval between two evaluations of the errors \[s\].
const INSTANT: f64 = 0.01;
/// Simulated surveys per crane, for the effect of the survey's noise.
const DRAWS: usize = 200;
/// Number of piston positions in the table of the published model.
const TABLE: usize = 17;

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

/// Errors of one method on one crane \[mm\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Errors {
    count: f64,
    sum: f64,
    squares: f64,
    /// Number of instants within two standard deviations, and sum of the standard deviations.
    within: f64,
    deviations: f64,
}

impl Errors {
    fn add(&mut self, error: f64, deviation: f64) {
        self.count += 1.0;
        self.sum += error;
        self.squares += error * error;
        self.within += f64::from(u8::from(error.abs() <= 2.0 * deviation));
        self.deviations += deviation;
    }
    fn bias(&self) -> f64 {
        self.sum / self.count
    }
    fn rms(&self) -> f64 {
        (self.squares / self.count).sqrt()
    }
    fn rms_about(&self) -> f64 {
        (self.squares / self.count - self.bias().powi(2)).max(0.0).sqrt()
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

/// Errors of the surveyed estimator that the noise of the survey alone causes.
#[derive(Clone, Debug, Serialize)]
pub struct NoiseFloor {
    /// Magnitude of the mean error \[mm\].
    pub bias_mm: Percentiles,
    /// RMS error about the mean \[mm\].
    pub rms_about_mm: Percentiles,
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
    /// Number of the crane drawn in the figure: the one of median RMS error after a survey.
    pub drawn: u64,
    /// Instants of the drawn crane's course.
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

/// Baseline: loss of height, c_0 + c_1 x + (c_2 + c_3 x) m, by least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
struct HeightMap(Vector4<f64>);

impl HeightMap {
    fn features(load: &TipLoad<f64>) -> Vector4<f64> {
        // scaled to similar magnitudes
        let (x, m) = (load.piston * 2.0, load.payload * 3e-3);
        Vector4::new(1.0, x, m, x * m)
    }

    fn fit(survey: &TipSurvey, rigid: &dyn Fn(f64) -> f64) -> Option<Self> {
        let (mut left, mut right) = (Matrix4::zeros(), Vector4::zeros());
        for p in &survey.points {
            let load = TipLoad { piston: p.stroke, payload: p.payload, acceleration: 0.0 };
            let row = Self::features(&load);
            let weight = p.deviation.powi(-2);
            left += row * row.transpose() * weight;
            right += row * (weight * (p.tip[1] - rigid(p.stroke)));
        }
        left.try_inverse().map(|inverse| Self(inverse * right))
    }

    fn at(&self, load: &TipLoad<f64>) -> f64 {
        self.0.dot(&Self::features(load))
    }
}

/// Height of the model's tip at rest over stroke and payload: linear in the payload, interpolated over the
/// stroke.
struct RestTable {
    stroke: f64,
    empty: Vec<f64>,
    per_kg: Vec<f64>,
}

impl RestTable {
    fn new(model: &Description) -> Result<Self, LabError> {
        let n = &model.numbers;
        let heavy = n.payload.max(1.0);
        let (mut empty, mut per_kg) = (Vec::new(), Vec::new());
        for k in 0..TABLE {
            let stroke = n.stroke * k as f64 / (TABLE - 1) as f64;
            let height = |payload: f64| {
                let mut loaded = model.clone();
                loaded.numbers.payload = payload;
                plant(&loaded, &loaded.start(stroke), Scheme::Implicit, 1e-3)
                    .map(|crane| crane.outputs().tip_y)
            };
            let without = height(0.0)?;
            empty.push(without);
            per_kg.push((height(heavy)? - without) / heavy);
        }
        Ok(Self { stroke: n.stroke, empty, per_kg })
    }

    fn at(&self, load: &TipLoad<f64>) -> f64 {
        let place = load.piston / self.stroke * (TABLE - 1) as f64;
        f64::interpolate(&self.empty, place) + load.payload * f64::interpolate(&self.per_kg, place)
    }
}

/// Estimators of the tip of one crane.
struct Known {
    unsurveyed: TipEstimator<f64>,
    surveyed: TipEstimator<f64>,
    map: HeightMap,
    /// Covariance of the fitted parameters due to the survey's noise alone.
    noise: Matrix3<f64>,
}

fn rigid_height(estimator: &TipEstimator<f64>, stroke: f64) -> f64 {
    let stiff = TipParameters { bending: 0.0, base: 0.0, stroke_offset: 0.0 };
    let load = TipLoad { piston: stroke, payload: 0.0, acceleration: 0.0 };
    estimator.model.position(&stiff, &load)[1]
}

impl Known {
    fn new(
        model: &Description,
        crane: &Description,
        order: &SurveyOrder,
    ) -> Result<Self, LabError> {
        let unsurveyed =
            tip_estimator(model).ok_or_else(|| SurveyError::NoTip(model.name.clone()))?;
        let survey = virtual_survey(crane, order)?;
        let fit = survey.fit(model)?;
        let map = HeightMap::fit(&survey, &|stroke| rigid_height(&unsurveyed, stroke))
            .ok_or_else(|| SurveyError::NoFit(survey.file.clone()))?;
        let noise = Matrix3::from_fn(|i, j| fit.noise[i][j]);
        Ok(Self { unsurveyed, surveyed: fit.estimator, map, noise })
    }
}

/// Results of a crane's course.
#[derive(Clone, Default)]
struct Run {
    errors: [Errors; Method::ALL.len()],
    slopes: SlopeMoments,
    course: Vec<TipInstant>,
}

/// Sums of the derivatives of the height with respect to the fitted parameters along a course, and of their
/// products.
#[derive(Clone, Copy, Debug, Default)]
struct SlopeMoments {
    count: f64,
    sum: Vector3<f64>,
    products: Matrix3<f64>,
}

impl SlopeMoments {
    fn add(&mut self, slopes: Vector3<f64>) {
        self.count += 1.0;
        self.sum += slopes;
        self.products += slopes * slopes.transpose();
    }

    /// Bias and RMS about it \[m\] for given errors of the fitted parameters.
    fn left_by(&self, errors: &Vector3<f64>) -> (f64, f64) {
        let bias = self.sum.dot(errors) / self.count;
        let square = errors.dot(&(self.products * errors)) / self.count;
        (bias, (square - bias * bias).max(0.0).sqrt())
    }

    /// The same for [`DRAWS`] surveys with noise of a given covariance.
    fn left_by_noise(&self, noise: &Matrix3<f64>, random: &mut Pcg64Mcg) -> Vec<(f64, f64)> {
        // scaled, because the parameters have different magnitudes
        let scale = Vector3::from_fn(|i, _| noise[(i, i)].sqrt().max(f64::MIN_POSITIVE));
        let scaled = Matrix3::from_fn(|i, j| noise[(i, j)] / (scale[i] * scale[j]));
        let eigen = scaled.symmetric_eigen();
        let size = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
        let draw = |_| {
            let normal = Vector3::from_fn(|_, _| StandardNormal.sample(&mut *random));
            let errors = eigen.eigenvectors * size.component_mul(&normal);
            self.left_by(&errors.component_mul(&scale))
        };
        (0..DRAWS).map(draw).collect()
    }
}

impl NoiseFloor {
    fn of(left: &[(f64, f64)]) -> Self {
        Self {
            bias_mm: Percentiles::of(left.iter().map(|(bias, _)| bias.abs() * 1e3)),
            rms_about_mm: Percentiles::of(left.iter().map(|(_, rms)| rms * 1e3)),
        }
    }

    /// Errors due to a survey's noise along the fast motion of a description with its payload.
    pub fn of_survey(fit: &SurveyFit, description: &Description, seed: u64) -> Self {
        let n = &description.numbers;
        let motion = description.motion(n.fast);
        let mut slopes = SlopeMoments::default();
        for k in 0..=(motion.duration() / INSTANT) as u32 {
            let piston = motion.reference(f64::from(k) * INSTANT).position;
            let load = TipLoad { piston, payload: n.payload, acceleration: 0.0 };
            slopes.add(Vector3::from(fit.estimator.slopes(&load).0[1]));
        }
        let noise = Matrix3::from_fn(|i, j| fit.noise[i][j]);
        Self::of(&slopes.left_by_noise(&noise, &mut Pcg64Mcg::seed_from_u64(seed)))
    }
}

struct Observer<'a> {
    controller: ScheduledLqrController,
    known: &'a Known,
    at_rest: &'a RestTable,
    memory: TipMemory<f64>,
    past: VecDeque<Sample>,
    delay: usize,
    command: f64,
    number: u64,
    every: u64,
    run: Run,
}

impl Observer<'_> {
    fn see(&mut self, sample: &Sample) {
        self.number += 1;
        let measurement = Measurement::new(self.number, sample.time, [sample.signals]);
        self.controller.observe(&measurement, self.command);
        if let Some(estimated) = self.controller.estimated() {
            let filter = &self.controller.estimator().filter;
            self.known.unsurveyed.update(&mut self.memory, filter, &estimated.filter);
        }
        self.command = sample.command.motor_speed;
        self.past.push_back(*sample);
        // the estimator has no measurement before the delay has passed
        if self.past.len() <= self.delay {
            return;
        }
        let Some(measured) = self.past.pop_front() else { return };
        if self.number.is_multiple_of(self.every) {
            self.compare(&measured);
        }
    }

    fn compare(&mut self, measured: &Sample) {
        let Some(estimated) = self.controller.estimated() else { return };
        let (filter, known) = (&estimated.filter, self.known);
        let model = &self.controller.estimator().filter.model;
        let payload = self.memory.payload;
        // the other methods use the same payload
        let load = TipLoad { payload, ..TipLoad::of(model, &filter.estimate) };
        let outputs = &measured.truth.outputs;
        let found = Method::ALL.map(|method| {
            let by = |tip: &TipEstimator<f64>| {
                let tip = tip.estimate(&self.memory, model, filter);
                (tip.y, tip.deviation_y)
            };
            let rigid = || rigid_height(&known.unsurveyed, load.piston);
            match method {
                Method::Rigid => (rigid(), 0.0),
                Method::Published => (self.at_rest.at(&load), 0.0),
                Method::Unsurveyed => by(&known.unsurveyed),
                Method::Map => (rigid() + known.map.at(&load), 0.0),
                Method::Surveyed => by(&known.surveyed),
            }
        });
        for (errors, (height, deviation)) in self.run.errors.iter_mut().zip(found) {
            errors.add((height - outputs.tip_y) * 1e3, deviation * 1e3);
        }
        self.run.slopes.add(Vector3::from(known.surveyed.slopes(&load).0[1]));
        self.run.course.push(TipInstant {
            time_s: measured.time,
            rigid_y_m: rigid_height(&known.unsurveyed, outputs.stroke),
            true_y_m: outputs.tip_y,
            estimated_y_m: found.map(|(height, _)| height),
            deviation_y_m: found.map(|(_, deviation)| deviation),
        });
    }
}

/// Surveys each crane of a family and runs the tip estimator beside a controller along a course. `go_on`
/// receives the share done and returns whether to continue.
///
/// # Errors
///
/// [`LabError`] if a crane cannot be built or surveyed, or the estimator cannot be designed for the model.
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
    let mut all: Vec<(Member, Known)> = Vec::with_capacity(numbers.len());
    for number in &numbers {
        let one = draw(nominal, family.seed, *number)?;
        let order = SurveyOrder {
            loads: [0.0, model.numbers.payload],
            deviation: family.survey_deviation,
            seed: family.seed.rotate_left(17) ^ number.wrapping_mul(0xa076_1d64_78bd_642f),
        };
        let known = Known::new(model, &one.crane, &order)?;
        all.push((one, known));
    }
    let estimator = scheduled_lqr_controller(model)?;
    let at_rest = RestTable::new(model)?;
    let groups: Vec<&[(Member, Known)]> = all.chunks(WIDTH).collect();
    let share = |done: usize| go_on(done as f64 / groups.len().max(1) as f64);
    let one = |group: &&[(Member, Known)]| {
        together(model, &estimator, &at_rest, controller, group, course)
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
fn together(
    model: &Description,
    estimator: &ScheduledLqrController,
    at_rest: &RestTable,
    controller: ControllerChoice,
    group: &[(Member, Known)],
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
    let every = (INSTANT / model.numbers.control_period).round().max(1.0) as u64;
    let mut observers: Vec<Observer<'_>> = group
        .iter()
        .map(|(member, known)| Observer {
            controller: *estimator,
            known,
            at_rest,
            memory: TipMemory::default(),
            past: VecDeque::new(),
            delay: member.crane.numbers.fieldbus_delay.round() as usize,
            command: 0.0,
            number: 0,
            every,
            run: Run::default(),
        })
        .collect();
    let ends = simulate_cases(model, &cases, |lane, sample| observers[lane].see(sample));
    Ok(observers
        .into_iter()
        .zip(ends)
        .map(|(observer, end)| end.map(|()| observer.run).map_err(|error| error.to_string()))
        .collect())
}

const _: () = assert!(PARAMETERS == 3, "the matrices of a survey's noise are of three numbers");

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
