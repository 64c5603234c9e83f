//! Parquet files that pyarrow wrote (`make.py`); only with the feature `parquet`.

use crate::temporary::folder;
use hydroboom_measurement::{Measurement, TimeColumn, Unit, read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn recorded(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/integration/parquet/files").join(name)
}

fn values<'a>(log: &'a Measurement, name: &str) -> &'a [f64] {
    &log.channel(name).unwrap_or_else(|| panic!("no {name} in {}", log.headings())).values
}

#[test]
fn columns_of_numbers_are_read_with_their_time() {
    for name in ["stamped", "seconds", "milliseconds"] {
        let log = read(&recorded(&format!("{name}.parquet")), None).unwrap();
        let stroke = log.channel("stroke_mm").unwrap();
        assert_eq!(stroke.values.len(), 60, "{name}");
        for k in 0..60 {
            assert!((stroke.time[k] - k as f64 * 0.01).abs() < 1e-12, "{name}: {}", stroke.time[k]);
            assert_eq!(stroke.values[k], 50.0 + k as f64);
            assert_eq!(values(&log, "motor_speed_rpm")[k], k as f64 - 30.0);
            assert_eq!(values(&log, "valve")[k], f64::from(u8::from(k > 20)));
            assert_eq!(values(&log, "cylinder.oil_bar")[k], 3.0 + k as f64);
            let pressure = values(&log, "p_A [bar]")[k];
            match k % 7 {
                3 => assert!(pressure.is_nan(), "{name}: {pressure}"),
                _ => assert!((pressure - 68.5 - 0.1 * k as f64).abs() < 1e-12),
            }
        }
        assert_eq!(log.channel("p_A [bar]").unwrap().unit.map(|u| u.name), Some("bar"));
        let left_out = log
            .remarks
            .iter()
            .any(|r| r.contains("2 columns are no numbers") && r.contains("state"));
        assert!(left_out, "{name}: {:?}", log.remarks);
    }
}

#[test]
fn a_file_without_a_time_is_refused_unless_one_is_named() {
    let message = read(&recorded("timeless.parquet"), None).unwrap_err().to_string();
    assert!(
        message.contains("no column is a timestamp, a time of the day or named as a time")
            && message.contains("numbers are: a"),
        "{message}"
    );
    let time = |column: &str| TimeColumn { column: Some(column.into()), ..TimeColumn::default() };
    let message =
        read(&recorded("seconds.parquet"), Some(&time("stroke"))).unwrap_err().to_string();
    assert!(message.contains("mm is a length, not a time"), "{message}");
    let stroke = TimeColumn { unit: Unit::from_text("s").ok(), ..time("stroke") };
    let log = read(&recorded("seconds.parquet"), Some(&stroke)).unwrap();
    assert_eq!(values(&log, "t")[5], 0.05);
    let message =
        read(&recorded("seconds.parquet"), Some(&time("nowhere"))).unwrap_err().to_string();
    assert!(message.contains("nowhere"), "{message}");
}

/// A file of one group of rows, written here; a cell may be missing where its column is optional.
fn written(name: &str, schema: &str, columns: &[Vec<Option<i64>>]) -> PathBuf {
    use parquet::data_type::{Int32Type, Int64Type};
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    let path = folder(module_path!()).join(name);
    let schema = Arc::new(parquet::schema::parser::parse_message_type(schema).unwrap());
    let file = std::fs::File::create(&path).unwrap();
    let properties = Arc::new(WriterProperties::builder().build());
    let mut file = SerializedFileWriter::new(file, Arc::clone(&schema), properties).unwrap();
    let mut group = file.next_row_group().unwrap();
    for (field, cells) in schema.get_fields().iter().zip(columns) {
        let there: Vec<i64> = cells.iter().flatten().copied().collect();
        let levels: Vec<i16> = cells.iter().map(|c| i16::from(c.is_some())).collect();
        let levels = field.is_optional().then_some(levels.as_slice());
        let mut column = group.next_column().unwrap().unwrap();
        match field.get_physical_type() {
            parquet::basic::Type::INT32 => {
                let there: Vec<i32> = there.iter().map(|v| *v as i32).collect();
                column.typed::<Int32Type>().write_batch(&there, levels, None).unwrap();
            }
            _ => {
                column.typed::<Int64Type>().write_batch(&there, levels, None).unwrap();
            }
        }
        column.close().unwrap();
    }
    group.close().unwrap();
    file.close().unwrap();
    path
}

fn all(of: impl Fn(i64) -> i64) -> Vec<Option<i64>> {
    (0..20).map(|k| Some(of(k))).collect()
}

#[test]
fn unsigned_integers_are_not_negative() {
    let path = written(
        "unsigned.parquet",
        "message log { required int64 time_ms; required int32 a (INTEGER(32,false)); required int64 b (UINT_64); required int32 c (INTEGER(32,true)); }",
        &[all(|k| k * 10), all(|k| 0xffff_ff00 + k), all(|k| -1 - k), all(|k| -k)],
    );
    let log = read(&path, None).unwrap();
    assert_eq!(values(&log, "a")[3], f64::from(0xffff_ff03_u32));
    assert_eq!(values(&log, "b")[0], u64::MAX as f64);
    assert_eq!(values(&log, "c")[3], -3.0);
}

#[test]
fn a_time_of_day_has_the_unit_stated_in_the_file() {
    // by their steps, 1 would be a second and 400 milliseconds
    for (kind, step, span) in
        [("int32 clock (TIME_MILLIS)", 1, 0.019), ("int64 clock (TIME(MICROS,true))", 400, 0.0076)]
    {
        let schema = format!("message log {{ required int32 stroke_mm; required {kind}; }}");
        let columns = [all(|k| k), all(|k| 36_000_000 + k * step)];
        let log = read(&written("clock.parquet", &schema, &columns), None).unwrap();
        let time = &log.channel("stroke_mm").unwrap().time;
        assert!((time[19] - time[0] - span).abs() < 1e-9, "{kind}: {time:?}");
        assert!(!log.remarks.iter().any(|r| r.contains("no unit")), "{:?}", log.remarks);
    }
}

#[test]
fn rows_without_a_time_are_counted() {
    let mut times = all(|k| k * 10);
    (times[4], times[9]) = (None, None);
    let schema = "message log { optional int64 time_ms; required int32 stroke_mm; }";
    let log = read(&written("timeless_rows.parquet", schema, &[times, all(|k| k)]), None).unwrap();
    assert_eq!(values(&log, "stroke_mm").len(), 18);
    assert!(
        log.remarks.iter().any(|r| r.contains("2 rows have no time (time_ms)")),
        "{:?}",
        log.remarks
    );
}
