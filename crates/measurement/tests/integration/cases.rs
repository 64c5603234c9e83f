//! Logs of one motion in the forms that export files take, each read rightly or refused with its reason.
//!
//! Each form is made here. Where the environment variable `HYDROBOOM_CASES` names a folder with files of the same
//! names, which hold a simulated lift, those are read too.

use crate::temporary::folder;
use hydroboom_measurement::{Mapping, Measurement, MeasurementError, Signal, Signals, read};
use std::path::{Path, PathBuf};

/// Rows of a log that is made, 10 ms apart.
const ROWS: u32 = 600;

/// A signal, and its value at a time \[s\] in mm, bar, rpm.
type Truth = (Signal, fn(f64) -> f64);

const TRUTH: [Truth; 8] = [
    (Signal::MotorSpeed, |t| 400.0 * t),
    (Signal::HoldingValve, |_| 1.0),
    (Signal::Stroke, |t| 50.0 + 20.0 * t),
    (Signal::PressurePumpA, |t| 69.5 - t),
    (Signal::PressureA, |t| 69.75 - t),
    (Signal::PressureB, |t| 3.0 - 0.125 * t),
    (Signal::PressurePumpB, |t| 2.5 - 0.125 * t),
    (Signal::PressureAccumulator, |t| 2.25 + 0.03125 * t),
];

/// The same in the files of the folder, at 0.02 s.
const IN_FILES: [(Signal, f64); 8] = [
    (Signal::MotorSpeed, 0.0),
    (Signal::HoldingValve, 1.0),
    (Signal::Stroke, 50.0007),
    (Signal::PressurePumpA, 69.5038),
    (Signal::PressureA, 69.6692),
    (Signal::PressureB, 2.90072),
    (Signal::PressurePumpB, 2.89468),
    (Signal::PressureAccumulator, 2.50283),
];

/// A form.
struct Case {
    /// Name of the file.
    name: &'static str,
    mapping: &'static str,
    made: fn() -> Vec<u8>,
    /// Signals that are found; none where the log is refused.
    signals: &'static [Signal],
    /// Segments, and seconds in the file of the folder.
    segments: usize,
    seconds: f64,
    /// Text that the remarks or the refusal must contain.
    remarks: &'static [&'static str],
}

fn value(signal: Signal, time: f64) -> f64 {
    TRUTH.iter().find(|(s, _)| *s == signal).map_or(f64::NAN, |(_, value)| value(time))
}

/// A column: its heading, its signal, and a factor to the number that is written.
type Column = (&'static str, Signal, f64);

const ALL: [Column; 8] = [
    ("motor_speed_rpm", Signal::MotorSpeed, 1.0),
    ("valve", Signal::HoldingValve, 1.0),
    ("stroke_mm", Signal::Stroke, 1.0),
    ("pressure_pump_a_bar", Signal::PressurePumpA, 1.0),
    ("pressure_a_bar", Signal::PressureA, 1.0),
    ("pressure_b_bar", Signal::PressureB, 1.0),
    ("pressure_pump_b_bar", Signal::PressurePumpB, 1.0),
    ("pressure_accumulator_bar", Signal::PressureAccumulator, 1.0),
];

/// Names of Scope for the same.
const SCOPE: [&str; 8] = [
    "GVL.fMotorSpeed",
    "GVL.bValve",
    "MAIN.fbCyl.fStroke",
    "MAIN.fPumpA",
    "MAIN.fPa",
    "MAIN.fPb",
    "MAIN.fPumpB",
    "MAIN.fPacc",
];

/// A table: the time as `time` writes it, then the columns, `sign` between.
fn table(heading: &str, time: impl Fn(u32) -> String, columns: &[Column], sign: &str) -> String {
    let names: Vec<&str> = columns.iter().map(|c| c.0).collect();
    let mut text = format!("{heading}{sign}{}\n", names.join(sign));
    for k in 0..ROWS {
        let t = f64::from(k) * 0.01;
        let cells =
            columns.iter().map(|(_, signal, factor)| (value(*signal, t) * factor).to_string());
        let cells: Vec<String> = cells.collect();
        text += &format!("{}{sign}{}\n", time(k), cells.join(sign));
    }
    text
}

fn seconds(k: u32) -> String {
    (f64::from(k) * 0.01).to_string()
}

/// An export of TwinCAT Scope with some rows of its head.
fn scope(rows: &[&str], copies: usize, factors: [f64; 8], sign: &str, comma: bool) -> String {
    let mut text = String::new();
    for row in rows {
        let cell = |k: usize| match *row {
            "Name" if k < 8 => SCOPE[k].to_string(),
            "Name" => format!("MAIN.fbMachine.aAxis[{k}].stStatus.fActualValueOfSensor"),
            "SampleTime[ms]" => "10".into(),
            "Data-Type" => "REAL64".into(),
            "Unit" => ["rpm (Rotational speed)", "(None)", "mm (Length)", "MPa (Pressure)"]
                [if k < 4 { k } else { 3 }]
            .into(),
            _ => String::new(),
        };
        let cells: Vec<String> =
            (0..8 * copies).map(|k| format!("{row}{sign}{}", cell(k))).collect();
        text += &format!("{}\n", cells.join(sign));
    }
    text.push('\n');
    for k in 0..ROWS {
        let t = f64::from(k) * 0.01;
        let cells = (0..8 * copies).map(|c| {
            let number = (value(TRUTH[c % 8].0, t) * factors[c % 8]).to_string();
            format!("{}{sign}{number}", k * 10)
        });
        let row = cells.collect::<Vec<_>>().join(sign);
        text += &if comma { row.replace('.', ",") } else { row };
        text.push('\n');
    }
    text + "EOF\n"
}

const PREAMBLE: &str = "Name\tScope Project\nFile\tC:\\TwinCAT\\Scope.svdx\nStarttime of export\t133964386997165000\tMontag, 1. Januar 2024\t10:00:00.000\n\n";
const WHOLE: [&str; 8] = [
    "Name",
    "SymbolComment",
    "Data-Type",
    "SampleTime[ms]",
    "VariableSize",
    "SymbolBased",
    "Unit",
    "Unit Offset",
];
const SHORT: [&str; 4] = ["Name", "SymbolComment", "Data-Type", "SampleTime[ms]"];
const MPA: [f64; 8] = [1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 0.1, 0.1];

const EVERY: &[Signal] = &[
    Signal::MotorSpeed,
    Signal::HoldingValve,
    Signal::Stroke,
    Signal::PressurePumpA,
    Signal::PressureA,
    Signal::PressureB,
    Signal::PressurePumpB,
    Signal::PressureAccumulator,
];
const FEW: &[Signal] = &[Signal::MotorSpeed, Signal::Stroke, Signal::PressureA];

const CASES: [Case; 22] = [
    Case {
        name: "u01_motor_speed_rad_s.csv",
        mapping: "[log]\nmotor_speed = \"motor_speed_rad_s\"\n",
        made: || {
            let radians = std::f64::consts::TAU / 60.0;
            let columns = [ALL[2], ("motor_speed_rad_s", Signal::MotorSpeed, radians), ALL[4]];
            table("time", seconds, &columns, ",").into_bytes()
        },
        signals: FEW,
        segments: 1,
        seconds: 17.66,
        remarks: &[],
    },
    Case {
        name: "u02_names_end_in_1.csv",
        mapping: "[log]\nstroke = \"position_1\"\nmotor_speed = \"motor_speed_1\"\npressure_a = \"pressure_1\"\n",
        made: || {
            let columns = [
                ("position_1", Signal::Stroke, 1.0),
                ("motor_speed_1", Signal::MotorSpeed, 1.0),
                ("pressure_1", Signal::PressureA, 1.0),
                ("pressure_2", Signal::PressureB, 1.0),
            ];
            table("time", seconds, &columns, ",").into_bytes()
        },
        signals: FEW,
        segments: 1,
        seconds: 4.98,
        remarks: &["\"pressure_1\" has no unit", "\"position_1\" has no unit"],
    },
    Case {
        name: "u03_paper_symbols.csv",
        mapping: "",
        made: || {
            let names = ["n", "p_PA", "p_A", "p_B", "p_PB", "p_acc"];
            let places = [0, 3, 4, 5, 6, 7];
            let rest = names.into_iter().zip(places).map(|(name, k)| (name, ALL[k].1, 1.0));
            let columns: Vec<Column> =
                std::iter::once(("x_cyl", Signal::Stroke, 1.0)).chain(rest).collect();
            table("t", seconds, &columns, ",").into_bytes()
        },
        signals: &[
            Signal::MotorSpeed,
            Signal::Stroke,
            Signal::PressurePumpA,
            Signal::PressureA,
            Signal::PressureB,
            Signal::PressurePumpB,
            Signal::PressureAccumulator,
        ],
        segments: 1,
        seconds: 4.98,
        remarks: &[
            "\"p_PA\" has no unit: p_PA is taken in bar",
            "the time \"t\" has no unit: taken as s",
        ],
    },
    Case {
        name: "u04_inch_psi.csv",
        mapping: "",
        made: || {
            let psi = 14.503_773_773;
            let columns = [
                ("motor speed [rpm]", Signal::MotorSpeed, 1.0),
                ALL[1],
                ("stroke [in]", Signal::Stroke, 1.0 / 25.4),
                ("pressure_a [psi]", Signal::PressureA, psi),
                ("pressure_b [psi]", Signal::PressureB, psi),
            ];
            table("time [s]", seconds, &columns, ",").into_bytes()
        },
        signals: &[Signal::MotorSpeed, Signal::Stroke, Signal::PressureA, Signal::PressureB],
        segments: 1,
        seconds: 4.98,
        remarks: &[],
    },
    Case {
        name: "u06_din_slash_units.csv",
        mapping: "",
        made: || {
            let columns = [
                ("motor speed / rpm", Signal::MotorSpeed, 1.0),
                ALL[1],
                ("stroke / m", Signal::Stroke, 1e-3),
                ("pressure_a / MPa", Signal::PressureA, 0.1),
            ];
            table("t / ms", |k| (k * 10).to_string(), &columns, ",").into_bytes()
        },
        signals: FEW,
        segments: 1,
        seconds: 4.98,
        remarks: &[],
    },
    Case {
        name: "u07_scope_unit_row_real_style.csv",
        mapping: "",
        made: || (PREAMBLE.to_string() + &scope(&WHOLE, 1, MPA, "\t", true)).into_bytes(),
        signals: EVERY,
        segments: 1,
        seconds: 4.76,
        remarks: &["an export of TwinCAT Scope"],
    },
    Case {
        name: "u10_valve_command_percent.csv",
        mapping: "[log]\nvalve_command = \"valve_command_percent\"\n",
        made: || {
            let text = table("t_s", seconds, &[("position_mm", Signal::Stroke, 1.0)], ",");
            let mut rows = text.lines();
            let mut changed = format!("{},valve_command_percent\n", rows.next().unwrap());
            for row in rows {
                changed += &format!("{row},27.00\n");
            }
            changed.into_bytes()
        },
        signals: &[Signal::ValveCommand],
        segments: 1,
        seconds: 11.99,
        remarks: &[],
    },
    Case {
        name: "t01_scope_name_only.csv",
        mapping: "",
        made: || {
            let preamble = PREAMBLE.replace('\t', ";");
            (preamble + &scope(&["Name"], 1, [1.0; 8], ";", false)).into_bytes()
        },
        signals: EVERY,
        segments: 1,
        seconds: 4.92,
        remarks: &["an export of TwinCAT Scope"],
    },
    Case {
        name: "t03_timestamp_us_epoch.csv",
        mapping: "",
        made: || {
            let stamp = |k: u32| (1_700_000_000_000_000 + u64::from(k) * 10_000).to_string();
            table("timestamp_us", stamp, &ALL, ",").into_bytes()
        },
        signals: EVERY,
        segments: 1,
        seconds: 4.98,
        remarks: &["time is counted from the first sample"],
    },
    Case {
        name: "t04_timestamp_ns_epoch.csv",
        mapping: "",
        made: || {
            let stamp =
                |k: u32| (1_700_000_000_000_000_000 + u64::from(k) * 10_000_000).to_string();
            table("timestamp_ns", stamp, &ALL, ",").into_bytes()
        },
        signals: EVERY,
        segments: 1,
        seconds: 4.98,
        remarks: &["time is counted from the first sample"],
    },
    Case {
        name: "t06_time_ns.csv",
        mapping: "",
        made: || {
            table("time [ns]", |k| (u64::from(k) * 10_000_000).to_string(), &ALL, ",").into_bytes()
        },
        signals: EVERY,
        segments: 1,
        seconds: 4.98,
        remarks: &[],
    },
    Case {
        name: "t07_temperature_T.csv",
        mapping: "",
        made: || {
            // it rises first, as a clock does, and falls then
            let text = table("time_s", seconds, &[ALL[2], ALL[0], ALL[4]], ",");
            let mut rows = text.lines();
            let mut changed = format!("{},T,pressure_b_bar\n", rows.next().unwrap());
            for (k, row) in rows.enumerate() {
                let t = k as f64 * 0.01;
                let warm = 40.0 + 0.2 * t * (4.0 - t);
                changed += &format!("{row},{warm},{}\n", value(Signal::PressureB, t));
            }
            changed.into_bytes()
        },
        signals: &[Signal::Stroke, Signal::MotorSpeed, Signal::PressureA, Signal::PressureB],
        segments: 1,
        seconds: 4.98,
        remarks: &[],
    },
    Case {
        name: "t09_clock_jump_1h.csv",
        mapping: "",
        made: || {
            let jump = |k: u32| if k < 300 { 0.0 } else { 3600.0 };
            let stamp = |k: u32| (f64::from(k) * 0.01 + jump(k)).to_string();
            table("time_s", stamp, &ALL, ",").into_bytes()
        },
        signals: EVERY,
        segments: 2,
        seconds: 3617.66,
        remarks: &["the clock jumps", "a new segment"],
    },
    Case {
        name: "t10_time_back_0_1ms.csv",
        mapping: "",
        made: || {
            let stamp = |k: u32| if k == 300 { "2.9899".into() } else { seconds(k) };
            table("time_s", stamp, &ALL, ",").into_bytes()
        },
        signals: EVERY,
        segments: 1,
        seconds: 9.48,
        remarks: &["1 rows whose time is out of order"],
    },
    Case {
        name: "f01_scope_200_channels.csv",
        mapping: "",
        made: || (PREAMBLE.to_string() + &scope(&WHOLE, 50, MPA, "\t", true)).into_bytes(),
        signals: EVERY,
        segments: 1,
        seconds: 0.02,
        remarks: &["an export of TwinCAT Scope"],
    },
    Case {
        name: "f02_text_column.csv",
        mapping: "",
        made: || {
            let text = table("time_s", seconds, &ALL, ",");
            let with = |(k, row): (usize, &str)| {
                let (time, rest) = row.split_once(',').unwrap();
                let word = ["state", "IDLE", "MOVE"][if k == 0 { 0 } else { 1 + k / 50 % 2 }];
                format!("{time},{word},{rest}\n")
            };
            text.lines().enumerate().map(with).collect::<String>().into_bytes()
        },
        signals: EVERY,
        segments: 1,
        seconds: 0.58,
        remarks: &["columns of text are left out: \"state\""],
    },
    Case {
        name: "f04_quoted_decimal_comma.csv",
        mapping: "",
        made: || {
            let text = table("time_s", seconds, &ALL, ";");
            let quoted = |(k, row): (usize, &str)| match k {
                0 => row.replace(';', ",") + "\n",
                _ => format!("\"{}\"\n", row.replace('.', ",").replace(';', "\",\"")),
            };
            text.lines().enumerate().map(quoted).collect::<String>().into_bytes()
        },
        signals: EVERY,
        segments: 1,
        seconds: 0.58,
        remarks: &[],
    },
    Case {
        name: "f05_excel_na.csv",
        mapping: "",
        made: || {
            let text = table("time_s", seconds, &[ALL[2], ALL[0], ALL[1], ALL[4]], ",");
            let some = |(k, row): (usize, &str)| match (k, row.rsplit_once(',')) {
                (500..520, Some((rest, _))) => format!("{rest},#N/A\n"),
                _ => format!("{row}\n"),
            };
            let rows: String = text.lines().enumerate().map(some).collect();
            ("#TOK #N/A\n".to_string() + &rows).into_bytes()
        },
        signals: FEW,
        segments: 1,
        seconds: 7.27,
        remarks: &[],
    },
    Case {
        name: "f07_utf16.csv",
        mapping: "",
        made: || {
            let text = table("time_s", seconds, &ALL, "\t");
            let units = std::iter::once(0xfeff).chain(text.encode_utf16());
            units.flat_map(u16::to_le_bytes).collect()
        },
        signals: EVERY,
        segments: 1,
        seconds: 0.58,
        remarks: &["UTF-16"],
    },
    Case {
        name: "f08_duplicate_names.csv",
        mapping: "[log]\npressure_a = \"pressure#1\"\npressure_b = \"pressure#2\"\npressure_pump_a = \"pressure#3\"\n",
        made: || {
            let columns = [
                ALL[2],
                ALL[0],
                ALL[1],
                ("pressure", Signal::PressureA, 1.0),
                ("pressure", Signal::PressureB, 1.0),
                ("pressure", Signal::PressurePumpA, 1.0),
            ];
            table("time_s", seconds, &columns, ",").into_bytes()
        },
        signals: &[Signal::Stroke, Signal::PressureA, Signal::PressureB, Signal::PressurePumpA],
        segments: 1,
        seconds: 0.58,
        remarks: &["\"pressure#2\" has no unit"],
    },
    Case {
        name: "f09_no_time_first_constant.csv",
        mapping: "",
        made: || table("x_goal", |_| "0.48".into(), &[ALL[2], ALL[0], ALL[4]], ",").into_bytes(),
        signals: &[],
        segments: 0,
        seconds: 0.0,
        remarks: &["it has no column of times", "--sample-time-ms"],
    },
    Case {
        name: "f11_scope_separator_colon.csv",
        mapping: "",
        made: || scope(&[&SHORT[..], &["Unit"]].concat(), 1, MPA, ":", false).into_bytes(),
        signals: EVERY,
        segments: 1,
        seconds: 0.39,
        remarks: &["an export of TwinCAT Scope"],
    },
];

/// The log, its signals, and all remarks on them.
fn taken(path: &Path, mapping: &str) -> Result<(Measurement, Signals, String), MeasurementError> {
    let given = if mapping.is_empty() { "[log]\n" } else { mapping };
    let given = Mapping::parse("map.toml", given)?;
    let log = read(path, Some(&given.time))?;
    let mapping = given.completed(&log)?;
    let remarks = [log.remarks.clone(), mapping.assumptions(&log)].concat().join("\n");
    let signals = Signals::of(&log, &mapping)?;
    Ok((log, signals, remarks))
}

/// A signal in mm, bar and rpm.
fn shown(signals: &Signals, signal: Signal, time: f64) -> f64 {
    let track = signals.get(signal).unwrap();
    track.at(time).map_or(f64::NAN, |value| value / signal.shown().1)
}

#[test]
fn each_format_is_read_correctly_or_refused_with_the_reason() {
    for case in CASES {
        let path = folder(module_path!()).join(format!("made_{}", case.name));
        std::fs::write(&path, (case.made)()).unwrap();
        let all = taken(&path, case.mapping);
        let (log, signals, remarks) = match (all, case.signals) {
            (Ok(all), [_, ..]) => all,
            (Err(error), []) => {
                case.remarks.iter().for_each(|w| assert!(error.to_string().contains(w), "{error}"));
                continue;
            }
            (Ok((log, ..)), []) => panic!("{} is read: {}", case.name, log.headings()),
            (Err(error), _) => panic!("{} is refused: {error}", case.name),
        };
        for wanted in case.remarks {
            assert!(remarks.contains(wanted), "{}: {remarks}", case.name);
        }
        assert_eq!(log.channels[0].segments().len(), case.segments, "{}", case.name);
        for signal in case.signals {
            if *signal == Signal::ValveCommand {
                assert!((signals.get(*signal).unwrap().at(1.0).unwrap() - 0.27).abs() < 1e-12);
                continue;
            }
            for time in [0.0, 0.02, 1.234, 2.5] {
                let (found, truth) = (shown(&signals, *signal, time), value(*signal, time));
                let close = 1e-6 * truth.abs().max(1.0);
                assert!(
                    (found - truth).abs() < close,
                    "{}: {signal:?} {found}, not {truth}, at {time} s",
                    case.name
                );
            }
        }
        // after a jump of the clock, as its own segment
        let later = if case.segments == 2 { 3600.0 } else { 0.0 };
        let signal = case.signals[0];
        if signal != Signal::ValveCommand {
            let (found, truth) = (shown(&signals, signal, 4.5 + later), value(signal, 4.5));
            assert!((found - truth).abs() < 1e-6 * truth.abs().max(1.0), "{}: {found}", case.name);
        }
    }
}

#[test]
fn a_log_without_times_is_read_with_its_sample_time() {
    let path = folder(module_path!()).join("counted.csv");
    let case = CASES.iter().find(|case| case.name.starts_with("f09")).unwrap();
    std::fs::write(&path, (case.made)()).unwrap();
    let (_, signals, remarks) = taken(&path, "[log]\nsample_time_ms = 10\n").unwrap();
    assert!((shown(&signals, Signal::Stroke, 1.5) - value(Signal::Stroke, 1.5)).abs() < 1e-9);
    assert!(remarks.contains("rows are counted, 10.0 ms apart"), "{remarks}");
}

#[test]
fn an_ambiguous_column_name_is_refused() {
    let path = folder(module_path!()).join("ambiguous.csv");
    let case = CASES.iter().find(|case| case.name.starts_with("f08")).unwrap();
    std::fs::write(&path, (case.made)()).unwrap();
    let error = taken(&path, "[log]\npressure_b = \"pressure\"\n").err().unwrap().to_string();
    assert!(error.contains("3 columns are called"), "{error}");
}

/// The files are not part of the project, because they are large.
#[test]
fn each_file_of_the_folder_is_read_correctly_or_refused() {
    let Some(folder) = std::env::var_os("HYDROBOOM_CASES").map(PathBuf::from) else { return };
    for case in CASES {
        let path = folder.join(case.name);
        if !path.exists() {
            continue;
        }
        let all = taken(&path, case.mapping);
        let (log, signals, remarks) = match (all, case.signals) {
            (Ok(all), [_, ..]) => all,
            (Err(error), []) => {
                case.remarks.iter().for_each(|w| assert!(error.to_string().contains(w), "{error}"));
                continue;
            }
            (Ok(_), []) => panic!("{} is read", case.name),
            (Err(error), _) => panic!("{} is refused: {error}", case.name),
        };
        case.remarks.iter().for_each(|w| assert!(remarks.contains(w), "{}: {remarks}", case.name));
        assert_eq!(log.channels[0].segments().len(), case.segments, "{}", case.name);
        let end = log.channels[0].time.last().copied().unwrap();
        assert!((end - case.seconds).abs() < 1e-6, "{}: {end} s", case.name);
        if case.signals == [Signal::ValveCommand] {
            let command = signals.get(Signal::ValveCommand).unwrap();
            assert!((command.at(5.0).unwrap() - 0.27).abs() < 1e-12 && command.is_share());
            continue;
        }
        for (signal, truth) in IN_FILES.iter().filter(|(s, _)| case.signals.contains(s)) {
            let found = shown(&signals, *signal, 0.02);
            assert!((found - truth).abs() < 1e-3, "{}: {signal:?} {found}", case.name);
        }
        // 120 mm/s at 18.78 rpm per mm/s; one file has a fifth of it
        let speed = signals.get(Signal::MotorSpeed).unwrap().values();
        let fastest = speed.iter().fold(0.0_f64, |most, v| most.max(*v)) * 60.0;
        let most = if case.name.starts_with("u01") { 2253.94 / 5.0 } else { 2253.94 };
        assert!(fastest < 1.0 || (fastest - most).abs() < 0.5, "{}: {fastest} rpm", case.name);
    }
}
