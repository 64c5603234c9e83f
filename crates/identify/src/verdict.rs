//! Verdict on a model: position, pressures, frequency and damping of a log, each compared with a stated
//! limit.

use crate::differences::{Difference, Differences};
use crate::limits::LIMITS;
use crate::ringing::Ringing;
use hydroboom_measurement::Signal;

/// Quantity by which a model is judged against a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aspect {
    /// The piston's position.
    Position,
    /// All measured pressures.
    Pressures,
    /// Frequency of the boom's oscillation, from the signal of largest amplitude over noise.
    Frequency,
    /// Damping of that oscillation.
    Damping,
}

/// Deviation of a model from a log in one quantity, and its limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// Judged quantity.
    pub aspect: Aspect,
    /// Signal in which the deviation, relative to its limit, is largest.
    pub signal: Signal,
    /// RMS difference \[m or Pa\], or relative difference of frequency or damping ratio \[-\], (model − log)/log.
    pub found: f64,
    /// Largest magnitude of `found` that is accepted, in the same unit.
    pub limit: f64,
}

impl Judgement {
    /// Whether the model is within the limit: |found| ≤ limit.
    pub fn is_right(&self) -> bool {
        self.found.abs() <= self.limit
    }
}

/// Judgement of a position or a pressure.
pub(crate) fn of_size(d: &Difference) -> Judgement {
    let (aspect, limit) = match d.signal {
        Signal::Stroke => (Aspect::Position, (LIMITS.position * d.span).max(LIMITS.least_position)),
        _ => (Aspect::Pressures, (LIMITS.pressure * d.largest).max(LIMITS.least_pressure)),
    };
    Judgement { aspect, signal: d.signal, found: d.rms, limit }
}

/// Judgements of a signal's frequency and damping, model over log, if both are identified. The frequency is
/// judged only if the damping is small enough.
fn of_ringing(d: &Difference) -> Vec<Judgement> {
    let (Some(log), Some(model)) = (d.ringing, d.model_ringing) else { return Vec::new() };
    let (Some(own), Some(shown)) = (log.damping, model.damping) else { return Vec::new() };
    let (signal, mut all) = (d.signal, Vec::new());
    if [log, model].iter().all(Ringing::has_reliable_frequency) {
        let found = model.frequency / log.frequency - 1.0;
        all.push(Judgement { aspect: Aspect::Frequency, signal, found, limit: LIMITS.frequency });
    }
    let limit = LIMITS.damping.max(LIMITS.least_damping / own.abs().max(1e-9));
    let found = (shown - own) / own.abs().max(1e-9);
    all.push(Judgement { aspect: Aspect::Damping, signal, found, limit });
    all
}

/// Whether an adequately sampled signal is beyond its limit.
pub(crate) fn is_beyond(d: &Difference) -> bool {
    d.unresolved.is_none() && !of_size(d).is_right()
}

/// All judgements: each adequately sampled signal, and the boom's oscillation.
pub(crate) fn judged(found: &Differences) -> Vec<Judgement> {
    let resolved = found.iter().filter(|d| d.unresolved.is_none());
    let boom = boom(found).map(of_ringing).into_iter().flatten();
    resolved.map(of_size).chain(boom).collect()
}

/// Deviations beyond their limits: of each adequately sampled signal, and of the boom's oscillation.
pub fn complaints(found: &Differences) -> Vec<Judgement> {
    judged(found).into_iter().filter(|j| !j.is_right()).collect()
}

/// Signal of the boom's oscillation: largest amplitude over sensor noise. An oscillation without an
/// identified damping has no reliable frequency.
fn boom(found: &Differences) -> Option<&Difference> {
    let amplitude_over_noise = |d: &&Difference| {
        d.ringing.map_or(0.0, |log| log.amplitude / d.noise.max(f64::MIN_POSITIVE))
    };
    let resolved = found.iter().filter(|d| d.unresolved.is_none() && !of_ringing(d).is_empty());
    resolved.max_by(|a, b| amplitude_over_noise(a).total_cmp(&amplitude_over_noise(b)))
}

/// Judgement of position, pressures, frequency and damping, each by the signal of largest deviation relative to its
/// limit. A quantity that the log does not show, or samples too coarsely, is left out.
pub fn verdict(found: &Differences) -> Vec<Judgement> {
    let worst = |of: Vec<Judgement>| {
        let share = |j: &Judgement| j.found.abs() / j.limit;
        of.into_iter().max_by(|a, b| share(a).total_cmp(&share(b)))
    };
    let resolved = || found.iter().filter(|d| d.unresolved.is_none());
    let of =
        |aspect: Aspect| worst(resolved().map(of_size).filter(|j| j.aspect == aspect).collect());
    let ringing = boom(found).map(of_ringing).into_iter().flatten();
    let sizes = [of(Aspect::Position), of(Aspect::Pressures)];
    sizes.into_iter().flatten().chain(ringing).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn difference(signal: Signal, rms: f64, rings: [Option<Ringing>; 2]) -> Difference {
        Difference {
            signal,
            count: 1000,
            rms,
            peak: rms,
            bias: 0.0,
            correlation: None,
            fit: None,
            delay: None,
            rms_without_delay: None,
            delay_halves: None,
            drift: None,
            rms_without_drift: None,
            ringing: rings[0],
            model_ringing: rings[1],
            coloured: 0.0,
            is_white: true,
            parts: None,
            span: if signal == Signal::Stroke { 0.4 } else { 10e5 },
            largest: if signal == Signal::Stroke { 0.5 } else { 80e5 },
            noise: 1.0,
            unresolved: None,
        }
    }

    fn ringing(frequency: f64, damping: Option<f64>) -> Option<Ringing> {
        Some(Ringing { frequency, damping, amplitude: 1e5 })
    }

    #[test]
    fn each_aspect_is_judged_by_its_worst_signal_and_an_unidentified_one_by_none() {
        let silent = [None; 2];
        let found = vec![
            difference(Signal::Stroke, 2e-3, silent),
            difference(
                Signal::PressureA,
                1.0e5,
                [ringing(3.0, Some(0.02)), ringing(3.15, Some(0.03))],
            ),
            difference(Signal::PressureB, 3.0e5, silent),
        ];
        let judged = verdict(&found);
        let aspects: Vec<(Aspect, Signal, bool)> =
            judged.iter().map(|j| (j.aspect, j.signal, j.is_right())).collect();
        // 2 mm of 400 mm; 3 bar of 80 bar; 5 % of the frequency; damping 0.03 for 0.02, which is half more
        let expected = [
            (Aspect::Position, Signal::Stroke, true),
            (Aspect::Pressures, Signal::PressureB, false),
            (Aspect::Frequency, Signal::PressureA, false),
            (Aspect::Damping, Signal::PressureA, false),
        ];
        assert_eq!(aspects, expected);
        // with strong damping the frequency is not judged, and the damping is
        let brief = [ringing(3.0, Some(0.04)), ringing(2.2, Some(0.28))];
        let judged = verdict(&vec![difference(Signal::PressureA, 1.0e5, brief)]);
        let aspects: Vec<Aspect> = judged.iter().map(|j| j.aspect).collect();
        assert_eq!(aspects, [Aspect::Pressures, Aspect::Damping]);
        let unsure = [ringing(3.0, None), ringing(3.15, Some(0.03))];
        let judged = verdict(&vec![difference(Signal::PressureA, 1.0e5, unsure)]);
        assert_eq!(judged.len(), 1, "{judged:?}");
    }
}
