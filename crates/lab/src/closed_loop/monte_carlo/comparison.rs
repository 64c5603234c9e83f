//! Comparison of controllers over a family, each with the benchmark and the scheduled LQR on the same crane.

use super::{Member, Outcome, Outcomes, Percentiles};
use crate::baselines::Baseline;
use crate::closed_loop::controller_choice::ControllerChoice;
use hydroboom_control::strategy::Strategy;
use serde::Serialize;

/// Distributions of the results of one controller along one course over a family of cranes, compared with the
/// benchmark.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Compared controller.
    #[serde(rename = "strategy")]
    pub controller: ControllerChoice,
    /// Name of the course.
    pub course: String,
    /// RMS true tracking error \[mm\].
    pub rms_true_mm: Percentiles,
    /// RMS measured tracking error \[mm\].
    pub rms_measured_mm: Percentiles,
    /// Magnitude of the peak true tracking error \[mm\].
    pub peak_true_mm: Percentiles,
    /// Magnitude of the peak measured tracking error \[mm\].
    pub peak_measured_mm: Percentiles,
    /// Share of cranes \[%\] in sustained oscillation, or on which the course could not be finished.
    pub unstable_percent: f64,
    /// RMS true error over the benchmark's on the same crane \[-\]: below 1 if smaller.
    pub rms_true_over_benchmark: Percentiles,
    /// RMS measured error over the benchmark's on the same crane \[-\].
    pub rms_measured_over_benchmark: Percentiles,
    /// RMS true error over that of the retuned benchmark on the same crane \[-\]; none if that is not one of the
    /// controllers.
    pub rms_true_over_retuned_benchmark: Option<Percentiles>,
    /// Magnitude of the peak true error over the benchmark's on the same crane \[-\].
    pub peak_true_over_benchmark: Percentiles,
    /// Motor energy over the benchmark's on the same crane \[-\].
    pub energy_over_benchmark: Percentiles,
    /// Largest motor speed over the benchmark's on the same crane \[-\].
    pub motor_speed_over_benchmark: Percentiles,
    /// Residual vibration of the tip over the benchmark's on the same crane \[-\].
    pub vibration_over_benchmark: Percentiles,
    /// Motor ripple at rest \[rpm\], as defined in `Effort`.
    pub motor_ripple_rpm: Percentiles,
    /// RMS rate of change of the motor speed over the course \[rpm/s\].
    pub motor_slew_rpm_per_s: Percentiles,
    /// Number of control periods of all cranes in which no solution was found and an earlier command was repeated.
    pub periods_without_solution: u64,
    /// Ratios to the scheduled LQR on the same crane; none if that is not one of the controllers.
    pub over_scheduled_lqr: Option<OverLqr>,
    /// Number of cranes in sustained oscillation.
    pub oscillating: usize,
    /// Number of cranes that did not finish the course.
    pub unfinished: usize,
    /// Share of cranes \[%\] with a smaller RMS true error than the benchmark's.
    pub better_percent: f64,
}

/// Ratios of a controller's results to those of the scheduled LQR on the same crane, along one course over a family.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct OverLqr {
    /// Ratio of the RMS true tracking errors \[-\].
    pub rms_true: Percentiles,
    /// Number of cranes with a smaller RMS true error than under the scheduled LQR.
    pub less_on: usize,
    /// Ratio of the RMS measured tracking errors \[-\].
    pub rms_measured: Percentiles,
    /// Ratio of the RMS rates of change of the motor speed \[-\].
    pub motor_slew: Percentiles,
}

/// Distributions over a family, one row per controller and course. Empty if the benchmark, to which they are compared,
/// is not one of the controllers.
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
    use crate::closed_loop::metrics::{Effort, TrackingError};
    use crate::closed_loop::monte_carlo::member;
    use hydroboom_description::Description;
    use hydroboom_design::benchmark_design::Gains;

    #[test]
    fn errors_are_divided_by_those_of_both_benchmarks_on_the_same_crane() {
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
}
