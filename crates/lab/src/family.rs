//! Many virtual cranes: no two machines are alike, and none stays as it was.

use crate::LabError;
use crate::motion_test::{Run, Strategy, run};
use hydroboom_description::Description;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::Serialize;
use statrs::statistics::{Data, OrderStatistics};

/// What varies from crane to crane, evenly within its range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Variation {
    /// What it is, with its unit.
    pub name: &'static str,
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

const fn vary(name: &'static str, low: f64, high: f64) -> Variation {
    Variation { name, low, high }
}

/// All of them, in the order in which they are drawn.
pub const VARIATIONS: [Variation; 10] = [
    vary("payload [% of the nominal]", 0.0, 120.0),
    vary("oil temperature [C]", 10.0, 60.0),
    vary("wear: leakage [times the nominal]", 0.5, 3.0),
    vary("air: transition pressure of the oil's stiffness [bar]", 20.0, 45.0),
    vary("friction [times the nominal]", 0.5, 1.6),
    vary("drive bandwidth [Hz]", 15.0, 80.0),
    vary("pump displacement [% of the nominal]", 97.0, 102.0),
    vary("pre-load at the start [%]", 85.0, 100.0),
    vary("rod-side pressure at the start [bar]", 2.0, 6.0),
    vary("accumulator pressure [bar]", 2.0, 3.2),
];

/// One crane of the family.
#[derive(Clone, Debug)]
pub struct Member {
    /// Its values of [`VARIATIONS`].
    pub values: [f64; VARIATIONS.len()],
    /// The crane.
    pub crane: Description,
}

/// The crane of the given number, always the same for the same seed and nominal crane.
///
/// # Errors
///
/// [`LabError::Description`] when such a machine cannot exist.
pub fn member(nominal: &Description, seed: u64, number: u64) -> Result<Member, LabError> {
    // a stream of its own for each, so that they can be drawn in any order
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let values = VARIATIONS.map(|v| random.random_range(v.low..=v.high));
    let [payload, oil, wear, air, friction, drive, displacement, preload, rod_side, accumulator] =
        values;
    let n = &nominal.numbers;
    let mut crane = nominal.clone();
    for assignment in [
        format!("payload.mass_kg={}", n.payload * payload / 100.0),
        format!("temperature.oil_c={oil}"),
        format!("oil.transition_bar={air}"),
        format!("pump.internal_leakage_m3_s_sqrtpa={:e}", n.internal_leakage * wear),
        format!("pump.case_leakage_a_m3_s_sqrtpa={:e}", n.case_leakage_a * wear),
        format!("pump.case_leakage_b_m3_s_sqrtpa={:e}", n.case_leakage_b * wear),
        format!("friction.coulomb_n={}", n.coulomb * friction),
        format!("friction.stiction_n={}", n.stiction * friction),
        format!("friction.viscous_ns_per_m={}", n.viscous * friction),
        format!("drive.bandwidth_hz={drive}"),
        format!("pump.displacement_cm3={}", n.displacement * 1e6 * displacement / 100.0),
        format!("start.preload_percent={preload}"),
        format!("start.rod_side_bar={rod_side}"),
        format!("accumulator.working_bar={accumulator}"),
        format!("virtual.seed={}", number + 1),
    ] {
        crane.set(&assignment)?;
    }
    crane.numbers.slip_at_rest *= wear;
    crane.numbers.slip_per_speed *= wear;
    Ok(Member { values, crane })
}

/// The same crane after years: three times the leakage, a third more friction, more air in its oil.
///
/// # Errors
///
/// [`LabError::Description`] when such a machine cannot exist.
pub fn worn(crane: &Description) -> Result<Description, LabError> {
    let n = &crane.numbers;
    let mut worn = crane.clone();
    for assignment in [
        format!("pump.internal_leakage_m3_s_sqrtpa={:e}", 3.0 * n.internal_leakage),
        format!("friction.coulomb_n={}", 1.33 * n.coulomb),
        format!("friction.stiction_n={}", 1.33 * n.stiction),
        format!("oil.transition_bar={}", n.transition * 1e-5 + 5.0),
    ] {
        worn.set(&assignment)?;
    }
    worn.numbers.slip_at_rest *= 3.0;
    worn.numbers.slip_per_speed *= 3.0;
    Ok(worn)
}

/// What one crane did under one strategy at one speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// RMS tracking error.
    pub rms_mm: f64,
    /// Peak tracking error, with its sign.
    pub peak_mm: f64,
    /// Whether it rang on, or could not be finished.
    pub unstable: bool,
}

/// A crane still swings if its position moves by more than this in the last second of rest \[m\]...
const SWINGING: f64 = 2e-3;
/// ... and no less than this share of what it did in the second before.
const SUSTAINED: f64 = 0.9;

/// Whether a run ends in an oscillation that does not die out.
pub fn is_unstable(run: &Run) -> bool {
    let swing = |from: usize, to: usize| {
        let count = run.samples.len();
        let part = &run.samples[count.saturating_sub(from)..count.saturating_sub(to)];
        let extent = part.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), s| {
            (low.min(s.truth.outputs.stroke), high.max(s.truth.outputs.stroke))
        });
        extent.1 - extent.0
    };
    let period = run.samples.get(1).map_or(1e-3, |s| s.time);
    let second = (1.0 / period).round() as usize;
    let (last, before) = (swing(second, 0), swing(2 * second, second));
    last > SWINGING && last > SUSTAINED * before
}

/// All strategies on one crane: outcomes by strategy, then by speed.
pub type Outcomes = [[Outcome; 2]; 4];

/// Runs all strategies at both speeds on cranes 0 to `count` − 1, on all cores; `progress` is told
/// the number of cranes done.
///
/// # Errors
///
/// [`LabError`] when a crane cannot be built. One that cannot finish a motion counts as unstable.
pub fn family(
    model: &Description,
    nominal: &Description,
    count: u64,
    seed: u64,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<Vec<(Member, Outcomes)>, LabError> {
    let done = std::sync::atomic::AtomicU64::new(0);
    (0..count)
        .into_par_iter()
        .map(|number| {
            let member = member(nominal, seed, number)?;
            let mut outcomes = Vec::with_capacity(4);
            for strategy in Strategy::ALL {
                outcomes.push(
                    [model.numbers.slow, model.numbers.fast]
                        .map(|speed| outcome(run(model, &member.crane, strategy, speed))),
                );
            }
            progress(done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1);
            let outcomes = std::array::from_fn(|k| outcomes[k]);
            Ok((member, outcomes))
        })
        .collect()
}

fn outcome(run: Result<Run, LabError>) -> Outcome {
    match run {
        Ok(run) => Outcome {
            rms_mm: run.rms() * 1e3,
            peak_mm: run.peak() * 1e3,
            unstable: is_unstable(&run),
        },
        Err(_) => Outcome { rms_mm: f64::NAN, peak_mm: f64::NAN, unstable: true },
    }
}

/// The distribution of a quantity over a family.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// A twentieth lies below.
    pub p5: f64,
    /// A quarter lies below.
    pub p25: f64,
    /// Half lie below.
    pub median: f64,
    /// A quarter lies above.
    pub p75: f64,
    /// A twentieth lies above.
    pub p95: f64,
    /// The largest.
    pub worst: f64,
}

impl Spread {
    /// Of the given values, those that are not numbers left out.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let finite: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
        let worst = finite.iter().copied().fold(f64::NAN, f64::max);
        let mut data = Data::new(finite);
        let mut share = |tau: f64| data.quantile(tau);
        Self {
            p5: share(0.05),
            p25: share(0.25),
            median: share(0.5),
            p75: share(0.75),
            p95: share(0.95),
            worst,
        }
    }
}

/// One strategy at one speed over the whole family.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The strategy.
    pub strategy: Strategy,
    /// Speed of the motion.
    pub speed_mm_s: f64,
    /// RMS tracking error.
    pub rms_mm: Spread,
    /// Magnitude of the peak tracking error.
    pub peak_mm: Spread,
    /// Share of cranes on which it is unstable.
    pub unstable_percent: f64,
    /// By how much its RMS is smaller than the benchmark's on the same crane; negative where it is
    /// larger.
    pub improvement_percent: Spread,
    /// Share of cranes on which it is smaller.
    pub improved_percent: f64,
}

/// The family in numbers: every strategy at both speeds.
pub fn rows(model: &Description, results: &[(Member, Outcomes)]) -> Vec<Row> {
    let benchmark = Strategy::BenchmarkClosedLoop as usize;
    let count = results.len().max(1) as f64;
    let mut rows = Vec::new();
    for (s, strategy) in Strategy::ALL.into_iter().enumerate() {
        for (v, speed) in [model.numbers.slow, model.numbers.fast].into_iter().enumerate() {
            let of = |outcome: fn(&Outcome) -> f64| {
                Spread::of(results.iter().map(|(_, o)| outcome(&o[s][v])))
            };
            let improvement =
                |o: &Outcomes| (1.0 - o[s][v].rms_mm / o[benchmark][v].rms_mm) * 100.0;
            let share = |holds: &dyn Fn(&Outcomes) -> bool| {
                results.iter().filter(|(_, o)| holds(o)).count() as f64 / count * 100.0
            };
            rows.push(Row {
                strategy,
                speed_mm_s: speed * 1e3,
                rms_mm: of(|o| o.rms_mm),
                peak_mm: of(|o| o.peak_mm.abs()),
                unstable_percent: share(&|o| o[s][v].unstable),
                improvement_percent: Spread::of(results.iter().map(|(_, o)| improvement(o))),
                improved_percent: share(&|o| improvement(o) > 0.0),
            });
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_member_depends_on_seed_and_number_alone() {
        let nominal = Description::uia_virtual().unwrap();
        let values = |seed, number| member(&nominal, seed, number).unwrap().values;
        assert_eq!(values(1, 5), values(1, 5));
        assert_ne!(values(1, 5), values(1, 6));
        assert_ne!(values(1, 5), values(2, 5));
        for number in 0..100 {
            for (value, range) in values(3, number).iter().zip(VARIATIONS) {
                assert!((range.low..=range.high).contains(value), "{}: {value}", range.name);
            }
        }
    }

    #[test]
    fn the_spread_of_even_numbers_is_even() {
        let spread = Spread::of((0..=1000).map(f64::from));
        assert!((spread.median - 500.0).abs() < 1.0, "{spread:?}");
        assert!((spread.p5 - 50.0).abs() < 1.0 && (spread.p95 - 950.0).abs() < 1.0, "{spread:?}");
        assert_eq!(spread.worst, 1000.0);
    }
}
