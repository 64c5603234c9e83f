//! A log with a clock jump or missing samples is compared segment by segment.

use hydroboom_description::Description;
use hydroboom_identify::{COMPARED, Experiment, Window, differences, predict};
use hydroboom_lab::simulate::{Drive, Settings, simulate};
use hydroboom_measurement::{Mapping, Signal, Signals, read};
use hydroboom_model::Scheme;
use std::path::PathBuf;

/// Experiments of a simulated motion with changed times; rows without a time are omitted.
fn experiments(name: &str, time: impl Fn(f64) -> Option<f64>) -> (Description, Vec<Experiment>) {
    let model = Description::uia_single_boom().unwrap();
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let settings = Settings {
        start_stroke: model.numbers.motion_start,
        scheme: Scheme::Implicit,
        step: 1e-4,
        log_interval: 1e-2,
        preloaded: true,
    };
    let drive = Drive::Course(Box::new(model.motion(model.numbers.fast)));
    simulate(&model, &drive, &settings, Some(&path), |_| {}).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let mut rows = text.lines();
    let mut changed = rows.next().unwrap().to_string();
    for row in rows {
        let (logged, rest) = row.split_once(',').unwrap();
        if let Some(time) = time(logged.parse().unwrap()) {
            changed += &format!("\n{time},{rest}");
        }
    }
    std::fs::write(&path, changed).unwrap();
    let log = read(&path, None).unwrap();
    let signals = Signals::of(&log, &Mapping::guess(&log)).unwrap();
    let each = Experiment::each(&model, &log, &signals, Window::default()).unwrap();
    (model, each)
}

/// Largest RMS difference of the position \[m\], and total duration \[s\].
fn compared(model: &Description, each: &[Experiment]) -> (f64, f64) {
    let stroke = COMPARED.iter().position(|s| *s == Signal::Stroke).unwrap();
    let rms = |experiment: &Experiment| {
        let prediction = predict(model, experiment).unwrap();
        differences(experiment, &prediction)[stroke].rms
    };
    (each.iter().map(rms).fold(0.0, f64::max), each.iter().map(Experiment::duration).sum())
}

#[test]
fn a_clock_jump_of_an_hour_is_not_simulated() {
    let (model, each) = experiments("jump.csv", |t| Some(if t < 8.995 { t } else { t + 3600.0 }));
    assert_eq!(each.len(), 2);
    let (rms, duration) = compared(&model, &each);
    assert!((17.0..18.0).contains(&duration), "{duration} s");
    assert!(rms < 0.5e-3, "{:.3} mm", rms * 1e3);
    assert!(each[1].remarks[0].contains("segment 2 of 2, 3609"), "{:?}", each[1].remarks);
}

#[test]
fn a_clock_set_back_loses_no_samples() {
    let (model, each) = experiments("reset.csv", |t| Some(if t < 8.995 { t } else { t - 8.0 }));
    assert_eq!(each.len(), 2);
    let (rms, duration) = compared(&model, &each);
    assert!((17.0..18.0).contains(&duration), "{duration} s");
    assert!(rms < 0.5e-3, "{:.3} mm", rms * 1e3);
}

#[test]
fn the_model_restarts_after_missing_samples() {
    // while the piston rests, and while it moves
    let (model, each) = experiments("gap.csv", |t| Some(t).filter(|t| !(8.5..9.0).contains(t)));
    assert_eq!(each.len(), 2);
    let (rms, duration) = compared(&model, &each);
    assert!((16.0..17.5).contains(&duration), "{duration} s");
    assert!(rms < 0.5e-3, "{:.3} mm", rms * 1e3);
    let (_, each) = experiments("gap2.csv", |t| Some(t).filter(|t| !(3.5..3.6).contains(t)));
    assert!(
        each[1].remarks.iter().any(|r| r.contains("begins in motion")),
        "{:?}",
        each[1].remarks
    );
}
