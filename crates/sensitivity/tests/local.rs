//! Exact derivatives against finite differences; the eigenfrequency with its conditions.

use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_identify::Free;
use hydroboom_sensitivity::{Case, Output, local};

#[test]
fn slopes_through_the_closed_loop_are_those_of_finite_differences() {
    let mut crane = Description::uia_single_boom().unwrap();
    // short, with every phase of the motion
    for assignment in ["motion.end_mm=250", "motion.dwell_s=1", "motion.rest_s=0.5"] {
        crane.set(assignment).unwrap();
    }
    let free: Vec<Free> = ["payload.mass_kg", "pump.flow_gain", "boom.youngs_modulus_gpa"]
        .iter()
        .map(|path| Free::from_path(path).unwrap())
        .collect();
    let case = Case::new(&crane, 0.05, &Output::ALL).unwrap();
    let (values, found) = local(&case, &free, &|| {}).unwrap();
    let plain = case.evaluate(&crane.numbers).unwrap();
    for (a, b) in values.iter().zip(&plain) {
        assert!((a - b).abs() <= 1e-9 * b.abs(), "{a} and {b}");
    }
    for l in &found {
        let moved = |by: f64| {
            let mut numbers = crane.numbers.to_array();
            numbers[l.key.place] *= f64::exp(by);
            case.evaluate(&Numbers::from_array(numbers)).unwrap()
        };
        let step = 1e-4;
        let (up, down) = (moved(step), moved(-step));
        for (k, output) in case.outputs.iter().enumerate() {
            let finite = (up[k] - down[k]) / (2.0 * step);
            let (slope, size) = (l.slopes[k], plain[k]);
            // valves switch at times that depend on the parameters: the difference quotient is only approximate
            let apart = (slope - finite).abs();
            assert!(
                apart < 0.02 * finite.abs() + 2e-3 * size,
                "{} by {}: {slope} and {finite} of {size}",
                output.name(),
                l.key.path()
            );
        }
    }
}

#[test]
fn a_stiffer_boom_raises_and_a_heavier_load_lowers_the_frequency() {
    let crane = Description::uia_single_boom().unwrap();
    let free: Vec<Free> = ["payload.mass_kg", "boom.youngs_modulus_gpa"]
        .iter()
        .map(|path| Free::from_path(path).unwrap())
        .collect();
    let case = Case::new(&crane, 0.1, &[Output::Eigenfrequency]).unwrap();
    let (values, found) = local(&case, &free, &|| {}).unwrap();
    let share = |k: usize| found[k].slopes[0] / values[0];
    // the exponent lies between those of a pure oil spring and of a pure boom
    assert!((-0.5..-0.3).contains(&share(0)), "{}", share(0));
    assert!((0.01..0.5).contains(&share(1)), "{}", share(1));
}

#[test]
fn the_eigenfrequency_states_position_trapped_pressure_and_drop() {
    let mut crane = Description::uia_single_boom().unwrap();
    crane.set("oscillation.drop_mm=2").unwrap();
    let case = Case::new(&crane, 0.1, &[Output::Eigenfrequency]).unwrap();
    let stated = case.conditions(Output::Eigenfrequency).unwrap();
    for condition in ["mid-stroke, 250 mm", "at 34.5 bar", "by 2.0 mm"] {
        assert!(stated.contains(condition), "{stated}");
    }
}
