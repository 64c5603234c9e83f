//! Draws of virtual cranes: the plant with its equipment, which contains effects that the model omits. Each
//! draw has a motion, the model tuned to it, and the coverage of the intervals.

use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_identify::{Experiment, Free, Task, Window, fit};
use hydroboom_lab::closed_loop::monte_carlo::widened;
use hydroboom_lab::virtual_run::{self, Contents, LogOrder, virtual_run};
use hydroboom_measurement::{Mapping, Signals, read};
use rayon::prelude::*;

/// Free keys.
pub const KEYS: [&str; 8] = [
    "payload.mass_kg",
    "friction.coulomb_n",
    "friction.viscous_ns_per_m",
    "friction.bristle_stiffness_n_per_mm",
    "boom.youngs_modulus_gpa",
    "pump.flow_gain",
    "pump.internal_leakage_m3_s_sqrtpa",
    "oil.transition_bar",
];

/// Results of one key over all draws.
#[derive(Clone, Default)]
pub struct Row {
    /// Draws in which it is determined, and those of them whose interval contains the truth.
    pub determined: [u32; 2],
    /// The same for draws in which it is not determined.
    pub open: [u32; 2],
    /// The same for draws in which it is marked as biased.
    pub biased: [u32; 2],
    /// Reason for the bias.
    pub reason: &'static str,
    /// Sum of standard deviations of ln θ.
    pub deviations: f64,
}

/// Motion of a draw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Course {
    /// That of the crane file.
    #[allow(dead_code, reason = "of the example")]
    OfFile,
    /// Half of its stroke, with rests of one second, of which a log learns little.
    Brief,
}

/// Draws of a seed; a row for each of [`KEYS`].
pub fn coverage(seed: u64, draws: std::ops::Range<u64>, course: Course) -> Vec<Row> {
    let drawn: Vec<[Outcome; KEYS.len()]> =
        draws.into_par_iter().map(|k| draw(seed, k, course)).collect();
    let mut rows = vec![Row::default(); KEYS.len()];
    for outcomes in drawn {
        for (row, outcome) in rows.iter_mut().zip(outcomes) {
            row.deviations += outcome.deviation;
            row.reason = outcome.biased.unwrap_or(row.reason);
            let counts = match (outcome.biased, outcome.is_determined) {
                (Some(_), _) => &mut row.biased,
                (None, true) => &mut row.determined,
                (None, false) => &mut row.open,
            };
            counts[0] += 1;
            counts[1] += u32::from(outcome.holds);
        }
    }
    rows
}

/// Result of one key in one draw.
#[derive(Clone, Copy)]
struct Outcome {
    deviation: f64,
    biased: Option<&'static str>,
    is_determined: bool,
    /// Whether the interval contains the truth.
    holds: bool,
}

/// One crane of a seed: its motion, the model tuned to it, and each key compared with its truth.
fn draw(seed: u64, k: u64, course: Course) -> [Outcome; KEYS.len()] {
    let mut model = Description::uia_single_boom().unwrap();
    model.set("friction.law=lugre").unwrap();
    let nominal = Description::uia_virtual().unwrap();
    let free: Vec<Free> = KEYS.iter().map(|path| Free::from_path(path).unwrap()).collect();
    let mut crane = widened(&nominal, seed, k).unwrap().crane;
    crane.numbers.payload = model.numbers.payload * (0.1 * normal(seed, k)).exp();
    if course == Course::Brief {
        let n = &mut crane.numbers;
        n.motion_end = 0.5 * (n.motion_start + n.motion_end);
        (n.rest, n.dwell) = (1.0, 1.0);
    }
    let course = crane.motion(crane.numbers.fast);
    let course = virtual_run::Task::Course(&course, Strategy::VelocityFeedforward);
    let experiments = [logged(&model, &crane, &course, k)];
    let task = Task {
        model: &model,
        experiments: &experiments,
        free: &free,
        fixed: &[],
        resume: None,
        generations: 0,
    };
    let found = fit(&task, &|_| true).unwrap();
    let truth = as_of_model(&crane, &model);
    std::array::from_fn(|key| {
        let t = &found.tuned[key];
        let (low, high) = t.interval();
        let truth = t.key.value(&truth);
        eprintln!(
            "{k} {}: {:+.2} deviations of {:.4}; found {:.4e}, truth {truth:.4e}; {:?}",
            t.key.path(),
            (t.value.1 / truth).ln() / t.deviation,
            t.deviation,
            t.value.1,
            t.determination,
        );
        Outcome {
            deviation: t.deviation,
            biased: t.biased(),
            is_determined: t.is_determined(),
            holds: (low..=high).contains(&truth),
        }
    })
}

/// True values of the model's keys for a crane, at its oil temperature. Of a product with a fixed key, only
/// the product is observable: the fixed factor is then the model's.
fn as_of_model(crane: &Description, model: &Description) -> Description {
    let mut there = crane.clone();
    let n = &mut there.numbers;
    n.youngs_modulus *= n.second_moment / model.numbers.second_moment;
    n.flow_gain *= n.displacement / model.numbers.displacement;
    let apart = n.oil_temperature - n.reference_temperature;
    n.viscous *= (-n.viscosity_slope * apart).exp();
    n.transition = (n.transition + n.air_slope * apart).max(0.0);
    there
}

/// Normally distributed number, truncated at two standard deviations.
fn normal(seed: u64, number: u64) -> f64 {
    let mut state = seed.wrapping_add(number.wrapping_mul(0x9e37_79b9_7f4a_7c15)) | 1;
    let mut uniform = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    uniform();
    let sum: f64 = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
    sum.clamp(-2.0, 2.0)
}

fn logged(
    model: &Description,
    crane: &Description,
    task: &virtual_run::Task<'_>,
    k: u64,
) -> Experiment {
    let name = format!("interval-coverage-{}-{k}.csv", std::process::id());
    let path = std::env::temp_dir().join(name);
    let order =
        LogOrder { path: &path, contents: Contents::Readings, estimates: false, interval: 5e-3 };
    virtual_run(model, crane, task, &[order], |_| {}).unwrap();
    let log = read(&path, None).unwrap();
    std::fs::remove_file(&path).unwrap();
    let signals = Signals::of(&log, &Mapping::default().completed(&log).unwrap()).unwrap();
    Experiment::new(model, &log, &signals, Window::default()).unwrap()
}
