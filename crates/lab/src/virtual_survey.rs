//! Simulated survey of a virtual crane's tip: the crane at rest at poses over its motion, with two
//! payloads.

use crate::LabError;
use hydroboom_description::Description;
use hydroboom_design::tip_survey::{SurveyPoint, TipSurvey};
use hydroboom_virtual_crane::VirtualCrane;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// Number of poses over the motion.
const POSES: usize = 5;

/// Settings of the simulated survey of a virtual crane's tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurveyOrder {
    /// Payloads with which the tip is surveyed \[kg\].
    pub loads: [f64; 2],
    /// Standard deviation of each surveyed coordinate \[m\].
    pub deviation: f64,
    /// Seed of the survey's noise.
    pub seed: u64,
}

/// Simulates the survey of a virtual crane's tip: piston position as measured by its encoder, true tip position plus
/// normal noise. Poses are equidistant from the start to the end of the crane file's motion, each with both payloads.
///
/// # Errors
///
/// [`LabError::Plant`] if the crane has no state of rest at a pose.
pub fn virtual_survey(crane: &Description, order: &SurveyOrder) -> Result<TipSurvey, LabError> {
    let mut random = Pcg64Mcg::seed_from_u64(order.seed);
    let mut noise = || order.deviation * Distribution::<f64>::sample(&StandardNormal, &mut random);
    let n = &crane.numbers;
    let mut points = Vec::with_capacity(2 * POSES);
    for payload in order.loads {
        let mut loaded = crane.clone();
        loaded.numbers.payload = payload;
        for pose in 0..POSES {
            let share = pose as f64 / (POSES - 1) as f64;
            let stroke = n.motion_start + share * (n.motion_end - n.motion_start);
            let at_rest = VirtualCrane::new(&loaded, &loaded.start(stroke))?;
            let outputs = at_rest.truth().outputs;
            points.push(SurveyPoint {
                line: 0,
                stroke: at_rest.signals().stroke,
                payload,
                tip: [outputs.tip_x + noise(), outputs.tip_y + noise()],
                deviation: order.deviation,
            });
        }
    }
    Ok(TipSurvey { file: format!("survey of {}", crane.name), points })
}
