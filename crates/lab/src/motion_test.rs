//! Tests 1 to 3 of section 5.3: strategies at two speeds on a plant that may differ from the model.

use crate::closed_loop::metrics::{Effort, Metrics, SustainedOscillation, TrackingError};
use crate::closed_loop::sample::Sample;
use crate::closed_loop::scenario::{Course, motion_name};
use crate::closed_loop::simulation::{Case, simulate_cases, simulate_closed_loop};
use crate::closed_loop::sustained_oscillation::sustained_oscillation as sustained_oscillation_of;
use crate::{LabError, paper};
use hydroboom_control::reference::profile::OutAndBack;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_design::stability::LoopStability;
use serde::{Serialize, Serializer};

/// Serialises a strategy by its name.
pub(crate) fn by_name<S: Serializer>(strategy: &Strategy, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(strategy.name())
}

/// Closed-loop simulation of one strategy along one course on one plant.
#[derive(Clone, Debug)]
pub struct Run {
    /// Control strategy.
    pub strategy: Strategy,
    /// Name of the course.
    pub course: String,
    /// Largest speed of the course \[m/s\].
    pub speed: f64,
    /// All control periods, up to the stop of a stopped simulation.
    pub samples: Vec<Sample>,
    /// Sustained oscillation of the piston while its reference rested, and after the course's end if it may
    /// have begun there.
    pub sustained_oscillation: Option<SustainedOscillation>,
    /// Reason why the simulation stopped before the course's end, or in the rest after it; none if
    /// complete. The samples go up to the stop.
    pub stopped: Option<String>,
}

impl Run {
    /// Result of a strategy along a course. A simulation whose state left the model's range of validity is
    /// a stopped run.
    fn ended(
        model: &Description,
        plant: &Description,
        (strategy, course): (Strategy, &dyn Course),
        samples: Vec<Sample>,
        end: Result<(), LabError>,
    ) -> Result<Self, LabError> {
        let (name, speed) = (course.name(), course.speed());
        let (sustained_oscillation, stopped) = (None, None);
        let mut run =
            Self { strategy, course: name, speed, samples, sustained_oscillation, stopped };
        let judged = end.and_then(|()| {
            sustained_oscillation_of(model, plant, strategy.into(), course, &run.metrics())
        });
        match judged {
            Ok(found) => run.sustained_oscillation = found,
            Err(LabError::Simulation { error, .. }) => run.stopped = Some(error.to_string()),
            Err(other) => return Err(other),
        }
        Ok(run)
    }

    /// Whether the course was completed and the piston came to rest where the reference rested. Only then are its
    /// errors tracking errors.
    pub fn is_stable(&self) -> bool {
        self.sustained_oscillation.is_none() && self.stopped.is_none()
    }

    /// Tracking errors, effort and oscillation of the run.
    pub fn metrics(&self) -> Metrics {
        let mut metrics = Metrics::new();
        self.samples.iter().for_each(|sample| metrics.add(sample));
        metrics
    }

    /// RMS and peak of the tracking error as text, or the sustained oscillation or the stop in their place.
    pub fn tracking(&self) -> String {
        let metrics = self.metrics();
        if let Some(reason) = &self.stopped {
            return format!("stopped: {reason}");
        }
        match self.sustained_oscillation {
            None => {
                let error = metrics.tracking_error();
                let [rms, rms_measured, peak, peak_measured] = error.cells();
                match error.is_measured_truly() {
                    true => format!("RMS {rms:.2} mm, peak {peak:.2} mm"),
                    false => format!(
                        "RMS true {rms:.2} mm, measured {rms_measured:.2} mm, peak true {peak:.2} mm, measured {peak_measured:.2} mm"
                    ),
                }
            }
            Some(oscillation) => format!("in sustained oscillation, {oscillation}"),
        }
    }

    /// RMS measured tracking error over the whole motion, rests included \[m\]; up to the stop for a stopped run.
    pub fn rms(&self) -> f64 {
        self.metrics().rms()
    }

    /// Measured error of largest magnitude, with its sign \[m\]; up to the stop for a stopped run.
    pub fn peak(&self) -> f64 {
        self.metrics().peak()
    }
}

/// Row of a results table: one strategy along one course on one plant.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Name of the plant, `nominal` for the model itself.
    pub plant: String,
    /// Control strategy.
    #[serde(serialize_with = "by_name")]
    pub strategy: Strategy,
    /// Name of the course.
    pub course: String,
    /// Largest reference speed of the course \[mm/s\].
    pub speed_mm_s: f64,
    /// Whether the piston came to rest where its reference rested: false for a sustained oscillation or a
    /// stopped simulation.
    pub stable: bool,
    /// Whether the linearised closed loops of the strategy on the plant are stable. If one is not, small
    /// errors are due to friction that holds the piston, or to an oscillation limited by the motor.
    pub has_stable_loops: bool,
    /// Reason why the simulation stopped before the course's end; it then has no errors. None for a completed course.
    pub stopped: Option<String>,
    /// Sustained oscillation; none without one. The errors then measure the oscillation and not the tracking.
    pub sustained_oscillation: Option<SustainedOscillation>,
    /// Tracking error; NaN for a stopped simulation.
    #[serde(flatten)]
    pub error: TrackingError,
    /// Control effort and vibration of the tip.
    #[serde(flatten)]
    pub effort: Effort,
    /// RMS error of the paper at this speed, measured on the real crane \[mm\]; none if the paper has none.
    pub paper_rms_mm: Option<f64>,
    /// Peak error of the paper at this speed, measured on the real crane \[mm\]; none if the paper has none.
    pub paper_peak_mm: Option<f64>,
}

impl Row {
    /// The row without the paper's values, which apply to its own crane only.
    #[must_use]
    pub fn without_paper(self) -> Self {
        Self { paper_rms_mm: None, paper_peak_mm: None, ..self }
    }

    /// The row with the stability of the strategy's loops on its plant.
    #[must_use]
    pub fn with_loops(self, loops: &[LoopStability]) -> Self {
        let stable = loops.iter().filter(|of| of.is_of(self.strategy)).all(|of| of.stable);
        Self { has_stable_loops: stable, ..self }
    }

    /// Name of the strategy, marked if a loop is unstable, or the run was in sustained oscillation or
    /// stopped.
    pub fn marked_name(&self) -> String {
        let mark = if self.stable && self.has_stable_loops { "" } else { UNSTABLE_MARK };
        format!("{}{mark}", self.strategy.name())
    }

    /// Row of a run on the named plant, with the paper's values if the course is its motion at one of its two speeds.
    ///
    /// Errors of a stopped run are NaN. The loops count as stable until [`with_loops`](Self::with_loops)
    /// judges them.
    pub fn of(plant: &str, run: &Run) -> Self {
        let (speed_mm_s, metrics) = (run.speed * 1e3, run.metrics());
        let column = paper::SPEEDS_MM_S.iter().position(|v| run.course == motion_name(*v));
        let printed = column.zip(paper::tracking_mm(run.strategy));
        let printed = printed.map(|(c, (rms, peak))| (rms[c], peak[c]));
        let (error, effort) = match run.stopped {
            None => (metrics.tracking_error(), metrics.effort()),
            Some(_) => (TrackingError::UNFINISHED, Effort::UNFINISHED),
        };
        Self {
            plant: plant.into(),
            strategy: run.strategy,
            course: run.course.clone(),
            speed_mm_s,
            stable: run.is_stable(),
            has_stable_loops: true,
            stopped: run.stopped.clone(),
            sustained_oscillation: run.sustained_oscillation,
            error,
            effort,
            paper_rms_mm: printed.map(|p| p.0),
            paper_peak_mm: printed.map(|p| p.1),
        }
    }
}

/// Mark behind the name of a strategy whose loop is unstable.
pub const UNSTABLE_MARK: &str = " (!)";

/// Explanation of [`UNSTABLE_MARK`], as a sentence below a table.
pub const REMARK_ON_MARK: &str = "(!): its closed loop is unstable, linearised, or the run was in sustained oscillation or stopped; its errors and effort are no merit.";

/// [`REMARK_ON_MARK`] if at least one row is marked, else none.
pub fn remark_on_mark(rows: &[Row]) -> Option<&'static str> {
    let is_marked = rows.iter().any(|row| !(row.stable && row.has_stable_loops));
    is_marked.then_some(REMARK_ON_MARK)
}

/// Remarks on runs in sustained oscillation and on stopped runs, a sentence each; empty if there are none.
pub fn instability_remarks(rows: &[Row]) -> Vec<String> {
    let remark = |row: &Row| {
        let what = match (&row.stopped, row.sustained_oscillation) {
            (Some(reason), _) => format!("STOPPED: {reason}; it has no errors"),
            (None, Some(oscillation)) => format!(
                "UNSTABLE, in sustained oscillation of {oscillation}; its errors are no tracking errors"
            ),
            (None, None) => return None,
        };
        let (strategy, plant, course) = (row.strategy.name(), &row.plant, row.course.trim());
        Some(format!("{strategy} on {plant} at {course}: {what}"))
    };
    rows.iter().filter_map(remark).collect()
}

/// Simulates one strategy along a course, with the controller every control period and the cranes every simulation
/// period.
///
/// Controller and simulated crane use the `model` only. They control the `plant`, measured by its sensors.
///
/// # Errors
///
/// [`LabError::Plant`] or [`LabError::Design`] if a crane or the controller cannot be built; [`LabError::Simulation`]
/// if a state leaves the model's range of validity.
pub fn run(
    model: &Description,
    plant: &Description,
    strategy: Strategy,
    course: &dyn Course,
) -> Result<Run, LabError> {
    let mut samples = Vec::with_capacity(count(model, course));
    simulate_closed_loop(model, plant, strategy, course, |sample| {
        samples.push(*sample);
        Ok(())
    })?;
    let (name, speed) = (course.name(), course.speed());
    let (sustained_oscillation, stopped) = (None, None);
    let mut run = Run { strategy, course: name, speed, samples, sustained_oscillation, stopped };
    run.sustained_oscillation =
        sustained_oscillation_of(model, plant, strategy.into(), course, &run.metrics())?;
    Ok(run)
}

/// Simulates one strategy along a course as [`run`], on a crane whose state may leave the model's range of validity.
/// The simulation then ends there and is [`stopped`](Run::stopped).
///
/// # Errors
///
/// [`LabError::Plant`] or [`LabError::Design`] if a crane or the controller cannot be built.
pub fn attempted(
    model: &Description,
    plant: &Description,
    strategy: Strategy,
    course: &dyn Course,
) -> Result<Run, LabError> {
    let mut samples = Vec::with_capacity(count(model, course));
    let end = simulate_closed_loop(model, plant, strategy, course, |sample| {
        samples.push(*sample);
        Ok(())
    });
    Run::ended(model, plant, (strategy, course), samples, end)
}

/// Simulates all strategies along a course, vectorised if the plant allows it, including stopped runs.
///
/// # Errors
///
/// See [`attempted`].
pub fn run_all(
    model: &Description,
    plant: &Description,
    course: &dyn Course,
) -> Result<[Run; Strategy::ALL.len()], LabError> {
    let cases =
        Strategy::ALL.map(|strategy| Case { crane: plant, controller: strategy.into(), course });
    let mut samples = cases.map(|_| Vec::with_capacity(count(model, course)));
    let ends = simulate_cases(model, &cases, |lane, sample| samples[lane].push(*sample));
    let all = Strategy::ALL.into_iter().zip(samples).zip(ends);
    let runs = all
        .map(|((strategy, samples), end)| {
            Run::ended(model, plant, (strategy, course), samples, end)
        })
        .collect::<Result<Vec<Run>, LabError>>()?;
    runs.try_into().map_err(|_| LabError::NoOscillation("a strategy was not run".into()))
}

fn count(model: &Description, course: &dyn Course) -> usize {
    (course.duration() / model.numbers.control_period) as usize + 2
}

/// Frequency \[Hz\] of the oscillation of the true p_A during the first cruise at constant speed, from a run under
/// velocity feedforward. It is n/Δt between upward crossings of the mean, as in [`crate::eigenfrequency::frequency`].
///
/// # Errors
///
/// [`LabError::NoOscillation`] if there are fewer than two whole periods.
pub fn pressure_oscillation(motion: &OutAndBack<f64>, run: &Run) -> Result<f64, LabError> {
    let from = motion.rest + motion.ramp;
    let to = motion.rest + motion.travel_time() - motion.ramp;
    let (times, values): (Vec<f64>, Vec<f64>) = run
        .samples
        .iter()
        .filter(|s| (from..=to).contains(&s.time))
        .map(|s| (s.time, s.truth.outputs.pressure_a))
        .unzip();
    crate::eigenfrequency::frequency(&times, &values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closed_loop::scenario::CourseChoice;

    #[test]
    fn strategies_simulated_side_by_side_equal_single_runs() {
        let model = Description::uia_single_boom().unwrap();
        let crane = Description::uia_virtual().unwrap();
        // with a payload change during the course
        let course = CourseChoice::Scenario("load-in-motion".into()).of(&crane).unwrap();
        let together = run_all(&model, &crane, course.as_ref()).unwrap();
        for strategy in [
            Strategy::VelocityFeedforward,
            Strategy::SimulationFeedforwardClosedLoop,
            Strategy::ScheduledLqr,
        ] {
            let alone = run(&model, &crane, strategy, course.as_ref()).unwrap();
            let other = &together[strategy as usize];
            assert_eq!(alone.samples.len(), other.samples.len());
            for (a, b) in alone.samples.iter().zip(&other.samples) {
                assert_eq!(a.signals, b.signals);
                assert_eq!(a.command, b.command);
            }
        }
    }
}
