//! Optimises the weights and the noise of the fixed-design LQG: `cargo run --release -p hydroboom-lab
//! --example reoptimise [GENERATIONS]`.
//!
//! Objective: geometric mean of the RMS error over the published benchmark's, over virtual cranes and both
//! speeds.

use cmaes::{CMAESOptions, DVector};
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::LabError;
use hydroboom_lab::baselines::{Baseline, LQG, Weights};
use hydroboom_lab::closed_loop::controller_choice::ControllerChoice;
use hydroboom_lab::closed_loop::monte_carlo::{Outcome, family, members};
use hydroboom_lab::closed_loop::scenario::CourseChoice;

/// Number of cranes, and seed of the family. Reported families use another seed.
const CRANES: u64 = 12;
const SEED: u64 = 7;
/// Error factor of a crane in sustained oscillation where the benchmark's is not, or of a failed
/// simulation.
const UNSTABLE: f64 = 10.0;
/// Number of optimised parameters.
const NUMBERS: usize = 7;
/// Standard deviation of the first generation, in the logarithm of each parameter.
const SPREAD: f64 = 0.4;

/// The design with each parameter multiplied by the exponential of the search variable.
fn changed(w: Weights, by: &[f64]) -> Weights {
    let times = |value: f64, k: usize| value * by[k].exp();
    Weights {
        // the weight of the position is fixed: only the ratios of the weights matter
        alike: [w.alike[0], times(w.alike[1], 0), times(w.alike[2], 1), times(w.alike[3], 2)],
        drift: [
            w.drift[0],
            times(w.drift[1], 3),
            times(w.drift[2], 4),
            times(w.drift[3], 5),
            times(w.drift[4], 6),
        ],
    }
}

fn main() -> Result<(), LabError> {
    let mut arguments = std::env::args().skip(1);
    let generations = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(25);
    let model = Description::uia_single_boom()?;
    let nominal = Description::uia_virtual()?;
    let n = &model.numbers;
    let courses = [n.slow, n.fast].map(CourseChoice::Motion);
    let cranes = members(&nominal, (CRANES, SEED), false)?;
    let run = |controller: ControllerChoice| -> Result<Vec<Outcome>, LabError> {
        let all = family(&model, cranes.clone(), &[controller], &courses, &|_| true)?;
        Ok(all.into_iter().flat_map(|(_, outcomes)| outcomes).flatten().collect())
    };
    let benchmark = run(Strategy::BenchmarkClosedLoop.into())?;
    let loss = |by: &DVector<f64>| {
        let tried = changed(LQG, by.as_slice());
        let Ok(outcomes) = run(ControllerChoice::Baseline(Baseline::Lqg(tried))) else {
            return UNSTABLE.ln();
        };
        let of = |(own, other): (&Outcome, &Outcome)| match own.error.rms_measured_mm.is_nan()
            || (own.unstable && !other.unstable)
        {
            true => UNSTABLE.ln(),
            false => (own.error.rms_measured_mm / other.error.rms_measured_mm).ln(),
        };
        let sum: f64 = outcomes.iter().zip(&benchmark).map(of).sum();
        let mean = sum / benchmark.len() as f64;
        eprintln!("{:.4} {tried:?}", mean.exp());
        mean
    };
    let search = CMAESOptions::new(vec![0.0; NUMBERS], SPREAD).seed(1).max_generations(generations);
    match search.build(loss) {
        Ok(mut search) => {
            if let Some(best) = search.run().overall_best {
                println!("{:.4} {:?}", best.value.exp(), changed(LQG, best.point.as_slice()));
            }
        }
        Err(error) => eprintln!("no search: {error:?}"),
    }
    Ok(())
}
