//! Preview, smoothing, speed limit and governor of the reference.

use hydroboom_control::reference::governor::ReferenceGovernor;
use hydroboom_control::reference::preview::{PERIODS_AHEAD, PERIODS_BEHIND, Preview};
use hydroboom_control::reference::profile::{OutAndBack, RampShape, SetPoint};
use hydroboom_control::reference::smoothing::smoothed;
use hydroboom_control::reference::speed_limit::SpeedLimit;

const PERIOD: f64 = 1e-3;

fn motion(speed: f64) -> OutAndBack<f64> {
    let profile = RampShape::Trapezoidal;
    OutAndBack { start: 0.05, end: 0.45, speed, ramp: 0.5, dwell: 1.0, rest: 1.5, profile }
}

/// A preview that was advanced in each period equals the trajectory at that time.
#[test]
fn a_preview_advances_with_the_trajectory() {
    let motion = motion(0.12);
    let mut preview = Preview::new(PERIOD, |t| motion.reference(t));
    for k in 1..=2500 {
        preview.advance(|t| motion.reference(PERIOD * f64::from(k) + t));
    }
    let now = 2.5;
    for periods in [-(PERIODS_BEHIND as i32), -57, 0, 1, 300, PERIODS_AHEAD as i32] {
        let after = PERIOD * f64::from(periods);
        let (kept, wanted) = (preview.at(after), motion.reference(now + after));
        assert!((kept.position - wanted.position).abs() < 1e-12, "{after}");
        assert!((kept.velocity - wanted.velocity).abs() < 1e-12, "{after}");
    }
    for after in [0.85, 1.3, 2.5] {
        let (kept, wanted) = (preview.position(after), motion.reference(now + after).position);
        assert!((kept - wanted).abs() < 1e-12, "{after}");
    }
}

#[test]
fn without_preview_the_reference_keeps_its_velocity() {
    let mut preview = Preview::at_rest(PERIOD, 0.2);
    for k in 0..50 {
        let position = 0.2 + 1e-4 * f64::from(k);
        preview.advance_without_preview(SetPoint { position, velocity: 0.1 });
    }
    let now = 0.2 + 49e-4;
    assert!((preview.position(0.5) - (now + 0.05)).abs() < 1e-12);
    assert!((preview.position(2.0) - (now + 0.2)).abs() < 1e-12);
    assert!((preview.at(-0.02).position - (now - 2e-3)).abs() < 1e-12, "the past stays");
}

/// The moving average of a parabola differs from it by a constant only, a²/24 of the window: zero phase.
#[test]
fn smoothing_has_zero_phase() {
    let acceleration = 0.4;
    let at = |t: f64| SetPoint {
        position: 0.1 + 0.5 * acceleration * (1.0 + t).powi(2),
        velocity: acceleration * (1.0 + t),
    };
    let window = 0.2;
    let smooth = smoothed(at, window, 0.3);
    let wanted = at(0.3);
    assert!((smooth.velocity - wanted.velocity).abs() < 1e-12);
    assert!((smooth.acceleration - acceleration).abs() < 1e-12);
    assert!(smooth.jerk.abs() < 1e-9, "{}", smooth.jerk);
    let lifted = acceleration * window * window / 24.0;
    assert!((smooth.position - wanted.position - lifted).abs() < 0.05 * lifted);
}

/// The smoothed velocity is the derivative of the smoothed position, and the acceleration that of the
/// velocity, along ramps as well.
#[test]
fn smoothed_velocity_and_acceleration_are_derivatives() {
    let motion = motion(0.12);
    let at = |time: f64| move |t: f64| motion.reference(time + t);
    let h = 1e-4;
    for k in 0..400 {
        let time = 0.01 * f64::from(k);
        let [before, here, after] = [-h, 0.0, h].map(|t| smoothed(at(time), 0.1, t));
        let velocity = (after.position - before.position) / (2.0 * h);
        // six points stand for the mean
        assert!((velocity - here.velocity).abs() < 2e-3, "{time}: {velocity} {here:?}");
        let acceleration = (after.velocity - before.velocity) / (2.0 * h);
        assert!((acceleration - here.acceleration).abs() < 2e-3, "{time}: {acceleration} {here:?}");
    }
}

fn limited(speed: f64, fastest: f64) -> (f64, f64, f64) {
    let motion = motion(speed);
    let mut preview = Preview::new(PERIOD, |t| motion.reference(t));
    let mut limit = SpeedLimit::at_rest(0.05);
    let (mut largest, mut ahead, mut behind) = (0.0_f64, 0.0_f64, 0.0_f64);
    let mut before = None;
    let end = 1.5 + motion.travel_time() + 0.9;
    for k in 0..(end / PERIOD) as usize {
        limit.update(&preview, [fastest; 2]);
        let [offset, _] = limit.at(0.0, PERIOD);
        let position = preview.now().position + offset;
        if let Some(before) = before {
            largest = largest.max((position - before) / PERIOD);
        }
        (ahead, behind) = (ahead.max(offset), behind.min(offset));
        before = Some(position);
        let time = PERIOD * (k + 1) as f64;
        preview.advance(|t| motion.reference(time + t));
    }
    (largest, ahead, behind)
}

#[test]
fn a_trajectory_within_the_speed_limit_is_unchanged() {
    let (_, ahead, behind) = limited(0.12, 0.13);
    assert!(ahead < 1e-9 && behind > -1e-9, "{ahead} {behind}");
}

/// A reference above the speed limit: the limit is met, and the initial lead is about equal to the final
/// lag.
#[test]
fn a_trajectory_beyond_the_speed_limit_starts_earlier() {
    let (largest, ahead, behind) = limited(0.2, 0.14);
    assert!(largest < 0.14 * 1.001, "{largest}");
    assert!(ahead > 0.02 && behind < -0.02, "{ahead} {behind}");
    assert!((ahead + behind).abs() < 0.3 * ahead, "{ahead} {behind}");
}

#[test]
fn the_governor_acts_on_large_errors_only_and_its_offset_decays() {
    let governor = ReferenceGovernor {
        largest_error: 4e-3,
        rate: 1.5,
        rate_by_frequency: 0.8,
        velocity: 0.05,
    };
    assert_eq!(governor.update(0.0, 3.9e-3, 1.5, PERIOD), 0.0);
    let offset = governor.update(0.0, 50e-3, 1.5, PERIOD);
    assert!((offset - 46e-3).abs() < 1e-12, "{offset}");
    // where the load oscillates slowly, the reference returns slowly
    assert!((governor.decay(1.0) - 0.8).abs() < 1e-12);
    assert_eq!(governor.decay(20.0), 1.5);
    // a machine that follows: the offset returns at the largest velocity, then decays at its rate
    let mut offset = 46e-3;
    for _ in 0..1000 {
        offset = governor.update(offset, offset, 1.5, PERIOD);
    }
    let from = governor.velocity / 1.5;
    let decays_for = 1.0 - (46e-3 - from) / governor.velocity;
    assert!((offset / from - (-1.5 * decays_for).exp()).abs() < 1e-3, "{offset}");
    assert_eq!(governor.drift(1.0, 1.5), -0.05);
}
