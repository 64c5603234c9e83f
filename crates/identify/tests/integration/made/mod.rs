//! Logs simulated with a model.

pub mod draws;

use hydroboom_description::Description;
use hydroboom_description::schema::{KEYS, Numbers};
use hydroboom_identify::{Experiment, Window};
use hydroboom_lab::simulate::{Drive, Settings, simulate};
use hydroboom_measurement::{Mapping, Measurement, Signal, Signals, Track, read};
use hydroboom_model::Scheme;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

/// The description with a key multiplied by a factor.
pub fn with(model: &Description, path: &str, factor: f64) -> Description {
    let place = KEYS.iter().position(|key| key.path() == path).unwrap();
    let mut numbers = model.numbers.to_array();
    numbers[place] *= factor;
    let mut changed = model.clone();
    changed.numbers = Numbers::from_array(numbers);
    changed
}

/// The same description with half the stroke of its motion and short rests: 7 s at the fast speed for 18.
pub fn brief(model: &Description) -> Description {
    let mut brief = model.clone();
    let n = &mut brief.numbers;
    (n.motion_end, n.dwell, n.rest) = (0.5 * (n.motion_start + n.motion_end), 1.0, 0.5);
    brief
}

/// Log of the model under velocity feedforward at its fast speed, with sensor noise of a share of the real
/// one.
pub fn log_of(model: &Description, noise: f64, seed: u64) -> Experiment {
    log_at(model, model.numbers.fast, noise, seed)
}

/// The same at a speed \[m/s\].
pub fn log_at(model: &Description, speed: f64, noise: f64, seed: u64) -> Experiment {
    let settings = Settings {
        start_stroke: model.numbers.motion_start,
        // the numerical damping of the published scheme would be identified as friction
        scheme: Scheme::Implicit,
        // short compared with the step of the model under test, so that only that one's error shows
        step: 2.5e-5,
        log_interval: 1e-3,
        preloaded: true,
    };
    let (log, signals) = recorded(model, speed, &settings, noise, seed);
    Experiment::new(model, &log, &signals, Window::default()).unwrap()
}

/// First 9 s of a log by `hydroboom simulate` at the fast speed with noise. `channels`: recorded signals,
/// each with its delay \[s\] and offset \[SI\].
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

/// Fast motion of the model without noise, sampled every millisecond.
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

/// Signals decimated by `every`, with white noise on the compared ones: 0.02 mm and 0.1 bar.
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

/// Standard deviation of a sensor's noise \[m or Pa\].
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

/// Log of the model under velocity feedforward with noise on the compared signals.
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
