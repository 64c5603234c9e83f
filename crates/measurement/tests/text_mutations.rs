//! Files that were damaged at random: read or refused, without a panic, within 10 s each and 500 MB in all.
//!
//! 300 of each kind; `HYDROBOOM_MUTATIONS` sets another number.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

mod damage;

use damage::{Chance, damaged, each};
use hydroboom_measurement::{Mapping, Signals, TimeColumn, read};
use std::path::PathBuf;

fn tables() -> [Vec<u8>; 4] {
    let row = |k: u32, sign: &str, comma: bool| {
        let t = f64::from(k) * 0.01;
        let numbers = [t, 50.0 + 20.0 * t, 69.5 - t, 3.0 - 0.125 * t, 400.0 * t];
        let row = numbers.map(|v| v.to_string()).join(sign);
        if comma { row.replace('.', ",") } else { row }
    };
    let rows = |sign: &str, comma: bool| -> String {
        (0..300).map(|k| row(k, sign, comma) + "\n").collect()
    };
    let plain = format!("time_s,stroke_mm,p_A [bar],p_B (MPa),n / rpm\n{}", rows(",", false));
    let german = format!("# von Hand\nZeit;Weg;p_A;p_B;n\ns;mm;bar;bar;1/min\n{}", rows(";", true));
    let scope = format!(
        "Name\tScope Project\nStarttime of export\t132961725843760000\n\nName\tGVL.fStroke\tGVL.fPa\tGVL.fPb\tGVL.fSpeed\n\
         SampleTime[ms]\t10\t10\t10\t10\nUnit\tmm (Length)\tbar\tbar\trpm\n\n{}EOF\n",
        rows("\t", false)
    );
    let wide: Vec<u8> = plain.encode_utf16().flat_map(u16::to_le_bytes).collect();
    [plain.into_bytes(), german.into_bytes(), scope.into_bytes(), wide]
}

#[test]
fn damaged_tables_are_read_or_refused() {
    each("CSV", |seed| {
        let mut chance = Chance::new(seed);
        let whole = tables();
        let bytes = damaged(&whole[seed as usize % whole.len()], &mut chance);
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("damaged.csv");
        std::fs::write(&path, bytes).unwrap();
        let counted = TimeColumn { sample_time: Some(0.01), ..TimeColumn::default() };
        for time in [None, Some(&counted)] {
            let Ok(log) = read(&path, time) else { continue };
            for channel in &log.channels {
                assert_eq!(channel.time.len(), channel.values.len(), "seed {seed}");
                assert!(
                    channel.time.windows(2).all(|w| w[0] < w[1]),
                    "seed {seed}: time goes back"
                );
                assert!(channel.breaks.iter().all(|b| *b < channel.time.len()), "seed {seed}");
            }
            if let Ok(mapping) = Mapping::default().completed(&log) {
                let signals = Signals::of(&log, &mapping).unwrap();
                assert!(mapping.suspicions(&log, 0.5, 50.0).len() < 100);
                let _ = (signals, mapping.assumptions(&log));
            }
        }
    });
}

#[test]
fn damaged_mappings_are_read_or_refused_with_a_short_message() {
    each("TOML", |seed| {
        let whole = "[log]\nsample_time_ms = 10\npressure_b = \"p#2\"\n[log.time]\ncolumn = \"t\"\nunit = \"ms\"\nscale = 2.0\noffset = 1\n\
                     [log.stroke]\ncolumn = \"x\"\nunit = \"mm\"\nsign = -1\noffset = 250.0\nscale = 0.1\ndelay_ms = 4.0\ndrift_ppm = 200\nfilter_ms = 20.0\n";
        let bytes = damaged(whole.as_bytes(), &mut Chance::new(seed));
        let text = String::from_utf8_lossy(&bytes);
        match Mapping::parse("damaged.toml", &text) {
            // an accepted mapping is accepted again after writing
            Ok(mapping) => {
                let again = Mapping::parse("again.toml", &mapping.to_toml());
                let again = again.unwrap_or_else(|e| panic!("seed {seed}: {e}"));
                assert_eq!(again.entries.len(), mapping.entries.len(), "seed {seed}");
            }
            Err(error) => assert!(error.to_string().len() < 2000, "seed {seed}: {error}"),
        }
    });
}

#[test]
fn a_mapping_of_brackets_is_refused_with_a_short_message() {
    for text in [
        "[log]\na = ".to_string() + &"[".repeat(200_000),
        "[".repeat(200_000),
        "\"".repeat(200_001),
    ] {
        let error = Mapping::parse("brackets.toml", &text).unwrap_err().to_string();
        assert!(error.len() < 500, "{} bytes", error.len());
    }
}
