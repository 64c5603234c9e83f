//! What one cycle tells of a machine, and what feedforward and learning are worth with it.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_description::Description;
use hydroboom_lab::closed_loop::monte_carlo::member;
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::cycle_learning::experiment::{
    CycleReport, Method, MethodError, learning_experiment,
};

/// A cycle of one crane at the fast speed.
fn cycle(crane: Description) -> CycleReport {
    let model = Description::uia_single_boom().unwrap();
    let course = [CourseChoice::Motion(model.numbers.fast)];
    let cranes = [("one".into(), crane)];
    learning_experiment(&model, &cranes, &course, &|| true).unwrap().remove(0)
}

/// True RMS error by a method \[mm\].
fn error(report: &CycleReport, method: Method, cycles: Option<usize>, reset: bool) -> f64 {
    let of = |m: &&MethodError| (m.method, m.cycles, m.reset) == (method, cycles, reset);
    report.methods.iter().find(of).unwrap().rms_true_mm.unwrap()
}

/// A worn pump leaks, and feedforward from the model as described errs by centimetres; from the identified model it does not, and learning corrects
/// what that still lacks.
#[test]
fn a_cycle_tells_what_feedforward_lacks() {
    let report = cycle(member(&Description::uia_virtual().unwrap(), 7, 10).unwrap().crane);
    let nominal = error(&report, Method::NominalModel, None, true);
    let identified = error(&report, Method::IdentifiedModel, None, true);
    assert!(identified < 1.0 && identified < 0.2 * nominal, "{nominal} mm, then {identified} mm");
    let learned = error(&report, Method::IterativeLearning, Some(10), true);
    // readings are a cycle of the fieldbus late: taken as of now, they would leave this much
    let n = Description::uia_virtual().unwrap().numbers;
    let late_mm = 1e3 * n.fast * n.fieldbus_delay * n.control_period;
    assert!(learned < 0.5 * late_mm, "{learned} mm, of {late_mm} mm");
    assert!(report.convergence.unwrap().is_contraction() && learned < identified, "{learned} mm");
}

/// A slow drive delays by its lag of second order, apart from the fieldbus; the identified model says so.
#[test]
fn a_cycle_tells_the_delay_of_a_slow_drive() {
    let model = Description::uia_single_boom().unwrap();
    let mut crane = Description::uia_virtual().unwrap();
    crane.set("drive.bandwidth_hz=15").unwrap();
    let n = &crane.numbers;
    let drive = 2.0 * n.drive_damping / (std::f64::consts::TAU * n.drive_bandwidth);
    let report = cycle(crane.clone());
    let mut identified = model.clone();
    report.identified.iter().for_each(|set| identified.set(set).unwrap());
    let lag = identified.numbers.tuning.estimator_drive_lag;
    assert!((lag - drive).abs() < 0.1 * drive, "{lag} s for {drive} s");
    let lag_mm = n.fast * (drive - model.numbers.tuning.estimator_drive_lag) * 1e3;
    let rms = error(&report, Method::IdentifiedModel, None, true);
    assert!(rms < 0.25 * lag_mm, "{rms} mm, of {lag_mm} mm by the delay");
}

/// A cylinder at rest holds any pressure that its friction can. Where the oil is so soft that this is millimetres of oil, a machine that is
/// commanded the same again errs by them; where it is stiff, it repeats itself.
#[test]
fn repeatability_depends_on_the_oils_stiffness_at_rest() {
    let nominal = Description::uia_virtual().unwrap();
    let [soft, stiff] = [16, 20].map(|number| {
        let report = cycle(member(&nominal, 1, number).unwrap().crane);
        error(&report, Method::Replay, None, false)
    });
    assert!(stiff < 0.5 && soft > 5.0, "{stiff} mm, {soft} mm");
}
