//! Logs of a closed loop: the controller's commands reach the crane through the motor speed, which is the
//! model's input.

use hydroboom_control::reference::profile::OutAndBack;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_identify::{COMPARED, Experiment, Free, Task, Window, fit, predict, sensitivities};
use hydroboom_lab::virtual_run::{self, Contents, LogOrder, virtual_run};
use hydroboom_measurement::{Mapping, Signal, Signals, read};
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicU32, Ordering};

/// Virtual crane with another payload, and with another drive than the model's.
fn machine() -> Description {
    let mut machine = Description::uia_virtual().unwrap();
    for set in ["payload.mass_kg=270", "drive.bandwidth_hz=35", "drive.dead_time_ms=4"] {
        machine.set(set).unwrap();
    }
    machine
}

/// The paper's crane with friction at rest, a typical drive and the machine's fieldbus. Its dead time is no
/// integer number of periods, where derivatives have a kink.
fn model() -> Description {
    let mut model = Description::uia_single_boom().unwrap();
    for set in [
        "friction.law=lugre",
        "drive.bandwidth_hz=60",
        "drive.dead_time_ms=2.3",
        "fieldbus.delay_cycles=1",
    ] {
        model.set(set).unwrap();
    }
    model
}

/// Log of a short motion of the machine under a strategy that uses the model only.
fn log_of(strategy: Strategy) -> Experiment {
    let (model, machine) = (model(), machine());
    let fast = machine.motion(machine.numbers.fast);
    let course = OutAndBack { end: fast.start + 0.12, dwell: 0.3, rest: 0.4, ramp: 0.4, ..fast };
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let name = format!("closed-loop-{}-{count}.csv", std::process::id());
    let path = std::env::temp_dir().join(name);
    let order =
        LogOrder { path: &path, contents: Contents::Readings, estimates: false, interval: 1e-3 };
    let task = virtual_run::Task::Course(&course, strategy);
    virtual_run(&model, &machine, &task, &[order], |_| {}).unwrap();
    let log = read(&path, None).unwrap();
    std::fs::remove_file(&path).unwrap();
    let signals = Signals::of(&log, &Mapping::default().completed(&log).unwrap()).unwrap();
    Experiment::new(&model, &log, &signals, Window::default()).unwrap()
}

fn drive(model: &Description) -> Vec<Free> {
    let keys = Free::of_drive(model);
    assert_eq!(keys.len(), 3, "{keys:?}");
    keys
}

/// Tests of `learn` identify the same from a cycle, and from a log of the benchmark.
#[test]
#[ignore = "campaign"]
fn campaign_a_log_of_the_scheduled_lqr_determines_payload_and_drive() {
    let (model, truth) = (model(), machine());
    let paths = ["payload.mass_kg", "friction.coulomb_n", "friction.viscous_ns_per_m"];
    let mut free: Vec<Free> = paths.iter().map(|path| Free::from_path(path).unwrap()).collect();
    free.extend(drive(&model));
    let strategy = Strategy::ScheduledLqr;
    let task = Task {
        model: &model,
        experiments: &[log_of(strategy)],
        free: &free,
        fixed: &[],
        resume: None,
        generations: 0,
    };
    let found = fit(&task, &|_| true).unwrap();
    let payload = &found.tuned[0];
    let (low, high) = payload.interval();
    assert!((low..=high).contains(&truth.numbers.payload), "{strategy:?}: {low} to {high} kg");
    let is_near = (payload.value.1 / truth.numbers.payload - 1.0).abs();
    assert!(is_near < 0.06, "{strategy:?}: {} kg", payload.value.1);
    // the sum of lag and dead time is determined best
    let lag = |n: &Numbers<f64>| n.drive_damping / (0.5 * TAU * n.drive_bandwidth);
    let [is, of] = [found.description.numbers, truth.numbers];
    for (is, of) in [
        (is.drive_bandwidth, of.drive_bandwidth),
        (is.drive_dead_time + lag(&is), of.drive_dead_time + lag(&of)),
    ] {
        assert!((is / of - 1.0).abs() < 0.03, "{strategy:?}: {is} for {of}");
    }
    let motor = COMPARED.iter().position(|signal| *signal == Signal::MotorSpeed).unwrap();
    let (before, after) = found.improvements[0].rms[motor].unwrap();
    assert!(after < 0.1 * before, "{strategy:?}: {before}, then {after} rev/s");
}

#[test]
fn sensitivities_of_the_motor_speed_are_those_of_finite_differences() {
    let (model, log) = (model(), log_of(Strategy::BenchmarkClosedLoop));
    let keys = drive(&model);
    let (_, slopes) = sensitivities(&model, &log, &keys).unwrap();
    let motor = COMPARED.len() - 1;
    let little = 1e-5;
    for (key, slope) in keys.iter().zip(slopes) {
        let [more, less] = [little, -little].map(|by: f64| {
            let mut numbers = model.numbers.to_array();
            numbers[key.place] *= by.exp();
            let mut moved = model.clone();
            moved.numbers = Numbers::from_array(numbers);
            predict(&moved, &log).unwrap()
        });
        let largest = slope.iter().fold(0.0, |most, row| f64::max(most, row[motor].abs()));
        assert!(largest > 0.1, "{}: {largest} rev/s", key.path());
        for ((row, more), less) in slope.iter().zip(&more).zip(&less) {
            let difference = (more[motor] - less[motor]) / (2.0 * little);
            let apart = (row[motor] - difference).abs();
            assert!(apart < 1e-4 * largest, "{}: {} for {difference}", key.path(), row[motor]);
            // and no signal of the crane depends on it
            assert!(row[..motor].iter().all(|slope| *slope == 0.0));
        }
    }
}

#[test]
fn the_motor_speed_is_compared_where_command_and_drive_are_known() {
    let log = log_of(Strategy::BenchmarkClosedLoop);
    assert!(log.is_measured(Signal::MotorSpeed));
    // an ideal motor has no free keys
    assert!(Free::of_drive(&Description::uia_single_boom().unwrap()).is_empty());
}
