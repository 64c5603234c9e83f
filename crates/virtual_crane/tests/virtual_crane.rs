//! Promises of the virtual crane.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_description::Description;
use hydroboom_model::{Input, Scheme};
use hydroboom_plant::plant;
use hydroboom_virtual_crane::{Effect, Fleet, Truth, VirtualCrane};

fn crane(overrides: &[&str]) -> Description {
    let mut crane = Description::uia_virtual().unwrap();
    for assignment in overrides {
        crane.set(assignment).unwrap();
    }
    crane
}

/// A command that changes in every period.
fn command(k: u32) -> AxisCommand<f64> {
    let t = f64::from(k) * 1e-3;
    AxisCommand { motor_speed: 12.0 * (3.0 * t).sin() + 4.0 * (41.0 * t).sin(), holding_valve: 1.0 }
}

fn readings(description: &Description, periods: u32) -> Vec<AxisSignals<f64>> {
    let mut crane = VirtualCrane::new(description, &description.start(0.25)).unwrap();
    (0..periods)
        .map(|k| {
            crane.advance(&command(k)).unwrap();
            crane.signals()
        })
        .collect()
}

#[test]
fn without_equipment_effects_it_equals_the_model_to_the_last_bit() {
    let mut bare = crane(&["start.preload_percent=100", "virtual.step_us=0"]);
    for effect in Effect::ALL {
        effect.remove_from(&mut bare).unwrap();
    }
    let mut model =
        plant(&bare, &bare.start(0.25), Scheme::Published, bare.numbers.simulation_period).unwrap();
    let limits = bare.benchmark().limits;
    let mut speed = 0.0;
    for (k, reading) in (0..).zip(readings(&bare, 500)) {
        let command = command(k);
        speed = limits.follow(speed, command.motor_speed, 1e-3);
        model.advance(&Input { pump_speed: speed, holding_valve: 1.0 }, 20).unwrap();
        let outputs = model.outputs();
        assert_eq!(reading.stroke, outputs.stroke);
        assert_eq!(reading.pressure_a, outputs.pressure_a);
        assert_eq!(reading.pressure_pump_b, outputs.pressure_pump_b);
        assert_eq!(reading.motor_speed, speed);
    }
}

#[test]
fn every_effect_can_be_switched_off_and_changes_the_readings() {
    // away from the reference temperature, and with transducer errors, so that all effects matter
    let all = crane(&["temperature.oil_c=25", "sensors.pressure_error_percent=0.25"]);
    let with = readings(&all, 600);
    for effect in Effect::ALL {
        assert_eq!(Effect::from_name(effect.name()), Some(effect));
        let mut less = all.clone();
        effect.remove_from(&mut less).unwrap();
        if effect == Effect::TorqueLosses {
            // affects only the motor, as long as its torque limit is not reached
            let torque = |d: &Description| {
                let mut crane = VirtualCrane::new(d, &d.start(0.25)).unwrap();
                (0..100).for_each(|k| crane.advance(&command(k)).unwrap());
                crane.truth().motor_torque
            };
            assert!(torque(&all) > torque(&less));
            continue;
        }
        if effect == Effect::Valve {
            // the valve is already open here; see the next test
            continue;
        }
        let without = readings(&less, 600);
        assert!(with != without, "{} changes nothing", effect.name());
    }
}

#[test]
fn the_load_is_released_after_valve_and_pilot_line_delays() {
    let description = crane(&["switching_valve.delay_ms=40", "fieldbus.delay_cycles=2"]);
    let mut start = description.start(0.25);
    start.preload = 0.0;
    let mut crane = VirtualCrane::new(&description, &start).unwrap();
    let open = AxisCommand { motor_speed: 0.0, holding_valve: 1.0 };
    let before = crane.truth().outputs.stroke;
    for _ in 0..41 {
        crane.advance(&open).unwrap();
    }
    assert_eq!(crane.truth().pilot, 0.0);
    let held = (crane.truth().outputs.stroke - before).abs();
    for _ in 0..200 {
        crane.advance(&open).unwrap();
    }
    // onto an unloaded pump side the piston drops by tens of millimetres
    let dropped = before - crane.truth().outputs.stroke;
    assert!(held < 1e-5 && dropped > 0.02, "{held} m, then {dropped} m");
}

#[test]
fn static_friction_holds_the_boom_with_the_pump_stopped() {
    let description = crane(&[]);
    let mut start = description.start(0.25);
    start.preload = 0.0;
    let mut crane = VirtualCrane::new(&description, &start).unwrap();
    let still = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };
    let before = crane.truth().outputs.stroke;
    for _ in 0..60_000 {
        crane.advance(&still).unwrap();
    }
    let crept = (crane.truth().outputs.stroke - before).abs();
    assert!(crept < 1e-7, "crept {crept} m in a minute");
}

#[test]
fn only_the_same_seed_gives_the_same_readings() {
    let seeded = |seed: &str| readings(&crane(&[seed]), 50);
    assert_eq!(seeded("virtual.seed=7"), seeded("virtual.seed=7"));
    assert_ne!(seeded("virtual.seed=7"), seeded("virtual.seed=8"));
}

#[test]
fn the_discretisation_error_is_below_the_sensor_noise() {
    // the noise-free crane with its step size, against a fourth of it
    let mut quiet = crane(&[]);
    Effect::Sensors.remove_from(&mut quiet).unwrap();
    let step = quiet.numbers.virtual_step;
    let mut fine = quiet.clone();
    fine.numbers.virtual_step = 0.25 * step;
    let (coarse, fine) = (readings(&quiet, 2000), readings(&fine, 2000));
    let rms = |quantity: fn(&AxisSignals<f64>) -> f64| {
        let pairs = coarse.iter().zip(&fine);
        let sum: f64 = pairs.map(|(a, b)| (quantity(a) - quantity(b)).powi(2)).sum();
        (sum / coarse.len() as f64).sqrt()
    };
    let n = crane(&[]).numbers;
    let (position, pressure) = (rms(|r| r.stroke), rms(|r| r.pressure_a));
    assert!(position < n.position_noise, "{position} m");
    let noise = n.pressure_noise * n.pressure_span;
    assert!(pressure < noise, "{pressure} Pa against {noise} Pa");
}

#[test]
fn cranes_simulated_side_by_side_equal_single_runs() {
    let cranes = [
        crane(&[]),
        crane(&["payload.mass_kg=100", "temperature.oil_c=25", "virtual.seed=5"]),
        crane(&["friction.coulomb_n=400", "drive.bandwidth_hz=20"]),
        // reaches its lower end stop, where a step solves an additional contact
        crane(&["motion.start_mm=10", "oil.air_shift_bar=3"]),
    ];
    let starts = cranes.each_ref().map(|c| {
        let stroke = if c.numbers.motion_start < 0.02 { 0.001 } else { 0.25 };
        c.start(stroke)
    });
    let mut fleet = Fleet::new(&cranes, &starts).unwrap().unwrap();
    let mut alone: Vec<_> =
        cranes.iter().zip(&starts).map(|(c, s)| VirtualCrane::new(c, s).unwrap()).collect();
    for k in 0..700 {
        let commands = std::array::from_fn(|lane| {
            let mut command = command(k);
            if lane == 3 {
                command.motor_speed = -30.0;
            }
            command
        });
        if k == 300 {
            fleet.set_payload(1, 50.0).unwrap();
            alone[1].set_payload(50.0).unwrap();
        }
        fleet.advance(&commands);
        for (lane, single) in alone.iter_mut().enumerate() {
            assert_eq!(single.advance(&commands[lane]).err(), fleet.stopped(lane));
            assert_eq!(single.signals(), fleet.signals(lane), "lane {lane}, period {k}");
            assert_eq!(single.truth().outputs, fleet.truth(lane).outputs);
            assert_eq!(single.truth().heat, fleet.truth(lane).heat);
        }
    }
}

#[test]
fn cranes_of_different_structure_are_not_simulated_side_by_side() {
    let other = crane(&["friction.law=stribeck"]);
    let cranes = [crane(&[]), other];
    let starts = cranes.each_ref().map(|c| c.start(0.25));
    assert!(Fleet::new(&cranes, &starts).unwrap().is_none());
}

/// RMS errors of piston position and pressure over a second, against a reference \[m, Pa\].
fn errors(coarse: &[Truth], fine: &[Truth]) -> [f64; 2] {
    let rms = |of: fn(&Truth) -> f64| {
        let pairs = coarse.iter().zip(fine);
        let sum: f64 = pairs.map(|(a, b)| (of(a) - of(b)).powi(2)).sum();
        (sum / coarse.len() as f64).sqrt()
    };
    [rms(|t| t.outputs.stroke), rms(|t| t.outputs.pressure_a)]
}

#[test]
fn halving_the_step_quarters_the_error() {
    // pump sides at the load's pressure: no transient at the start
    let described = crane(&["start.preload_percent=100"]);
    let run = |step_us: f64| -> Vec<Truth> {
        let mut described = described.clone();
        described.numbers.virtual_step = step_us * 1e-6;
        let mut crane = VirtualCrane::new(&described, &described.start(0.25)).unwrap();
        let speed = |k: u32| 10.0 * (1.0 - (std::f64::consts::TAU * f64::from(k) * 1e-3).cos());
        (0..1000)
            .map(|k| {
                crane.advance(&AxisCommand { motor_speed: speed(k), holding_valve: 1.0 }).unwrap();
                crane.truth()
            })
            .collect()
    };
    let reference = run(15.625);
    let [coarse, fine] = [250.0, 125.0].map(|step| errors(&run(step), &reference));
    for (coarse, fine) in coarse.iter().zip(fine) {
        assert!((3.6..4.4).contains(&(coarse / fine)), "{coarse} {fine}");
    }
}

#[test]
fn motor_and_sensors_stay_within_their_limits() {
    // no load can exceed this torque limit: only the slew limit matters
    let described = crane(&["sensors.pressure_span_bar=80", "drive.max_torque_nm=500"]);
    let n = &described.numbers;
    let mut crane = VirtualCrane::new(&described, &described.start(0.25)).unwrap();
    let mut before = 0.0;
    let (mut fastest, mut steepest, mut highest) = (0.0_f64, 0.0_f64, 0.0_f64);
    for k in 0..1500 {
        // square wave far beyond the motor's speed limit
        let motor_speed = if (k / 250) % 2 == 0 { 400.0 } else { -400.0 };
        crane.advance(&AxisCommand { motor_speed, holding_valve: 1.0 }).unwrap();
        let truth = crane.truth();
        fastest = fastest.max(truth.motor_speed.abs());
        steepest = steepest.max((truth.motor_speed - before).abs() / crane.period());
        highest = highest.max(crane.signals().pressure_a);
        before = truth.motor_speed;
    }
    assert!(fastest <= n.motor_speed && fastest > 0.99 * n.motor_speed, "{fastest} rev/s");
    assert!(steepest <= n.motor_slew * (1.0 + 1e-9) && steepest > 0.5 * n.motor_slew, "{steepest}");
    // rounding to the resolution may exceed the span by half a digit
    let digit = n.pressure_span / n.pressure_bits.exp2();
    assert!(highest <= n.pressure_span + 0.5 * digit && highest > 0.99 * n.pressure_span);
}

#[test]
fn a_motor_too_weak_for_its_load_is_driven_backwards() {
    // 68 bar at 10.6 cm3 need 11.5 N·m and the losses
    let described = crane(&["drive.max_torque_nm=6"]);
    let mut crane = VirtualCrane::new(&described, &described.start(0.25)).unwrap();
    for _ in 0..1000 {
        crane.advance(&AxisCommand { motor_speed: 10.0, holding_valve: 1.0 }).unwrap();
    }
    assert!(crane.truth().motor_speed < 0.0, "{} rev/s", crane.truth().motor_speed);
}
