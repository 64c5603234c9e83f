//! The model beside logs that it made itself: what comes out is known.

mod made;

use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_identify::{Free, differences, predict, remedies, sensitivities};
use hydroboom_measurement::Signal;
use made::{log_of, with};

#[test]
fn a_log_made_by_the_model_is_predicted_to_its_rounding() {
    let model = Description::uia_single_boom().unwrap();
    let experiment = log_of(&model, 0.0, 1);
    let prediction = predict(&model, &experiment).unwrap();
    for d in differences(&experiment, &prediction) {
        // nothing between them but half the step, and how the motor's speed runs from sample to sample
        let most = if d.signal == Signal::Stroke { 1e-5 } else { 0.03e5 };
        assert!(d.rms < most, "{:?}: {}", d.signal, d.rms);
        assert!(d.correlation.is_none_or(|c| c > 0.999));
    }
}

#[test]
fn slopes_are_those_of_finite_differences() {
    let model = Description::uia_single_boom().unwrap();
    let experiment = log_of(&model, 0.0, 1);
    let free = Free::usual(&model);
    let (values, slopes) = sensitivities(&model, &experiment, &free).unwrap();
    let plain = predict(&model, &experiment).unwrap();
    for (with_slopes, without) in values.iter().zip(&plain) {
        for (a, b) in with_slopes.iter().zip(without) {
            assert!((a - b).abs() <= 1e-9 * b.abs().max(1.0), "{a} and {b}");
        }
    }
    for (key, slope) in free.iter().zip(&slopes) {
        let moved = |by: f64| {
            let mut changed = model.clone();
            let mut numbers = changed.numbers.to_array();
            numbers[key.place] *= by.exp();
            changed.numbers = Numbers::from_array(numbers);
            predict(&changed, &experiment).unwrap()
        };
        let step = 2e-4;
        let (up, down) = (moved(step), moved(-step));
        for signal in 0..6 {
            let (mut error, mut size) = (0.0_f64, 0.0_f64);
            for k in 0..slope.len() {
                let finite = (up[k][signal] - down[k][signal]) / (2.0 * step);
                error += (finite - slope[k][signal]).powi(2);
                size += finite.powi(2);
            }
            // kinks of valves pass at other times with other parameters
            let floor = if signal == 0 { 1e-6 } else { 30.0 };
            let count = slope.len() as f64;
            let (error, size) = ((error / count).sqrt(), (size / count).sqrt());
            assert!(
                error < 0.03 * size + floor,
                "{} signal {signal}: {error} of {size}",
                key.path()
            );
        }
    }
}

#[test]
fn what_is_wrong_with_a_model_is_among_the_remedies() {
    let truth = Description::uia_single_boom().unwrap();
    for (key, signal) in
        [("payload.mass_kg", Signal::PressureA), ("pump.flow_gain", Signal::Stroke)]
    {
        let wrong = with(&truth, key, 0.95);
        let experiment = log_of(&truth, 0.0, 1);
        let (_, found) = remedies(&wrong, &experiment).unwrap();
        let (_, list) = found.iter().find(|(of, _)| *of == signal).unwrap();
        let remedy =
            list.iter().find(|r| r.path == key).unwrap_or_else(|| panic!("{key}: {list:?}"));
        assert!((remedy.change - (1.0 / 0.95 - 1.0)).abs() < 0.02, "{remedy:?}");
    }
}
