//! The baselines are competitive, and the trials show the effects they are made for.

use hydroboom_control::reference::profile::{OutAndBack, RampShape, SetPoint};
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::LabError;
use hydroboom_lab::baselines::Baseline;
use hydroboom_lab::closed_loop::controller_choice::ControllerChoice;
use hydroboom_lab::closed_loop::metrics::Metrics;
use hydroboom_lab::closed_loop::robustness::{robustness, run, shaping};
use hydroboom_lab::closed_loop::scenario::Course;
use hydroboom_lab::closed_loop::simulation::simulate_closed_loop;
use std::sync::LazyLock;

/// All baselines designed for the paper's crane, once for all tests.
fn designed() -> [Baseline; 5] {
    static DESIGNED: LazyLock<[Baseline; 5]> = LazyLock::new(|| {
        let model = Description::uia_single_boom().expect("the embedded crane file is read");
        Baseline::all(&model).expect("the paper's crane has gains")
    });
    *DESIGNED
}

/// On the virtual crane, which none of the controllers knows, state feedback and prediction have smaller
/// errors than the published benchmark.
#[test]
fn baselines_with_an_estimator_are_better_than_the_published_benchmark() {
    let (model, crane) =
        (Description::uia_single_boom().unwrap(), Description::uia_virtual().unwrap());
    let course = OutAndBack { ramp: 0.5, ..SUDDEN };
    let [.., lqg, linear, nonlinear] = designed().map(ControllerChoice::Baseline);
    let error = |choice: ControllerChoice| {
        let mut metrics = Metrics::new();
        simulate_closed_loop(&model, &crane, choice, &course, |sample| {
            metrics.add(sample);
            Ok(())
        })
        .unwrap();
        metrics.true_rms() * 1e3
    };
    let benchmark = error(Strategy::BenchmarkClosedLoop.into());
    for choice in [lqg, linear, nonlinear] {
        let own = error(choice);
        assert!(own < 0.5 * benchmark, "{}: {own} of {benchmark} mm", choice.name());
    }
}

/// The published gains oscillate with an empty hook; gains designed for the payload range do not.
#[test]
fn the_retuned_benchmark_does_not_oscillate_with_an_empty_hook() {
    let (model, crane) =
        (Description::uia_single_boom().unwrap(), Description::uia_virtual().unwrap());
    let mut trials = robustness(&model, &crane).unwrap();
    trials.retain(|trial| trial.name == "empty hook");
    let [retuned, ..] = designed().map(ControllerChoice::Baseline);
    let controllers = [Strategy::BenchmarkClosedLoop.into(), retuned];
    let outcomes = run(&model, &trials, &controllers, &|| ());
    let unstable: Vec<bool> = outcomes.iter().map(|o| o.unstable).collect();
    assert_eq!(unstable, [true, false], "{outcomes:?}");
}

/// Motion of 100 mm and back with ramps that the motor cannot follow.
const SUDDEN: OutAndBack<f64> = OutAndBack {
    start: 0.2,
    end: 0.3,
    speed: 0.12,
    ramp: 0.05,
    dwell: 0.3,
    rest: 0.3,
    profile: RampShape::Trapezoidal,
};

/// A course at rest.
struct Still;

impl Trajectory for Still {
    fn reference(&self, _t: f64) -> SetPoint<f64> {
        SetPoint { position: 0.25, velocity: 0.0 }
    }
    fn duration(&self) -> f64 {
        1.0
    }
    fn speed(&self) -> f64 {
        0.0
    }
}

impl Course for Still {
    fn name(&self) -> String {
        "still".into()
    }
}

/// A reference at rest causes no motion on a crane that equals the model, except for the correction of
/// leakage. That is 0.1 mm until the filter has estimated it, and more with the benchmarks, whose integral
/// starts at zero.
#[test]
fn a_constant_reference_causes_no_motion() {
    let model = Description::uia_single_boom().unwrap();
    for baseline in designed() {
        let (mut moved, mut turned): (f64, f64) = (0.0, 0.0);
        let choice = ControllerChoice::Baseline(baseline);
        simulate_closed_loop(&model, &model, choice, &Still, |sample| {
            moved = moved.max((sample.truth.outputs.stroke - 0.25).abs());
            turned = turned.max(sample.command.motor_speed.abs());
            Ok(())
        })
        .unwrap();
        let name = baseline.name();
        let allowed = if name.ends_with("benchmark") { 0.5e-3 } else { 0.1e-3 };
        assert!(moved < allowed && turned < 1.0, "{name}: {} mm, {turned} rev/s", moved * 1e3);
    }
}

/// A motion too sudden for the motor: no command exceeds its speed limit. The nonlinear controller also
/// keeps a pressure limit, which the linear one does not have.
#[test]
fn limits_are_kept_along_a_sudden_motion() {
    let mut model = Description::uia_single_boom().unwrap();
    let crane = model.clone();
    let highest = |model: &Description, baseline| {
        let mut highest: f64 = 0.0;
        let choice = ControllerChoice::Baseline(baseline);
        simulate_closed_loop(model, &crane, choice, &SUDDEN, |sample| {
            let speed = sample.command.motor_speed.abs();
            assert!(speed <= model.numbers.motor_speed, "{speed} rev/s");
            highest = highest.max(sample.truth.outputs.pressure_a);
            Ok(())
        })
        .unwrap();
        highest * 1e-5
    };
    let free = [Baseline::LinearMpc, Baseline::NonlinearMpc].map(|of| highest(&model, of));
    let limit = 0.5 * (free[1] + rest_bar(&crane).unwrap());
    model.set(&format!("relief.cracking_bar={limit}")).unwrap();
    let limited = highest(&model, Baseline::NonlinearMpc);
    assert!(limited < limit + 0.5, "{limited} bar for {limit}, free {free:?}");
    let linear = highest(&model, Baseline::LinearMpc);
    assert!(linear > limit + 1.0, "{linear} bar for {limit}");
}

/// Piston-side pressure at rest \[bar\].
fn rest_bar(crane: &Description) -> Result<f64, LabError> {
    let mut rest = 0.0;
    simulate_closed_loop(crane, crane, Baseline::LinearMpc, &Still, |sample| {
        rest = sample.truth.outputs.pressure_a * 1e-5;
        Ok(())
    })?;
    Ok(rest)
}

/// A ZV shaper (two impulses half a period of the boom apart) reduces the vibration of the tip, a ZVD
/// shaper (three impulses) reduces it further. Noise increases the motor's effort.
#[test]
fn shaping_reduces_vibration_and_noise_increases_the_effort() {
    let (model, crane) =
        (Description::uia_single_boom().unwrap(), Description::uia_virtual().unwrap());
    // the scheduled LQR smooths its reference itself and filters its measurements
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
