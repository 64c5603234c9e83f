//! Study: all experiments of the paper.

use crate::claims::{self, Claim, claims};
use crate::closed_loop::scenario::Course;
use crate::double_damping::{DoubleDamping, double_damping};
use crate::energy_audit::{Audit, audit};
use crate::numerical_damping::{NumericalDamping, numerical_damping};
use crate::work_precision::{Point, work_precision};
use crate::{LabError, calibrate, eigenfrequency, paper};
use crate::{
    motion_test::Row, motion_test::Run, motion_test::attempted, motion_test::pressure_oscillation,
    motion_test::run_all,
};
use hydroboom_control::strategy::Strategy;
use hydroboom_description::{Description, OFF_MODEL};
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
        said_of_unstable(&self.loops, &self.stable_with_expected_lags)
    }

    /// Run of a strategy at a speed \[mm/s\] on a plant; none if there is no such run.
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

fn said_of_unstable(
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

/// Runs the study on a crane, and on a virtual crane that represents the real one, if given.
///
/// The paper's values are shown for its own crane only (`is_papers_crane`), with or without overrides.
/// `progress` receives the name of each completed part.
///
/// # Errors
///
/// [`LabError`] if an experiment fails.
pub fn study(
    description: &Description,
    virtual_crane: Option<&Description>,
    is_papers_crane: bool,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Study, LabError> {
    let (off, off_model) = off_model(description)?;
    let n = &description.numbers;
    // two workers: the motion tests, and all other experiments
    let (runs, rest) = thread::scope(|scope| {
        let rest = scope.spawn(|| {
            let virtual_results = match virtual_crane {
                Some(crane) => Some(virtual_results(description, crane)?),
                None => None,
            };
            progress("virtual crane");
            let mut rows = Vec::new();
            for stroke_mm in paper::EIGEN_STROKE_MM {
                let row = eigenfrequency::row(description, stroke_mm * 1e-3)?;
                rows.push(if is_papers_crane { row } else { row.without_paper() });
            }
            let oscillation = eigenfrequency::oscillation(description, 0.2, n.oscillation_drop)?;
            let off_hz = locked_modes(&off)?;
            progress("eigenfrequencies");
            let mut audits = Vec::new();
            for step in [2.0, 1.0, 0.5] {
                audits.push(audit(description, Scheme::Implicit, step * IMPLICIT_STEP)?);
            }
            let numerical_damping = numerical_damping(description)?;
            let energy = EnergyResults { audits, numerical_damping };
            progress("energy audit");
            Ok::<_, LabError>((rows, off_hz, oscillation, virtual_results, energy))
        });
        let runs = (|| {
            let mut runs = Vec::new();
            for (name, plant) in [(NOMINAL, description), (OFF, &off)] {
                for speed in [n.slow, n.fast] {
                    let all = run_all(description, plant, &description.motion(speed))?;
                    runs.extend(all.into_iter().map(|run| (name.to_string(), run)));
                }
                progress(&format!("motion tests, {name} plant"));
            }
            let fast = description.motion(n.fast);
            let damping = double_damping(description, NOMINAL, description, &fast, &[])?;
            let points = work_precision(description)?;
            progress("work and precision");
            Ok::<_, LabError>((runs, damping, points))
        })();
        let rest = rest.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        (runs, rest)
    });
    let (mut runs, damping, points) = runs?;
    let (eigenfrequency, off_hz, oscillation, virtual_results, energy) = rest?;

    let mut double_damping = vec![damping];
    let mut seen = None;
    let (mut alongside, mut virtual_hz, mut virtual_oscillation) = (None, None, None);
    if let Some(results) = virtual_results {
        let [_, fast] = &results.alongside;
        let is_fast =
            |run: &&Run| run.strategy == Strategy::VelocityFeedforward && run.course == fast.course;
        seen = results.runs.iter().find(is_fast).and_then(|run| differences_of(fast, run));
        runs.extend(results.runs.into_iter().map(|run| (VIRTUAL.to_string(), run)));
        double_damping.push(results.damping);
        alongside = Some(results.alongside);
        virtual_hz = Some(results.eigenfrequency);
        virtual_oscillation = results.pressure_oscillation;
    }
    let fast = |plant: &str| {
        runs.iter().find(|(name, run)| {
            name == plant && run.strategy == Strategy::VelocityFeedforward && run.speed == n.fast
        })
    };
    let (Some((_, nominal)), Some((_, other))) = (fast(NOMINAL), fast(OFF)) else {
        return Err(LabError::NoOscillation("the fast motion was not run".into()));
    };
    let pressure_oscillation_hz = pressure_oscillation(&description.motion(n.fast), nominal).ok();
    let differences = match differences_of(nominal, other) {
        Some(off_model) => differences(seen, off_model, is_papers_crane),
        None => Vec::new(),
    };
    let plants = [(NOMINAL, Some(description)), (OFF, Some(&off)), (VIRTUAL, virtual_crane)];
    let (loops, stable_with_expected_lags) = loops_around(description, &plants)?;
    let row = |(plant, run): &(String, Run)| {
        let around = loops.iter().find(|of| of.plant == plant);
        let row = Row::of(plant, run).with_loops(around.map_or(&[], |of| &of.loops));
        if is_papers_crane { row } else { row.without_paper() }
    };
    let motion: Vec<Row> = runs.iter().map(row).collect();
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
        work_precision: points,
        off_model,
        runs,
        alongside: alongside.map(|[_, fast]| fast),
        oscillation: Some(oscillation),
    })
}

/// Crane that differs from the model by the same ratios as the off-model plant from the paper's crane, with
/// the differences as overrides.
fn off_model(model: &Description) -> Result<(Description, Vec<String>), LabError> {
    let own = Description::uia_single_boom()?;
    let (off, _) = own.overridden("cranes/off-model.toml", OFF_MODEL)?;
    let mut overrides = Vec::new();
    for changed in own.differences(&off) {
        let entry = model.own_entries().find(|(key, ..)| key.path() == changed.key);
        let shares = (changed.there.parse::<f64>(), changed.here.parse::<f64>());
        if let (Some((key, value, _)), (Ok(there), Ok(here))) = (entry, shares) {
            // without rounding noise
            overrides.push(format!("{}={}", key.path(), short(value * there / here)));
        }
    }
    let mut plant = model.clone();
    plant.set_together(overrides.iter().map(String::as_str))?;
    Ok((plant, overrides.iter().map(|assignment| assignment.replace('=', " = ")).collect()))
}

/// Number with eleven digits; very small ones with an exponent.
fn short(value: f64) -> String {
    let value: f64 = format!("{value:.10e}").parse().unwrap_or(value);
    if value != 0.0 && value.abs() < 1e-3 { format!("{value:e}") } else { value.to_string() }
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
            said_of_unstable(&loops, &expected)
        };
        let far = remarks("payload.x_mm=9000");
        let begins = "nominal, scheduled LQR: the closed loop is UNSTABLE at 25 to 475 mm";
        let lqr = far.iter().find(|text| text.starts_with(begins)).unwrap();
        assert!(lqr.contains("with an ideal drive and no delay"), "{lqr}");
        let last = far.last().unwrap();
        assert!(last.contains("the closed loop of the scheduled LQR is stable"), "{last}");
        assert_eq!(remarks("payload.x_mm=3500"), [""; 0]);
    }

    #[test]
    fn the_off_model_plant_differs_by_the_same_shares_from_any_crane() {
        let own = Description::uia_single_boom().unwrap();
        let (off, _) = own.overridden("cranes/off-model.toml", OFF_MODEL).unwrap();
        assert!(off.differences(&off_model(&own).unwrap().0).is_empty());
        let mut light = own.clone();
        light.set("payload.mass_kg=60").unwrap();
        let payload = off_model(&light).unwrap().0.numbers.payload;
        assert!((payload / (60.0 * 316.0 / 307.0) - 1.0).abs() < 1e-9, "{payload} kg");
    }
}
