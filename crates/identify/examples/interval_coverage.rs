//! How often the 95 % intervals of `tune` hold the truth, on logs of virtual cranes: the plant with its equipment, which has what the model
//! leaves out.
//!
//! Each draw is a crane of the widened family (oil, wear, air, friction, drive, beam, base, volumes, sensors, fieldbus) with a payload
//! drawn from what the model's file claims to know; a fast motion and two oscillation tests of it are logged, and the paper's crane, with friction that holds, is tuned to
//! them as `hydroboom tune` does.
//!
//! ```sh
//! cargo run --release -p hydroboom-identify --example interval_coverage -- 2031 0 100     # seed, first crane, the one after the last
//! ```

#![expect(clippy::unwrap_used, reason = "an example that cannot set up has failed")]

use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_identify::{Experiment, Free, Task, Window, fit};
use hydroboom_lab::closed_loop::monte_carlo::widened;
use hydroboom_lab::virtual_run::{self, Contents, LogOrder, virtual_run};
use hydroboom_measurement::{Mapping, Signals, read};

/// What is moved.
const KEYS: [&str; 12] = [
    "boom.youngs_modulus_gpa",
    "boom.damping_ratio",
    "payload.mass_kg",
    "friction.viscous_ns_per_m",
    "friction.coulomb_n",
    "friction.stiction_n",
    "friction.bristle_stiffness_n_per_mm",
    "pump.flow_gain",
    "pump.internal_leakage_m3_s_sqrtpa",
    "pump.case_leakage_a_m3_s_sqrtpa",
    "cylinder.dead_volume_a_l",
    "oil.transition_bar",
];

/// What became of one key over all draws.
#[derive(Clone, Default)]
struct Row {
    /// Draws in which `tune` calls it determined or leaves it open, and of those the intervals that hold the truth.
    told: [u32; 2],
    held: [u32; 2],
    /// Draws in which it is called biased, intervals that hold the truth, and why it is biased.
    biased: [u32; 2],
    reason: &'static str,
    /// Widths of intervals: deviations of ln θ.
    deviations: f64,
}

fn main() {
    let arguments: Vec<u64> = std::env::args().skip(1).map(|a| a.parse().unwrap()).collect();
    let [seed, from, to] = arguments[..] else {
        eprintln!("interval_coverage SEED FROM TO");
        std::process::exit(2);
    };
    let mut model = Description::uia_single_boom().unwrap();
    model.set("friction.law=lugre").unwrap();
    let nominal = Description::uia_virtual().unwrap();
    let free: Vec<Free> = KEYS.iter().map(|path| Free::from_path(path).unwrap()).collect();
    let mut rows = vec![Row::default(); KEYS.len()];
    for k in from..to {
        let mut crane = widened(&nominal, seed, k).unwrap().crane;
        crane.numbers.payload = model.numbers.payload * (0.1 * normal(seed, k)).exp();
        let fast = crane.motion(crane.numbers.fast);
        let drop = crane.numbers.oscillation_drop;
        let logs = [
            virtual_run::Task::Course(&fast, Strategy::VelocityFeedforward),
            virtual_run::Task::Oscillation { stroke: 0.2, drop },
        ];
        let experiments: Vec<Experiment> =
            logs.iter().map(|task| logged(&model, &crane, task)).collect();
        let task = Task {
            model: &model,
            experiments: &experiments,
            free: &free,
            fixed: &[],
            resume: None,
            generations: 0,
        };
        let found = match fit(&task, &|_| true) {
            Ok(found) => found,
            Err(error) => {
                eprintln!("crane {k}: {error}");
                continue;
            }
        };
        let truth = as_of_model(&crane, &model);
        for (row, t) in rows.iter_mut().zip(&found.tuned) {
            let (low, high) = t.interval();
            let truth = t.key.value(&truth);
            let holds = u32::from((low..=high).contains(&truth));
            row.deviations += t.deviation;
            match t.biased {
                Some(reason) => {
                    row.reason = reason;
                    row.biased[0] += 1;
                    row.biased[1] += holds;
                }
                None => {
                    let place = usize::from(!t.is_determined);
                    row.told[place] += 1;
                    row.held[place] += holds;
                }
            }
            eprintln!(
                "{k} {}: {:+.2} deviations of {:.4}; prior {:.2}, from logs {:.4}, found {:.4e}, truth {truth:.4e}{}",
                t.key.path(),
                (t.value.1 / truth).ln() / t.deviation,
                t.deviation,
                t.prior,
                t.from_logs,
                t.value.1,
                t.partner
                    .as_ref()
                    .map_or(String::new(), |(key, c)| format!(", traded against {key} ({c:+.2})"))
            );
        }
    }
    println!(
        "| key | determined, holds the truth | not determined, holds | called biased, holds | mean deviation | why biased |"
    );
    println!("|---|---|---|---|---|---|");
    for (key, row) in KEYS.iter().zip(&rows) {
        let all: u32 = row.told.iter().sum::<u32>() + row.biased[0];
        println!(
            "| {key} | {} of {} | {} of {} | {} of {} | {:.1} % | {} |",
            row.held[0],
            row.told[0],
            row.held[1],
            row.told[1],
            row.biased[1],
            row.biased[0],
            100.0 * row.deviations / f64::from(all.max(1)),
            row.reason
        );
    }
}

/// What the model's keys are of a crane: at the temperature of its oil, and of those that show only as a product with one that stays, with that as the
/// model has it.
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

/// A number of the normal distribution, within two deviations.
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

fn logged(model: &Description, crane: &Description, task: &virtual_run::Task<'_>) -> Experiment {
    let path = std::env::temp_dir().join(format!("interval-coverage-{}.csv", std::process::id()));
    let order =
        LogOrder { path: &path, contents: Contents::Readings, estimates: false, interval: 5e-3 };
    virtual_run(model, crane, task, &[order], |_| {}).unwrap();
    let log = read(&path, None).unwrap();
    std::fs::remove_file(&path).unwrap();
    let signals = Signals::of(&log, &Mapping::default().completed(&log).unwrap()).unwrap();
    Experiment::new(model, &log, &signals, Window::default()).unwrap()
}
