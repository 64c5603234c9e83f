//! Finds the numbers of a rival anew: `cargo run --release -p hydroboom-lab --example reoptimise benchmark|lqg|mpc [GENERATIONS]`.
//!
//! Least geometric mean, over virtual cranes and both speeds, of the RMS error over the published benchmark's.

use cmaes::{CMAESOptions, DVector};
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::LabError;
use hydroboom_lab::family::{Outcome, family};
use hydroboom_lab::rivals::{Contender, Gains, LQG, MPC, REOPTIMISED, Rival, Weights};
use hydroboom_lab::scenario::CourseChoice;

/// Cranes, and the seed they are drawn with; families that are reported have another.
const CRANES: u64 = 12;
const SEED: u64 = 7;
/// A crane that swings on where the benchmark's does not, or cannot be steered to the end, counts as much as this factor on its error.
const UNSTABLE: f64 = 10.0;
/// Standard deviation of the first generation, of the logarithm of each number.
const SPREAD: f64 = 0.4;

/// A rival with numbers in the place of those it has, each times the exponential of what the search tries.
fn changed(rival: Rival, by: &[f64]) -> Rival {
    let times = |value: f64, k: usize| value * by[k].exp();
    let weights = |w: Weights| Weights {
        // position weighs as it does: only what the others weigh beside it counts
        alike: [w.alike[0], times(w.alike[1], 0), times(w.alike[2], 1), times(w.alike[3], 2)],
        drift: [
            w.drift[0],
            times(w.drift[1], 3),
            times(w.drift[2], 4),
            times(w.drift[3], 5),
            times(w.drift[4], 6),
        ],
    };
    match rival {
        Rival::ReoptimisedBenchmark(g) => Rival::ReoptimisedBenchmark(Gains {
            proportional: times(g.proportional, 0),
            integral: times(g.integral, 1),
            pressure_feedback: times(g.pressure_feedback, 2),
            high_pass: times(g.high_pass, 3),
        }),
        Rival::Lqg(w) => Rival::Lqg(weights(w)),
        Rival::Mpc(w) => Rival::Mpc(weights(w)),
    }
}

fn main() -> Result<(), LabError> {
    let mut arguments = std::env::args().skip(1);
    let (rival, size) = match arguments.next().as_deref() {
        Some("lqg") => (Rival::Lqg(LQG), 7),
        Some("mpc") => (Rival::Mpc(MPC), 7),
        _ => (Rival::ReoptimisedBenchmark(REOPTIMISED), 4),
    };
    let generations = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(25);
    let model = Description::uia_single_boom()?;
    let nominal = Description::uia_virtual()?;
    let n = &model.numbers;
    let courses = [n.slow, n.fast].map(CourseChoice::Motion);
    let run = |contender: Contender| -> Result<Vec<Outcome>, LabError> {
        let all = family(&model, &nominal, &[contender], &courses, CRANES, SEED, &|_| true)?;
        Ok(all.into_iter().flat_map(|(_, outcomes)| outcomes).flatten().collect())
    };
    let benchmark = run(Strategy::BenchmarkClosedLoop.into())?;
    let loss = |by: &DVector<f64>| {
        let tried = changed(rival, by.as_slice());
        let Ok(outcomes) = run(Contender::Rival(tried)) else { return UNSTABLE.ln() };
        let of = |(own, other): (&Outcome, &Outcome)| match own.rms_mm.is_nan()
            || (own.unstable && !other.unstable)
        {
            true => UNSTABLE.ln(),
            false => (own.rms_mm / other.rms_mm).ln(),
        };
        let sum: f64 = outcomes.iter().zip(&benchmark).map(of).sum();
        let mean = sum / benchmark.len() as f64;
        eprintln!("{:.4} {tried:?}", mean.exp());
        mean
    };
    let search = CMAESOptions::new(vec![0.0; size], SPREAD).seed(1).max_generations(generations);
    match search.build(loss) {
        Ok(mut search) => {
            if let Some(best) = search.run().overall_best {
                println!("{:.4} {:?}", best.value.exp(), changed(rival, best.point.as_slice()));
            }
        }
        Err(error) => eprintln!("no search: {error:?}"),
    }
    Ok(())
}
