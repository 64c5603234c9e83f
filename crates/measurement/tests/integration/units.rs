//! Units of columns: stated, mapped, guessed, or refused.

use crate::temporary::folder;
use hydroboom_measurement::{Mapping, Measurement, MeasurementError, Signal, Signals, Track, read};

fn log(name: &str, content: &str) -> Measurement {
    let path = folder(module_path!()).join(name);
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
fn the_logs_unit_applies_where_a_mapping_names_only_the_column() {
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
fn a_unit_that_is_unknown_or_of_another_quantity_is_an_error() {
    let text =
        "t,pressure_a [barr],x [bar],n [Hz],pressure_b [mm]\n0,1,1,1,1\n1,2,2,2,2\n2,3,3,3,3\n";
    let log = log("wrong.csv", text);
    let message = |mapping: &str| mapped(&log, mapping).unwrap_err().to_string();
    // the column would be assigned to p_A: the message names the unit that the log states
    let text = message("");
    assert!(text.contains("\"barr\" is no known unit; the nearest is bar"), "{text}");
    // the remedy in the message is accepted, on two lines
    assert!(text.contains("[log.pressure_a] column = \"pressure_a [barr]\", unit = "), "{text}");
    let stated = "[log.pressure_a]\ncolumn = \"pressure_a [barr]\"\nunit = \"bar\"\n";
    assert!(mapped(&log, stated).is_ok());
    let known = "[log.pressure_a]\ncolumn = \"pressure_a\"\nunit = \"bar\"\n";
    let text = message(&format!("stroke = \"x\"\n{known}"));
    assert!(text.contains("\"bar\" is a pressure, not a length"), "{text}");
    let text = message(&format!("motor_speed = \"n\"\n{known}"));
    assert!(text.contains("\"Hz\" is a frequency, not a rotational speed"), "{text}");
    // a column that is only named alike is left, and that is reported
    let (mapping, _) = mapped(&log, known).unwrap();
    let message = mapping.assumptions(&log).join("\n");
    assert!(
        message.contains("\"pressure_b [mm]\" is not taken for p_B: mm is a length"),
        "{message}"
    );
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
    // the written mapping can be read
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
fn guessed_units_are_marked_in_the_mapping_and_reported() {
    let log = log("bare.csv", "time,position_1,pressure_1\n0,50,69\n1,51,70\n2,52,69\n");
    let (mapping, _) =
        mapped(&log, "stroke = \"position_1\"\npressure_a = \"pressure_1\"\n").unwrap();
    let message = mapping.assumptions(&log).join("\n");
    assert!(message.contains("\"pressure_1\" has no unit: p_A is taken in bar"), "{message}");
    let text = mapping.to_toml();
    assert_eq!(text.matches("# guessed by the size").count(), 2, "{text}");
    assert_eq!(text.matches("# guessed by its name").count(), 0, "{text}");
    let again = Mapping::parse("again.toml", &text).unwrap().completed(&log).unwrap();
    assert_eq!(again.assumptions(&log), Vec::<String>::new());
}

#[test]
fn an_absolute_pressure_is_suspected_by_its_name_or_rest_value() {
    // a rod side that is open to the air while it rests, gauge and absolute
    let rows = |air: f64| -> String {
        (0..200)
            .map(|k| {
                let load = if k < 80 { 0.0 } else { f64::from(k - 80) * 0.05 };
                format!("{},{},{}\n", f64::from(k) * 0.01, load + air, 60.0 + load)
            })
            .collect()
    };
    let message = |name: &str, heading: &str, air: f64| {
        let log = log(name, &format!("time_s,{heading},pressure_a_bar\n{}", rows(air)));
        let mapping = Mapping::default().completed(&log).unwrap();
        let found = mapping.suspicions(&log, 0.5, 50.0);
        // it is of use all the same
        assert!(found.iter().all(|s| !s.is_unusable), "{found:?}");
        found.iter().map(|s| s.text.clone()).collect::<Vec<_>>().join("\n")
    };
    let text = message("absolute.csv", "pressure_b_bar", 1.013);
    assert!(text.contains("p_B") && text.contains("rests at about 1 bar for 40 %"), "{text}");
    assert!(text.contains("unit = \"bar abs\", or offset = -1.0132"), "{text}");
    assert_eq!(message("gauge.csv", "pressure_b_bar", 0.0), "");
    assert_eq!(message("stated.csv", "pressure_b [bar abs]", 1.013), "");
    let text = message("named.csv", "pressure_b_abs [bar]", 3.0);
    assert!(text.contains("is named as an absolute pressure"), "{text}");
}

/// The proposed correction gives the signal its true values, also with sign and offset in the mapping.
#[test]
fn the_proposed_zero_is_right_with_sign_and_offset() {
    for (sign, offset) in [(1.0, 0.0), (-1.0, 0.0), (1.0, 100.0), (-1.0, -40.0)] {
        // a cylinder's own length, from 650 to 900 mm
        let rows: String = (0..200)
            .map(|k| {
                let length = 650.0 + 250.0 * f64::from(k) / 199.0;
                format!("{},{}\n", f64::from(k) * 0.01, sign * length - offset)
            })
            .collect();
        let log = log("zero.csv", &format!("time_s,x\n{rows}"));
        let mapped = |offset: f64| {
            let text = format!(
                "[log.stroke]\ncolumn = \"x\"\nunit = \"mm\"\nsign = {sign:?}\noffset = {offset:?}\n"
            );
            Mapping::parse("m", &text).unwrap().completed(&log).unwrap()
        };
        let suspicions = mapped(offset).suspicions(&log, 0.5, 50.0);
        let message = &suspicions[0].text;
        let proposed = message.split("offset = ").nth(1).and_then(|t| t.split(' ').next());
        let proposed: f64 = proposed.and_then(|t| t.parse().ok()).expect(message);
        let signals = Signals::of(&log, &mapped(proposed)).unwrap();
        let stroke = signals.get(Signal::Stroke).unwrap().values();
        assert!(
            stroke[0].abs() < 1e-9 && (stroke[199] - 0.25).abs() < 1e-9,
            "{message}: {stroke:?}"
        );
        assert!(mapped(proposed).suspicions(&log, 0.5, 50.0).is_empty());
    }
}

#[test]
fn signals_without_a_sample_have_no_time_in_common() {
    let mut signals = Signals::default();
    signals.insert(Signal::Stroke, Track::new(&[0.0, 1.0], &[f64::NAN, f64::NAN]));
    signals.insert(Signal::PressureA, Track::new(&[0.0, 1.0], &[1.0, 2.0]));
    assert_eq!(signals.overlap(&[Signal::Stroke, Signal::PressureA]), None);
    assert_eq!(signals.overlap(&[Signal::PressureA]), Some((0.0, 1.0)));
}
