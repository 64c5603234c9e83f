//! What the scheduled LQR is compared with has to be worth it, and trials have to tell what they are made for.

use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::baselines::Baseline;
use hydroboom_lab::closed_loop::controller_choice::ControllerChoice;
use hydroboom_lab::closed_loop::robustness::{robustness, run, shaping};

/// On the virtual crane, which none of them knows, every rival errs less than the published benchmark: they are no straw men.
#[test]
fn baselines_are_better_than_the_published_benchmark() {
    let (model, crane) =
        (Description::uia_single_boom().unwrap(), Description::uia_virtual().unwrap());
    let trials: Vec<_> = robustness(&model, &crane).unwrap();
    let fast: Vec<_> = trials.into_iter().take(1).collect();
    let mut controllers = vec![ControllerChoice::from(Strategy::BenchmarkClosedLoop)];
    controllers.extend(Baseline::ALL.map(ControllerChoice::Baseline));
    let outcomes = run(&model, &fast, &controllers, &|| ());
    let errors: Vec<f64> = outcomes
        .iter()
        .filter_map(|o| Some(o.error.rms_measured_mm).filter(|mm| mm.is_finite()))
        .collect();
    assert_eq!(errors.len(), controllers.len());
    for (outcome, error) in outcomes.iter().zip(&errors).skip(1) {
        assert!(*error < errors[0] && !outcome.unstable, "{outcome:?}");
    }
}

/// A ZV shaper (two impulses, half a period of the boom apart) leaves less of the tip's vibration, a ZVD shaper (three) less again; noise asks more of the motor.
#[test]
fn trials_show_what_they_are_made_for() {
    let (model, crane) =
        (Description::uia_single_boom().unwrap(), Description::uia_virtual().unwrap());
    // the scheduled LQR smooths its reference itself, and filters its measurements
    let benchmark = [ControllerChoice::from(Strategy::BenchmarkClosedLoop)];
    let of = |trials, name: &str| {
        let outcomes = run(&model, trials, &benchmark, &|| ());
        let found = outcomes.into_iter().find(|o| o.trial.contains(name));
        found.unwrap_or_else(|| panic!("no trial {name}"))
    };
    let mut shaped = shaping(&model, &crane).unwrap();
    shaped.retain(|trial| trial.name.starts_with("120"));
    let left = |name: &str| of(&shaped, name).effort.residual_vibration_mm;
    let [published, zv, zvd] =
        ["published", "trapezoid, shaped twice", "trapezoid, shaped thrice"].map(left);
    assert!(zvd < zv && zv < published && zvd < 0.8 * published, "{published}, {zv}, {zvd}");
    let mut hard = robustness(&model, &crane).unwrap();
    hard.retain(|trial| trial.name.contains("as it is, fast") || trial.name.contains("noisy"));
    let ripple = |name: &str| of(&hard, name).effort.motor_ripple_rpm;
    assert!(ripple("noisy") > 1.5 * ripple("as it is"));
}
