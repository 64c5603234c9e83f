//! Which column is the time, and what it counts.

use crate::temporary::folder;
use hydroboom_measurement::{Mapping, Measurement, MeasurementError, TimeColumn, read};
use std::path::PathBuf;

fn file(name: &str, content: &str) -> PathBuf {
    let path = folder(module_path!()).join(name);
    std::fs::write(&path, content).unwrap();
    path
}

fn log(name: &str, content: &str) -> Result<Measurement, MeasurementError> {
    read(&file(name, content), None)
}

/// A table whose first column is written by a function of the row; rows are 10 ms apart.
fn table(heading: &str, time: impl Fn(u32) -> String) -> String {
    let rows =
        (0..300).map(|k| format!("{};{};{}\n", time(k), 50 + k % 7, 69.0 + f64::from(k % 5)));
    format!("{heading};stroke_mm;p_A_bar\n{}", rows.collect::<String>())
}

/// Time of row 200, which is 2 s after the first.
fn two_seconds(log: &Measurement) -> f64 {
    log.channels[0].time[200] - log.channels[0].time[0]
}

#[test]
fn an_unstated_unit_of_time_is_inferred_from_the_numbers() {
    for (name, expected, first, step) in [
        ("time", "taken as s", 0.0, 0.01),
        ("time", "taken as s", 1234.5, 0.01),
        ("time", "taken as ms", 0.0, 10.0),
        ("time", "taken as us", 0.0, 10_000.0),
        ("time", "taken as ns", 0.0, 10_000_000.0),
        ("timestamp", "seconds since 1970", 1.7e9, 0.01),
        ("timestamp", "milliseconds since 1970", 1.7e12, 10.0),
        ("timestamp", "microseconds since 1970", 1.7e15, 1e4),
        ("timestamp", "nanoseconds since 1970", 1.7e18, 1e7),
        ("time", "MATLAB's datenum", 739_252.4, 0.01 / 86_400.0),
        ("time", "a spreadsheet's date", 45_322.4, 0.01 / 86_400.0),
    ] {
        let text = table(name, |k| format!("{}", first + f64::from(k) * step));
        let log = log("unitless.csv", &text).unwrap();
        assert!((two_seconds(&log) - 2.0).abs() < 1e-4, "{expected}: {}", two_seconds(&log));
        assert!(log.remarks.iter().any(|r| r.contains(expected)), "{expected}: {:?}", log.remarks);
    }
}

#[test]
fn a_stated_unit_has_precedence_over_an_inferred_one() {
    for (heading, step) in [
        ("time_s", 0.01),
        ("time [ms]", 10.0),
        ("t / µs", 1e4),
        ("t / μs", 1e4),
        ("Zeit (min)", 0.01 / 60.0),
        ("time_h", 0.01 / 3600.0),
        ("Elapsed [msec]", 10.0),
        ("time [d]", 0.01 / 86_400.0),
    ] {
        let log = log("unit.csv", &table(heading, |k| (f64::from(k) * step).to_string())).unwrap();
        assert!((two_seconds(&log) - 2.0).abs() < 1e-6, "{heading}: {}", two_seconds(&log));
        assert!(log.remarks.is_empty(), "{:?}", log.remarks);
    }
    let text =
        log("lightyears.csv", &table("time [lj]", |k| k.to_string())).unwrap_err().to_string();
    assert!(text.contains("\"lj\" is no known unit"), "{text}");
}

/// What a column of times is called, and how it writes a moment.
type Writer = (&'static str, fn(Moment) -> String);

/// Days, hours, minutes, seconds, milliseconds.
type Moment = (u32, u32, u32, u32, u32);

#[test]
fn dates_and_times_of_day_are_read_in_every_notation() {
    // row 200 comes 2 s after the first, over midnight
    let parts = |k: u32| {
        let ms = 86_399_000 + k * 10;
        let (day, ms) = (ms / 86_400_000, ms % 86_400_000);
        (day, ms / 3_600_000, ms / 60_000 % 60, ms / 1000 % 60, ms % 1000)
    };
    let writers: [Writer; 6] = [
        ("ISO", |(d, h, m, s, ms)| format!("2024-02-{:02}T{h:02}:{m:02}:{s:02}.{ms:03}Z", 28 + d)),
        ("blank", |(d, h, m, s, ms)| format!("2024-02-{:02} {h:02}:{m:02}:{s:02}.{ms:03}", 28 + d)),
        ("German", |(d, h, m, s, ms)| {
            format!("{:02}.02.2024 {h:02}:{m:02}:{s:02},{ms:03}", 28 + d)
        }),
        ("clock", |(_, h, m, s, ms)| format!("{h:02}:{m:02}:{s:02}.{ms:03}")),
        ("colons", |(_, h, m, s, ms)| format!("{h:02}:{m:02}:{s:02}:{ms:03}")),
        ("columns", |(d, h, m, s, ms)| {
            format!("{:02}.02.2024;{h:02}:{m:02}:{s:02},{ms:03}", 28 + d)
        }),
    ];
    for (name, write) in writers {
        let heading = if name == "columns" { "Datum;Uhrzeit" } else { "Zeitstempel" };
        let log = log(&format!("{name}.csv"), &table(heading, |k| write(parts(k)))).unwrap();
        assert!((two_seconds(&log) - 2.0).abs() < 1e-6, "{name}: {}", two_seconds(&log));
        assert_eq!(log.headings(), "stroke_mm, p_A_bar", "{name}");
    }
    // durations go on after a day
    let log = log(
        "days.csv",
        &table("elapsed", |k| format!("{:02}:00:{:05.2}", 30, f64::from(k) * 0.01)),
    );
    assert!((two_seconds(&log.unwrap()) - 2.0).abs() < 1e-6);
}

#[test]
fn a_single_letter_does_not_identify_a_time_column() {
    // a temperature that rises throughout stands before the time, and others behind it
    let rows: String = (0..300)
        .map(|k| {
            let t = f64::from(k) * 0.01;
            format!("{},{t},{},{},{}\n", 40.0 + t, 50 + k % 7, 41.0 + t, 1.0 + t)
        })
        .collect();
    for head in ["T,time,stroke_mm,T,t2", "T,t,stroke_mm,Temps,t2", "temp,time,stroke_mm,T,t_2"] {
        let log = log("letters.csv", &format!("{head}\n{rows}")).unwrap();
        assert_eq!(log.channels.len(), 4, "{head}: {}", log.headings());
        assert!((two_seconds(&log) - 2.0).abs() < 1e-9, "{head}");
        assert_eq!(log.channels[1].heading, "stroke_mm");
    }
}

#[test]
fn ticks_of_100_ns_are_assumed_in_scope_exports_only() {
    let text =
        table("timestamp", |k| (133_000_000_000_000_000_u64 + u64::from(k) * 100_000).to_string());
    let message = log("ticks_of_whom.csv", &text).unwrap_err().to_string();
    assert!(message.contains("neither seconds nor"), "{message}");
    // a mapping may say so
    let mapping =
        Mapping::parse("m", "[log.time]\ncolumn = \"timestamp\"\nunit = \"ns\"\nscale = 100\n")
            .unwrap();
    let log = read(&file("ticks_of_whom.csv", &text), Some(&mapping.time)).unwrap();
    assert!((two_seconds(&log) - 2.0).abs() < 1e-5, "{}", two_seconds(&log));
}

#[test]
fn a_time_that_was_guessed_is_written_to_the_mapping_and_read_back() {
    for (heading, wanted) in [("Zeit", "unit = \"ms\""), ("t [us]", "unit = \"us\"")] {
        let text = table(heading, |k| (k * 10).to_string());
        let log = read(&file("guessed_time.csv", &text), None).unwrap();
        let mapping = Mapping::default().completed(&log).unwrap();
        let written = mapping.to_toml();
        let column = format!("[log.time]\ncolumn = \"{heading}\"  # guessed");
        assert!(written.contains(&column) && written.contains(wanted), "{written}");
        let again = Mapping::parse("again", &written).unwrap();
        assert!(!again.time.is_guessed);
        let same = read(&file("guessed_time.csv", &text), Some(&again.time)).unwrap();
        assert_eq!(same.channels[0].time, log.channels[0].time);
    }
}

#[test]
fn all_clocks_of_a_table_pass_midnight_together() {
    for dates in [["2024-01-31 ", "2024-02-01 "], ["", ""]] {
        // the second clock begins after midnight
        let row = |k: u32| {
            let stamp = |s: u32| match s < 86_400 {
                true => format!("{}23:59:{:02}", dates[0], s - 86_340),
                false => format!("{}00:00:{:02}", dates[1], s - 86_400),
            };
            format!("{};{};{};{}\n", stamp(86_398 + k), 50 + k, stamp(86_401 + k), 70 + k)
        };
        let text = format!("time;stroke_mm;time;p_A_bar\n{}", (0..20).map(row).collect::<String>());
        let log = log("midnight.csv", &text).unwrap();
        let begins: Vec<f64> = log.channels.iter().map(|c| c.time[0]).collect();
        assert_eq!(begins, [0.0, 3.0], "{dates:?}: {:?}", log.remarks);
        assert!(log.channels.iter().all(|c| c.time[19] - c.time[0] == 19.0), "{dates:?}");
    }
}

#[test]
fn a_sample_time_applies_to_rows_of_text_files_only() {
    let path = file("counted.mcap", "\u{89}MCAP0\r\n");
    let bytes = [&[0x89][..], b"MCAP0\r\n"].concat();
    std::fs::write(&path, bytes).unwrap();
    let counted = TimeColumn { sample_time: Some(0.01), ..TimeColumn::default() };
    let message = read(&path, Some(&counted)).unwrap_err().to_string();
    assert!(
        message.contains("counts rows of text files; in an MCAP file name the time"),
        "{message}"
    );
    let nameless = TimeColumn { scale: 2.0, ..TimeColumn::default() };
    let message = read(&path, Some(&nameless)).unwrap_err().to_string();
    assert!(message.contains("name the column that is meant"), "{message}");
}

#[test]
fn a_clock_is_mapped_and_shifted_by_a_mapping() {
    let text = table("ticks", |k| (k * 5).to_string());
    let mapping = Mapping::parse(
        "m",
        "[log.time]\ncolumn = \"ticks\"\nunit = \"ms\"\nscale = 2.0\noffset = 500\n",
    )
    .unwrap();
    let log = read(&file("mapped_time.csv", &text), Some(&mapping.time)).unwrap();
    assert!((log.channels[0].time[0] - 0.5).abs() < 1e-12);
    assert!((two_seconds(&log) - 2.0).abs() < 1e-9);
    assert_eq!(Mapping::parse("again", &mapping.to_toml()).unwrap().time, mapping.time);
    for (text, wanted) in [
        ("[log.time]\nunit = \"bar\"\n", "log.time.unit: \"bar\" is a pressure, not a time"),
        ("[log.time]\nunit = \"seks\"\n", "is no known unit"),
        ("[log.time]\nscale = 0\n", "scale is more than zero"),
        ("[log]\nsample_time_ms = -1\n", "sample_time_ms is the interval"),
        ("[log.time]\ncolour = 1\n", "colour is not understood"),
    ] {
        let message = Mapping::parse("m", text).unwrap_err().to_string();
        assert!(message.contains(wanted), "{message}");
    }
}
