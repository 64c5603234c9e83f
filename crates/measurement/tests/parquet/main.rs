//! Parquet files that pyarrow wrote (`make.py`); only with the feature `parquet`.

#![cfg(feature = "parquet")]

use hydroboom_measurement::{Measurement, TimeColumn, read};
use std::path::{Path, PathBuf};

fn recorded(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/parquet/files").join(name)
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
fn a_file_without_a_time_is_refused_and_one_may_be_named() {
    let said = read(&recorded("timeless.parquet"), None).unwrap_err().to_string();
    assert!(
        said.contains("no column is a timestamp or named as a time")
            && said.contains("numbers are: a"),
        "{said}"
    );
    let time = |column: &str| TimeColumn { column: Some(column.into()), ..TimeColumn::default() };
    let log = read(&recorded("seconds.parquet"), Some(&time("stroke"))).unwrap();
    assert_eq!(values(&log, "t")[5], 0.05);
    let said = read(&recorded("seconds.parquet"), Some(&time("nowhere"))).unwrap_err().to_string();
    assert!(said.contains("nowhere"), "{said}");
}
