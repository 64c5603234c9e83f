//! Consistency checks between signals: wrong sign, exchanged columns, valve state against motion.

use crate::signal::Signal;
use crate::signals::{Signals, Track};
use crate::suspicion::Suspicion;

/// Difference interval for the piston's speed \[s\]: long enough for the encoder's noise, short compared with a
/// movement.
const SPAN: f64 = 0.1;
/// Largest number of times at which signals are compared.
const MOST_TIMES: usize = 5_000;
/// Smallest change of position that counts as a movement \[m\].
const TRAVEL: f64 = 0.02;
/// Correlation below which two signals have opposite signs.
const OPPOSITE: f64 = -0.5;
/// Pressures count as exchanged if exchanging them reduces their differences to less than this share.
const EXCHANGED: f64 = 0.3;

/// All contradictions between the signals.
pub(crate) fn contradictions(signals: &Signals) -> Vec<Suspicion> {
    let checks = [against_the_piston, shut_and_moving, exchanged];
    checks.iter().filter_map(|check| check(signals)).collect()
}

fn suspicion(signal: Signal, text: String) -> Suspicion {
    Suspicion { signal, text, is_unusable: false }
}

/// Evenly spaced times within a signal's duration \[s\].
fn times(track: &Track) -> Vec<f64> {
    let (Some(first), Some(last)) = (track.time().first(), track.time().last()) else {
        return Vec::new();
    };
    let count = track.time().len().min(MOST_TIMES);
    (0..count).map(|k| first + (last - first) * (k as f64 + 0.5) / count as f64).collect()
}

/// Range of a signal: largest minus smallest value, in its unit.
fn travel(track: &Track) -> f64 {
    let (low, high) = track
        .values()
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    high - low
}

/// Speeds of piston \[m/s\] and motor \[rev/s\] at the same times; `None` if the piston does not move.
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

/// Detects a motor speed with the sign opposite to the piston's speed.
fn against_the_piston(signals: &Signals) -> Option<Suspicion> {
    let pairs = speeds(signals)?;
    // correlation about zero, not about the mean: at rest the motor turns only because of leakage
    let of = |product: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(product).sum::<f64>();
    let (both, speed, motor) = (of(&|p| p.0 * p.1), of(&|p| p.0 * p.0), of(&|p| p.1 * p.1));
    (both < OPPOSITE * (speed * motor).sqrt()).then(|| {
        let text = "the motor turns against the piston: does its speed, or the position, count the other way? ([log.motor_speed] sign = -1)";
        suspicion(Signal::MotorSpeed, text.into())
    })
}

/// Detects a load-holding valve that is logged as closed while the piston moves.
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

/// Detects cylinder pressures that follow the opposite pump sides.
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
