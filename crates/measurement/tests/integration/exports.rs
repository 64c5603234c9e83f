//! Export files of real tools, in the forms that users show in public issues.

use crate::temporary::folder;
use hydroboom_measurement::{Mapping, Measurement, Signal, Signals, TimeBase, read};

fn log(name: &str, content: &str) -> Measurement {
    let path = folder(module_path!()).join(name);
    std::fs::write(&path, content).unwrap();
    read(&path, None).unwrap()
}

fn rows(row: impl Fn(f64) -> String) -> String {
    (0..200).map(|k| row(f64::from(k)) + "\n").collect()
}

fn interval(log: &Measurement, column: usize) -> f64 {
    TimeBase::of(&log.channels[column].time).unwrap().interval
}

/// Value of a column at a time.
fn at(log: &Measurement, column: &str, time: f64) -> f64 {
    let channel = log.channel(column).unwrap();
    let place = channel.time.partition_point(|t| *t < time - 1e-9);
    channel.values[place]
}

/// `ladisk/lvm_read`, issue 5: two headers, notes, sizes of blocks, a column of comments at the end.
#[test]
fn a_labview_measurement_with_notes_is_read() {
    let text = format!(
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nMulti_Headings\tNo\nX_Columns\tOne\n\
         Time_Pref\tAbsolute\nOperator\tuser\nDate\t2016/08/11\nTime\t14:37:48.201000213623046875\n***End_of_Header***\t\n\t\n\
         Notes\tX values guaranteed valid only for Dev0/Ai0\t\t\t\nChannels\t2\t\t\t\nSamples\t100\t100\t\t\n\
         Date\t2016/08/11\t2016/08/11\t\t\nTime\t15:37:48.375\t15:37:48.375\t\t\nY_Unit_Label\tMPa\tmm\t\t\nX_Dimension\tTime\tTime\t\t\n\
         X0\t0.0000000000000000E+0\t0.0000000000000000E+0\t\t\nDelta_X\t0.001000\t0.001000\t\t\n***End_of_Header***\t\t\t\t\n\
         X_Value\tPressure A\tStroke\tComment\n{}",
        rows(|k| format!("{:.6}\t{:.6}\t{:.6}\t", k * 1e-3, 7.0 + k * 1e-3, 50.0 + k))
    );
    let log = log("notes.lvm", &text);
    assert!((interval(&log, 0) - 1e-3).abs() < 1e-9);
    assert_eq!((at(&log, "Pressure A", 0.1), at(&log, "Stroke", 0.1)), (7.1, 150.0));
}

/// `ladisk/lvm_read`, pull request 14, and files with `X_Columns No`: separated by commas, rows without a time, their
/// interval in the head.
#[test]
fn a_labview_measurement_without_times_is_read() {
    for (separator, comma) in [("\t", ","), (",", ".")] {
        let text = "LabVIEW Measurement\nSeparator\tTab\nX_Columns\tNo\n***End_of_Header***\n\nChannels\t2\nSamples\t100\t100\n\
                    Delta_X\t0.002000\t0.002000\n***End_of_Header***\nX_Value\tUntitled\tUntitled 1\tComment\n";
        let text = text.replace('\t', separator);
        let number = |v: f64| format!("{v:.6}").replace('.', comma);
        let text = text.replace("0.002000", &number(2e-3));
        let body = rows(|k| ["".into(), number(7.0 + k), number(50.0)].join(separator));
        let log = log("timeless.lvm", &(text + &body));
        assert!((interval(&log, 0) - 2e-3).abs() < 1e-9, "{comma}");
        assert_eq!(at(&log, "Untitled", 0.2), 107.0);
    }
}

/// `ngscopeclient/scopehal`, issues 408 and 429: a head of comments, a date with dots within its seconds, times from
/// before the trigger on.
#[test]
fn an_acquisition_of_digilent_waveforms_is_read() {
    let text = format!(
        "#Digilent WaveForms Oscilloscope Acquisition\n#Device Name: ADP3450\n#Serial Number: SN:210018B04985\n\
         #Date Time: 2021-04-14 13:10:34.255.812.740\n\nTime (s),Channel 1 (V)\n{}",
        rows(|k| format!("{:.12},{:.12}", (k - 100.0) * 1e-4, k * 1e-2))
    );
    let log = log("waveforms.csv", &text);
    assert_eq!(log.channels[0].unit.map(|u| u.name), Some("V"));
    assert!((log.channels[0].time[0] + 0.01).abs() < 1e-12);
    assert!((interval(&log, 0) - 1e-4).abs() < 1e-12);
}

/// `OPM/ResInsight`, issue 9611: three lines of head, of which units are the second; dates in a column of days.
#[test]
fn three_header_lines_with_units_in_the_second_are_read() {
    let text = format!(
        "TIME;PA;PB\nS;BARS;BARS\n;well-a;well-b\n{}",
        rows(|k| format!("{};{};{}", k * 0.01, 69.0 + k, 3.0))
    );
    let log = log("three.csv", &text);
    assert_eq!(log.headings(), "PA, PB");
    let signals = Signals::of(&log, &Mapping::guess(&log)).unwrap();
    assert!((signals.get(Signal::PressureA).unwrap().at(0.5).unwrap() - 119e5).abs() < 1.0);
}

/// `SBFspot/SBFspot`, issue 74: units stand above names, decimal commas, a German date and time.
#[test]
fn units_above_names_and_german_dates_are_read() {
    let text = format!(
        "Version CSV1|Tool SBFspot3.0.1 (Windows)|Linebreaks CR/LF|Delimiter semicolon|Decimalpoint comma|Precision 3\r\n\r\n\
         ;;;bar;mm\r\ndd/MM/yyyy HH:mm:ss;DeviceName;DeviceType;pressure_a;stroke\r\n{}",
        rows(|k| {
            let (p, x) = (format!("{:.3}", 69.0 + k * 0.01), format!("{:.3}", 50.0 + k));
            let (p, x) = (p.replace('.', ","), x.replace('.', ","));
            format!(
                "04.11.2017 10:{:02}:{:02},500;one;two;{p};{x}\r",
                (k as u32) / 60,
                (k as u32) % 60
            )
        })
    );
    let log = log("spot.csv", &text);
    assert_eq!(log.headings(), "pressure_a, stroke");
    assert!((interval(&log, 0) - 1.0).abs() < 1e-9);
    assert_eq!(log.channels[0].unit.map(|u| u.name), Some("bar"));
    assert_eq!(at(&log, "pressure_a", 100.0), 70.0);
    assert!(log.remarks.iter().any(|r| r.contains("DeviceName")), "{:?}", log.remarks);
}

/// TwinCAT Scope with its timelines exported for each sample time: several channels below one time column; and with
/// ticks of 100 ns.
#[test]
fn a_scope_export_with_several_sample_times_is_read() {
    let text = format!(
        "Name,GVL.fPressureA,GVL.fPressureB,Name,GVL.fStroke\n{}",
        rows(|k| format!("{k},{},{},{},{}", 69.0 + k, 3.0, k * 10.0, 50.0 + k))
    );
    let slow = log("groups.csv", &text);
    assert_eq!(slow.headings(), "GVL.fPressureA, GVL.fPressureB, GVL.fStroke");
    assert!((interval(&slow, 1) - 1e-3).abs() < 1e-9 && (interval(&slow, 2) - 1e-2).abs() < 1e-9);
    let text = format!(
        "Name\tYT Scope Project\nStarttime of export\t132961725843760000\nName\tGVL.fPressureA\nData-Type\tREAL64\nSampleTime[ms]\t1\n{}",
        rows(|k| format!("{}\t{}", 132_961_725_843_760_000_u64 + k as u64 * 10_000, 69.0 + k))
    );
    let ticks = log("ticks.csv", &text);
    assert!((interval(&ticks, 0) - 1e-3).abs() < 1e-5, "{}", interval(&ticks, 0));
    assert!(ticks.remarks.iter().any(|r| r.contains("100 ns")));
}
