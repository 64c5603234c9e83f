//! Numbers of the paper that the model reproduces.
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::{eigenfrequency, paper};
use hydroboom_lab::{motion_test::Row, motion_test::pressure_oscillation, motion_test::run};

fn crane() -> Description {
    Description::uia_single_boom().unwrap()
}

#[test]
fn velocity_feedforward_errs_as_published() {
    let crane = crane();
    for speed in [crane.numbers.slow, crane.numbers.fast] {
        let done =
            run(&crane, &crane, Strategy::VelocityFeedforward, &crane.motion(speed)).unwrap();
        let row = Row::of("nominal", &done);
        let rms = row.error.rms_measured_mm / row.paper_rms_mm.unwrap() - 1.0;
        let peak = row.error.peak_measured_mm / row.paper_peak_mm.unwrap() - 1.0;
        assert!(rms.abs() < 0.15 && peak.abs() < 0.15, "{row:?}");
    }
}

#[test]
fn locked_cylinder_oscillates_at_the_published_frequency() {
    let frictionless = eigenfrequency::without_friction(&crane()).unwrap();
    for (stroke, published) in paper::EIGEN_STROKE_MM.into_iter().zip(paper::EIGEN_SIMULATED_HZ) {
        let mode = eigenfrequency::locked_mode(&frictionless, stroke * 1e-3).unwrap();
        let error = mode.frequency_hz / published - 1.0;
        assert!(error.abs() < 0.01, "{} against {published} at {stroke} mm", mode.frequency_hz);
    }
}

#[test]
fn oscillation_and_linearisation_agree_without_friction() {
    for stroke in [0.1, 0.2, 0.4] {
        let row = eigenfrequency::row(&crane(), stroke).unwrap();
        let error = row.frictionless_hz.unwrap() / row.linearised_hz - 1.0;
        assert!(error.abs() < 0.005, "{row:?}");
    }
}

#[test]
fn open_valve_pressure_oscillates_at_the_published_frequency() {
    let crane = crane();
    let speed = crane.numbers.fast;
    let done = run(&crane, &crane, Strategy::VelocityFeedforward, &crane.motion(speed)).unwrap();
    let frequency = pressure_oscillation(&crane.motion(speed), &done).unwrap();
    let error = frequency / paper::PRESSURE_OSCILLATION_HZ - 1.0;
    assert!(error.abs() < 0.1, "{frequency}");
}

#[test]
fn benchmark_is_stable_with_pressure_feedback_and_unstable_without() {
    let with = crane();
    let mut without = crane();
    without.set("controller.pressure_feedback_m3_per_spa=0").unwrap();
    let speed = with.numbers.fast;
    // tracking error in the last second of rest: a stable loop is at rest there, an unstable one oscillates
    let swing = |crane: &Description| match run(
        crane,
        crane,
        Strategy::BenchmarkClosedLoop,
        &crane.motion(speed),
    ) {
        Ok(done) => {
            let tail = &done.samples[done.samples.len() - 1000..];
            tail.iter().map(|s| s.error().abs()).fold(0.0, f64::max)
        }
        // the oscillation left the model's range of validity
        Err(_) => f64::INFINITY,
    };
    let (with, without) = (swing(&with), swing(&without));
    assert!(with < 1e-3 && without > 10e-3, "{with} m with, {without} m without");
}
