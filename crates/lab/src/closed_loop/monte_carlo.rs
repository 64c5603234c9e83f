//! Monte Carlo simulation over families of virtual cranes with random parameters.

use crate::LabError;
use crate::baselines::Baseline;
use crate::closed_loop::controller_choice::ControllerChoice;
use crate::closed_loop::metrics::{Effort, Metrics, TrackingError};
use crate::closed_loop::scenario::CourseChoice;
use crate::closed_loop::simulation::{Case, WIDTH, simulate_side_by_side};
use crate::closed_loop::sustained_oscillation::has_sustained_oscillation;
use crate::interruptible::as_long_as;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use statrs::statistics::{Data, OrderStatistics};
use std::f64::consts::TAU;

/// Random parameter, uniformly distributed within its range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Variation {
    /// Name with its unit.
    pub name: &'static str,
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

const fn vary(name: &'static str, low: f64, high: f64) -> Variation {
    Variation { name, low, high }
}

/// All random parameters in the order in which they are drawn.
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

/// Further random parameters of a widened family in the order in which they are drawn. The virtual crane
/// draws the last one for each transducer separately.
pub const WIDENED: [Variation; 6] = [
    vary("beam: Young's modulus [times the nominal]", 0.8, 1.2),
    vary("base: stiffness [times the nominal]", 0.7, 1.3),
    vary("lines: dead volumes of cylinder and pump [times the nominal]", 0.7, 1.3),
    vary("sensors: lag [ms beyond the nominal]", -0.2, 0.2),
    vary("fieldbus: delay each way [whole cycles beyond the nominal]", -1.0, 1.0),
    vary("pressure transducers: constant error [% of the span]", -0.5, 0.5),
];

/// Shortest lag of a sensor \[s\]. Below it the lag is zero, because its bandwidth cannot be stated.
const SHORTEST_LAG: f64 = 1e-5;

/// Crane of a family.
#[derive(Clone, Debug)]
pub struct Member {
    /// Values of [`VARIATIONS`], and in a widened family of [`WIDENED`] except its last entry.
    pub values: Vec<f64>,
    /// Description of the crane.
    pub crane: Description,
}

/// Crane with the given number. It depends on the seed and the nominal crane only.
///
/// # Errors
///
/// [`LabError::Description`] if such a machine cannot exist.
pub fn member(nominal: &Description, seed: u64, number: u64) -> Result<Member, LabError> {
    // a random stream of its own, so that cranes can be drawn in any order
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
    Ok(Member { values: values.to_vec(), crane })
}

/// Crane of a widened family: [`member`] with the variations of [`WIDENED`] added, from a separate random
/// stream.
///
/// # Errors
///
/// [`LabError::Description`] if such a machine cannot exist.
pub fn widened(nominal: &Description, seed: u64, number: u64) -> Result<Member, LabError> {
    let Member { mut values, mut crane } = member(nominal, seed, number)?;
    let stream = seed.rotate_left(32) ^ number.wrapping_mul(0xd1b5_4a32_d192_ed03);
    let mut random = Pcg64Mcg::seed_from_u64(!stream);
    let [beam, base, volumes, lag, delay, transducers] = WIDENED;
    let [beam, base, volumes, lag] =
        [beam, base, volumes, lag].map(|v| random.random_range(v.low..=v.high));
    let cycles = random.random_range(delay.low as i32..=delay.high as i32);
    let transducer_seed = random.random_range(1..=1_u64 << 50);
    let n = &nominal.numbers;
    let known_lag = match n.sensor_bandwidth > 0.0 {
        true => 1.0 / (TAU * n.sensor_bandwidth),
        false => 0.0,
    };
    let sensor_lag = known_lag + lag * 1e-3;
    let bandwidth = if sensor_lag > SHORTEST_LAG { 1.0 / (TAU * sensor_lag) } else { 0.0 };
    for assignment in [
        format!("boom.youngs_modulus_gpa={}", n.youngs_modulus * 1e-9 * beam),
        format!("base.stiffness_knm_per_rad={}", n.base_stiffness * 1e-3 * base),
        format!("cylinder.dead_volume_a_l={}", n.dead_volume_a * 1e3 * volumes),
        format!("cylinder.dead_volume_b_l={}", n.dead_volume_b * 1e3 * volumes),
        format!("pump.volume_a_l={}", n.volume_pump_a * 1e3 * volumes),
        format!("pump.volume_b_l={}", n.volume_pump_b * 1e3 * volumes),
        format!("sensors.bandwidth_hz={bandwidth}"),
        format!("fieldbus.delay_cycles={}", (n.fieldbus_delay + f64::from(cycles)).max(0.0)),
        format!("sensors.pressure_error_percent={}", transducers.high),
        format!("virtual.seed={transducer_seed}"),
    ] {
        crane.set(&assignment)?;
    }
    values.extend([beam, base, volumes, lag, f64::from(cycles)]);
    Ok(Member { values, crane })
}

/// Cranes 0 to `count` - 1 of a family, widened or not.
///
/// # Errors
///
/// [`LabError::Description`] if one of them cannot exist.
pub fn members(
    nominal: &Description,
    (count, seed): (u64, u64),
    is_widened: bool,
) -> Result<Vec<Member>, LabError> {
    let of = if is_widened { widened } else { member };
    (0..count).map(|number| of(nominal, seed, number)).collect()
}

/// Random parameters of a family, widened or not.
pub fn variations(is_widened: bool) -> Vec<Variation> {
    let more: &[Variation] = if is_widened { &WIDENED } else { &[] };
    [&VARIATIONS, more].concat()
}

/// The crane after years of wear: three times the leakage, a third more friction, more air in its oil.
///
/// # Errors
///
/// [`LabError::Description`] if such a machine cannot exist.
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

/// Result of one crane under one controller along one course.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// Tracking error.
    #[serde(flatten)]
    pub error: TrackingError,
    /// Effort and vibration.
    #[serde(flatten)]
    pub effort: Effort,
    /// Whether it was in sustained oscillation, or could not be finished.
    pub unstable: bool,
}

/// Results of one crane by controller, then by course.
pub type Outcomes = Vec<Vec<Outcome>>;

/// Runs all controllers along all courses on cranes of a family, vectorised and on all cores. `go_on`
/// receives the share done and returns whether to continue; otherwise the cranes completed so far are
/// returned.
///
/// # Errors
///
/// [`LabError`] if a crane cannot be built. A crane that cannot finish a course counts as unstable.
pub fn family(
    model: &Description,
    members: Vec<Member>,
    controllers: &[ControllerChoice],
    courses: &[CourseChoice],
    go_on: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Vec<(Member, Outcomes)>, LabError> {
    let groups: Vec<&[Member]> = members.chunks(WIDTH).collect();
    let jobs: Vec<_> = groups
        .iter()
        .flat_map(|group| {
            controllers.iter().flat_map(move |controller| {
                courses.iter().map(move |course| (*group, *controller, course))
            })
        })
        .collect();
    let share = |done: usize| go_on(done as f64 / jobs.len() as f64);
    let one = |(group, controller, course): &(&[Member], ControllerChoice, &CourseChoice)| {
        together(model, group, *controller, course)
    };
    let outcomes = as_long_as(&jobs, &share, one)
        .into_iter()
        .map(Option::transpose)
        .collect::<Result<Vec<_>, LabError>>()?;
    let of = |number: usize, s: usize, c: usize| {
        let job = (number / WIDTH * controllers.len() + s) * courses.len() + c;
        outcomes[job].map(|cases| cases[number % WIDTH])
    };
    Ok(members
        .into_iter()
        .enumerate()
        .filter_map(|(number, member)| {
            let along = |s| (0..courses.len()).map(|c| of(number, s, c)).collect();
            let all = (0..controllers.len()).map(along).collect::<Option<Outcomes>>()?;
            Some((member, all))
        })
        .collect())
}

/// One controller along one course on up to [`WIDTH`] cranes.
fn together(
    model: &Description,
    group: &[Member],
    controller: ControllerChoice,
    choice: &CourseChoice,
) -> Result<[Outcome; WIDTH], LabError> {
    // in a smaller last group its last crane also fills the remaining lanes
    let member = |lane: usize| &group[lane.min(group.len() - 1)].crane;
    let mut courses = Vec::with_capacity(WIDTH);
    for lane in 0..WIDTH {
        courses.push(choice.of(member(lane))?);
    }
    let cases: [Case<'_>; WIDTH] = std::array::from_fn(|lane| Case {
        crane: member(lane),
        controller,
        course: courses[lane].as_ref(),
    });
    let mut scores = cases.map(|_| Metrics::new());
    let ends = simulate_side_by_side(model, &cases, |lane, sample| scores[lane].add(sample));
    Ok(std::array::from_fn(|lane| match &ends[lane] {
        Ok(()) => Outcome {
            error: scores[lane].tracking_error(),
            effort: scores[lane].effort(),
            unstable: has_sustained_oscillation(
                model,
                cases[lane].crane,
                controller,
                cases[lane].course,
                &scores[lane],
            ),
        },
        Err(_) => {
            Outcome { error: TrackingError::UNFINISHED, effort: Effort::UNFINISHED, unstable: true }
        }
    }))
}

/// Distribution of a quantity over a family.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentiles {
    /// Minimum.
    pub least: f64,
    /// 5th percentile.
    pub p5: f64,
    /// 25th percentile.
    pub p25: f64,
    /// Median.
    pub median: f64,
    /// 75th percentile.
    pub p75: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Maximum.
    pub worst: f64,
}

impl Percentiles {
    /// Distribution of the given values; non-finite ones are ignored. Without a finite value all are NaN, which is
    /// null in JSON and a dash in [`text`](Self::text).
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let finite: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
        let [least, worst] =
            [f64::min, f64::max].map(|of| finite.iter().copied().fold(f64::NAN, of));
        let is_empty = finite.is_empty();
        let mut data = Data::new(finite);
        let mut share = |tau: f64| if is_empty { f64::NAN } else { data.quantile(tau) };
        Self {
            least,
            p5: share(0.05),
            p25: share(0.25),
            median: share(0.5),
            p75: share(0.75),
            p95: share(0.95),
            worst,
        }
    }

    /// Whether there was no finite value.
    fn is_empty(&self) -> bool {
        self.median.is_nan()
    }

    /// Text with `digits` decimals: median (minimum .. maximum); a dash without values.
    pub fn range_text(&self, digits: usize) -> String {
        if self.is_empty() {
            return "-".into();
        }
        let Self { least, median, worst, .. } = self;
        format!("{median:.digits$} ({least:.digits$} .. {worst:.digits$})")
    }

    /// Text with `digits` decimals: median (5 .. 95 %), maximum; a dash without values.
    pub fn text(&self, digits: usize) -> String {
        if self.is_empty() {
            return "-".into();
        }
        let Self { p5, median, p95, worst, .. } = self;
        format!("{median:.digits$} ({p5:.digits$} .. {p95:.digits$}), {worst:.digits$}")
    }
}

/// One controller along one course over the whole family.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Controller.
    #[serde(rename = "strategy")]
    pub controller: ControllerChoice,
    /// Name of the course.
    pub course: String,
    /// RMS true tracking error.
    pub rms_true_mm: Percentiles,
    /// RMS measured tracking error.
    pub rms_measured_mm: Percentiles,
    /// Magnitude of the peak true tracking error.
    pub peak_true_mm: Percentiles,
    /// Magnitude of the peak measured tracking error.
    pub peak_measured_mm: Percentiles,
    /// Share of cranes on which it is unstable.
    pub unstable_percent: f64,
    /// RMS true error over the benchmark's on the same crane: below 1 if smaller.
    pub rms_true_over_benchmark: Percentiles,
    /// The same for the measured error.
    pub rms_measured_over_benchmark: Percentiles,
    /// RMS true error over that of the retuned benchmark on the same crane, if that is one of the
    /// controllers.
    pub rms_true_over_retuned_benchmark: Option<Percentiles>,
    /// Peak true error over the benchmark's on the same crane.
    pub peak_true_over_benchmark: Percentiles,
    /// Motor energy over the benchmark's on the same crane.
    pub energy_over_benchmark: Percentiles,
    /// Largest motor speed over the benchmark's on the same crane.
    pub motor_speed_over_benchmark: Percentiles,
    /// Residual vibration of the tip over the benchmark's on the same crane.
    pub vibration_over_benchmark: Percentiles,
    /// Motor ripple at rest.
    pub motor_ripple_rpm: Percentiles,
    /// RMS motor slew over each course.
    pub motor_slew_rpm_per_s: Percentiles,
    /// Control periods of all cranes without a solution, in which an earlier command was repeated.
    pub periods_without_solution: u64,
    /// Ratios to the scheduled LQR on the same crane, if that is one of the controllers.
    pub over_scheduled_lqr: Option<OverLqr>,
    /// Number of cranes in sustained oscillation.
    pub oscillating: usize,
    /// Number of cranes that did not finish the course.
    pub unfinished: usize,
    /// Share of cranes with a smaller RMS true error than the benchmark's.
    pub better_percent: f64,
}

/// Ratios of a controller to the scheduled LQR on the same crane, along one course over the whole family.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct OverLqr {
    /// RMS true tracking error.
    pub rms_true: Percentiles,
    /// Number of cranes on which it is smaller.
    pub less_on: usize,
    /// RMS measured tracking error.
    pub rms_measured: Percentiles,
    /// Motor slew.
    pub motor_slew: Percentiles,
}

/// Rows of a family, one per controller and course; none if the benchmark is not one of the controllers.
pub fn rows(
    controllers: &[ControllerChoice],
    courses: &[String],
    results: &[(Member, Outcomes)],
) -> Vec<Row> {
    let is_benchmark = |c: &ControllerChoice| *c == Strategy::BenchmarkClosedLoop.into();
    let Some(benchmark) = controllers.iter().position(is_benchmark) else { return Vec::new() };
    let is_retuned = |c: &ControllerChoice| {
        matches!(c, ControllerChoice::Baseline(Baseline::RetunedBenchmark(_)))
    };
    let retuned = controllers.iter().position(is_retuned);
    let scheduled = controllers.iter().position(|c| *c == Strategy::ScheduledLqr.into());
    let count = results.len().max(1) as f64;
    let mut rows = Vec::new();
    for (s, controller) in controllers.iter().enumerate() {
        for (c, course) in courses.iter().enumerate() {
            let spread = |of: &dyn Fn(&Outcome) -> f64| {
                Percentiles::of(results.iter().map(|(_, o)| of(&o[s][c])))
            };
            let over_that_of = |other: usize, of: &dyn Fn(&Outcome) -> f64| {
                Percentiles::of(results.iter().map(|(_, o)| of(&o[s][c]) / of(&o[other][c])))
            };
            let over = |of: &dyn Fn(&Outcome) -> f64| over_that_of(benchmark, of);
            let share = |holds: &dyn Fn(&Outcomes) -> bool| {
                results.iter().filter(|(_, o)| holds(o)).count() as f64 / count * 100.0
            };
            let count_of = |holds: &dyn Fn(&Outcome) -> bool| {
                results.iter().filter(|(_, o)| holds(&o[s][c])).count()
            };
            let over_lqr = |other: usize| OverLqr {
                rms_true: over_that_of(other, &|o| o.error.rms_true_mm),
                less_on: results
                    .iter()
                    .filter(|(_, o)| o[s][c].error.rms_true_mm < o[other][c].error.rms_true_mm)
                    .count(),
                rms_measured: over_that_of(other, &|o| o.error.rms_measured_mm),
                motor_slew: over_that_of(other, &|o| o.effort.motor_slew_rpm_per_s),
            };
            rows.push(Row {
                controller: *controller,
                course: course.clone(),
                rms_true_mm: spread(&|o| o.error.rms_true_mm),
                rms_measured_mm: spread(&|o| o.error.rms_measured_mm),
                peak_true_mm: spread(&|o| o.error.peak_true_mm.abs()),
                peak_measured_mm: spread(&|o| o.error.peak_measured_mm.abs()),
                rms_true_over_benchmark: over(&|o| o.error.rms_true_mm),
                unstable_percent: share(&|o| o[s][c].unstable),
                rms_measured_over_benchmark: over(&|o| o.error.rms_measured_mm),
                rms_true_over_retuned_benchmark: retuned
                    .map(|other| over_that_of(other, &|o| o.error.rms_true_mm)),
                peak_true_over_benchmark: over(&|o| o.error.peak_true_mm.abs()),
                energy_over_benchmark: over(&|o| o.effort.energy_kj),
                motor_speed_over_benchmark: over(&|o| o.effort.motor_speed_rpm),
                vibration_over_benchmark: over(&|o| o.effort.residual_vibration_mm),
                motor_ripple_rpm: spread(&|o| o.effort.motor_ripple_rpm),
                motor_slew_rpm_per_s: spread(&|o| o.effort.motor_slew_rpm_per_s),
                periods_without_solution: results
                    .iter()
                    .map(|(_, o)| o[s][c].effort.periods_without_solution)
                    .sum(),
                over_scheduled_lqr: scheduled.map(over_lqr),
                oscillating: count_of(&|o| o.unstable && !o.error.rms_true_mm.is_nan()),
                unfinished: count_of(&|o| o.error.rms_true_mm.is_nan()),
                better_percent: share(&|o| {
                    o[s][c].error.rms_true_mm < o[benchmark][c].error.rms_true_mm
                }),
            });
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_design::benchmark_design::Gains;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A course without a rest of a second has no ripple at rest: NaN of a single crane is left out, and without any
    /// value there is a dash, and null in JSON.
    #[test]
    fn a_quantity_without_values_is_a_dash_and_null() {
        let none = Percentiles::of([f64::NAN; 3]);
        assert_eq!((none.text(1), none.range_text(2)), ("-".into(), "-".into()));
        let json = serde_json::to_value(none).unwrap();
        for key in ["least", "p5", "p25", "median", "p75", "p95", "worst"] {
            assert!(json[key].is_null(), "{json}");
        }
        assert_eq!(Percentiles::of([]).text(1), "-");
        let some = Percentiles::of([2.0, f64::NAN, 4.0]);
        assert_eq!((some.least, some.worst), (2.0, 4.0));
        assert!(some.text(1).starts_with("3.0 ("), "{}", some.text(1));
    }

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

    /// A widened member equals the member except in the further variations, which depend on seed and number
    /// only.
    #[test]
    fn a_widened_member_is_the_member_with_further_variations() {
        let nominal = Description::uia_virtual().unwrap();
        let known = member(&nominal, 1, 5).unwrap();
        let wide = |seed, number| widened(&nominal, seed, number).unwrap();
        assert_eq!(wide(1, 5).crane.numbers, wide(1, 5).crane.numbers);
        assert_eq!(wide(1, 5).values[..VARIATIONS.len()], known.values);
        let mut back = wide(1, 5).crane.numbers;
        let n = &known.crane.numbers;
        (back.youngs_modulus, back.base_stiffness) = (n.youngs_modulus, n.base_stiffness);
        (back.dead_volume_a, back.dead_volume_b) = (n.dead_volume_a, n.dead_volume_b);
        (back.volume_pump_a, back.volume_pump_b) = (n.volume_pump_a, n.volume_pump_b);
        (back.sensor_bandwidth, back.fieldbus_delay) = (n.sensor_bandwidth, n.fieldbus_delay);
        (back.pressure_error, back.seed) = (n.pressure_error, n.seed);
        assert_eq!(back, *n);
        let beyond = |seed, number| wide(seed, number).values[VARIATIONS.len()..].to_vec();
        assert!(beyond(1, 5) != beyond(1, 6) && beyond(1, 5) != beyond(2, 5));
        let lag = |crane: &Description| 1e3 / (TAU * crane.numbers.sensor_bandwidth);
        let mut delays = [false; 3];
        for number in 0..100 {
            let Member { values, crane } = wide(3, number);
            for (value, range) in values.iter().zip(variations(true)) {
                assert!((range.low..=range.high).contains(value), "{}: {value}", range.name);
            }
            let off = lag(&crane) - lag(&nominal);
            assert!(off.abs() <= 0.2 + 1e-9, "{off} ms");
            delays[crane.numbers.fieldbus_delay as usize] = true;
            assert!(
                (0.7..1.3).contains(&(crane.numbers.dead_volume_a / nominal.numbers.dead_volume_a))
            );
        }
        assert_eq!(delays, [true; 3]);
    }

    /// On one core a group completes all courses before the next group begins.
    #[test]
    fn cranes_of_an_interrupted_family_have_gone_all_the_way() {
        let model = Description::uia_single_boom().unwrap();
        let mut nominal = Description::uia_virtual().unwrap();
        let n = &mut nominal.numbers;
        (n.motion_end, n.ramp) = (n.motion_start + 0.1, 0.4);
        (n.dwell, n.rest) = (0.5, 0.5);
        let controllers = [ControllerChoice::Strategy(Strategy::BenchmarkClosedLoop)];
        let courses = [1, 2, 3].map(|_| CourseChoice::Motion(nominal.numbers.fast));
        let cranes = members(&nominal, (3 * WIDTH as u64, 1), false).unwrap();
        let interrupted = |after: usize| {
            let done = AtomicUsize::new(0);
            let go_on = |_| done.fetch_add(1, Ordering::Relaxed) + 1 < after;
            let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
            one_thread
                .install(|| family(&model, cranes.clone(), &controllers, &courses, &go_on))
                .unwrap()
        };
        assert!(interrupted(2).is_empty());
        let left = interrupted(4);
        assert_eq!(left.len(), WIDTH);
        for (number, (left, outcomes)) in left.iter().enumerate() {
            assert_eq!(left.values, member(&nominal, 1, number as u64).unwrap().values);
            assert!(outcomes[0].len() == courses.len() && outcomes[0].iter().all(|o| !o.unstable));
        }
    }

    #[test]
    fn errors_are_told_over_those_of_both_benchmarks_on_the_same_crane() {
        let gains = Gains::of(&Description::uia_single_boom().unwrap());
        let retuned = ControllerChoice::Baseline(Baseline::RetunedBenchmark(gains));
        let controllers =
            [Strategy::BenchmarkClosedLoop.into(), Strategy::ScheduledLqr.into(), retuned];
        let outcome = |rms_mm| Outcome {
            error: TrackingError {
                rms_true_mm: rms_mm,
                rms_measured_mm: rms_mm,
                peak_true_mm: rms_mm,
                peak_measured_mm: rms_mm,
            },
            effort: Effort::default(),
            unstable: false,
        };
        let nominal = Description::uia_virtual().unwrap();
        // all controllers have ten times the error on the second crane
        let results: Vec<_> = [1.0, 10.0]
            .iter()
            .enumerate()
            .map(|(k, hard)| {
                let of = |rms_mm: f64| vec![outcome(rms_mm * hard)];
                (member(&nominal, 1, k as u64).unwrap(), vec![of(0.8), of(0.1), of(0.4)])
            })
            .collect();
        let rows = rows(&controllers, &["there".into()], &results);
        for (row, (over, over_retuned)) in rows.iter().zip([(1.0, 2.0), (0.125, 0.25), (0.5, 1.0)])
        {
            assert_eq!(
                (row.rms_true_over_benchmark.p5, row.rms_true_over_benchmark.worst),
                (over, over)
            );
            let spread = row.rms_true_over_retuned_benchmark.unwrap();
            assert_eq!((spread.p5, spread.worst), (over_retuned, over_retuned));
        }
        let over_lqr = rows.iter().map(|row| row.over_scheduled_lqr.unwrap());
        for (over, (ratio, less_on)) in over_lqr.zip([(8.0, 0), (1.0, 0), (4.0, 0)]) {
            assert!((over.rms_true.least / ratio - 1.0).abs() < 1e-12, "{over:?}");
            assert_eq!(
                (over.less_on, over.rms_true.range_text(1)),
                (less_on, format!("{ratio:.1} ({ratio:.1} .. {ratio:.1})"))
            );
        }
    }

    #[test]
    fn the_spread_of_even_numbers_is_even() {
        let spread = Percentiles::of((0..=1000).map(f64::from));
        assert!((spread.median - 500.0).abs() < 1.0, "{spread:?}");
        assert!((spread.p5 - 50.0).abs() < 1.0 && (spread.p95 - 950.0).abs() < 1.0, "{spread:?}");
        assert_eq!(spread.worst, 1000.0);
    }
}
