//! Units of columns: stated, mapped, guessed, or refused.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_measurement::{Mapping, Measurement, MeasurementError, Signal, Signals, read};
use std::path::PathBuf;

fn log(name: &str, content: &str) -> Measurement {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, content).unwrap();
    read(&path, None).unwrap()
}

fn mapped(log: &Measurement, mapping: &str) -> Result<(Mapping, Signals), MeasurementError> {
    let mapping = Mapping::parse("map.toml", &format!("[log]\n{mapping}"))?.completed(log)?;
    let signals = Signals::of(log, &mapping)?;
    Ok((mapping, signals))
}

fn at(signals: &Signals, signal: Signal) -> f64 {
    signals.get(signal).unwrap().at(1.0).unwrap()
}

#[test]
fn the_logs_unit_counts_where_a_mapping_names_only_the_column() {
    let text = "time,motor_speed_rad_s,p [MPa],x / in\n0,0,0,0\n1,157.07963,6.9,2\n2,0,0,0\n";
    let log = log("stated.csv", text);
    let mapping = "motor_speed = \"motor_speed_rad_s\"\npressure_a = \"p\"\nstroke = \"x\"\n";
    let (mapping, signals) = mapped(&log, mapping).unwrap();
    assert!((at(&signals, Signal::MotorSpeed) - 25.0).abs() < 1e-6);
    assert!((at(&signals, Signal::PressureA) - 69e5).abs() < 1e-6);
    assert!((at(&signals, Signal::Stroke) - 0.0508).abs() < 1e-12);
    assert_eq!(mapping.assumptions(&log), Vec::<String>::new());
}

#[test]
fn a_unit_that_is_unknown_or_of_something_else_is_an_error() {
    let text =
        "t,pressure_a [barr],x [bar],n [Hz],pressure_b [mm]\n0,1,1,1,1\n1,2,2,2,2\n2,3,3,3,3\n";
    let log = log("wrong.csv", text);
    let said = |mapping: &str| mapped(&log, mapping).unwrap_err().to_string();
    // it would be taken for p_A: nobody is told another unit than the one that stands there
    let text = said("");
    assert!(text.contains("\"barr\" is no known unit; the nearest is bar"), "{text}");
    assert!(text.contains("[log.pressure_a] unit = "), "{text}");
    let known = "[log.pressure_a]\ncolumn = \"pressure_a\"\nunit = \"bar\"\n";
    let text = said(&format!("stroke = \"x\"\n{known}"));
    assert!(text.contains("\"bar\" is a pressure, not a length"), "{text}");
    let text = said(&format!("motor_speed = \"n\"\n{known}"));
    assert!(text.contains("\"Hz\" is a frequency, not a rotational speed"), "{text}");
    // a column that is only named alike is left, and that is said
    let (mapping, _) = mapped(&log, known).unwrap();
    let said = mapping.assumptions(&log).join("\n");
    assert!(said.contains("\"pressure_b [mm]\" is not taken for p_B: mm is a length"), "{said}");
}

#[test]
fn any_column_is_scaled_and_shifted() {
    // 4 to 20 mA are 0 to 250 bar; the motor's encoder gives 4096 a turn; absolute pressure
    let text = "time,p [mA],counts,pressure_b [bar abs]\n0,4,0,1.01325\n1,12,81920,3.01325\n2,4,0,1.01325\n";
    let log = log("scaled.csv", text);
    let (mapping, signals) = mapped(
        &log,
        "[log.pressure_a]\ncolumn = \"p\"\nunit = \"bar\"\nscale = 15.625\noffset = -62.5\n\
         [log.motor_speed]\ncolumn = \"counts\"\nunit = \"rev/s\"\nscale = 0.000244140625\nsign = -1\n",
    )
    .unwrap();
    assert!((at(&signals, Signal::PressureA) - 125e5).abs() < 1e-6);
    assert!((at(&signals, Signal::MotorSpeed) + 20.0).abs() < 1e-12);
    assert!((at(&signals, Signal::PressureB) - 2e5).abs() < 1e-6);
    // what is written is read again
    let again = Mapping::parse("again.toml", &mapping.to_toml()).unwrap();
    for (signal, entry) in &mapping.entries {
        let other = &again.entries[signal];
        assert_eq!(
            (entry.scale, entry.sign, entry.offset),
            (other.scale, other.sign, other.offset)
        );
        assert_eq!(entry.unit, other.unit);
    }
}

#[test]
fn a_valves_command_is_in_volts_or_a_share() {
    let text = "t_s,valve_command_percent,position_mm\n0,0,1\n1,27,2\n2,0,3\n";
    let log = log("share.csv", text);
    let (_, signals) = mapped(&log, "valve_command = \"valve_command_percent\"\n").unwrap();
    assert!((at(&signals, Signal::ValveCommand) - 0.27).abs() < 1e-12);
    assert!(signals.get(Signal::ValveCommand).unwrap().is_share());
    let stated =
        "[log.valve_command]\ncolumn = \"valve_command_percent\"\nunit = \"V\"\nscale = 0.1\n";
    let (_, signals) = mapped(&log, stated).unwrap();
    assert!((at(&signals, Signal::ValveCommand) - 2.7).abs() < 1e-12);
    assert!(!signals.get(Signal::ValveCommand).unwrap().is_share());
}

#[test]
fn what_was_guessed_is_marked_in_the_mapping_and_said() {
    let log = log("bare.csv", "time,position_1,pressure_1\n0,50,69\n1,51,70\n2,52,69\n");
    let (mapping, _) =
        mapped(&log, "stroke = \"position_1\"\npressure_a = \"pressure_1\"\n").unwrap();
    let said = mapping.assumptions(&log).join("\n");
    assert!(said.contains("\"pressure_1\" has no unit: p_A is taken in bar"), "{said}");
    let text = mapping.to_toml();
    assert_eq!(text.matches("# guessed by the size").count(), 2, "{text}");
    assert_eq!(text.matches("# guessed by its name").count(), 0, "{text}");
    let again = Mapping::parse("again.toml", &text).unwrap().completed(&log).unwrap();
    assert_eq!(again.assumptions(&log), Vec::<String>::new());
}
