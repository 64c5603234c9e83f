//! MAT files as people have them: how arrays lie, structures, results of simulations, and what cannot be read.

pub mod written;

use self::written::{
    cells, doubles, file, integers, level_4, level_4_texts, object, packed, row, structure, text,
};
use crate::temporary::folder;
use hydroboom_measurement::{Mapping, Measurement, Signal, Signals, TimeColumn, read};
use std::path::PathBuf;

const SAMPLES: usize = 50;

fn path(name: &str, content: &[u8]) -> PathBuf {
    let path = folder(module_path!()).join(name);
    std::fs::write(&path, content).unwrap();
    path
}

fn log(name: &str, content: &[u8]) -> Measurement {
    read(&path(name, content), None).unwrap()
}

fn refused(name: &str, content: &[u8]) -> String {
    read(&path(name, content), None).unwrap_err().to_string()
}

/// Times at 100 Hz \[s\], positions \[mm\] and pressures \[bar\].
fn course() -> [Vec<f64>; 3] {
    let of = |value: fn(f64) -> f64| (0..SAMPLES).map(|k| value(k as f64)).collect();
    [of(|k| k * 0.01), of(|k| 50.0 + k), of(|k| 68.5 + 0.1 * k)]
}

/// Several signals as a matrix with a sample a column.
fn beside(signals: &[&Vec<f64>]) -> Vec<f64> {
    (0..SAMPLES).flat_map(|k| signals.iter().map(move |s| s[k])).collect()
}

/// Position and pressure are those of the course.
fn holds(log: &Measurement) {
    let signals = Signals::of(log, &Mapping::guess(log)).unwrap();
    let at = |signal| signals.get(signal).unwrap().at(0.255).unwrap();
    assert!((at(Signal::Stroke) - 75.5e-3).abs() < 1e-6, "{}", at(Signal::Stroke));
    assert!((at(Signal::PressureA) - 71.05e5).abs() < 10.0, "{}", at(Signal::PressureA));
}

#[test]
fn signals_in_rows_or_columns_are_recognised_by_the_time_length() {
    let [t, x, p] = course();
    let p_b: Vec<f64> = p.iter().map(|p| p - 60.0).collect();
    let in_rows = doubles("pressures_bar", &[2, SAMPLES], &beside(&[&p, &p_b]));
    let in_columns = doubles("pressures_bar", &[SAMPLES, 2], &[p.clone(), p_b.clone()].concat());
    let in_pages = doubles("pressures_bar", &[1, 2, SAMPLES], &beside(&[&p, &p_b]));
    for (k, pressures) in [in_rows, in_columns, in_pages].into_iter().enumerate() {
        let log =
            log(&format!("lie{k}.mat"), &file(&[row("t", &t), row("stroke_mm", &x), pressures]));
        assert_eq!(log.headings(), "stroke_mm, pressures_bar_1, pressures_bar_2");
        let of = |name: &str| &log.channel(name).unwrap().values;
        assert_eq!((of("pressures_bar_1"), of("pressures_bar_2")), (&p, &p_b));
        assert_eq!(log.channel("pressures_bar_2").unwrap().unit.map(|u| u.name), Some("bar"));
    }
}

#[test]
fn integers_and_packed_variables_are_read() {
    let [t, x, p] = course();
    let whole: Vec<i32> = x.iter().map(|x| *x as i32 - 60).collect();
    let log = log(
        "integers.mat",
        &file(&[packed(&row("t", &t)), integers("stroke_mm", &whole), packed(&row("p_A_bar", &p))]),
    );
    assert_eq!(log.channel("stroke_mm").unwrap().values[..2], [-10.0, -9.0]);
    assert_eq!(log.channel("p_A_bar").unwrap().values, p);
}

#[test]
fn structures_are_read_with_an_inner_or_outer_time() {
    let [t, x, p] = course();
    let slow: Vec<f64> = (0..10).map(|k| f64::from(k) * 0.05).collect();
    let inner =
        structure("", &["time", "pressure_a_bar"], &[vec![row("", &slow), row("", &[70.0; 10])]]);
    let log = log(
        "structures.mat",
        &file(&[
            row("t", &t),
            structure("log", &["stroke_mm", "fast"], &[vec![row("", &x), inner]]),
            row("p_A_bar", &p),
        ]),
    );
    assert_eq!(log.headings(), "p_A_bar, log.stroke_mm, log.fast.pressure_a_bar");
    assert_eq!(log.channels[1].time.len(), SAMPLES);
    assert_eq!(*log.channels[2].time, *slow);
}

/// "Structure With Time" of scopes and To Workspace: time, signals.values, dimensions, label, blockName, as described
/// in robotology/robometry issue 8.
#[test]
fn a_structure_with_time_of_simulink_is_read_by_its_labels() {
    let [t, x, p] = course();
    let column = |v: &[f64]| doubles("", &[SAMPLES, 1], v);
    let signals = structure(
        "",
        &["values", "dimensions", "label", "title", "blockName"],
        &[
            vec![
                column(&x),
                doubles("", &[1, 1], &[1.0]),
                text("", "<stroke_mm>"),
                text("", ""),
                text("", "lift/Scope"),
            ],
            vec![
                // three signals of one block, without a label
                doubles("", &[SAMPLES, 3], &[p.clone(), p.clone(), x.clone()].concat()),
                doubles("", &[1, 1], &[3.0]),
                text("", ""),
                text("", ""),
                text("", "lift/Pressure (bar)"),
            ],
        ],
    );
    let with_time = structure(
        "ScopeData",
        &["time", "signals", "blockName"],
        &[vec![column(&t), signals, text("", "lift/Scope")]],
    );
    let log = log("with_time.mat", &file(&[packed(&with_time)]));
    assert_eq!(log.headings(), "stroke_mm, Pressure (bar)_1, Pressure (bar)_2, Pressure (bar)_3");
    assert_eq!(log.channels[0].values, x);
    assert_eq!(log.channels[1].values, p);
    assert_eq!(log.channels[3].unit.map(|u| u.name), Some("bar"));
    assert_eq!(log.channels[3].time[1], 0.01);
}

/// To File in its "Array" format: one matrix, its first row the time.
#[test]
fn an_array_of_simulinks_to_file_has_its_time_in_the_first_row() {
    let [t, x, p] = course();
    let ans = doubles("ans", &[3, SAMPLES], &beside(&[&t, &x, &p]));
    let log = log("to_file.mat", &file(&[ans]));
    assert_eq!(log.headings(), "ans_2, ans_3");
    assert_eq!((&log.channels[0].values, &log.channels[1].values), (&x, &p));
    assert_eq!(*log.channels[0].time, *t);
}

/// Recordings of dSPACE ControlDesk: X(k).Data the times of a raster, Y(k) a signal with Name, Unit, XIndex and Data.
#[test]
fn a_recording_of_dspace_is_read_by_names_units_and_rasters() {
    let [t, x, p] = course();
    let slow: Vec<f64> = (0..10).map(|k| f64::from(k) * 0.05).collect();
    let times = structure(
        "",
        &["Name", "Data", "Unit"],
        &[
            vec![text("", "HostService"), row("", &t), text("", "s")],
            vec![text("", "Slow"), row("", &slow), text("", "s")],
        ],
    );
    let signal = |name: &str, unit: &str, raster: f64, values: &[f64]| {
        vec![text("", name), text("", unit), doubles("", &[1, 1], &[raster]), row("", values)]
    };
    let signals = structure(
        "",
        &["Name", "Unit", "XIndex", "Data"],
        &[
            signal("Platform()://Crane/Model Root/stroke/Out1", "mm", 1.0, &x),
            signal("\"Model Root\"/\"p_A\"/\"In1\"", "bar", 1.0, &p),
            signal("Model Root/oil [bar]/Out1", "", 2.0, &[3.0; 10]),
            signal("Model Root/lost", "", 3.0, &x),
        ],
    );
    let recording =
        structure("rec_001", &["X", "Y", "Description"], &[vec![times, signals, text("", "")]]);
    let log = log("dspace.mat", &file(&[recording]));
    let names: Vec<&str> = log.channels.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["stroke", "p_A", "oil"]);
    assert_eq!(log.channels[2].time.len(), 10);
    assert_eq!(log.channels[2].unit.map(|u| u.name), Some("bar"));
    assert!(log.remarks.iter().any(|r| r.contains("Model Root/lost")), "{:?}", log.remarks);
    holds(&log);
}

/// A result of OpenModelica (`transposed`: a variable a column) or of Dymola (either way).
fn trajectory(is_transposed: bool) -> Vec<u8> {
    let [t, x, p] = course();
    let metres: Vec<f64> = x.iter().map(|x| x * 1e-3).collect();
    let pascals: Vec<f64> = p.iter().map(|p| -p * 1e5).collect();
    let kind = if is_transposed { "binTrans" } else { "binNormal" };
    let info: [[f64; 4]; 5] = [
        [0.0, 1.0, 0.0, -1.0],
        [2.0, 2.0, 0.0, -1.0],
        [2.0, -3.0, 0.0, -1.0],
        [1.0, 2.0, 0.0, 0.0],
        [2.0, 2.0, 0.0, -1.0],
    ];
    let data = match is_transposed {
        true => level_4("data_2", 0, 3, &beside(&[&t, &metres, &pascals])),
        false => level_4("data_2", 0, SAMPLES, &[t, metres, pascals].concat()),
    };
    let info = match is_transposed {
        true => level_4("dataInfo", 20, 4, &info.concat()),
        false => {
            let by_columns: Vec<f64> = (0..4).flat_map(|k| info.map(|row| row[k])).collect();
            level_4("dataInfo", 20, 5, &by_columns)
        }
    };
    [
        level_4_texts("Aclass", &["Atrajectory", "1.1", "", kind], false),
        level_4_texts(
            "name",
            &["time", "cylinder.s", "cylinder.p_a", "mass", "alias.s"],
            is_transposed,
        ),
        level_4_texts(
            "description",
            &["Time in [s]", "Stroke [m]", "Pressure [Pa|bar]", "Mass [kg]", "Stroke [m]"],
            is_transposed,
        ),
        info,
        level_4("data_1", 0, 2, &[0.0, 307.0, 0.0, 307.0]),
        data,
    ]
    .concat()
}

/// Variables are found by dataInfo, with its sign; described by tools such as FMPy issue 448 and PyFMI.
#[test]
fn results_of_openmodelica_and_dymola_are_read_transposed_or_not() {
    let [t, x, p] = course();
    for is_transposed in [true, false] {
        let log = log(&format!("trajectory_{is_transposed}.mat"), &trajectory(is_transposed));
        assert_eq!(log.headings(), "cylinder.s, cylinder.p_a, alias.s");
        assert_eq!(*log.channels[0].time, *t);
        for k in 0..SAMPLES {
            assert!((log.channels[0].values[k] - x[k] * 1e-3).abs() < 1e-12);
            assert!((log.channels[1].values[k] - p[k] * 1e5).abs() < 1e-6);
        }
        let units: Vec<_> = log.channels.iter().map(|c| c.unit.map(|u| u.name)).collect();
        assert_eq!(units, [Some("m"), Some("Pa"), Some("m")]);
        assert!(log.remarks.iter().any(|r| r.contains("1 parameters")), "{:?}", log.remarks);
    }
}

#[test]
fn days_since_year_zero_are_recognised() {
    let [t, x, p] = course();
    let days: Vec<f64> = t.iter().map(|t| 739_000.0 + t / 86_400.0).collect();
    let log =
        log("datenum.mat", &file(&[row("t", &days), row("stroke_mm", &x), row("p_A_bar", &p)]));
    assert!(log.remarks.iter().any(|r| r.contains("taken as days")), "{:?}", log.remarks);
    let span = log.channels[0].time[SAMPLES - 1];
    assert!((span - 0.49).abs() < 2e-5, "{span}");
}

/// Level 7.3 is HDF5: made by `make_7_3.py`, as MATLAB lays it out.
#[test]
fn level_7_3_is_read_as_level_7_is() {
    let [t, x, p] = course();
    let log = read(&recorded("arrays_7_3.mat"), None).unwrap();
    assert_eq!(
        log.headings(),
        "pressures_bar_1, pressures_bar_2, single_bar, stroke_mm, log.oil_bar"
    );
    let values = |name: &str| &log.channel(name).unwrap().values;
    assert_eq!(values("stroke_mm"), &x);
    assert_eq!(*log.channel("stroke_mm").unwrap().time, *t);
    for (k, p) in p.iter().enumerate() {
        assert!((values("pressures_bar_1")[k] - p).abs() < 1e-12);
        assert!((values("pressures_bar_2")[k] - p + 60.0).abs() < 1e-12);
        assert!((values("single_bar")[k] - p).abs() < 1e-4);
    }
    assert_eq!(log.channel("log.oil_bar").unwrap().time.len(), 10);
    for wanted in ["names is a cell array", "out is an object (timeseries)"] {
        assert!(log.remarks.iter().any(|r| r.contains(wanted)), "{:?}", log.remarks);
    }
    let log = read(&recorded("scope_7_3.mat"), None).unwrap();
    assert_eq!(log.headings(), "stroke_mm, p_A [bar]");
    holds(&log);
}

/// A file of level 7.3 of the tests.
fn recorded(name: &str) -> PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/integration/mat/files").join(name)
}

#[test]
fn groups_of_level_7_3_that_are_no_structures_are_named() {
    let log = read(&recorded("groups_7_3.mat"), None).unwrap();
    assert_eq!(log.headings(), "stroke_mm");
    for wanted in ["sparse is a sparse matrix", "handle is a function"] {
        assert!(log.remarks.iter().any(|r| r.contains(wanted)), "{:?}", log.remarks);
    }
}

#[test]
fn unresolvable_references_are_refused_with_the_reason() {
    let mut bytes = std::fs::read(recorded("scope_7_3.mat")).unwrap();
    // the name of the group with the targets of references
    let at = bytes.windows(6).position(|w| w == b"#refs#").unwrap();
    bytes[at + 1..at + 5].copy_from_slice(b"lost");
    let message = refused("lost_7_3.mat", &bytes);
    assert!(
        message.contains("ScopeData cannot be read") && message.contains("#refs#"),
        "{message}"
    );
}

#[test]
fn two_times_of_one_length_are_reported() {
    let [t, x, _] = course();
    let slow: Vec<f64> = t.iter().map(|t| 2.0 * t).collect();
    let both = |second: &[f64]| {
        log("rivals.mat", &file(&[row("t", &t), row("time", second), row("stroke_mm", &x)]))
    };
    let (two, same) = (both(&slow), both(&t));
    let says = |log: &Measurement| log.remarks.iter().any(|r| r.contains("t and time are times"));
    assert!(says(&two) && !says(&same), "{:?}, {:?}", two.remarks, same.remarks);
    assert_eq!((two.channels.len(), two.channels[0].time[1]), (1, 0.01));
}

#[test]
fn the_number_of_signals_is_bounded() {
    // each two samples long: more memory than their numbers
    let wide = doubles("p_bar", &[2, 100_000], &vec![1.0; 200_000]);
    let whole = file(&[row("t", &[0.0, 1.0]), wide, row("stroke_mm", &[5.0, 6.0])]);
    let log = log("wide.mat", &whole);
    assert_eq!(log.headings(), "stroke_mm");
    assert!(
        log.remarks.iter().any(|r| r.contains("more than 20000 signals: 100000 others")),
        "{:?}",
        log.remarks
    );
}

#[test]
fn unread_variables_are_named_and_a_file_of_these_only_is_refused() {
    let [t, x, _] = course();
    let others = [cells("names", &["stroke", "p_A"]), object("out", "timeseries")];
    let message = refused("cells.mat", &file(&[vec![row("t", &t)], others.to_vec()].concat()));
    for wanted in ["cells.mat", "names is a cell array", "out is an object (timeseries)"] {
        assert!(message.contains(wanted), "{message}");
    }
    let some = file(&[vec![row("t", &t), row("stroke_mm", &x)], others.to_vec()].concat());
    let log = log("some.mat", &some);
    assert_eq!(log.headings(), "stroke_mm");
    assert!(log.remarks.iter().any(|r| r.contains("cell array")), "{:?}", log.remarks);
    let message = refused("timeless.mat", &file(&[row("b", &x), row("a", &x)]));
    assert!(
        message.contains("no variable is named as a time") && message.contains("b, a"),
        "{message}"
    );
}

fn named(column: &str) -> TimeColumn {
    TimeColumn { column: Some(column.into()), ..TimeColumn::default() }
}

#[test]
fn the_time_variable_may_be_named() {
    let [t, x, p] = course();
    let fields = structure("s", &["clock", "stroke_mm"], &[vec![row("", &t), row("", &x)]]);
    let path = path("named.mat", &file(&[row("p_A_bar", &p), fields]));
    for name in ["clock", "s.clock"] {
        let log = read(&path, Some(&named(name))).unwrap();
        assert_eq!(log.headings(), "s.stroke_mm");
    }
    let message = read(&path, Some(&named("nowhere"))).unwrap_err().to_string();
    assert!(message.contains("nowhere") && message.contains("s.clock"), "{message}");
}

#[test]
fn a_truncated_file_is_read_up_to_its_end() {
    let [t, x, p] = course();
    let whole = file(&[row("t", &t), row("stroke_mm", &x), packed(&row("p_A_bar", &p))]);
    let log = log("cut_off.mat", &whole[..whole.len() - 20]);
    assert_eq!(log.headings(), "stroke_mm");
    assert!(log.remarks[0].contains("after stroke_mm"), "{:?}", log.remarks);
}

#[test]
fn a_small_file_that_decompresses_to_much_is_refused() {
    let bomb = packed(&doubles("x", &[1 << 15, 1 << 10], &vec![0.0; 1 << 25]));
    assert!(bomb.len() < 400_000);
    let message = refused("bomb.mat", &file(&[bomb]));
    assert!(message.contains("up to 20 million numbers"), "{message}");
}
