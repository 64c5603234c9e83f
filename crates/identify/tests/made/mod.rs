//! Logs made by a model.

#![allow(dead_code, reason = "each test uses a part")]
#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_description::Description;
use hydroboom_description::schema::{KEYS, Numbers};
use hydroboom_identify::{Experiment, Window};
use hydroboom_lab::simulate::{Drive, Settings, simulate};
use hydroboom_measurement::{Mapping, Measurement, Signal, Signals, Track, read};
use hydroboom_model::Scheme;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

/// The same description with a key multiplied.
pub fn with(model: &Description, path: &str, factor: f64) -> Description {
    let place = KEYS.iter().position(|key| key.path() == path).unwrap();
    let mut numbers = model.numbers.to_array();
    numbers[place] *= factor;
    let mut changed = model.clone();
    changed.numbers = Numbers::from_array(numbers);
    changed
}

/// A log of the model under velocity feedforward at its fast speed, its sensors scattering by a share of what
/// real ones do.
pub fn log_of(model: &Description, noise: f64, seed: u64) -> Experiment {
    log_at(model, model.numbers.fast, noise, seed)
}

/// The same at a speed \[m/s\].
pub fn log_at(model: &Description, speed: f64, noise: f64, seed: u64) -> Experiment {
    let settings = Settings {
        start_stroke: model.numbers.motion_start,
        // the published scheme damps a little by itself, which would be found as friction
        scheme: Scheme::Implicit,
        // short beside the model's own, so that it is the model's that shows
        step: 2.5e-5,
        log_interval: 1e-3,
        preloaded: true,
    };
    let (log, signals) = recorded(model, speed, &settings, noise, seed);
    Experiment::new(model, &log, &signals, Window::default()).unwrap()
}

/// What `hydroboom simulate` records at the fast speed with noise on it: some channels, each as late \[s\] and as much off \[SI\] as
/// asked for, the first 9 s of it.
pub fn commanded(model: &Description, channels: &[(Signal, f64, f64)], seed: u64) -> Experiment {
    let settings = Settings {
        start_stroke: model.numbers.motion_start,
        scheme: Scheme::Published,
        step: 5e-5,
        log_interval: 1e-2,
        preloaded: true,
    };
    let (log, clean) = recorded(model, model.numbers.fast, &settings, 1.0, seed);
    let mut signals = Signals::default();
    signals.insert(Signal::MotorSpeed, clean.get(Signal::MotorSpeed).unwrap().clone());
    for (signal, late, off) in channels {
        let track = clean.get(*signal).unwrap();
        let time: Vec<f64> = track.time().iter().map(|t| t + late).collect();
        let values: Vec<f64> = track.values().iter().map(|v| v + off).collect();
        signals.insert(*signal, Track::new(&time, &values));
    }
    Experiment::new(model, &log, &signals, Window { from: None, to: Some(9.0) }).unwrap()
}

/// The model's fast motion without noise, a sample every millisecond.
pub fn clean(model: &Description) -> (Measurement, Signals) {
    let settings = Settings {
        start_stroke: model.numbers.motion_start,
        scheme: Scheme::Implicit,
        step: 5e-4,
        log_interval: 1e-3,
        preloaded: true,
    };
    recorded(model, model.numbers.fast, &settings, 0.0, 1)
}

/// Every so many samples of signals, with white noise on what is compared: 0.02 mm and 0.1 bar.
pub fn sampled(signals: &Signals, every: usize, seed: u64) -> Signals {
    let mut normal = normal(seed);
    let mut sampled = Signals::default();
    for signal in [Signal::MotorSpeed].into_iter().chain(Signal::COMPARED) {
        let track = signals.get(signal).unwrap();
        let size = if signal == Signal::MotorSpeed { 0.0 } else { scatter(signal) };
        let time: Vec<f64> = track.time().iter().step_by(every).copied().collect();
        let values = track.values().iter().step_by(every);
        let values: Vec<f64> = values.map(|v| v + size * normal()).collect();
        sampled.insert(signal, Track::new(&time, &values));
    }
    sampled
}

/// Noise of a sensor \[m or Pa\].
pub fn scatter(signal: Signal) -> f64 {
    if signal == Signal::Stroke { 2e-5 } else { 0.1e5 }
}

/// Numbers of the standard normal distribution.
fn normal(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    move || (-2.0 * uniform().max(1e-300).ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
}

/// A log of the model under velocity feedforward, noise on what is compared.
fn recorded(
    model: &Description,
    speed: f64,
    settings: &Settings,
    noise: f64,
    seed: u64,
) -> (Measurement, Signals) {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let name = format!("made-{}-{count}.csv", std::process::id());
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let drive = Drive::Course(Box::new(model.motion(speed)));
    simulate(model, &drive, settings, Some(&path), |_| {}).unwrap();
    let log = read(&path, None).unwrap();
    std::fs::remove_file(&path).unwrap();
    let clean = Signals::of(&log, &Mapping::guess(&log)).unwrap();
    let mut signals = clean.clone();
    let mut normal = normal(seed);
    for signal in Signal::COMPARED {
        let track = clean.get(signal).unwrap();
        let size = noise * scatter(signal);
        let noisy: Vec<f64> = track.values().iter().map(|v| v + size * normal()).collect();
        signals.insert(signal, Track::new(track.time(), &noisy));
    }
    (log, signals)
}
