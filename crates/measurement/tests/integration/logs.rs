//! Logs as people have them, good and bad.

use crate::temporary::folder;
use hydroboom_measurement::{
    Mapping, Measurement, MeasurementError, Signal, Signals, TimeBase, digest, read,
};
use std::fmt::Write;
use std::path::PathBuf;

fn file(name: &str, content: impl AsRef<[u8]>) -> PathBuf {
    let path = folder(module_path!()).join(name);
    std::fs::write(&path, content).unwrap();
    path
}

fn log(name: &str, content: impl AsRef<[u8]>) -> Measurement {
    read(&file(name, content), None).unwrap()
}

/// The position and pressure of a log, at a time, in SI units.
fn position_and_pressure(log: &Measurement, time: f64) -> (f64, f64) {
    let signals = Signals::of(log, &Mapping::guess(log)).unwrap();
    let at = |signal| signals.get(signal).unwrap().at(time).unwrap();
    (at(Signal::Stroke), at(Signal::PressureA))
}

#[test]
fn a_measurement_in_every_notation_gives_the_same_signals() {
    let rows: Vec<(f64, f64, f64)> = (0..100)
        .map(|k| {
            let t = f64::from(k) * 0.01;
            (t, 50.0 + 10.0 * t, 68.5 + t)
        })
        .collect();
    let write = |line: &dyn Fn(f64, f64, f64) -> String| -> String {
        rows.iter().map(|(t, x, p)| line(*t, *x, *p)).collect()
    };
    let comma = |v: f64| v.to_string().replace('.', ",");
    let plain =
        format!("time_s,stroke_mm,pressure_a_bar\n{}", write(&|t, x, p| format!("{t},{x},{p}\n")));
    let german = format!(
        "# recorded by hand\nZeit;Position [mm];p_A [bar]\n{}",
        write(&|t, x, p| format!("{};{};{}\n", comma(t), comma(x), comma(p)))
    );
    let units_below = format!(
        "t\tx_cyl\tpA\n(ms)\t(m)\t(Pa)\n{}",
        write(&|t, x, p| format!("{}\t{}\t{}\n", t * 1e3, x * 1e-3, p * 1e5))
    );
    let quoted = format!(
        "\"time\",\"stroke (mm)\",\"p_A (bar)\"\r\n{}",
        write(&|t, x, p| format!("\"{t}\",\"{x}\",\"{p}\"\r\n"))
    );
    // each signal with its own time, as Simulink's data inspector writes it
    let pairs = format!(
        "time,stroke_mm,time,pressure_a_bar\n{}",
        write(&|t, x, p| format!("{t},{x},{t},{p}\n"))
    );
    for (name, text) in [
        ("plain", plain),
        ("german", german),
        ("units", units_below),
        ("quoted", quoted),
        ("pairs", pairs),
    ] {
        let log = log(&format!("{name}.csv"), text);
        assert_eq!(log.channels.len(), 2, "{name}: {}", log.headings());
        let (x, p) = position_and_pressure(&log, 0.505);
        assert!((x - 0.05505).abs() < 1e-9, "{name}: {x} m");
        assert!((p - 69.005e5).abs() < 1.0, "{name}: {p} Pa");
    }
}

#[test]
fn an_export_of_twincat_scope_keeps_the_time_base_of_each_channel() {
    let mut text = String::from(
        "Name\tScope Project\nFile\tC:\\lift.svdx\nStarttime of export\t132961725843760000\t02.05.2022\n\n\
         Name\tGVL.fPosition\tName\tGVL.fPressureA\n\
         SymbolComment\t\tSymbolComment\t\nData-Type\tREAL64\tData-Type\tREAL64\n\
         SampleTime[ms]\t10\tSampleTime[ms]\t1\nUnit\tmm\tUnit\tbar\n\n",
    );
    for k in 0..1000 {
        let slow = match k < 100 {
            true => format!(
                "{}\t{}",
                k * 10,
                format!("{:.3}", 50.0 + f64::from(k) * 0.1).replace('.', ",")
            ),
            false => "\t".into(),
        };
        let fast = format!("{:.2}", 68.0 + f64::from(k) * 0.001).replace('.', ",");
        writeln!(text, "{slow}\t{k}\t{fast}").unwrap();
    }
    text += "EOF\n";
    let log = log("scope.csv", text);
    assert_eq!(log.headings(), "GVL.fPosition, GVL.fPressureA");
    let interval = |k: usize| TimeBase::of(&log.channels[k].time).unwrap().interval;
    assert!((interval(0) - 0.01).abs() < 1e-9 && (interval(1) - 0.001).abs() < 1e-9);
    let (x, p) = position_and_pressure(&log, 0.5);
    assert!((x - 0.055).abs() < 1e-9 && (p - 68.5e5).abs() < 1e3, "{x} m, {p} Pa");
}

#[test]
fn bad_logs_get_clear_errors() {
    let message = |name: &str, content: &[u8]| {
        read(&file(name, content), None).err().map(|e| e.to_string()).unwrap_or_default()
    };
    for (name, content, wanted) in [
        ("empty.csv", &b""[..], "it is empty"),
        ("blank.csv", b"\n\n\n", "it is empty"),
        ("header.csv", b"time_s,stroke_mm\n", "no row"),
        ("one.csv", b"time_s,stroke_mm\n0,1\n", "1 row"),
        ("prose.csv", b"to be or not to be\nthat is the question\n", "no row"),
        ("words.csv", b"time_s,state\n0,a 1\n1,b 2\n", "no row in it has two numbers"),
        ("still.csv", b"time_s,stroke_mm\n1,1\n1,2\n1,3\n", "time_s is named as a time"),
        ("timeless.csv", b"u_valve,p_pressure\n0,1\n1,2\n0.5,3\n", "no column is named as a time"),
        ("asks.csv", b"u_valve,p_pressure\n0,1\n1,2\n0.5,3\n", "--sample-time-ms"),
        ("unitless.csv", b"u_valve,p_pressure\n0,1\n1,2\n0.5,3\n", "no column has a unit"),
        ("binary.csv", b"\x00\x01\x02\x03,\x00", "it is no text"),
        ("level73.mat", b"MATLAB 7.3 MAT-file", "not read as a MAT file of level 7.3"),
        ("cut.mat", b"MATLAB 5.0 MAT-file, cut", "not read as a MAT file"),
        ("foreign.mat", b"something else entirely, long enough", "neither"),
    ] {
        let text = message(name, content);
        assert!(text.contains(wanted), "{name}: {text}");
        assert!(text.contains(name), "{name} is not named: {text}");
    }
    let none = read(&PathBuf::from("/nowhere/log.csv"), None).unwrap_err();
    assert!(matches!(none, MeasurementError::File { .. }));
}

#[test]
fn missing_samples_are_not_filled() {
    let text = "time_s,stroke_mm,p_A_bar\n0,1,68\n0.01,,69\n0.02,NaN,70\n0.03,4\n1.5,5,72\n1.51,6,73\n1.52,7,74\n";
    let log = log("missing.csv", text);
    assert_eq!(log.channels[0].range().unwrap().missing, 2);
    assert!(log.remarks.iter().any(|r| r.contains("shorter")), "{:?}", log.remarks);
    let base = TimeBase::of(&log.channels[0].time).unwrap();
    assert_eq!(base.gaps.len(), 1);
    let signals = Signals::of(&log, &Mapping::guess(&log)).unwrap();
    let stroke = signals.get(Signal::Stroke).unwrap();
    // a short dropout is bridged, a long one is not
    assert!((stroke.at(0.015).unwrap() - 2.5e-3).abs() < 1e-12);
    assert_eq!(stroke.at(0.8), None);
    assert_eq!(stroke.held(0.8), Some(4e-3));
}

#[test]
fn lines_without_numbers_are_left_out_and_counted() {
    let text = "# made by hand\ntime_s,stroke_mm,p_A_bar\n0,1,68\n0.01,2,69\n# a pause\n0.02,3,oops\ntime_s,stroke_mm,p_A_bar\n0.03,4\n\
                0.04,5,71,9\n0.05,6,---\n,7,70\n0.06,8,7";
    let read_log = log("odd.csv", text);
    assert_eq!(read_log.channels[0].values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0]);
    assert_eq!(read_log.channels[1].range().unwrap().missing, 3);
    let message = read_log.remarks.join("\n");
    for wanted in [
        "1 comments, first line 5",
        "1 rows that hold words in place of numbers, first line 7",
        "1 cells that are no numbers, first line 6 (\"oops\" in p_A_bar)",
        "1 rows are shorter than the others, first line 8",
        "1 rows are longer than the others, first line 9",
        "1 rows without a time, first line 11",
    ] {
        assert!(message.contains(wanted), "{wanted}: {message}");
    }
    // half a number at the end of a file that was cut off is none
    let cut = log("cut.csv", "time_s,stroke_mm,p_A_bar\n0,1,68\n0.01,2,69\n0.02,3,69\n0.03,48");
    assert_eq!(cut.channels[0].values, [1.0, 2.0, 3.0]);
    assert!(cut.remarks.iter().any(|r| r.contains("cut off by the end")), "{:?}", cut.remarks);
}

#[test]
fn a_mapping_assigns_unguessable_columns_and_refuses_missing_ones() {
    let text = "zeitachse,kanal1,kanal2\n0,-50,6800000\n10,-51,6810000\n20,-52,6820000\n";
    let path = file("mapped.csv", text);
    let mapping = Mapping::parse(
        "map.toml",
        "[log.time]\ncolumn = \"zeitachse\"\nunit = \"s\"\n[log.pressure_a]\ncolumn = \"kanal2\"\nunit = \"bar\"\n[log.stroke]\ncolumn = \"kanal1\"\n\
         unit = \"mm\"\nsign = -1\noffset = 10\ndelay_ms = 5000\n",
    )
    .unwrap();
    let log = read(&path, Some(&mapping.time)).unwrap();
    let signals = Signals::of(&log, &mapping).unwrap();
    let stroke = signals.get(Signal::Stroke).unwrap();
    assert!((stroke.at(5.0).unwrap() - 41e-3).abs() < 1e-12, "{:?}", stroke.at(5.0));
    // pascals that the mapping takes for bar: it is suspected aloud
    let suspicions = mapping.suspicions(&log, 0.5, 50.0);
    let text = suspicions.iter().map(|s| s.text.as_str()).collect::<Vec<_>>().join("; ");
    assert!(text.contains("p_A") && text.contains("Pa"), "{text}");
    // the written mapping can be read
    assert_eq!(Mapping::parse("again", &mapping.to_toml()).unwrap().entries.len(), 2);
    for (text, wanted) in [
        ("[log]\nstrocke = \"a\"\n", "log.strocke is no signal"),
        (
            "[log.stroke]\ncolumn = \"a\"\nunit = \"bar\"\n",
            "log.stroke.unit: \"bar\" is a pressure, not a length: one of mm",
        ),
        ("[log.stroke]\nunit = \"mm\"\n", "has no column"),
        ("[log.stroke]\ncolumn = \"a\"\nsign = 2\n", "sign is 1 or -1"),
        ("[log.stroke]\ncolumn = \"a\"\nfilter_ms = -3\n", "filter_ms is zero or more"),
        ("[log.stroke]\ncolumn = \"a\"\ndrift_ppm = 2e5\n", "drift_ppm is between"),
        ("[log.stroke]\ncolumn = \"a\"\ncolour = 2\n", "colour is not understood"),
        ("x = 1\n", "no table [log]"),
    ] {
        let message = Mapping::parse("map.toml", text).unwrap_err().to_string();
        assert!(message.contains(wanted), "{message}");
    }
    let missing = Mapping::parse("map.toml", "[log]\nstroke = \"nowhere\"\n").unwrap();
    let message = Signals::of(&log, &missing).unwrap_err().to_string();
    assert!(message.contains("nowhere") && message.contains("kanal1"), "{message}");
}

#[test]
fn a_clock_drift_is_corrected() {
    // it counts 1.002 s in one; what it shows is the true time
    let rows = (0..5000).map(|k| format!("{},{}\n", f64::from(k) * 1.002e-2, f64::from(k) * 1e-2));
    let log = log("drift.csv", format!("t,x\n{}", rows.collect::<String>()));
    let text = "[log.stroke]\ncolumn = \"x\"\nunit = \"m\"\ndrift_ppm = 2000\nfilter_ms = 4\n";
    let mapping = Mapping::parse("map.toml", text).unwrap();
    let again = Mapping::parse("again", &mapping.to_toml()).unwrap();
    assert_eq!(again.entries, mapping.entries);
    let stroke = Signals::of(&log, &mapping).unwrap();
    let stroke = stroke.get(Signal::Stroke).unwrap();
    for time in [0.5, 12.345, 49.0] {
        let shown = stroke.at(time).unwrap();
        assert!((shown - time).abs() < 1e-9, "{shown} at {time}");
    }
    // no value is changed by the filter: the model is seen through it
    assert_eq!(stroke.filter(), 4e-3);
}

#[test]
fn an_open_quote_loses_one_cell_and_an_endless_line_is_an_error() {
    let mut text = String::from("t,x\n0,1\n1,2\n2,\"3a\n");
    for k in 3..100_000 {
        text += &format!("{k},5\n");
    }
    let read_quote = log("quote.csv", &text);
    assert_eq!(read_quote.channels[0].values.len(), 100_000);
    assert_eq!(read_quote.channels[0].range().unwrap().missing, 1);
    let message = read_quote.remarks.join("\n");
    assert!(message.contains("1 cells that are no numbers, first line 4"), "{message}");
    let endless = file("endless.csv", "1,".repeat(20 << 20));
    let message = read(&endless, None).err().map(|e| e.to_string()).unwrap();
    assert!(message.contains("line 1 is longer than"), "{message}");
}

#[test]
fn columns_are_guessed_and_references_are_not_taken_for_measured() {
    let head = "time_s,reference_position_mm,stroke_mm,simulated_stroke_mm,pressure_pump_a_bar,\
                pressure_a_bar,pressure_b_bar,pressure_pump_b_bar,pressure_accumulator_bar,motor_speed_rpm,\
                command_motor_speed_rpm,command_holding_valve,estimated_position_mm,deviation_position_mm,\
                innovation_position_mm,estimated_load_pressure_bar,estimated_unknown_flow_rpm";
    let row = |k: u32| format!("{},{}", f64::from(k) * 1e-3, ["1"; 16].join(","));
    let log = log("run.csv", format!("{head}\n{}\n{}\n{}\n", row(0), row(1), row(2)));
    let mapping = Mapping::guess(&log);
    let column = |s: Signal| mapping.entries.get(&s).map(|e| e.column.as_str());
    assert_eq!(column(Signal::Stroke), Some("stroke_mm"));
    assert_eq!(column(Signal::PressureA), Some("pressure_a_bar"));
    assert_eq!(column(Signal::PressurePumpA), Some("pressure_pump_a_bar"));
    assert_eq!(column(Signal::PressureAccumulator), Some("pressure_accumulator_bar"));
    assert_eq!(column(Signal::MotorSpeed), Some("motor_speed_rpm"));
    assert_eq!(column(Signal::MotorCommand), Some("command_motor_speed_rpm"));
    assert_eq!(column(Signal::HoldingValve), Some("command_holding_valve"));
    let taken = mapping.entries.values().map(|entry| entry.column.as_str());
    let estimates = ["estimated_", "deviation_", "innovation_"];
    for column in taken {
        assert!(!estimates.iter().any(|prefix| column.starts_with(prefix)), "{column}");
    }
}

#[test]
fn a_mat_file_is_read_and_a_digest_distinguishes_files() {
    // level 4, as MATLAB writes it with -v4: type, rows, columns, imaginary, length of the name
    let mut bytes = Vec::new();
    for (name, values) in [("t", [0.0, 0.1, 0.2]), ("p_A_bar", [68.0, 69.0, 70.0])] {
        for integer in [0_u32, 3, 1, 0, name.len() as u32 + 1] {
            bytes.extend(integer.to_le_bytes());
        }
        bytes.extend(name.as_bytes());
        bytes.push(0);
        values.iter().for_each(|v: &f64| bytes.extend(v.to_le_bytes()));
    }
    let path = file("four.mat", &bytes);
    let log = read(&path, None).unwrap();
    let signals = Signals::of(&log, &Mapping::guess(&log)).unwrap();
    assert_eq!(signals.get(Signal::PressureA).unwrap().at(0.15), Some(69.5e5));
    let other = file("other.mat", &bytes[..bytes.len() - 1]);
    assert_ne!(digest(&path).unwrap(), digest(&other).unwrap());
    // the empty file's digest is known to all
    let empty = digest(&file("nothing", b"")).unwrap();
    assert!(empty.starts_with("e3b0c44298fc1c14"), "{empty}");
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig {
        cases: 200, failure_persistence: None, ..Default::default()
    })]

    /// Any file is read or refused without a panic.
    #[test]
    fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..400)) {
        let _ = read(&file("any.csv", &bytes), None);
        let _ = read(&file("any.mat", &bytes), None);
        let mut mat = b"MATLAB 5.0 MAT-file".to_vec();
        mat.extend(&bytes);
        let _ = read(&file("any5.mat", &mat), None);
        let mut mcap = vec![0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'];
        mcap.extend(&bytes);
        let _ = read(&file("any.mcap", &mcap), None);
        if let Ok(text) = String::from_utf8(bytes) {
            let _ = Mapping::parse("any.toml", &text);
        }
    }

    /// Rows of irregular length with unusual signs.
    #[test]
    fn any_table_is_read_or_refused(
        rows in proptest::collection::vec("[0-9eE+.,;\\t\" -]{0,30}", 0..30)
    ) {
        let _ = read(&file("table.csv", rows.join("\n")), None);
    }
}

/// A file that is not a log is refused with its kind; a MAT file is recognised by its content.
#[test]
fn file_formats_are_recognised_by_their_first_bytes() {
    let at = |name: &str| folder(module_path!()).join(name);
    for (bytes, wanted) in [
        (&b"\x1f\x8b\x08\0\0\0\0\0"[..], "packed by gzip: unpack it"),
        (b"PK\x03\x04\x14\0\0\0", "save the table as CSV"),
    ] {
        std::fs::write(at("other.csv"), bytes).unwrap();
        let message = read(&at("other.csv"), None).unwrap_err().to_string();
        assert!(message.contains(wanted), "{message}");
    }
    let mut level_5 = b"MATLAB 5.0 MAT-file".to_vec();
    level_5.resize(116, b' ');
    std::fs::write(at("level_5.dat"), level_5).unwrap();
    let message = read(&at("level_5.dat"), None).unwrap_err().to_string();
    assert!(message.contains("MAT"), "{message}");
    let message = read(&PathBuf::from("/dev/null"), None).unwrap_err().to_string();
    assert!(message.contains("is no regular file"), "{message}");
}

#[test]
fn a_second_header_in_another_order_ends_the_table() {
    let rows = |swapped: bool| -> String {
        let row = |k: u32| {
            let [a, b] = if swapped { [70 + k, k] } else { [k, 70 + k] };
            format!("{},{a},{b}\n", f64::from(k) * 0.01)
        };
        (0..50).map(row).collect()
    };
    let path = folder(module_path!()).join("heads.csv");
    let text = format!("time_s,x_mm,p_A_bar\n{}time_s,p_A_bar,x_mm\n{}", rows(false), rows(true));
    std::fs::write(&path, text).unwrap();
    let log = read(&path, None).unwrap();
    let pressure = log.channel("p_A_bar").unwrap();
    assert_eq!(pressure.values.len(), 50);
    assert!(pressure.values.iter().all(|p| *p >= 70.0));
    let message = log.remarks.join("\n");
    assert!(message.contains("line 52 is a head with the columns in another order"), "{message}");
}

#[test]
fn short_rows_directly_below_the_header_are_counted() {
    let path = folder(module_path!()).join("short.csv");
    let rows: String =
        (2..50).map(|k| format!("{},1,2,3,4,5,6,7\n", f64::from(k) * 0.01)).collect();
    let text = format!("time_s,a,b,c,d,e,f,g\n0.0,1\n0.01,1\n{rows}");
    std::fs::write(&path, text).unwrap();
    let log = read(&path, None).unwrap();
    assert_eq!(log.channel("a").unwrap().values.len(), 50);
    let message = log.remarks.join("\n");
    assert!(message.contains("2 rows are shorter than the others, first line 2"), "{message}");
}

#[test]
fn thousands_separators_follow_from_the_decimals_of_the_table() {
    let path = folder(module_path!()).join("thousands.csv");
    let rows: String = (0..50).map(|k| format!("0,{:03};2.25{};{k}\n", 10 * k, k % 10)).collect();
    std::fs::write(&path, format!("time_s;n_rpm;p_A_bar\n{rows}")).unwrap();
    let log = read(&path, None).unwrap();
    assert_eq!(log.channel("n_rpm").unwrap().values[..3], [2250.0, 2251.0, 2252.0]);
    assert_eq!(log.channels[0].time[1], 0.01);
}
