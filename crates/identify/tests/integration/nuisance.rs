//! Delay and offset of a log's channels, fitted together with the keys, which would be biased otherwise.

use crate::made::commanded;
use hydroboom_description::Description;
use hydroboom_identify::{
    Channel, Fit, Free, Nuisance, Prediction, Task, differences, fit, predict,
};
use hydroboom_measurement::Signal;

const ATMOSPHERE: f64 = 1.01325e5;
const KEYS: [&str; 3] = ["payload.mass_kg", "boom.youngs_modulus_gpa", "pump.flow_gain"];

fn tuned(channels: &[(Signal, f64, f64)], fixed: &[Nuisance]) -> Fit {
    let model = Description::uia_single_boom().unwrap();
    let free: Vec<Free> = KEYS.iter().map(|path| Free::from_path(path).unwrap()).collect();
    let experiments = [commanded(&model, channels, 5)];
    let task = Task {
        model: &model,
        experiments: &experiments,
        free: &free,
        fixed,
        resume: None,
        generations: 0,
    };
    fit(&task, &|_| true).unwrap()
}

fn channel<'a>(found: &'a Fit, path: &str) -> &'a Channel {
    found.channels.iter().find(|c| c.nuisance.path() == path).unwrap()
}

/// Whether each key's interval contains its initial value, which is the truth here.
fn holds_truth(found: &Fit) -> Vec<bool> {
    let of = found.tuned.iter().map(|t| {
        let (low, high) = t.interval();
        eprintln!("{}: {:.5e} to {:.5e} for {:.5e}", t.key.path(), low, high, t.value.0);
        (low..=high).contains(&t.value.0)
    });
    of.collect()
}

/// If the delay were fixed at zero, a position delayed by 20 ms would give a payload of 145 kg instead of
/// 307 kg.
#[test]
fn a_delayed_position_changes_its_delay_and_no_key() {
    for late in [20e-3, 4e-3] {
        let channels = [(Signal::Stroke, late, 0.0)];
        let found = tuned(&channels, &[]);
        assert_eq!(holds_truth(&found), [true; 3], "{late} s late");
        // the published first-order step is early by one and a half steps
        let delay = channel(&found, "stroke.delay_ms");
        assert!((delay.value - late * 1e3).abs() < 0.5 && delay.is_off(), "{delay:?}");
        // another log of the same machine has the same delay
        let other = commanded(&found.description, &channels, 9);
        let rms = |shown: &Prediction| differences(&other, shown)[0].rms;
        let seen = rms(&found.on_another_log(&other).unwrap());
        let plain = rms(&predict(&found.description, &other).unwrap());
        assert!(seen < 0.5 * plain, "{seen} m for {plain}");
        // the same holds for both delays, so one fit without the delay is enough
        if late < 10e-3 {
            continue;
        }
        let without = tuned(&channels, &Nuisance::named("stroke.delay").unwrap());
        assert!(without.channels.iter().all(|c| c.nuisance.path() != "stroke.delay_ms"));
        let left = |found: &Fit| found.improvements[0].rms[0].unwrap().1;
        assert!(left(&without) > 3.0 * left(&found), "{} m without", left(&without));
    }
}

#[test]
fn an_absolute_pressure_transmitter_gives_an_offset_and_no_load_error() {
    let channels = [(Signal::Stroke, 0.0, 0.0), (Signal::PressureA, 0.0, ATMOSPHERE)];
    let found = tuned(&channels, &[]);
    assert_eq!(holds_truth(&found), [true; 3]);
    let offset = channel(&found, "pressure_a.offset_bar");
    let (low, high) = offset.interval();
    assert!((low..=high).contains(&(ATMOSPHERE * 1e-5)) && offset.value > 0.5, "{offset:?}");
    // payload and offset of the load pressure differ only in the lever arm over the stroke
    let (key, correlation) = offset.partner.as_ref().unwrap();
    assert!(key == "payload.mass_kg" && *correlation < -0.3, "{offset:?}");
    // the interval is therefore wide: with the offset fixed at zero it was 312.05 kg ± 0.25 kg
    let payload = &found.tuned[0];
    assert!(payload.deviation > 0.01, "{payload:?}");
}

#[test]
fn intervals_from_a_simulated_log_contain_the_true_values() {
    let found = tuned(&[(Signal::Stroke, 0.0, 0.0)], &[]);
    assert_eq!(holds_truth(&found), [true; 3]);
}

#[test]
fn an_offset_of_the_position_shifts_its_initial_value() {
    let channels = [(Signal::Stroke, 0.0, 3e-3), (Signal::PressureA, 0.0, 0.0)];
    let found = tuned(&channels, &[]);
    assert_eq!(holds_truth(&found), [true; 3]);
    let offset = channel(&found, "stroke.offset_mm");
    let (low, high) = offset.interval();
    assert!((low..=high).contains(&3.0) && (offset.value - 3.0).abs() < 0.5, "{offset:?}");
}
