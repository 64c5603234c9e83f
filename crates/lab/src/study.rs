//! The paper's experiments in one go.

use crate::energy_audit::{Audit, audit};
use crate::motion_test::{Row, Run, Strategy, pressure_oscillation, run};
use crate::numerical_damping::{NumericalDamping, numerical_damping};
use crate::work_precision::{Point, work_precision};
use crate::{LabError, calibrate, eigenfrequency, paper};
use hydroboom_description::{Description, OFF_MODEL};
use hydroboom_model::Scheme;
use serde::Serialize;
use std::thread;

/// Name of the plant that equals the model.
pub const NOMINAL: &str = "nominal";
/// Name of the embedded plant that does not.
pub const OFF: &str = "off-model";

/// Default step of the implicit scheme \[s\].
pub const IMPLICIT_STEP: f64 = 500e-6;

/// RMS and peak difference of one signal between model and off-model plant under the same input.
#[derive(Clone, Debug, Serialize)]
pub struct Difference {
    /// The paper's name of the signal.
    pub signal: String,
    /// Its unit.
    pub unit: String,
    /// RMS difference here.
    pub rms: f64,
    /// Peak difference here.
    pub peak: f64,
    /// The paper's, between its simulation and the real crane.
    pub paper_rms: f64,
    /// The paper's.
    pub paper_peak: f64,
}

/// Does the energy add up, and what do the time steps take from it?
#[derive(Clone, Debug, Serialize)]
pub struct EnergyResults {
    /// Audits of a motion cycle.
    pub audits: Vec<Audit>,
    /// Damping and order of the schemes.
    pub numerical_damping: Vec<NumericalDamping>,
}

/// All results of the study.
#[derive(Clone, Debug, Serialize)]
pub struct Study {
    /// Name of the crane.
    pub crane: String,
    /// Table 5.
    pub eigenfrequency: Vec<eigenfrequency::Row>,
    /// Tables 7 to 9, on both plants.
    pub motion: Vec<Row>,
    /// Frequency of the p_A oscillation with the valve open, not fitted.
    pub pressure_oscillation_hz: f64,
    /// The paper's simulated one.
    pub paper_pressure_oscillation_hz: f64,
    /// Table 6 between model and off-model plant.
    pub differences: Vec<Difference>,
    /// Energy.
    pub energy: EnergyResults,
    /// Work-precision trials.
    pub work_precision: Vec<Point>,
    /// Overrides that make the off-model plant.
    pub off_model: Vec<String>,
    /// The runs themselves, for figures: nominal, then off-model.
    #[serde(skip)]
    pub runs: Vec<(String, Run)>,
    /// A locked-valve oscillation for figure 17, at the middle stroke.
    #[serde(skip)]
    pub oscillation: Option<eigenfrequency::Oscillation>,
}

impl Study {
    /// The run of a strategy at a speed \[mm/s\] on a plant.
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

/// Runs the study on a crane; `progress` is told what has been done.
///
/// # Errors
///
/// [`LabError`] when any of the experiments fails.
pub fn study(
    description: &Description,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Study, LabError> {
    let (off, off_model) = description.overridden("cranes/off-model.toml", OFF_MODEL)?;
    let n = &description.numbers;
    // two workers: the motion tests, and everything else
    let (runs, rest) = thread::scope(|scope| {
        let rest = scope.spawn(|| {
            let mut rows = Vec::new();
            for stroke_mm in paper::EIGEN_STROKE_MM {
                rows.push(eigenfrequency::row(description, stroke_mm * 1e-3)?);
            }
            let oscillation = eigenfrequency::oscillation(description, 0.2, n.oscillation_drop)?;
            progress("eigenfrequencies");
            let mut audits = Vec::new();
            for step in [2.0, 1.0, 0.5] {
                audits.push(audit(description, Scheme::Implicit, step * IMPLICIT_STEP)?);
            }
            let numerical_damping = numerical_damping(description)?;
            let energy = EnergyResults { audits, numerical_damping };
            progress("energy audit");
            let points = work_precision(description)?;
            progress("work and precision");
            Ok::<_, LabError>((rows, oscillation, energy, points))
        });
        let runs = (|| {
            let mut runs = Vec::new();
            for (name, plant) in [(NOMINAL, description), (OFF, &off)] {
                for strategy in Strategy::ALL {
                    for speed in [n.slow, n.fast] {
                        runs.push((name.to_string(), run(description, plant, strategy, speed)?));
                    }
                }
                progress(&format!("motion tests, {name} plant"));
            }
            Ok::<_, LabError>(runs)
        })();
        let rest = rest.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        (runs, rest)
    });
    let (runs, (eigenfrequency, oscillation, energy, points)) = (runs?, rest?);

    let motion = runs.iter().map(|(plant, run)| Row::of(plant, run)).collect();
    let fast = |plant: &str| {
        runs.iter().find(|(name, run)| {
            name == plant && run.strategy == Strategy::VelocityFeedforward && run.speed == n.fast
        })
    };
    let (Some((_, nominal)), Some((_, other))) = (fast(NOMINAL), fast(OFF)) else {
        return Err(LabError::NoOscillation("the fast motion was not run".into()));
    };
    let pressure_oscillation_hz = pressure_oscillation(&description.motion(n.fast), nominal)?;
    let differences = differences(nominal, other);
    Ok(Study {
        crane: description.name.clone(),
        eigenfrequency,
        motion,
        pressure_oscillation_hz,
        paper_pressure_oscillation_hz: paper::PRESSURE_OSCILLATION_HZ,
        differences,
        energy,
        work_precision: points,
        off_model,
        runs,
        oscillation: Some(oscillation),
    })
}

/// Table 6: the same motor speed drives model and plant.
fn differences(model: &Run, plant: &Run) -> Vec<Difference> {
    let seen = calibrate::differences(model, plant);
    paper::TABLE_6
        .iter()
        .zip(seen)
        .map(|((name, unit, paper_peak, paper_rms), (rms, peak))| Difference {
            signal: name.to_string(),
            unit: unit.to_string(),
            rms,
            peak,
            paper_rms: *paper_rms,
            paper_peak: *paper_peak,
        })
        .collect()
}
