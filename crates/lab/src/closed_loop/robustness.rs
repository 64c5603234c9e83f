//! Robustness and input-shaping trials on the virtual crane, each under several controllers.

use crate::LabError;
use crate::closed_loop::controller_choice::ControllerChoice;
use crate::closed_loop::metrics::{Effort, Metrics, SustainedOscillation, TrackingError};
use crate::closed_loop::scenario::{Course, CourseChoice, Load};
use crate::closed_loop::simulation::simulate_closed_loop;
use crate::closed_loop::sustained_oscillation::sustained_oscillation;
use crate::eigenfrequency::locked_mode;
use crate::motion_test::UNSTABLE_MARK;
use hydroboom_control::reference::input_shaper::ShapedTrajectory;
use hydroboom_control::reference::profile::{OutAndBack, RampShape, SetPoint};
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_description::Description;
use rayon::prelude::*;
use serde::Serialize;

/// Largest payload of the trials, relative to the crane's payload \[-\].
pub const HEAVIEST: f64 = 1.45;

/// Trial: a changed virtual crane and a course with load changes.
pub struct Trial {
    /// Name of the trial.
    pub name: String,
    crane: Description,
    course: Box<dyn Course>,
}

/// Result of one controller in a trial.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// Name of the trial.
    pub trial: String,
    /// Controller under test.
    #[serde(rename = "strategy")]
    pub controller: ControllerChoice,
    /// Tracking error; NaN if the course could not be finished.
    #[serde(flatten)]
    pub error: TrackingError,
    /// Control effort and vibration of the tip.
    #[serde(flatten)]
    pub effort: Effort,
    /// Whether the loop was in sustained oscillation at rest, or the course could not be finished.
    pub unstable: bool,
    /// Negation of `unstable`, under the name that the other commands use.
    pub stable: bool,
    /// Whether the linearised closed loops of the controller on the crane are stable. None if unknown, as for
    /// baselines other than a retuned benchmark.
    pub has_stable_loops: Option<bool>,
    /// Sustained oscillation of the piston; none without one, and for a course that was not finished.
    pub sustained_oscillation: Option<SustainedOscillation>,
}

/// Robustness trials: delays, noise, friction, limits, and load changes in motion, on a virtual crane. The
/// controllers use the model only.
///
/// # Errors
///
/// [`LabError::Description`] if a crane cannot be changed accordingly.
pub fn robustness(model: &Description, crane: &Description) -> Result<Vec<Trial>, LabError> {
    let n = &crane.numbers;
    let fast = CourseChoice::Motion(model.numbers.fast);
    let slow = CourseChoice::Motion(model.numbers.slow);
    let scenario = |name: &str| CourseChoice::Scenario(name.into());
    let with = |name: &str, course: &CourseChoice, changes: &[String]| {
        let mut crane = crane.clone();
        changes.iter().try_for_each(|change| crane.set(change))?;
        Ok(Trial { name: name.into(), course: course.of(&crane)?, crane })
    };
    let delay = |cycles: u32| {
        let name = format!("fieldbus delay each way: {cycles} of its cycles");
        with(&name, &fast, &[format!("fieldbus.delay_cycles={cycles}")])
    };
    let of = |key: &str, value: f64| format!("{key}={value}");
    let fast_with = |name: &str, key: &str, value: f64| with(name, &fast, &[of(key, value)]);
    let mass = n.payload;
    [
        with("as it is, fast", &fast, &[]),
        fast_with("ramps of 0.1 s", "motion.ramp_s", 0.1),
        fast_with("ramps of 0.2 s", "motion.ramp_s", 0.2),
        fast_with("ramps of 0.5 s", "motion.ramp_s", 0.5),
        fast_with("empty hook", "payload.mass_kg", 0.0),
        fast_with("half the payload", "payload.mass_kg", 0.5 * mass),
        fast_with("1.45 times the payload", "payload.mass_kg", HEAVIEST * mass),
        fast_with("oil that stiffens at 10 bar", "oil.transition_bar", 10.0),
        fast_with("oil that stiffens at 65 bar", "oil.transition_bar", 65.0),
        fast_with(
            "beam with 0.7 times the stiffness",
            "boom.youngs_modulus_gpa",
            0.7e-9 * n.youngs_modulus,
        ),
        fast_with(
            "pressure sensors off by 0.5 % of their span",
            "sensors.pressure_error_percent",
            0.5,
        ),
        fast_with("sensors of 200 Hz", "sensors.bandwidth_hz", 200.0),
        fast_with("encoder of 0.2 mm", "sensors.position_resolution_mm", 0.2),
        delay(0),
        delay(1),
        delay(2),
        delay(3),
        with(
            "sensors four times as noisy",
            &fast,
            &[
                of("sensors.position_noise_mm", 4e3 * n.position_noise),
                of("sensors.pressure_noise_percent", 400.0 * n.pressure_noise),
            ],
        ),
        fast_with("drive of 15 Hz", "drive.bandwidth_hz", 15.0),
        fast_with("drive of 1.5 Hz", "drive.bandwidth_hz", 1.5),
        Ok(Trial {
            name: "reference known only up to now, fast".into(),
            course: Box::new(Joystick(fast.of(crane)?)),
            crane: crane.clone(),
        }),
        with("starts slowly, as it is", &slow, &[]),
        with(
            "starts slowly, twice the stiction",
            &slow,
            &[of("friction.stiction_n", 2.0 * n.stiction)],
        ),
        with("small moves", &scenario("small-moves"), &[]),
        with("starts and stops", &scenario("start-stop"), &[]),
        with("reversal without a pause", &scenario("reversal"), &[]),
        with("faster than the motor can", &scenario("saturation"), &[]),
        with("load picked up and lost in motion", &scenario("load-in-motion"), &[]),
        with("load changed at rest", &scenario("payload-change"), &[]),
    ]
    .into_iter()
    .collect()
}

/// Course without preview, as from a joystick: the controller knows past and present set points only.
struct Joystick(Box<dyn Course>);

impl Trajectory for Joystick {
    fn reference(&self, t: f64) -> SetPoint<f64> {
        self.0.reference(t)
    }
    fn duration(&self) -> f64 {
        self.0.duration()
    }
    fn speed(&self) -> f64 {
        self.0.speed()
    }
}

impl Course for Joystick {
    fn name(&self) -> String {
        self.0.name()
    }
    fn loads(&self) -> &[Load] {
        self.0.loads()
    }
    fn is_known_ahead(&self) -> bool {
        false
    }
}

/// Motion with its own name.
struct Named<P> {
    name: String,
    path: P,
}

impl<P: Trajectory> Trajectory for Named<P> {
    fn reference(&self, t: f64) -> SetPoint<f64> {
        self.path.reference(t)
    }
    fn duration(&self) -> f64 {
        self.path.duration()
    }
    fn speed(&self) -> f64 {
        self.path.speed()
    }
}

impl<P: Trajectory> Course for Named<P> {
    fn name(&self) -> String {
        self.name.clone()
    }
}

/// Input-shaping trials: the published trapezoid, S-curves with the same ramp, and both input shapers for
/// the model's lowest mode at locked cylinder.
///
/// # Errors
///
/// [`LabError::NoOscillation`] if the model has no such mode; [`LabError::Plant`] or [`LabError::Design`] if it has no
/// state of rest at the middle of its motion, or its eigenvalues cannot be computed.
pub fn shaping(model: &Description, crane: &Description) -> Result<Vec<Trial>, LabError> {
    let middle = 0.5 * (model.numbers.motion_start + model.numbers.motion_end);
    let mode = locked_mode(model, middle)?;
    let (frequency, damping) = (mode.frequency_hz, mode.damping_ratio);
    let mut all = Vec::new();
    for speed in [model.numbers.slow, model.numbers.fast] {
        let trapezoid = OutAndBack { profile: RampShape::Trapezoidal, ..model.motion(speed) };
        let curve = OutAndBack { profile: RampShape::SCurve, ..trapezoid };
        let mut add = |what: &str, path: Box<dyn Course>| {
            let name = format!("{:.0} mm/s, {what}", speed * 1e3);
            all.push(Trial { name, crane: crane.clone(), course: path });
        };
        add("trapezoid (published)", named(trapezoid));
        add("S-curve", named(curve));
        add("trapezoid, shaped twice", named(ShapedTrajectory::zv(trapezoid, frequency, damping)));
        let thrice = ShapedTrajectory::zvd(trapezoid, frequency, damping);
        add("trapezoid, shaped thrice", named(thrice));
        let both = ShapedTrajectory::zv(curve, frequency, damping);
        add("S-curve, shaped twice", named(both));
    }
    Ok(all)
}

fn named<P: Trajectory + 'static>(path: P) -> Box<dyn Course> {
    Box::new(Named { name: "motion".into(), path })
}

impl Outcome {
    /// Name of the controller, marked if a loop is unstable, or the run was in sustained oscillation or
    /// could not be finished.
    pub fn marked_name(&self) -> String {
        format!("{}{}", self.controller.name(), if self.is_marked() { UNSTABLE_MARK } else { "" })
    }

    /// Whether a loop is unstable, or the run was in sustained oscillation or could not be finished: its errors are
    /// then no tracking errors.
    pub fn is_marked(&self) -> bool {
        !self.stable || self.has_stable_loops == Some(false)
    }

    /// Sentence on a run that did not come to rest, with the oscillation; empty otherwise.
    pub fn verdict(&self) -> String {
        let stability = match (self.stable, self.sustained_oscillation) {
            (true, _) => String::new(),
            (false, Some(oscillation)) => format!("unstable: {oscillation}"),
            (false, None) => "unstable: cannot be finished".into(),
        };
        let missing = self.effort.without_solution();
        let both: Vec<String> =
            [stability, missing].into_iter().filter(|said| !said.is_empty()).collect();
        both.join("; ")
    }
}

/// Simulates each trial under each controller, on all cores. Controllers are designed for `model` and know nothing of
/// the changed crane; `progress` is called after each simulation. A simulation that fails is an outcome without errors
/// (NaN) that counts as unstable.
pub fn run(
    model: &Description,
    trials: &[Trial],
    controllers: &[ControllerChoice],
    progress: &(dyn Fn() + Sync),
) -> Vec<Outcome> {
    // many trials share a crane
    let is_same =
        |a: &Description, b: &Description| a.numbers == b.numbers && a.choices == b.choices;
    let mut cranes: Vec<&Description> = Vec::new();
    for trial in trials {
        if !cranes.iter().any(|crane| is_same(crane, &trial.crane)) {
            cranes.push(&trial.crane);
        }
    }
    let loops_around = |crane: &&Description| -> Vec<Option<bool>> {
        controllers.iter().map(|controller| controller.has_stable_loops(model, crane)).collect()
    };
    let loops: Vec<Vec<Option<bool>>> = cranes.par_iter().map(loops_around).collect();
    let jobs: Vec<(&Trial, usize)> =
        trials.iter().flat_map(|trial| (0..controllers.len()).map(move |c| (trial, c))).collect();
    jobs.par_iter()
        .map(|(trial, c)| {
            let crane = cranes.iter().position(|crane| is_same(crane, &trial.crane));
            let outcome = Outcome {
                has_stable_loops: crane.and_then(|crane| loops[crane][*c]),
                ..one(model, trial, controllers[*c])
            };
            progress();
            outcome
        })
        .collect()
}

fn one(model: &Description, trial: &Trial, controller: ControllerChoice) -> Outcome {
    let course = trial.course.as_ref();
    let mut metrics = Metrics::new();
    let end = simulate_closed_loop(model, &trial.crane, controller, course, |sample| {
        metrics.add(sample);
        Ok(())
    });
    let oscillation =
        end.and_then(|()| sustained_oscillation(model, &trial.crane, controller, course, &metrics));
    let (done, stable) = (oscillation.is_ok(), matches!(oscillation, Ok(None)));
    Outcome {
        trial: trial.name.clone(),
        controller,
        error: if done { metrics.tracking_error() } else { TrackingError::UNFINISHED },
        effort: metrics.effort(),
        unstable: !stable,
        stable,
        has_stable_loops: None,
        sustained_oscillation: oscillation.ok().flatten(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::strategy::Strategy;

    /// A short course on a light crane whose loop is unstable with the published gains. Its row is marked,
    /// whether the run oscillated or not.
    #[test]
    fn a_row_of_an_unstable_loop_is_marked() {
        let model = Description::uia_single_boom().unwrap();
        let mut light = model.clone();
        light.set("payload.mass_kg=100").unwrap();
        let path = OutAndBack { end: model.numbers.motion_start + 0.01, ..model.motion(0.12) };
        let trial = |crane: &Description| Trial {
            name: "short".into(),
            crane: crane.clone(),
            course: named(path),
        };
        let controllers =
            [Strategy::BenchmarkClosedLoop, Strategy::VelocityFeedforward].map(Into::into);
        let outcomes = run(&model, &[trial(&light), trial(&model)], &controllers, &|| ());
        let marked: Vec<bool> =
            outcomes.iter().map(|outcome| outcome.marked_name().ends_with(UNSTABLE_MARK)).collect();
        assert!(marked[0]);
        assert_eq!(marked[2..], [false, false], "{outcomes:?}");
        assert_eq!(
            (outcomes[0].has_stable_loops, outcomes[1].has_stable_loops),
            (Some(false), Some(true))
        );
    }
}
