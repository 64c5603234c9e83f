//! Logs of the model itself with one signal read wrong: that signal is named, and no key of the crane.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

mod made;

use hydroboom_description::Description;
use hydroboom_identify::{
    Experiment, Fault, Isolated, SignalFault, Window, complaints, isolate, remedies,
};
use hydroboom_measurement::{Signal, Signals, Track};
use made::{clean, sampled, with};
use std::sync::OnceLock;

fn model() -> &'static Description {
    static MODEL: OnceLock<Description> = OnceLock::new();
    MODEL.get_or_init(|| Description::uia_single_boom().unwrap())
}

/// The first 9 s of the model's fast motion, noise on what is compared, each signal's times and values changed.
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

/// What is named as faulty, with nothing left to complain of and no key to move.
fn only(experiment: &Experiment) -> SignalFault {
    let Isolated { faults, mended, left, .. } = isolate(model(), experiment).unwrap();
    let [fault] = &faults[..] else { panic!("{faults:?}") };
    assert!(fault.is_told(), "{fault:?}");
    assert!(complaints(&left).is_empty(), "{fault:?}: {:?}", complaints(&left));
    assert!(remedies(model(), &mended).unwrap().1.is_empty());
    fault.clone()
}

const PRESSURES: [Signal; 5] = [
    Signal::PressurePumpA,
    Signal::PressureA,
    Signal::PressureB,
    Signal::PressurePumpB,
    Signal::PressureAccumulator,
];

/// The model begins with pressures that were read: what is wrong with one moves others too, and is one fault all the same.
#[test]
fn an_offset_of_each_pressure_is_its_sensor_s() {
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

/// One that is late beside all others is one delay, not several early sensors; so is one that is early, which a delay that all share looks like.
#[test]
fn a_motor_speed_that_is_late_is_one_delay() {
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
fn a_position_that_is_late_is_no_input_s_delay() {
    let found = isolate(
        model(),
        &log(all, |of, t, v| (if of == Signal::Stroke { t + 0.02 } else { t }, v)),
    )
    .unwrap();
    assert!(found.faults.is_empty(), "{:?}", found.faults);
    assert!(found.found[0].is_late(), "{:?}", found.found[0]);
}

/// What both sensors of the load pressure show is the load's; without the one beside it an offset is not told from a load.
#[test]
fn a_load_is_no_sensor_s_and_a_sensor_alone_may_be_the_load_s() {
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
    assert!(!fault.is_told() && !complaints(&found.left).is_empty(), "{fault:?}");
}
