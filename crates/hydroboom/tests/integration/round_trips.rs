//! Written files are read back bit-identically in every format.

use crate::support::command::{files, folder, hydroboom, parsed};
use crate::support::short_crane::short_crane;
use hydroboom_measurement::{Mapping, Measurement, Signal, Signals, read};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn made(arguments: &[&str]) {
    let output = hydroboom(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

fn log(path: &str) -> Measurement {
    read(Path::new(path), None).unwrap()
}

/// All numbers of a CSV file by column.
fn columns(path: &str) -> Vec<(String, Vec<f64>)> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names = lines.next().unwrap().split(',');
    let mut columns: Vec<(String, Vec<f64>)> = names.map(|n| (n.into(), Vec::new())).collect();
    for line in lines {
        for (column, cell) in columns.iter_mut().zip(line.split(',')) {
            column.1.push(match cell {
                "true" => 1.0,
                "false" => 0.0,
                number => number.parse().unwrap_or(f64::NAN),
            });
        }
    }
    columns
}

/// Bits of numbers; all NaN are equal, and so are both zeros.
fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| if v.is_nan() { u64::MAX } else { (v + 0.0).to_bits() }).collect()
}

/// Checks that the channels of a log are these columns, and its signals these in SI units.
fn is_read_as(log: &Measurement, written: &[(String, Vec<f64>)]) {
    let time = &written[0].1;
    for channel in &log.channels {
        let (_, values) = written
            .iter()
            .find(|(name, _)| *name == channel.heading)
            .unwrap_or_else(|| panic!("{}: no {}", log.name, channel.heading));
        let is_same = bits(&channel.values) == bits(values) && bits(&channel.time) == bits(time);
        assert!(is_same, "{}: {}", log.name, channel.heading);
    }
    let mapping = Mapping::default().completed(log).unwrap();
    let signals = Signals::of(log, &mapping).unwrap();
    for signal in Signal::COMPARED.into_iter().chain([Signal::MotorSpeed]) {
        let entry = &mapping.entries[&signal];
        assert!(!entry.is_unit_guessed, "{}: {}", log.name, signal.key());
        let (_, values) = written.iter().find(|(name, _)| *name == entry.column).unwrap();
        let unit = log.channels.iter().find(|c| c.heading == entry.column).unwrap().unit.unwrap();
        let expected: Vec<f64> = values.iter().map(|v| unit.si(*v)).collect();
        let found = signals.get(signal).unwrap().values();
        assert!(bits(found) == bits(&expected), "{}: {}", log.name, signal.key());
    }
}

/// Checks that both validations agree except for the log's name.
fn validates_alike(one: &str, other: &str) {
    let of = |path: &str| -> Value {
        let mut found = parsed(&["validate", "--log", path, "--to-s", "2", "--json"]);
        found["log"] = Value::Null;
        found["notes"] = Value::Null;
        found
    };
    let found = of(one);
    assert!(!found["signals"].as_array().unwrap().is_empty(), "{found}");
    assert_eq!(found, of(other));
}

#[test]
fn simulate_and_virtual_are_read_back_from_csv_and_mat() {
    let at = files("round-trip");
    for command in [
        &["simulate", "--speed-mm-s", "120", "--log-ms", "20", "--log"][..],
        &["virtual", "--speed-mm-s", "120", "--log-ms", "20", "--log"],
        &["virtual", "--speed-mm-s", "120", "--log-ms", "20", "--truth", "--log"],
    ] {
        let (csv, mat) = (at("x.csv"), at("x.mat"));
        made(&[command, &[&csv]].concat());
        made(&[command, &[&mat]].concat());
        let written = columns(&csv);
        assert!(written[0].1.len() > 100);
        // numbers have all their digits: few end after ten
        let digits = |v: &f64| format!("{v:e}").split('e').next().unwrap().len();
        let (_, pressures) = written.iter().find(|(n, _)| n.ends_with("pressure_a_bar")).unwrap();
        if command[0] == "simulate" {
            assert!(pressures.iter().filter(|v| digits(v) > 14).count() > 100);
        }
        is_read_as(&log(&csv), &written);
        is_read_as(&log(&mat), &written);
        validates_alike(&csv, &mat);
    }
}

#[test]
fn a_run_is_read_back_from_mcap_and_csv() {
    let at = files("round-trip-run");
    let (mcap, csv) = (at("run.mcap"), at("run.csv"));
    made(&["run", "--auto", "--simulated-time", "--speed-mm-s", "120", "--log", &mcap]);
    made(&["log", "to-csv", &mcap, "--out", &csv]);
    let written = columns(&csv);
    assert!(written[0].1.len() > 1000);
    let found = log(&mcap);
    // numbers of the messages, and of the table made from them
    let mut compared = 0;
    let is_of = |heading: &str, name: &str| heading.rsplit(['.', '/']).next() == Some(name);
    for channel in &found.channels {
        let Some((_, values)) = written.iter().find(|(name, _)| is_of(&channel.heading, name))
        else {
            continue;
        };
        let there =
            |v: &[f64]| bits(&v.iter().copied().filter(|v| v.is_finite()).collect::<Vec<_>>());
        assert!(there(&channel.values) == there(values), "{}", channel.heading);
        compared += 1;
    }
    assert!(compared > 20, "{compared} of {:?}", found.headings());
    let mapping = Mapping::default().completed(&found).unwrap();
    let signals = Signals::of(&found, &mapping).unwrap();
    for signal in Signal::COMPARED {
        let entry = &mapping.entries[&signal];
        let column = written.iter().find(|(name, _)| is_of(&entry.column, name));
        let unit = found.channels.iter().find(|c| c.heading == entry.column).unwrap().unit.unwrap();
        let expected: Vec<f64> = column.unwrap().1.iter().map(|v| unit.si(*v)).collect();
        assert!(bits(signals.get(signal).unwrap().values()) == bits(&expected), "{}", signal.key());
    }
    let found = parsed(&["validate", "--log", &mcap, "--to-s", "2", "--json"]);
    assert!(!found["signals"].as_array().unwrap().is_empty(), "{found}");
    // the log's clock counts ns, the time column has the computed values: a valve may open in another step
    let of_csv = parsed(&["validate", "--log", &csv, "--to-s", "2", "--json"]);
    let rms = |of: &Value| -> Vec<f64> {
        let signals = of["signals"].as_array().unwrap().iter();
        signals.map(|s| s["rms"].as_f64().unwrap()).collect()
    };
    for (a, b) in rms(&found).into_iter().zip(rms(&of_csv)) {
        assert!((a / b - 1.0).abs() < 0.05, "{a} and {b}");
    }
}

#[test]
fn motion_tests_are_read_back_and_their_report_has_its_figures() {
    let dir = folder("round-trip-motion");
    let at = |name: &str| dir.join(name).to_str().unwrap().to_string();
    let asked = ["motion", "--scenario", "reversal", "--plant-set", "payload.mass_kg=300"];
    made(&[&asked[..], &["--log", &at("logs"), "--out", &at("out")]].concat());
    let logs: Vec<_> = fs::read_dir(at("logs")).unwrap().map(|e| e.unwrap().path()).collect();
    assert_eq!(logs.len(), 5, "{logs:?}");
    for path in &logs {
        let path = path.to_str().unwrap();
        is_read_as(&log(path), &columns(path));
    }
    let page = fs::read_to_string(at("out/motion.html")).unwrap();
    let digest = parsed(&["show", "--json"]);
    assert!(digest.is_object());
    for note in ["hydroboom 0.", "reversal --plant-set", "SHA-256", "<dt>date</dt><dd>20"] {
        assert!(page.contains(note), "no {note}");
    }
    let drawn = page.matches("<figure>").count();
    assert!(drawn >= 9 && page.matches("role=\"img\" aria-label=\"").count() == drawn, "{drawn}");
    let mut files: Vec<String> = fs::read_dir(at("out/motion-figures"))
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    assert_eq!(files.iter().filter(|name| name.ends_with(".svg")).count(), drawn);
    assert_eq!(files.iter().filter(|name| name.ends_with(".csv")).count(), drawn);
    // the data of a figure are all those of the runs
    let error = files.iter().find(|n| n.contains("tracking-error") && n.ends_with(".csv")).unwrap();
    let figure = columns(&at(&format!("out/motion-figures/{error}")));
    let run = logs.iter().find(|p| p.to_str().unwrap().contains("velocity-feedforward")).unwrap();
    let run = columns(run.to_str().unwrap());
    let of = |name: &str| &run.iter().find(|(n, _)| n == name).unwrap().1;
    assert_eq!(bits(&figure[0].1), bits(of("time_s")));
    let errors = of("stroke_mm").iter().zip(of("reference_position_mm")).map(|(x, r)| x - r);
    for (found, expected) in figure[1].1.iter().zip(errors) {
        assert!((found - expected).abs() < 1e-9, "{found} for {expected}");
    }
}

/// A report can be reproduced from its origin block.
#[test]
fn a_report_states_how_it_was_made() {
    let at = files("origin");
    let (crane, log) = (at("it's a crane.toml"), at("v.csv"));
    made(&["new", &crane]);
    made(&["simulate", "--hold-s", "1", "--valve", "0", "--log", &log]);
    made(&["validate", "--crane", &crane, "--log", &log, "--report", &at("v.html")]);
    let page = fs::read_to_string(at("v.html")).unwrap();
    let digest = hydroboom_measurement::digest_of(&fs::read(&crane).unwrap());
    assert!(page.contains(&digest), "the crane file's own digest");
    let digest = hydroboom_measurement::digest(Path::new(&log)).unwrap();
    assert!(page.contains(&digest), "the log's digest");
    let drawn = page.matches("<figure>").count();
    let figures: Vec<_> =
        fs::read_dir(at("v-figures")).unwrap().map(|e| e.unwrap().path()).collect();
    let count = |kind: &str| figures.iter().filter(|p| p.extension().unwrap() == kind).count();
    assert!(drawn > 0 && count("svg") == drawn && count("csv") == drawn, "{drawn}: {figures:?}");
    assert!(page.contains(r"it'\''s a crane.toml'"), "quoted for a shell");
    assert!(!page.contains("<dt>seed</dt>"));
    let short = short_crane(&folder("origin-crane"));
    made(&["motion", "--family", "1", "--seed", "77", "--crane", &short, "--out", &at("f")]);
    let page = fs::read_to_string(at("f/family.html")).unwrap();
    assert!(page.contains("<dt>seed</dt><dd>77</dd>"));
}
