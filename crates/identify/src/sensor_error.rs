//! Constant errors of single sensors that would explain a difference of log and model: an offset, or a wrong scale.

use crate::differences::{Difference, Differences};
use crate::experiment::{COMPARED, Experiment};
use crate::limits::LIMITS;
use crate::prediction::Prediction;
use crate::verdict::is_beyond;
use hydroboom_measurement::Signal;

/// What may be wrong with a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// It reads more by this \[SI\]; of no position, for the model begins where the log does.
    Offset(f64),
    /// It reads so many times what is there: of a position about where its log begins, where the model begins too; of a pressure about zero.
    Scale(f64),
}

/// An error of a sensor that would explain most of a signal's difference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorError {
    /// The signal.
    pub signal: Signal,
    /// What may be wrong.
    pub fault: Fault,
    /// RMS difference that would be left without it \[SI\].
    pub left: f64,
    /// A sensor of nearly the same pressure that shows nothing of it: then it is no matter of the crane.
    pub against: Option<Signal>,
}

/// Errors of sensors, of signals beyond their limit. What two sensors of nearly the same pressure show alike is the crane's, and none of them.
pub fn sensor_errors(
    experiment: &Experiment,
    prediction: &Prediction,
    found: &Differences,
) -> Vec<SensorError> {
    let pairs = |signal: Signal| -> Vec<(f64, f64)> {
        let place = COMPARED.iter().position(|other| *other == signal);
        let both = experiment.samples.iter().zip(prediction);
        both.filter_map(|(sample, model)| Some((sample.values[place?]?, model[place?]))).collect()
    };
    let of = |d: &Difference| {
        let (fault, left) = fault(d.signal, &pairs(d.signal))?;
        let beside = beside(d.signal).filter(|other| found.iter().any(|d| d.signal == *other));
        if beside.is_some_and(|other| shows(fault, &pairs(other))) {
            return None;
        }
        Some(SensorError { signal: d.signal, fault, left, against: beside })
    };
    let is_asked = |d: &&Difference| is_beyond(d) && !d.is_late() && !d.is_of_clock();
    found.iter().filter(is_asked).filter_map(of).collect()
}

/// The sensor on the other side of an open valve.
fn beside(signal: Signal) -> Option<Signal> {
    match signal {
        Signal::PressureA => Some(Signal::PressurePumpA),
        Signal::PressurePumpA => Some(Signal::PressureA),
        Signal::PressureB => Some(Signal::PressurePumpB),
        Signal::PressurePumpB => Some(Signal::PressureB),
        _ => None,
    }
}

/// Mean of log less model.
fn offset(pairs: &[(f64, f64)]) -> f64 {
    pairs.iter().map(|(log, model)| log - model).sum::<f64>() / pairs.len().max(1) as f64
}

/// The factor on the model, about a zero, that comes nearest to the log.
fn scale(pairs: &[(f64, f64)], zero: f64) -> f64 {
    let (both, square) = pairs.iter().fold((0.0, 0.0), |(both, square), (log, model)| {
        (both + (log - zero) * (model - zero), square + (model - zero).powi(2))
    });
    if square > 0.0 { both / square } else { 1.0 }
}

/// The fault that explains most of a difference, and the RMS that is left without it.
fn fault(signal: Signal, pairs: &[(f64, f64)]) -> Option<(Fault, f64)> {
    let zero = if signal == Signal::Stroke { pairs.first()?.0 } else { 0.0 };
    let rms = |of: &dyn Fn(f64, f64) -> f64| {
        let sum: f64 = pairs.iter().map(|(log, model)| of(*log, *model).powi(2)).sum();
        (sum / pairs.len() as f64).sqrt()
    };
    let all = rms(&|log, model| log - model);
    let largest = pairs.iter().fold(0.0_f64, |most, (log, _)| most.max(log.abs()));
    let (offset, scale) = (offset(pairs), scale(pairs, zero));
    let without_offset = rms(&|log, model| log - offset - model);
    let without_scale = rms(&|log, model| log - zero - scale * (model - zero));
    // the model begins where the log's piston is: an offset of its sensor moves both
    let is_told = signal != Signal::Stroke;
    let may_be_offset = is_told && offset.abs() <= LIMITS.sensor_offset * largest;
    let may_be_scale = (scale - 1.0).abs() <= LIMITS.sensor_scale;
    let faults = [
        (Fault::Offset(offset), without_offset, may_be_offset),
        (Fault::Scale(scale), without_scale, may_be_scale),
    ];
    let most = faults.into_iter().filter(|(_, left, may)| *may && *left < LIMITS.most * all);
    most.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(fault, left, _)| (fault, left))
}

/// Whether a pressure beside it shows the same.
fn shows(fault: Fault, pairs: &[(f64, f64)]) -> bool {
    let share = match fault {
        Fault::Offset(own) => offset(pairs) / own,
        Fault::Scale(own) => (scale(pairs, 0.0) - 1.0) / (own - 1.0),
    };
    share > LIMITS.shared
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A load pressure of 70 bar that swings by 8, as a sensor shows it.
    fn read(of: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        let model = |k: u32| 70e5 + 8e5 * (0.01 * f64::from(k)).sin();
        (0..2000).map(|k| (of(model(k)), model(k))).collect()
    }

    #[test]
    fn an_offset_and_a_scale_are_told_apart_and_what_is_neither_is_none() {
        let of = |pairs: &[(f64, f64)]| fault(Signal::PressureA, pairs).map(|found| found.0);
        let Some(Fault::Offset(bar)) = of(&read(|p| p + 5e5)) else { panic!("no offset") };
        assert!((bar - 5e5).abs() < 1.0, "{bar} Pa");
        let Some(Fault::Scale(factor)) = of(&read(|p| 1.08 * p)) else { panic!("no scale") };
        assert!((factor - 1.08).abs() < 1e-6, "{factor}");
        // 40 bar of 70 are no sensor's
        assert_eq!(of(&read(|p| p - 40e5)), None);
        assert_eq!(of(&read(|p| p + 2e5 * (p * 1e-4).sin())), None);
    }

    /// A payload that is heavier shows in both sensors of the load pressure.
    #[test]
    fn what_two_sensors_show_alike_is_no_sensors() {
        let heavier = read(|p| p + 5e5);
        let (own, _) = fault(Signal::PressureA, &heavier).unwrap();
        assert!(shows(own, &heavier) && !shows(own, &read(|p| p)));
    }

    #[test]
    fn a_position_is_scaled_about_where_its_log_begins() {
        let model = |k: u32| 0.05 + 1e-4 * f64::from(k);
        let pairs: Vec<(f64, f64)> =
            (0..2000).map(|k| (0.05 + 1.03 * (model(k) - 0.05), model(k))).collect();
        let (found, left) = fault(Signal::Stroke, &pairs).unwrap();
        let Fault::Scale(factor) = found else { panic!("{found:?}") };
        assert!((factor - 1.03).abs() < 1e-6 && left < 1e-9, "{factor}, {left}");
        // lower by 5 mm all the way, but for where both begin: no sensor's offset
        let lower: Vec<(f64, f64)> = (0..2000)
            .map(|k| (if k == 0 { model(k) } else { model(k) - 5e-3 }, model(k)))
            .collect();
        let found = fault(Signal::Stroke, &lower);
        assert!(!matches!(found, Some((Fault::Offset(_), _))), "{found:?}");
    }
}
