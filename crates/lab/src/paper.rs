//! Printed results of the paper for comparison (doi:10.3390/act14020080). Errors are x − x_ref.

use hydroboom_control::strategy::Strategy;
use hydroboom_description::{Description, Difference, RangeSource};

/// Table 5: piston positions \[mm\].
pub const EIGEN_STROKE_MM: [f64; 3] = [100.0, 200.0, 400.0];
/// Table 5: simulated eigenfrequencies \[Hz\].
pub const EIGEN_SIMULATED_HZ: [f64; 3] = [3.25, 3.16, 2.94];
/// Table 5: measured eigenfrequencies \[Hz\].
pub const EIGEN_MEASURED_HZ: [f64; 3] = [3.19, 3.18, 3.10];
/// Table 6: frequency of the simulated p_A oscillation during the fast motion \[Hz\].
pub const PRESSURE_OSCILLATION_HZ: f64 = 2.2404;
/// Table 6: frequency of the measured p_A oscillation during the fast motion \[Hz\].
pub const PRESSURE_OSCILLATION_MEASURED_HZ: f64 = 2.2744;
/// Table 6: differences, crane minus simulation, between the real crane and the paper's simulation at the
/// fast speed, (signal, unit, peak, RMS).
pub const TABLE_6: [(&str, &str, f64, f64); 6] = [
    ("x_cyl", "mm", -9.5524, 4.4377),
    ("p_A", "bar", 8.8999, 2.7538),
    ("p_B", "bar", 1.7436, 0.6109),
    ("p_PA", "bar", 8.7480, 2.7914),
    ("p_PB", "bar", 1.3490, 0.5270),
    ("p_acc", "bar", 0.3039, 0.2379),
];
/// Section 5.3: slow and fast speed of the piston \[mm/s\].
pub const SPEEDS_MM_S: [f64; 2] = [25.0, 120.0];
/// Tables 7 to 9: RMS and peak tracking errors \[mm\] on the real crane at both speeds, in the
/// order of [`Strategy::ALL`](hydroboom_control::strategy::Strategy::ALL).
pub const TRACKING_MM: [([f64; 2], [f64; 2]); 4] = [
    ([31.94, 25.11], [-46.19, -37.32]),
    ([5.39, 5.37], [-8.94, -9.39]),
    ([0.22, 0.42], [-1.58, -2.12]),
    ([0.18, 0.37], [-0.88, -1.55]),
];

/// RMS and peak tracking error \[mm\] of a published strategy on the real crane, each at both speeds (Tables 7 to 9);
/// none for strategies that are not in the paper.
pub fn tracking_mm(strategy: Strategy) -> Option<([f64; 2], [f64; 2])> {
    TRACKING_MM.get(strategy as usize).copied()
}

/// Table 1: stroke of the cylinder \[mm\], L_cyl,max minus L_cyl,min.
pub const STROKE_MM: f64 = 500.0;
/// Table 7: reduction of the RMS tracking error by simulation feedforward in open loop, compared with
/// velocity feedforward, at both speeds \[%\].
pub const IMPROVEMENT_OPEN_LOOP_PERCENT: [f64; 2] = [83.11, 78.61];
/// Table 9: reduction of the RMS tracking error by simulation feedforward in closed loop, compared with the
/// benchmark, at both speeds \[%\].
pub const IMPROVEMENT_CLOSED_LOOP_PERCENT: [f64; 2] = [16.37, 11.89];
/// Abstract: accuracy of the simulated eigenfrequency \[%\].
pub const STATED_EIGENFREQUENCY_PERCENT: f64 = 97.0;
/// Abstract: deviation of the simulated piston position as a share of the stroke \[%\].
pub const STATED_POSITION_PERCENT: f64 = 1.2;
/// Conclusions: RMS deviation of the simulated piston position \[mm\].
pub const STATED_POSITION_MM: f64 = 5.85;
/// Abstract: reduction of the RMS tracking error in open loop, at the slow speed \[%\].
pub const STATED_OPEN_LOOP_PERCENT: f64 = 83.0;
/// Conclusions: reduction of the RMS tracking error in closed loop at both speeds \[%\].
pub const STATED_CLOSED_LOOP_PERCENT: [f64; 2] = [16.0, 12.0];

/// Modelling choices that do not change the machine: the division of the boom, and which of the paper's two
/// friction laws is simulated.
const METHODS: [&str; 2] = ["boom.segment_lengths_mm", "friction.law"];
/// Speeds of the motion, which select the paper's errors.
const SPEEDS: [&str; 2] = ["motion.slow_mm_s", "motion.fast_mm_s"];

/// Whether a crane is the paper's, so that its results may be compared with the paper's. Printed values
/// must be equal, and values that the paper does not print must equal the embedded file's or lie within its
/// ranges. The same applies to its motion except the speeds. Controllers and equipment may differ.
pub fn is_its_crane(crane: &Description) -> bool {
    let Ok(own) = Description::uia_single_boom() else { return false };
    let is_possible = |difference: &Difference| {
        let entry = own.own_ranges().find(|(key, ..)| key.path() == difference.key);
        let is_printed = own.own_entries().any(|(key, _, origin)| {
            key.path() == difference.key
                && ["printed", "derived"].contains(&origin.provenance.as_str())
        });
        let value: Option<f64> = difference.there.parse().ok();
        entry.zip(value).is_some_and(|((_, [low, high], source), value)| {
            !is_printed && source == RangeSource::File && (low..=high).contains(&value)
        })
    };
    own.differences(crane).iter().all(|difference| {
        let is_of_motion =
            difference.key.starts_with("motion.") && !SPEEDS.contains(&difference.key.as_str());
        !(difference.is_of_machine() || is_of_motion)
            || METHODS.contains(&difference.key.as_str())
            || is_possible(difference)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crane_with_other_printed_values_is_not_the_papers() {
        let is_its = |set: &[&str]| {
            let mut crane = Description::uia_single_boom().unwrap();
            crane.set_together(set.iter().copied()).unwrap();
            is_its_crane(&crane)
        };
        assert!(is_its(&[]));
        // controllers, methods, and values that the paper does not print
        for own in [
            "controller.proportional_per_s=6",
            "boom.segments=10",
            "friction.law=lugre",
            "friction.viscous_ns_per_m=4000",
            "motion.fast_mm_s=100",
        ] {
            assert!(is_its(&[own]), "{own}");
        }
        for other in [
            "payload.mass_kg=60",
            "cylinder.piston_mm=100",
            "payload.x_mm=9000",
            "motion.end_mm=300",
        ] {
            assert!(!is_its(&[other]), "{other}");
        }
        assert!(!is_its_crane(&Description::uia_virtual().unwrap()));
        assert!(!is_its_crane(&Description::patu_lift().unwrap()));
    }
}
