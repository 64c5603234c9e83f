//! Samples that cannot be, and signals that contradict each other.

use crate::temporary::folder;
use hydroboom_measurement::{Mapping, Measurement, Signal, Signals, read};

const STROKE: f64 = 0.5;
const MOTOR_SPEED: f64 = 50.0;

/// A lift of a piston by 200 mm and back, row by row: position, pressures, motor speed and valve.
struct Row {
    position: f64,
    pressures: [f64; 4],
    motor: f64,
    valve: u8,
}

fn log(name: &str, change: impl Fn(usize, &mut Row)) -> Measurement {
    let mut text = "time_s,x_mm,p_A_bar,p_B_bar,p_PA_bar,p_PB_bar,n_rpm,valve\n".to_string();
    for k in 0..600 {
        let phase = std::f64::consts::TAU * k as f64 / 600.0;
        let mut row = Row {
            position: 150.0 - 100.0 * phase.cos(),
            pressures: [70.0, 3.0, 71.0, 2.5],
            motor: 900.0 * phase.sin(),
            valve: 1,
        };
        change(k, &mut row);
        let [a, b, pump_a, pump_b] = row.pressures;
        let (x, n, valve) = (row.position, row.motor, row.valve);
        text += &format!("{},{x},{a},{b},{pump_a},{pump_b},{n},{valve}\n", k as f64 * 0.01);
    }
    let path = folder(module_path!()).join(name);
    std::fs::write(&path, text).unwrap();
    read(&path, None).unwrap()
}

fn suspected(log: &Measurement) -> String {
    let mapping = Mapping::default().completed(log).unwrap();
    let all = mapping.suspicions(log, STROKE, MOTOR_SPEED);
    all.into_iter().map(|s| s.text).collect::<Vec<_>>().join("; ")
}

#[test]
fn signals_that_contradict_each_other_are_suspected_and_others_are_not() {
    assert_eq!(suspected(&log("whole.csv", |_, _| {})), "");
    let message = suspected(&log("sign.csv", |_, row| row.motor = -row.motor));
    assert!(message.starts_with("the motor turns against the piston"), "{message}");
    let message = suspected(&log("valve.csv", |_, row| row.valve = 0));
    assert!(message.contains("shut throughout, and the piston moves by 200 mm"), "{message}");
    let message = suspected(&log("exchanged.csv", |_, row| row.pressures.swap(0, 1)));
    assert_eq!(message, "p_A is near p_PB, and p_B near p_PA: are two columns exchanged?");
    // at rest nothing contradicts a sign or a valve
    let rest = log("rest.csv", |_, row| (row.position, row.motor, row.valve) = (50.0, -20.0, 0));
    assert_eq!(suspected(&rest), "");
}

#[test]
fn impossible_single_samples_are_removed_and_others_kept() {
    let broken = |k: usize, row: &mut Row| match k {
        100 => row.position = -9999.0,
        200 | 201 => row.pressures[0] = 65_535.0,
        _ => {}
    };
    let mut log = log("outliers.csv", broken);
    let mapping = Mapping::default().completed(&log).unwrap();
    let remarks = mapping.without_outliers(&mut log, STROKE, MOTOR_SPEED);
    assert_eq!(remarks.len(), 2, "{remarks:?}");
    assert!(
        remarks[0].contains("1 samples of \"x_mm\" cannot be x_cyl, the first -9999.0 at 1.000 s")
    );
    assert!(remarks[1].contains("2 samples of \"p_A_bar\""), "{remarks:?}");
    assert!(mapping.suspicions(&log, STROKE, MOTOR_SPEED).is_empty());
    let signals = Signals::of(&log, &mapping).unwrap();
    assert_eq!(signals.get(Signal::PressureA).unwrap().values().len(), 598);
    assert_eq!(signals.get(Signal::Stroke).unwrap().values().len(), 599);
}

/// A signal in another unit is not an error of single samples.
#[test]
fn a_signal_in_another_unit_keeps_its_samples() {
    let mut log = log("unit.csv", |_, row| row.pressures[0] *= 1e5);
    let mapping = Mapping::default().completed(&log).unwrap();
    assert!(mapping.without_outliers(&mut log, STROKE, MOTOR_SPEED).is_empty());
    assert!(mapping.suspicions(&log, STROKE, MOTOR_SPEED)[0].text.contains("is it in Pa"));
}

/// A pressure is below vacuum because of its offset: no unit explains the values. A pressure in another
/// unit agrees with the adjacent pressure in that unit.
#[test]
fn a_pressure_below_vacuum_is_an_offset_and_no_wrong_unit() {
    let low = |k: usize| if k < 100 { 2.5 } else { 71.0 };
    let text = suspected(&log("below.csv", |k, row| row.pressures[2] = low(k) - 5.0));
    assert!(text.contains("p_PA is") && text.contains("another zero (offset)"), "{text}");
    assert!(!text.contains("is it in"), "{text}");
    let text = suspected(&log("kpa.csv", |_, row| row.pressures[2] *= 100.0));
    assert!(text.contains("is it in kPa?"), "{text}");
    let all = |_: usize, row: &mut Row| row.pressures = row.pressures.map(|bar| 100.0 * bar);
    let text = suspected(&log("all-kpa.csv", all));
    assert!(text.contains("p_A is") && text.contains("or kPa"), "{text}");
    // psi are 14.5 to a bar, and twelve are no unit
    let text = suspected(&log("psi.csv", |_, row| row.pressures[2] *= 14.504));
    assert!(text.contains("is it in psi?") && !text.contains("kPa"), "{text}");
    let text = suspected(&log("twelve.csv", |_, row| row.pressures[2] *= 12.0));
    assert!(text.contains("p_PA is") && !text.contains("is it in"), "{text}");
}

#[test]
fn other_columns_that_may_be_a_signal_are_named() {
    let path = folder(module_path!()).join("rivals.csv");
    let rows: String =
        (0..50).map(|k| format!("{},{k},{},{}\n", 0.01 * f64::from(k), k + 5, 2 * k)).collect();
    std::fs::write(&path, format!("time_s,x_mm,piston position [mm],temperature_degC\n{rows}"))
        .unwrap();
    let log = read(&path, None).unwrap();
    let mapping = Mapping::default().completed(&log).unwrap();
    let taken = &mapping.entries[&Signal::Stroke].column;
    let other = log.channels.iter().find(|c| c.heading != *taken).unwrap();
    let message = mapping.assumptions(&log).join("; ");
    assert!(message.contains(&format!("\"{}\" may be x_cyl too", other.heading)), "{message}");
}

/// The line to the tank is without pressure, which is correct.
#[test]
fn a_tank_line_without_pressure_is_not_suspected() {
    let path = folder(module_path!()).join("tank.csv");
    let rows: String = (0..50).map(|k| format!("{},0.0{}\n", 0.01 * f64::from(k), k % 7)).collect();
    std::fs::write(&path, format!("time_s,pressure_tank_bar\n{rows}")).unwrap();
    let log = read(&path, None).unwrap();
    assert_eq!(suspected(&log), "");
}

/// A tenth of the expected pressure and motor speed: the columns are in MPa and rad/s without a stated unit.
#[test]
fn guessed_units_are_checked_against_the_crane() {
    let per_second = std::f64::consts::TAU / 60.0;
    // the piston goes 200 mm in 3 s by a sine, the motor 900 rpm at most
    let travel = 0.1 * std::f64::consts::TAU / 6.0 / 15.0;
    let expected = hydroboom_measurement::Expected { holding_pressure: [62e5, 71e5], travel };
    let suspected = |name: &str, [pressure, motor]: [f64; 2], units: [&str; 2]| {
        let change = |_: usize, row: &mut Row| {
            row.pressures = row.pressures.map(|bar| pressure * bar);
            row.motor *= motor;
        };
        let log = log(name, change);
        let path = folder(module_path!()).join(name);
        let text = std::fs::read_to_string(&path).unwrap();
        let text = text.replacen("p_A_bar", units[0], 1).replacen("p_PA_bar", "p_PA", 1);
        std::fs::write(&path, text.replacen("n_rpm", units[1], 1)).unwrap();
        drop(log);
        let log = read(&path, None).unwrap();
        let mapping = Mapping::default().completed(&log).unwrap();
        let all = mapping.unit_suspicions(&log, &expected);
        all.into_iter().map(|s| s.text).collect::<Vec<_>>().join("; ")
    };
    let text = suspected("mpa.csv", [0.1, per_second], ["p_A", "n"]);
    assert!(text.contains("is it in MPa?") && text.contains("is it in rad/s?"), "{text}");
    assert_eq!(suspected("bar.csv", [1.0, 1.0], ["p_A", "n"]), "");
    // stated units are not questioned
    assert_eq!(
        suspected("stated.csv", [0.1, per_second], ["p_A_bar", "n_rpm"]).matches("p_A ").count(),
        0
    );
}
