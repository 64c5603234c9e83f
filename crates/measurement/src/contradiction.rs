//! Signals that contradict each other: a sign, two columns exchanged, a valve that is said to be shut.

use crate::signal::Signal;
use crate::signals::{Signals, Track};
use crate::suspicion::Suspicion;

/// Time over which the piston's speed is taken \[s\]: long beside the noise of an encoder, short beside a movement.
const SPAN: f64 = 0.1;
/// Times at which signals are compared, at most.
const MOST_TIMES: usize = 5_000;
/// Least travel by which a piston has moved \[m\].
const TRAVEL: f64 = 0.02;
/// Correlation below which two signals have opposite signs.
const OPPOSITE: f64 = -0.5;
/// Pressures are exchanged where exchanging them leaves less of their differences than this share.
const EXCHANGED: f64 = 0.3;

/// What of some signals cannot be true together.
pub(crate) fn contradictions(signals: &Signals) -> Vec<Suspicion> {
    let checks = [against_the_piston, shut_and_moving, exchanged];
    checks.iter().filter_map(|check| check(signals)).collect()
}

fn suspicion(signal: Signal, text: String) -> Suspicion {
    Suspicion { signal, text, is_unusable: false }
}

/// Evenly spaced times within a signal \[s\].
fn times(track: &Track) -> Vec<f64> {
    let (Some(first), Some(last)) = (track.time().first(), track.time().last()) else {
        return Vec::new();
    };
    let count = track.time().len().min(MOST_TIMES);
    (0..count).map(|k| first + (last - first) * (k as f64 + 0.5) / count as f64).collect()
}

/// By how much a signal changes in all.
fn travel(track: &Track) -> f64 {
    let (low, high) = track
        .values()
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    high - low
}

/// Speeds of piston \[m/s\] and motor \[rev/s\] at the same times; none where the piston does not move.
pub(crate) fn speeds(signals: &Signals) -> Option<Vec<(f64, f64)>> {
    let (position, motor) = (signals.get(Signal::Stroke)?, signals.get(Signal::MotorSpeed)?);
    if travel(position) < TRAVEL {
        return None;
    }
    let pair = |t: f64| {
        let speed = (position.at(t + 0.5 * SPAN)? - position.at(t - 0.5 * SPAN)?) / SPAN;
        Some((speed, motor.at(t)?))
    };
    Some(times(position).into_iter().filter_map(pair).collect())
}

/// The motor's speed, where it has the other sign than the piston's.
fn against_the_piston(signals: &Signals) -> Option<Suspicion> {
    let pairs = speeds(signals)?;
    // about zero: leakage alone turns the motor at rest
    let of = |product: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(product).sum::<f64>();
    let (both, speed, motor) = (of(&|p| p.0 * p.1), of(&|p| p.0 * p.0), of(&|p| p.1 * p.1));
    (both < OPPOSITE * (speed * motor).sqrt()).then(|| {
        let text = "the motor turns against the piston: does its speed, or the position, count the other way? ([log.motor_speed] sign = -1)";
        suspicion(Signal::MotorSpeed, text.into())
    })
}

/// A load-holding valve that is shut throughout while the piston moves.
fn shut_and_moving(signals: &Signals) -> Option<Suspicion> {
    let (position, valve) = (signals.get(Signal::Stroke)?, signals.get(Signal::HoldingValve)?);
    let is_shut = valve.values().iter().all(|v| *v < 0.5);
    (is_shut && travel(position) >= TRAVEL).then(|| {
        let text = format!(
            "the load-holding valve is shut throughout, and the piston moves by {:.0} mm: is the column another signal, or 0 where the valve is open?",
            1e3 * travel(position)
        );
        suspicion(Signal::HoldingValve, text)
    })
}

/// Pressures of the two sides of the cylinder, where each is that of the pump's other side.
fn exchanged(signals: &Signals) -> Option<Suspicion> {
    let [a, b, pump_a, pump_b] =
        [Signal::PressureA, Signal::PressureB, Signal::PressurePumpA, Signal::PressurePumpB]
            .map(|signal| signals.get(signal));
    let (a, b, pump_a, pump_b) = (a?, b?, pump_a?, pump_b?);
    let (mut alike, mut crossed) = (0.0, 0.0);
    for t in times(a) {
        let (Some(a), Some(b)) = (a.at(t), b.at(t)) else { continue };
        let (Some(pump_a), Some(pump_b)) = (pump_a.at(t), pump_b.at(t)) else { continue };
        alike += (a - pump_a).abs() + (b - pump_b).abs();
        crossed += (a - pump_b).abs() + (b - pump_a).abs();
    }
    (crossed < EXCHANGED * alike).then(|| {
        let text = "p_A is near p_PB, and p_B near p_PA: are two columns exchanged?";
        suspicion(Signal::PressureA, text.into())
    })
}
