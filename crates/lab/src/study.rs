//! Study: all experiments of the paper.

use crate::claims::{self, Claim, claims};
use crate::closed_loop::scenario::Course;
use crate::double_damping::{DoubleDamping, double_damping};
use crate::energy_audit::{Audit, audit};
use crate::numerical_damping::{NumericalDamping, numerical_damping};
use crate::off_model::off_model;
use crate::work_precision::{Point, work_precision};
use crate::{LabError, calibrate, eigenfrequency, paper};
use crate::{
    motion_test::Row, motion_test::Run, motion_test::attempted, motion_test::pressure_oscillation,
    motion_test::run_all,
};
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_design::stability::{
    LoopStability, remark_on_expected_lags, stability_of, stable_with_expected_lags,
};
use hydroboom_model::Scheme;
use serde::Serialize;
use std::thread;

/// Name of the plant that equals the model.
pub const NOMINAL: &str = "nominal";
/// Name of the embedded plant that differs from the model.
pub const OFF: &str = "off-model";

/// Name of the virtual crane, which represents the real one, as a plant.
pub const VIRTUAL: &str = "virtual";

/// Default integration step of the implicit scheme \[s\].
pub const IMPLICIT_STEP: f64 = 500e-6;

/// RMS and peak difference of one signal, plant minus published model, both under velocity feedforward (Table 6).
#[derive(Clone, Debug, Serialize)]
pub struct Difference {
    /// Symbol of the signal in the paper.
    pub signal: String,
    /// Unit of all differences.
    pub unit: String,
    /// RMS difference of the virtual crane, in the unit of the field `unit`; none without a virtual crane.
    pub virtual_rms: Option<f64>,
    /// Peak difference of the virtual crane with its sign, in the unit of the field `unit`; none without a virtual
    /// crane.
    pub virtual_peak: Option<f64>,
    /// RMS difference of the off-model plant, in the unit of the field `unit`.
    pub off_model_rms: f64,
    /// Peak difference of the off-model plant with its sign, in the unit of the field `unit`.
    pub off_model_peak: f64,
    /// RMS difference between the real crane and the paper's simulation, in the unit of the field `unit`; none for
    /// another crane.
    pub paper_rms: Option<f64>,
    /// Peak difference between the real crane and the paper's simulation, in the unit of the field `unit`; none for
    /// another crane.
    pub paper_peak: Option<f64>,
}

/// Energy balance, and numerical damping of the integration schemes.
#[derive(Clone, Debug, Serialize)]
pub struct EnergyResults {
    /// Energy balances of a motion cycle, one for each scheme and step.
    pub audits: Vec<Audit>,
    /// Numerical damping and order of the integration schemes.
    pub numerical_damping: Vec<NumericalDamping>,
}

/// Stability of the linearised closed loops of the strategies on one plant.
#[derive(Clone, Debug, Serialize)]
pub struct PlantLoops {
    /// Name of the plant.
    pub plant: &'static str,
    /// Stability of each strategy's loop on the plant.
    pub loops: Vec<LoopStability>,
}

/// Results of all experiments of the paper, repeated with this model.
#[derive(Clone, Debug, Serialize)]
pub struct Study {
    /// Name of the crane.
    pub crane: String,
    /// Whether it is the paper's crane; the paper's values are shown for no other.
    pub is_papers_crane: bool,
    /// Main claims of the paper with the corresponding figures of this model.
    pub claims: Vec<Claim>,
    /// Mean accuracy of this model's eigenfrequencies compared with the paper's measurements \[%\]; none for another
    /// crane.
    pub eigenfrequency_accuracy_percent: Option<f64>,
    /// Eigenfrequencies at the piston positions of Table 5.
    pub eigenfrequency: Vec<eigenfrequency::Row>,
    /// Eigenfrequencies of the virtual crane at the same positions \[Hz\]; none without a virtual crane.
    pub virtual_eigenfrequency_hz: Option<[f64; 3]>,
    /// Tracking errors of Tables 7 to 9 on all plants.
    pub motion: Vec<Row>,
    /// Whether all linearised loops are stable, and no run was in sustained oscillation or stopped.
    pub stable: bool,
    /// Stability of the linearised closed loops on each plant.
    pub loops: Vec<PlantLoops>,
    /// Loops that are unstable on the ideal nominal or off-model plant, but stable with the lags of a drive
    /// and a fieldbus.
    pub stable_with_expected_lags: Vec<LoopStability>,
    /// Remark on the benchmark's gains; none for no remark.
    pub remark_on_gains: Option<String>,
    /// Frequency of the p_A oscillation with open valve \[Hz\], not fitted. None if the motion contains less than two
    /// whole periods of it.
    pub pressure_oscillation_hz: Option<f64>,
    /// Frequency of the p_A oscillation simulated in the paper (Table 6) \[Hz\]; none for another crane.
    pub paper_pressure_oscillation_hz: Option<f64>,
    /// Frequency of the p_A oscillation of the virtual crane \[Hz\]; none without one.
    pub virtual_pressure_oscillation_hz: Option<f64>,
    /// Frequency of the p_A oscillation measured in the paper (Table 6) \[Hz\]; none for another crane.
    pub paper_measured_pressure_oscillation_hz: Option<f64>,
    /// Differences of Table 6; empty if a run of the comparison stopped.
    pub differences: Vec<Difference>,
    /// Effect of the second damping, on the nominal plant and on the virtual crane.
    pub double_damping: Vec<DoubleDamping>,
    /// Energy balances and numerical damping.
    pub energy: EnergyResults,
    /// Error and computing time of the integration schemes over the step.
    pub work_precision: Vec<Point>,
    /// Overrides `section.key=value` that define the off-model plant.
    pub off_model: Vec<String>,
    /// Runs for figures, each with the name of its plant: nominal, then off-model, then virtual.
    #[serde(skip)]
    pub runs: Vec<(String, Run)>,
    /// Published model along the virtual crane's fast motion, for figures 18 to 23; none without a virtual crane.
    #[serde(skip)]
    pub alongside: Option<Run>,
    /// Locked-valve oscillation for figure 17 at the middle piston position.
    #[serde(skip)]
    pub oscillation: Option<eigenfrequency::Oscillation>,
}

impl Study {
    /// Remarks on unstable loops, a sentence each; empty if all are stable.
    pub fn unstable_loops(&self) -> Vec<String> {
        remarks_on_unstable(&self.loops, &self.stable_with_expected_lags)
    }

    /// Run of a strategy at a speed \[mm/s\] on a plant, by the plant's name: [`NOMINAL`], [`OFF`] or [`VIRTUAL`].
    /// None if there is no such run.
    pub fn run(&self, plant: &str, strategy: Strategy, speed_mm_s: f64) -> Option<&Run> {
        self.runs
            .iter()
            .find(|(name, run)| {
                name == plant
                    && run.strategy == strategy
                    && (run.speed * 1e3 - speed_mm_s).abs() < 1e-6
            })
            .map(|(_, run)| run)
    }
}

fn remarks_on_unstable(
    loops: &[PlantLoops],
    stable_with_expected_lags: &[LoopStability],
) -> Vec<String> {
    let unstable = |of: &PlantLoops| {
        let each = of.loops.iter().filter(|one| !one.stable);
        each.map(|one| format!("{}, {one}", of.plant)).collect::<Vec<_>>()
    };
    let remark = remark_on_expected_lags(stable_with_expected_lags);
    loops.iter().flat_map(unstable).chain(remark).collect()
}

/// Loops on each plant by its name. In addition, the loops that are unstable on an ideal plant and stable
/// with the lags that the controllers expect.
fn loops_around(
    model: &Description,
    plants: &[(&'static str, Option<&Description>)],
) -> Result<(Vec<PlantLoops>, Vec<LoopStability>), LabError> {
    let mut loops = Vec::new();
    for (plant, machine) in plants {
        if let Some(machine) = machine {
            loops.push(PlantLoops { plant, loops: stability_of(&Strategy::ALL, model, machine)? });
        }
    }
    let all: Vec<LoopStability> = loops.iter().flat_map(|of| of.loops.clone()).collect();
    let expected = stable_with_expected_lags(model, &all)?;
    Ok((loops, expected))
}

/// Results for the virtual crane.
struct VirtualResults {
    eigenfrequency: [f64; 3],
    runs: Vec<Run>,
    /// Model along the slow and the fast motion.
    alongside: [Run; 2],
    pressure_oscillation: Option<f64>,
    damping: DoubleDamping,
}

impl VirtualResults {
    /// Table 6 of the fast motion under velocity feedforward.
    fn differences(&self) -> Option<[(f64, f64); 6]> {
        let [_, fast] = &self.alongside;
        let is_fast =
            |run: &&Run| run.strategy == Strategy::VelocityFeedforward && run.course == fast.course;
        self.runs.iter().find(is_fast).and_then(|run| differences_of(fast, run))
    }
}

/// Eigenfrequencies at the paper's strokes \[Hz\], load held, without friction.
fn locked_modes(crane: &Description) -> Result<[f64; 3], LabError> {
    let frictionless = eigenfrequency::without_friction(crane)?;
    let mut frequencies = [0.0; 3];
    for (hz, stroke) in frequencies.iter_mut().zip(paper::EIGEN_STROKE_MM) {
        *hz = eigenfrequency::locked_mode(&frictionless, stroke * 1e-3)?.frequency_hz;
    }
    Ok(frequencies)
}

fn virtual_results(model: &Description, crane: &Description) -> Result<VirtualResults, LabError> {
    let n = &model.numbers;
    let (slow, fast) = (crane.motion(n.slow), crane.motion(n.fast));
    let mut runs = Vec::new();
    for motion in [slow, fast] {
        runs.extend(run_all(model, crane, &motion)?);
    }
    let velocity_feedforward = runs
        .iter()
        .find(|run| run.strategy == Strategy::VelocityFeedforward && run.course == fast.name());
    let oscillation = velocity_feedforward.and_then(|run| pressure_oscillation(&fast, run).ok());
    Ok(VirtualResults {
        eigenfrequency: locked_modes(crane)?,
        alongside: [
            attempted(model, model, Strategy::VelocityFeedforward, &slow)?,
            attempted(model, model, Strategy::VelocityFeedforward, &fast)?,
        ],
        pressure_oscillation: oscillation,
        damping: double_damping(model, VIRTUAL, crane, &fast, &runs)?,
        runs,
    })
}

/// Results of the nominal and the off-model plant.
struct MotionTests {
    /// Runs of all strategies at both speeds, each with the name of its plant.
    runs: Vec<(String, Run)>,
    /// On the nominal plant.
    damping: DoubleDamping,
    work_precision: Vec<Point>,
}

fn motion_tests(
    description: &Description,
    off: &Description,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<MotionTests, LabError> {
    let n = &description.numbers;
    let mut runs = Vec::new();
    for (name, plant) in [(NOMINAL, description), (OFF, off)] {
        for speed in [n.slow, n.fast] {
            let all = run_all(description, plant, &description.motion(speed))?;
            runs.extend(all.into_iter().map(|run| (name.to_string(), run)));
        }
        progress(&format!("motion tests, {name} plant"));
    }
    let fast = description.motion(n.fast);
    let damping = double_damping(description, NOMINAL, description, &fast, &[])?;
    let work_precision = work_precision(description)?;
    progress("work and precision");
    Ok(MotionTests { runs, damping, work_precision })
}

/// Results of the experiments beside the motion tests, and of the virtual crane.
struct OtherExperiments {
    eigenfrequency: Vec<eigenfrequency::Row>,
    /// Eigenfrequencies of the off-model plant \[Hz\].
    off_hz: [f64; 3],
    oscillation: eigenfrequency::Oscillation,
    virtual_results: Option<VirtualResults>,
    energy: EnergyResults,
}

fn other_experiments(
    description: &Description,
    off: &Description,
    virtual_crane: Option<&Description>,
    is_papers_crane: bool,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<OtherExperiments, LabError> {
    let virtual_results = match virtual_crane {
        Some(crane) => Some(virtual_results(description, crane)?),
        None => None,
    };
    progress("virtual crane");
    let mut eigenfrequency = Vec::new();
    for stroke_mm in paper::EIGEN_STROKE_MM {
        let row = eigenfrequency::row(description, stroke_mm * 1e-3)?;
        eigenfrequency.push(if is_papers_crane { row } else { row.without_paper() });
    }
    let drop = description.numbers.oscillation_drop;
    let oscillation = eigenfrequency::oscillation(description, 0.2, drop)?;
    let off_hz = locked_modes(off)?;
    progress("eigenfrequencies");
    let mut audits = Vec::new();
    for step in [2.0, 1.0, 0.5] {
        audits.push(audit(description, Scheme::Implicit, step * IMPLICIT_STEP)?);
    }
    let numerical_damping = numerical_damping(description)?;
    let energy = EnergyResults { audits, numerical_damping };
    progress("energy audit");
    Ok(OtherExperiments { eigenfrequency, off_hz, oscillation, virtual_results, energy })
}

/// Run of velocity feedforward at the fast speed \[m/s\] on a plant.
fn fast_feedforward<'a>(runs: &'a [(String, Run)], plant: &str, fast: f64) -> Option<&'a Run> {
    let is_it = |(name, run): &&(String, Run)| {
        name == plant && run.strategy == Strategy::VelocityFeedforward && run.speed == fast
    };
    runs.iter().find(is_it).map(|(_, run)| run)
}

/// Rows of Tables 7 to 9.
fn rows(runs: &[(String, Run)], loops: &[PlantLoops], is_papers_crane: bool) -> Vec<Row> {
    let row = |(plant, run): &(String, Run)| {
        let around = loops.iter().find(|of| of.plant == plant);
        let row = Row::of(plant, run).with_loops(around.map_or(&[], |of| &of.loops));
        if is_papers_crane { row } else { row.without_paper() }
    };
    runs.iter().map(row).collect()
}

/// Runs the study on a crane, and on a virtual crane that represents the real one, if given.
///
/// The paper's values are shown for its own crane only (`is_papers_crane`), with or without overrides.
/// `progress` receives the name of each completed part.
///
/// # Errors
///
/// The first error of an experiment: [`LabError::Description`] if the off-model plant is impossible,
/// [`LabError::Plant`] or [`LabError::Build`] if a crane has no state of rest or no model. [`LabError::Design`] if a
/// controller cannot be designed; [`LabError::Simulation`] or [`LabError::NoOscillation`] if a test fails.
pub fn study(
    description: &Description,
    virtual_crane: Option<&Description>,
    is_papers_crane: bool,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Study, LabError> {
    let (off, off_model) = off_model(description)?;
    let n = &description.numbers;
    // two workers: the motion tests, and all other experiments
    let (tested, others) = thread::scope(|scope| {
        let others = scope.spawn(|| {
            other_experiments(description, &off, virtual_crane, is_papers_crane, progress)
        });
        let tested = motion_tests(description, &off, progress);
        let others = others.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        (tested, others)
    });
    let MotionTests { mut runs, damping, work_precision } = tested?;
    let OtherExperiments { eigenfrequency, off_hz, oscillation, virtual_results, energy } = others?;

    let mut double_damping = vec![damping];
    let mut seen = None;
    let (mut alongside, mut virtual_hz, mut virtual_oscillation) = (None, None, None);
    if let Some(results) = virtual_results {
        seen = results.differences();
        runs.extend(results.runs.into_iter().map(|run| (VIRTUAL.to_string(), run)));
        double_damping.push(results.damping);
        alongside = Some(results.alongside);
        virtual_hz = Some(results.eigenfrequency);
        virtual_oscillation = results.pressure_oscillation;
    }
    let (Some(nominal), Some(other)) =
        (fast_feedforward(&runs, NOMINAL, n.fast), fast_feedforward(&runs, OFF, n.fast))
    else {
        return Err(LabError::NoOscillation("the fast motion was not run".into()));
    };
    let pressure_oscillation_hz = pressure_oscillation(&description.motion(n.fast), nominal).ok();
    let differences = match differences_of(nominal, other) {
        Some(off_model) => differences(seen, off_model, is_papers_crane),
        None => Vec::new(),
    };
    let plants = [(NOMINAL, Some(description)), (OFF, Some(&off)), (VIRTUAL, virtual_crane)];
    let (loops, stable_with_expected_lags) = loops_around(description, &plants)?;
    let motion = rows(&runs, &loops, is_papers_crane);
    let model_hz = std::array::from_fn(|k| eigenfrequency[k].linearised_hz);
    let mut plants_hz = vec![(OFF, off_hz)];
    plants_hz.extend(virtual_hz.map(|hz| (VIRTUAL, hz)));
    let claims = claims(&claims::Shown {
        is_papers_crane,
        stroke: n.stroke,
        speeds: [n.slow, n.fast],
        eigen_stroke_mm: paper::EIGEN_STROKE_MM,
        model_hz,
        plants_hz,
        runs: &runs,
        alongside: alongside.as_ref().map(|[slow, fast]| [slow, fast]),
    });
    let accuracy = claims::accuracy_percent(&model_hz, &paper::EIGEN_MEASURED_HZ);
    Ok(Study {
        crane: description.name.clone(),
        is_papers_crane,
        claims,
        eigenfrequency_accuracy_percent: is_papers_crane.then_some(accuracy),
        eigenfrequency,
        virtual_eigenfrequency_hz: virtual_hz,
        stable: motion.iter().all(|row| row.stable)
            && loops.iter().flat_map(|of| &of.loops).all(|one| one.stable),
        motion,
        loops,
        stable_with_expected_lags,
        remark_on_gains: None,
        pressure_oscillation_hz,
        paper_pressure_oscillation_hz: is_papers_crane.then_some(paper::PRESSURE_OSCILLATION_HZ),
        virtual_pressure_oscillation_hz: virtual_oscillation,
        paper_measured_pressure_oscillation_hz: is_papers_crane
            .then_some(paper::PRESSURE_OSCILLATION_MEASURED_HZ),
        differences,
        double_damping,
        energy,
        work_precision,
        off_model,
        runs,
        alongside: alongside.map(|[_, fast]| fast),
        oscillation: Some(oscillation),
    })
}

/// Table 6 of two completed runs.
fn differences_of(model: &Run, plant: &Run) -> Option<[(f64, f64); 6]> {
    let whole = model.stopped.is_none() && plant.stopped.is_none();
    whole.then(|| calibrate::differences(model, plant))
}

/// Table 6.
fn differences(
    virtual_crane: Option<[(f64, f64); 6]>,
    off_model: [(f64, f64); 6],
    is_papers_crane: bool,
) -> Vec<Difference> {
    let table = paper::TABLE_6.iter().zip(off_model).enumerate();
    table
        .map(|(k, ((name, unit, paper_peak, paper_rms), (off_rms, off_peak)))| Difference {
            signal: name.to_string(),
            unit: unit.to_string(),
            virtual_rms: virtual_crane.map(|seen| seen[k].0),
            virtual_peak: virtual_crane.map(|seen| seen[k].1),
            off_model_rms: off_rms,
            off_model_peak: off_peak,
            paper_rms: is_papers_crane.then_some(*paper_rms),
            paper_peak: is_papers_crane.then_some(*paper_peak),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Payload at 9 m. The nominal plant has no lag, while the scheduled LQR expects one. Both facts are
    /// reported, and neither applies to the paper's crane.
    #[test]
    fn a_loop_unstable_on_the_ideal_plant_only_is_reported() {
        let remarks = |set: &str| {
            let mut crane = Description::uia_single_boom().unwrap();
            crane.set(set).unwrap();
            let (loops, expected) = loops_around(&crane, &[(NOMINAL, Some(&crane))]).unwrap();
            remarks_on_unstable(&loops, &expected)
        };
        let far = remarks("payload.x_mm=9000");
        let begins = "nominal, scheduled LQR: the closed loop is UNSTABLE at 25 to 475 mm";
        let lqr = far.iter().find(|text| text.starts_with(begins)).unwrap();
        assert!(lqr.contains("with an ideal drive and no delay"), "{lqr}");
        let last = far.last().unwrap();
        assert!(last.contains("the closed loop of the scheduled LQR is stable"), "{last}");
        assert_eq!(remarks("payload.x_mm=3500"), [""; 0]);
    }
}
