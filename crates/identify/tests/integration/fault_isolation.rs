//! Logs of the model itself with one faulty signal: the fault is isolated, and no key of the crane is
//! proposed.

use crate::made::{clean, sampled, with};
use hydroboom_description::Description;
use hydroboom_identify::{
    Experiment, Fault, Isolated, SignalFault, Window, complaints, isolate, remedies,
};
use hydroboom_measurement::{Signal, Signals, Track};
use std::sync::OnceLock;

fn model() -> &'static Description {
    static MODEL: OnceLock<Description> = OnceLock::new();
    MODEL.get_or_init(|| Description::uia_single_boom().unwrap())
}

/// First 9 s of the model's fast motion with noise on the compared signals, and with each signal's times
/// and values changed.
fn log(
    is_there: impl Fn(Signal) -> bool,
    change: impl Fn(Signal, f64, f64) -> (f64, f64),
) -> Experiment {
    static CLEAN: OnceLock<(hydroboom_measurement::Measurement, Signals)> = OnceLock::new();
    let (log, signals) = CLEAN.get_or_init(|| clean(model()));
    let mut noisy = sampled(signals, 5, 3);
    noisy.insert(Signal::HoldingValve, signals.get(Signal::HoldingValve).unwrap().clone());
    let mut read = Signals::default();
    for signal in Signal::ALL.into_iter().filter(|signal| is_there(*signal)) {
        let Some(track) = noisy.get(signal) else { continue };
        let pairs = track.time().iter().zip(track.values());
        let (time, values): (Vec<f64>, Vec<f64>) =
            pairs.map(|(t, v)| change(signal, *t, *v)).unzip();
        read.insert(signal, Track::new(&time, &values));
    }
    Experiment::new(model(), log, &read, Window { from: None, to: Some(9.0) }).unwrap()
}

fn all(_: Signal) -> bool {
    true
}

/// The one isolated fault; no difference remains beyond its limit, and no key is proposed.
fn only(experiment: &Experiment) -> SignalFault {
    let Isolated { faults, corrected, left, .. } = isolate(model(), experiment).unwrap();
    let [fault] = &faults[..] else { panic!("{faults:?}") };
    assert!(fault.is_isolable(), "{fault:?}");
    assert!(complaints(&left).is_empty(), "{fault:?}: {:?}", complaints(&left));
    assert!(remedies(model(), &corrected).unwrap().1.is_empty());
    fault.clone()
}

const PRESSURES: [Signal; 5] = [
    Signal::PressurePumpA,
    Signal::PressureA,
    Signal::PressureB,
    Signal::PressurePumpB,
    Signal::PressureAccumulator,
];

/// The model starts from measured pressures: an error of one affects other signals too and is still one
/// fault.
#[test]
fn an_offset_of_each_pressure_is_attributed_to_its_sensor() {
    for signal in PRESSURES {
        for off in [5e5, -2e5] {
            let experiment = log(all, |of, t, v| (t, if of == signal { v + off } else { v }));
            let fault = only(&experiment);
            let Fault::Offset(found) = fault.fault else { panic!("{signal:?}: {fault:?}") };
            assert_eq!(fault.signal, signal);
            assert!((found - off).abs() < 0.1e5, "{signal:?}: {found} for {off} Pa");
        }
    }
}

/// An input delayed relative to all other signals is one delay, not several advanced sensors. So is an
/// advanced input, whose effect is the same as a common delay.
#[test]
fn a_delayed_motor_speed_is_one_delay() {
    for late in [0.02, -0.015] {
        let fault =
            only(&log(all, |of, t, v| (if of == Signal::MotorSpeed { t + late } else { t }, v)));
        let Fault::Delay(found) = fault.fault else { panic!("{fault:?}") };
        assert_eq!(fault.signal, Signal::MotorSpeed);
        assert!((found - late).abs() < 1e-3, "{found} for {late} s");
        assert!(fault.explains.contains(&Signal::Stroke), "{fault:?}");
    }
}

#[test]
fn a_delayed_position_is_no_delay_of_an_input() {
    let found = isolate(
        model(),
        &log(all, |of, t, v| (if of == Signal::Stroke { t + 0.02 } else { t }, v)),
    )
    .unwrap();
    assert!(found.faults.is_empty(), "{:?}", found.faults);
    assert!(found.found[0].is_late(), "{:?}", found.found[0]);
}

/// A difference that both sensors of the load pressure share is due to the load. Without the redundant
/// sensor an offset is not distinguished from a load.
#[test]
fn a_load_is_not_attributed_to_a_sensor_and_a_single_sensor_is_not_isolable() {
    let light = with(model(), "payload.mass_kg", 0.9);
    let found = isolate(&light, &log(all, |_, t, v| (t, v))).unwrap();
    assert!(!complaints(&found.found).is_empty());
    assert!(found.faults.is_empty(), "{:?}", found.faults);
    let alone = log(
        |of| of != Signal::PressurePumpA,
        |of, t, v| (t, if of == Signal::PressureA { v + 5e5 } else { v }),
    );
    let found = isolate(model(), &alone).unwrap();
    let [fault] = &found.faults[..] else { panic!("{:?}", found.faults) };
    assert_eq!(fault.signal, Signal::PressureA);
    assert!(!fault.is_isolable() && !complaints(&found.left).is_empty(), "{fault:?}");
}
