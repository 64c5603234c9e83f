//! Crane that shares no code with the model: `crane.c`, in which the boom is a continuous beam. The tests
//! check its physics, and that the controllers perform on it as on the virtual crane.

mod benchmark;
mod plant;
mod scheduled_lqr;

use self::benchmark::{benchmark, rms_error_on_virtual_crane};
use self::plant::{IndependentPlant, PayloadChange, Sample, rms_error};
use self::scheduled_lqr::scheduled_lqr;
use hydroboom_description::Description;
use hydroboom_lab::eigenfrequency::{frequency, locked_mode, without_friction};
use std::f64::consts::FRAC_PI_4;

fn model() -> Description {
    Description::uia_single_boom().unwrap()
}

fn virtual_crane() -> Description {
    Description::uia_virtual().unwrap()
}

/// Areas of piston and rod side \[m²\].
fn areas(crane: &Description) -> (f64, f64) {
    let n = &crane.numbers;
    let piston = FRAC_PI_4 * n.piston.powi(2);
    (piston, piston - FRAC_PI_4 * n.rod.powi(2))
}

fn mean(samples: &[Sample], value: impl Fn(&Sample) -> f64) -> f64 {
    samples.iter().map(value).sum::<f64>() / samples.len() as f64
}

/// Load pressure \[Pa\] that holds the rigid boom at a stroke \[m\], by virtual work: p_L A_p dL = g sum(m dh).
fn holding_pressure(crane: &Description, stroke: f64) -> f64 {
    let n = &crane.numbers;
    let (mount, base) = (n.mount_x.hypot(n.mount_y), n.base_x.hypot(n.base_y));
    let length = n.shortest + stroke;
    let cosine = (mount.powi(2) + base.powi(2) - length.powi(2)) / (2.0 * mount * base);
    let between = cosine.acos();
    let angle = between + n.base_y.atan2(n.base_x) - n.mount_y.atan2(n.mount_x);
    let boom_lever = 0.5 * n.boom_length * angle.cos();
    let payload_lever = n.payload_x * angle.cos() - n.payload_y * angle.sin();
    let moment = n.gravity * (n.boom_mass * boom_lever + n.payload * payload_lever);
    moment / (mount * base * between.sin() / length) / areas(crane).0
}

#[test]
fn the_load_pressure_at_rest_balances_the_weight() {
    let crane = virtual_crane();
    let (piston, rod_side) = areas(&crane);
    for stroke_mm in [100.0, 250.0, 400.0] {
        let start = format!("motion.start_mm={stroke_mm}");
        let mut plant = IndependentPlant::start(&[&start]);
        plant.hold_load();
        let samples = plant.control(1.0, &[], |_| 0.0);
        let load = |s: &Sample| s.readings.pressure_a - rod_side / piston * s.readings.pressure_b;
        let pressure = mean(&samples[500..], load);
        let expected = holding_pressure(&crane, 1e-3 * stroke_mm);
        assert!((pressure / expected - 1.0).abs() < 0.01, "{pressure} {expected}");
        let moved = samples.last().unwrap().true_stroke - samples[0].true_stroke;
        assert!(moved.abs() < 1e-6, "{moved}");
    }
}

/// The model's chain of ten segments on a rigid base, without friction, has the beam's lowest natural
/// frequency.
#[test]
fn the_natural_frequency_is_that_of_the_models_linearisation() {
    let crane = without_friction(&virtual_crane().divided(10)).unwrap();
    let rod_side = format!("start.rod_side_bar={}", 1e-5 * crane.numbers.oscillation_rod_side);
    for stroke_mm in [100.0, 200.0, 400.0] {
        let start = format!("motion.start_mm={stroke_mm}");
        let mut plant = IndependentPlant::start(&[
            &start,
            &rod_side,
            "start.preload_percent=0",
            "friction.viscous_ns_per_m=0",
            "friction.coulomb_n=0",
            "friction.stiction_n=0",
        ]);
        plant.hold_load();
        plant.add_impulse(2e-3);
        let samples = plant.control(4.0, &[], |_| 0.0);
        let (time, stroke): (Vec<_>, Vec<_>) =
            samples.iter().map(|s| (s.readings.time, s.true_stroke)).unzip();
        let measured = frequency(&time, &stroke).unwrap();
        let predicted = locked_mode(&crane, 1e-3 * stroke_mm).unwrap();
        assert!((measured / predicted.frequency_hz - 1.0).abs() < 0.02, "{measured} {predicted:?}");
        // nothing excites the oscillation, and hardly anything but the boom's own damping reduces it
        let range = |part: &[f64]| {
            let (low, high) =
                part.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
            high - low
        };
        let ratio = range(&stroke[3000..]) / range(&stroke[..1000]);
        assert!(ratio > 0.8 && ratio < 1.0, "{ratio}");
    }
}

/// After a payload change, the load pressure balances the new weight once viscous friction has damped the
/// oscillation.
#[test]
fn a_changed_payload_is_held_by_its_own_pressure() {
    let mut crane = virtual_crane();
    let (piston, rod_side) = areas(&crane);
    let mut plant = IndependentPlant::start(&[
        "friction.viscous_ns_per_m=1e5",
        "friction.coulomb_n=0",
        "friction.stiction_n=0",
    ]);
    plant.hold_load();
    let change = PayloadChange { time: 0.2, mass: 200.0 };
    let samples = plant.control(4.0, &[change], |_| 0.0);
    let load = |s: &Sample| s.readings.pressure_a - rod_side / piston * s.readings.pressure_b;
    for (payload, window) in [(crane.numbers.payload, &samples[..200]), (200.0, &samples[3500..])] {
        crane.numbers.payload = payload;
        let (pressure, stroke) = (mean(window, load), mean(window, |s| s.true_stroke));
        let expected = holding_pressure(&crane, stroke);
        assert!((pressure / expected - 1.0).abs() < 0.01, "{payload} kg: {pressure} {expected}");
    }
}

/// A command takes one period to the drive, and a measurement one period back; the drive follows within its
/// slew rate.
#[test]
fn the_motor_is_read_two_periods_after_the_command() {
    let numbers = virtual_crane().numbers;
    let mut plant = IndependentPlant::start(&[]);
    let samples = plant.control(0.2, &[], |_| 30.0);
    let speeds: Vec<f64> = samples.iter().map(|s| s.readings.motor_speed).collect();
    assert_eq!(speeds[..3], [0.0; 3]);
    assert!(speeds[3] > 0.0, "{speeds:?}");
    let slew = 1e-3 * numbers.motor_slew;
    assert!(speeds.windows(2).all(|v| v[1] - v[0] < 1.1 * slew), "{speeds:?}");
    assert!((speeds[200] / 30.0 - 1.0).abs() < 1e-3, "{speeds:?}");
}

/// At rest the measurements have the sensors' noise and resolution.
#[test]
fn readings_have_the_noise_of_the_sensors() {
    let numbers = virtual_crane().numbers;
    let mut plant = IndependentPlant::start(&[]);
    plant.hold_load();
    let samples = plant.control(2.0, &[], |_| 0.0);
    let scatter = |value: fn(&Sample) -> f64| {
        let middle = mean(&samples, value);
        mean(&samples, |s| (value(s) - middle).powi(2)).sqrt()
    };
    let rounding = |unit: f64| unit / 12_f64.sqrt();
    let pressure_unit = numbers.pressure_span / numbers.pressure_bits.exp2();
    for (seen, noise, unit) in [
        (scatter(|s| s.readings.stroke), numbers.position_noise, numbers.position_resolution),
        (
            scatter(|s| s.readings.pressure_a),
            numbers.pressure_noise * numbers.pressure_span,
            pressure_unit,
        ),
    ] {
        let expected = noise.hypot(rounding(unit));
        assert!((seen / expected - 1.0).abs() < 0.05, "{seen} {expected}");
    }
    let steps = samples[100].readings.stroke / numbers.position_resolution;
    assert!((steps - steps.round()).abs() < 1e-6, "{steps}");
}

/// With the motor at rest and the load held nothing moves; the pressure of pump side A decreases by its
/// leakage.
#[test]
fn at_rest_pressure_sinks_by_leakage_only() {
    let crane = virtual_crane();
    let n = &crane.numbers;
    let mut plant = IndependentPlant::start(&[]);
    plant.hold_load();
    let samples = plant.control(2.0, &[], |_| 0.0);
    let windows: Vec<&[Sample]> = samples[1..].chunks_exact(100).collect();
    let pump_a: Vec<f64> =
        windows.iter().map(|w| mean(w, |s| s.readings.pressure_pump_a)).collect();
    assert!(pump_a.windows(2).all(|p| p[1] < p[0]), "{pump_a:?}");
    let held = |window: &[Sample]| mean(window, |s| s.readings.pressure_a);
    let (before, after) = (held(&samples[1..500]), held(&samples[1500..]));
    assert!((after - before).abs() < 2e3, "{before} {after}");
    let most =
        samples.iter().map(|s| (s.true_stroke - samples[0].true_stroke).abs()).fold(0.0, f64::max);
    assert!(most < 1e-6, "{most}");

    // p' = -(beta/V) (K_int r(p - p_PB) + K_ext r(p - p_acc) + c_0 (p - p_PB)), with the largest bulk
    // modulus
    let last = windows.len() - 1;
    let (time, low) = (0.1 * last as f64, mean(windows[0], |s| s.readings.pressure_pump_b));
    let accumulator = mean(windows[0], |s| s.readings.pressure_accumulator);
    let (mut pressure, steps) = (pump_a[0], 10_000);
    for _ in 0..steps {
        let leakage = n.internal_leakage * (pressure - low).sqrt()
            + n.case_leakage_a * (pressure - accumulator).sqrt()
            + n.slip_at_rest * (pressure - low);
        let air = n.air_shift;
        let middle = 0.5 * (n.bulk_modulus_max + n.bulk_modulus_min);
        let half = 0.5 * (n.bulk_modulus_max - n.bulk_modulus_min);
        let beta = middle + half * ((pressure - n.transition + air) / n.transition_width).tanh();
        pressure -= beta / n.volume_pump_a * leakage * time / f64::from(steps);
    }
    let sunk = (pump_a[0] - pump_a[last]) / (pump_a[0] - pressure);
    assert!((sunk - 1.0).abs() < 0.01, "{sunk}");
}

/// The integration error is small compared with the sensors' resolution: half the step gives the same
/// trajectory.
#[test]
fn half_the_step_gives_the_same_trajectory() {
    let model = model();
    let motion = model.motion(model.numbers.fast);
    let revolutions = areas(&model).0 / model.numbers.displacement;
    let path = |step: &str| {
        let mut plant = IndependentPlant::start(&[step]);
        plant.control(8.0, &[], |r| revolutions * motion.reference(r.time).velocity)
    };
    let (coarse, fine) = (path("integrator.step_us=20"), path("integrator.step_us=10"));
    let apart = |(a, b): (&Sample, &Sample)| (a.true_stroke - b.true_stroke).abs();
    let most = coarse.iter().zip(&fine).map(apart).fold(0.0, f64::max);
    assert!(coarse.iter().any(|s| s.true_stroke > 0.4), "it moved");
    assert!(most < 1e-6, "{most}");
}

#[test]
fn the_benchmark_tracks_as_on_the_virtual_crane() {
    let (model, crane) = (model(), virtual_crane());
    let speed = model.numbers.fast;
    let motion = model.motion(speed);
    let mut plant = IndependentPlant::start(&[]);
    let samples = plant.control(motion.duration(), &[], benchmark(&model, speed));
    let here = rms_error(&samples, |time| motion.reference(time).position);
    let there = rms_error_on_virtual_crane(&model, &crane, speed);
    assert!(here < 1.5 * there && there < 1.5 * here, "{here} {there}");
}

/// On a plant that differs from the model, along the motion and with a load change during it.
#[test]
fn the_scheduled_lqr_tracks_with_a_tenth_of_the_benchmarks_error() {
    let model = model();
    let speed = model.numbers.fast;
    let motion = model.motion(speed);
    let changed = [PayloadChange { time: 3.5, mass: 250.0 }];
    for (changes, share) in [(&[][..], 0.1), (&changed[..], 0.2)] {
        let rms = |controller: &mut dyn FnMut(&plant::Readings) -> f64| {
            let mut plant = IndependentPlant::start(&[]);
            let samples = plant.control(motion.duration(), changes, controller);
            rms_error(&samples, |time| motion.reference(time).position)
        };
        let lqr = rms(&mut scheduled_lqr(&model, speed));
        let benchmark = rms(&mut benchmark(&model, speed));
        assert!(lqr < share * benchmark, "{lqr} {benchmark}");
    }
}
