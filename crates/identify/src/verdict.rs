//! Is the model right? Position, pressures, frequency and damping of a log, each against a stated limit.

use crate::differences::{Difference, Differences};
use crate::ringing::Ringing;
use hydroboom_measurement::Signal;

/// What a model is right or wrong for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aspect {
    /// The piston's position.
    Position,
    /// All pressures that were measured.
    Pressures,
    /// How fast the load pressure, or what rings loudest, oscillates.
    Frequency,
    /// How fast that fades.
    Damping,
}

/// Limits within which a model is called right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// RMS difference of the position over the way that the log's piston goes.
    pub position: f64,
    /// RMS difference of a pressure over the largest that the log has of it.
    pub pressure: f64,
    /// And never less than this \[Pa\].
    pub least_pressure: f64,
    /// And of a position \[m\].
    pub least_position: f64,
    /// Share by which frequencies may differ.
    pub frequency: f64,
    /// Share by which damping ratios may differ, and never less than `least_damping`.
    pub damping: f64,
    /// Difference of damping ratios that is none.
    pub least_damping: f64,
}

/// The limits: half of what the paper's model leaves between itself and its crane (Table 6: 4.4 mm of 400 mm and 2.75 bar of 80; 2.24 Hz for 2.27), and 30 % of a damping,
/// which no oscillation of a few periods tells better.
pub const LIMITS: Limits = Limits {
    position: 0.006,
    pressure: 0.02,
    least_pressure: 0.3e5,
    least_position: 0.2e-3,
    frequency: 0.02,
    damping: 0.3,
    least_damping: 0.005,
};

/// Whether a model is right for one aspect of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// The aspect.
    pub aspect: Aspect,
    /// The signal that decides.
    pub signal: Signal,
    /// What was found: an RMS difference in SI units, or a share of frequency or damping with its sign, the model over the log.
    pub found: f64,
    /// What it may be, its size.
    pub limit: f64,
}

impl Judgement {
    /// Whether the model is right.
    pub fn is_right(&self) -> bool {
        self.found.abs() <= self.limit
    }
}

/// What a model is right for, of what the log tells; the signal that is worst decides.
pub fn verdict(found: &Differences) -> Vec<Judgement> {
    let worst = |of: Vec<Judgement>| {
        let share = |j: &Judgement| j.found.abs() / j.limit;
        of.into_iter().max_by(|a, b| share(a).total_cmp(&share(b)))
    };
    let position = found.iter().filter(|d| d.signal == Signal::Stroke).map(|d| Judgement {
        aspect: Aspect::Position,
        signal: d.signal,
        found: d.rms,
        limit: (LIMITS.position * d.span).max(LIMITS.least_position),
    });
    let pressures = found.iter().filter(|d| d.signal != Signal::Stroke).map(|d| Judgement {
        aspect: Aspect::Pressures,
        signal: d.signal,
        found: d.rms,
        limit: (LIMITS.pressure * d.largest).max(LIMITS.least_pressure),
    });
    // what rings loudest above its sensor's scatter is the boom; an oscillation whose fading cannot be told has no frequency to be relied on
    let pairs = found.iter().filter_map(|d| {
        let [log, model] = [d.ringing, d.model_ringing].map(|r| r.filter(|r| r.damping.is_some()));
        Some((d, log?, model?))
    });
    let loudness = |(d, log, _): &(&Difference, Ringing, Ringing)| {
        log.amplitude / d.noise.max(f64::MIN_POSITIVE)
    };
    let boom = pairs.max_by(|a, b| loudness(a).total_cmp(&loudness(b)));
    let pair = boom.map(|(d, log, model)| (d.signal, log, model));
    let frequency = pair.map(|(signal, log, model)| Judgement {
        aspect: Aspect::Frequency,
        signal,
        found: model.frequency / log.frequency - 1.0,
        limit: LIMITS.frequency,
    });
    let damping = pair.and_then(|(signal, log, model)| {
        let (log, model) = (log.damping?, model.damping?);
        let limit = LIMITS.damping.max(LIMITS.least_damping / log.abs().max(1e-9));
        let found = (model - log) / log.abs().max(1e-9);
        Some(Judgement { aspect: Aspect::Damping, signal, found, limit })
    });
    let all = [worst(position.collect()), worst(pressures.collect()), frequency, damping];
    all.into_iter().flatten().collect()
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
            parts: None,
            span: if signal == Signal::Stroke { 0.4 } else { 10e5 },
            largest: if signal == Signal::Stroke { 0.5 } else { 80e5 },
            noise: 1.0,
        }
    }

    fn ringing(frequency: f64, damping: Option<f64>) -> Option<Ringing> {
        Some(Ringing { frequency, damping, amplitude: 1e5 })
    }

    #[test]
    fn each_aspect_is_judged_by_its_worst_signal_and_what_is_not_told_by_none() {
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
        let told: Vec<(Aspect, Signal, bool)> =
            judged.iter().map(|j| (j.aspect, j.signal, j.is_right())).collect();
        // 2 mm of 400 mm; 3 bar of 80; 5 % of the frequency; a damping of 0.03 for 0.02, which is half more
        let expected = [
            (Aspect::Position, Signal::Stroke, true),
            (Aspect::Pressures, Signal::PressureB, false),
            (Aspect::Frequency, Signal::PressureA, false),
            (Aspect::Damping, Signal::PressureA, false),
        ];
        assert_eq!(told, expected);
        let unsure = [ringing(3.0, None), ringing(3.15, Some(0.03))];
        let judged = verdict(&vec![difference(Signal::PressureA, 1.0e5, unsure)]);
        assert_eq!(judged.len(), 1, "{judged:?}");
    }
}
