//! Is the model right? Position, pressures, frequency and damping of a log, each against a stated limit.

use crate::differences::{Difference, Differences};
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
    // what rings loudest above its sensor's scatter is the boom
    let loudness = |d: &&Difference| {
        d.ringing.filter(|r| r.damping.is_some()).map_or(0.0, |r| r.amplitude / d.noise.max(1e-300))
    };
    let rings = found.iter().filter(|d| d.ringing.is_some() && d.model_ringing.is_some());
    let boom =
        rings.filter(|d| loudness(d) > 0.0).max_by(|a, b| loudness(a).total_cmp(&loudness(b)));
    let pair = boom.and_then(|d| Some((d.signal, d.ringing?, d.model_ringing?)));
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
