//! What a cycle tells in hindsight, and what open loop is worth with it.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_description::Description;
use hydroboom_lab::closed_loop::monte_carlo::member;
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::learning::{Taught, taught};

/// A cycle of one crane at the fast speed.
fn cycle(crane: Description) -> Taught {
    let model = Description::uia_single_boom().unwrap();
    let course = [CourseChoice::Motion(model.numbers.fast)];
    let mut all = taught(&model, &[("one".into(), crane)], &course, &|| true).unwrap();
    all.remove(0)
}

/// A worn pump leaks, and the model as described errs by centimetres in open loop; the model that is fitted to the cycle does not.
#[test]
fn a_cycle_tells_what_open_loop_lacks() {
    let crane = member(&Description::uia_virtual().unwrap(), 7, 10).unwrap().crane;
    let found = cycle(crane);
    let [before, hindsight, amended] =
        [found.before, found.in_hindsight, found.amended].map(|rms| rms.unwrap().rms_measured_mm);
    assert!(hindsight < 1.0 && hindsight < 0.2 * before, "{before} mm, then {hindsight} mm");
    assert!(amended < 1.0, "{amended} mm");
}

/// A slow drive is as late as its lag of second order says and its commands and readings are under way; the rehearsal leads by as much.
#[test]
fn a_cycle_tells_how_late_a_slow_drive_is() {
    let model = Description::uia_single_boom().unwrap();
    let mut crane = Description::uia_virtual().unwrap();
    crane.set("drive.bandwidth_hz=15").unwrap();
    let n = &crane.numbers;
    let drive = 2.0 * n.drive_damping / (std::f64::consts::TAU * n.drive_bandwidth);
    let late = drive + 2.0 * n.fieldbus_delay * n.control_period;
    let found = cycle(crane.clone());
    let mut fitted = model.clone();
    found.set_in_hindsight.iter().for_each(|set| fitted.set(set).unwrap());
    let lag = fitted.numbers.tuning.estimator_drive_lag;
    assert!((lag - late).abs() < 0.1 * late, "{lag} s for {late} s");
    let lag_mm = n.fast * (late - model.numbers.tuning.estimator_drive_lag) * 1e3;
    let rehearsed = found.in_hindsight.unwrap().rms_measured_mm;
    assert!(rehearsed < 0.25 * lag_mm, "{rehearsed} mm, of {lag_mm} mm that are late");
}

/// A cylinder that rests holds any pressure that its friction can. Where the oil is so soft that this is millimetres of oil, a machine that is
/// commanded the same again strays by them; where it is stiff, it does the same again.
#[test]
fn what_comes_again_depends_on_how_soft_the_oil_is_where_it_rests() {
    let nominal = Description::uia_virtual().unwrap();
    let [soft, stiff] = [16, 20].map(|number| {
        cycle(member(&nominal, 1, number).unwrap().crane).told_again.unwrap().rms_measured_mm
    });
    assert!(stiff < 0.5 && soft > 5.0, "{stiff} mm, {soft} mm");
}
