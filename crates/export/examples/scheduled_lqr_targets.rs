//! A minute of readings and previews of the scheduled LQR on the virtual crane, given to every exported form of it: how far each
//! signal is off from Rust's, as a share of its size.
//!
//! ```sh
//! cargo run --release -p hydroboom-export --example scheduled_lqr_targets -- 60
//! ```
//!
//! FMUs are tried where `HYDROBOOM_FMPY` names a Python with FMPy. Structured Text is evaluated, about 0.5 ms a period.

#![expect(clippy::unwrap_used, reason = "an example that cannot set up has failed")]
#![allow(dead_code, reason = "the tests use more of what it shares with them")]

#[path = "../tests/evaluator/mod.rs"]
mod evaluator;
#[path = "../tests/recording/mod.rs"]
mod recording;

use hydroboom_export::c::Precision;
use hydroboom_export::closed_loop::Case;
use hydroboom_export::fmi::Version;
use recording::{
    From, Recording, compiled, cranes, in_c, in_fmu, in_structured_text, nothing, plain, recorded,
    shares_off, structured_text,
};

/// Payloads \[kg\] and positions \[m\] of the courses, one after the other until the time is over.
const COURSES: [(f64, f64); 6] =
    [(307.0, 0.2), (60.0, 0.06), (450.0, 0.35), (200.0, 0.2), (0.0, 0.35), (318.0, 0.06)];

fn main() {
    let seconds: usize = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(60);
    let python = std::env::var("HYDROBOOM_FMPY").ok();
    let folder = std::env::temp_dir().join(format!("hydroboom-targets-{}", std::process::id()));
    let [double, single] = ["double", "single"].map(|name| folder.join(name));
    std::fs::create_dir_all(&double).unwrap();
    std::fs::create_dir_all(&single).unwrap();
    let programs =
        [compiled(&double, Precision::Double, &[]), compiled(&single, Precision::Single, &[])];
    let mut left = 1000 * seconds;
    let mut rows: Vec<(String, Vec<(String, f64)>)> = Vec::new();
    let mut add = |target: &str, course: &str, found: &[Vec<f64>], recording: &Recording| {
        rows.push((format!("{target} | {course}"), shares_off(found, recording)));
        let (name, share) =
            rows.last().unwrap().1.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        println!("{target} | {course} | {share:.1e} ({name})");
    };
    println!("controller | course | largest difference, as a share of the signal's size");
    println!("---|---|---");
    for (payload, stroke) in COURSES {
        let case = Case { payload, stroke, ..plain(&cranes().0) };
        let (recording, outcome) = recorded(&case, 800, nothing, (From::PowerUp, left));
        let periods = recording.given.len();
        left -= periods;
        let time = 1e-3 * periods as f64;
        let course = format!(
            "{payload} kg from {} mm, {time:.1} s, status {}",
            1e3 * stroke,
            outcome.status
        );
        let found = in_c(&programs[0], &recording);
        let same = found.iter().flatten().zip(recording.wanted.iter().flatten());
        let same = same.filter(|(a, b)| a.to_bits() == b.to_bits()).count();
        println!(
            "C | {course} | {same} of {} numbers equal to the last bit",
            recording.wanted.len() * recording.wanted[0].len()
        );
        add("C", &course, &found, &recording);
        add("C, float", &course, &in_c(&programs[1], &recording), &recording);
        if let Some(python) = &python {
            for version in [Version::Two, Version::Three] {
                let found = in_fmu(python, version, &recording, &folder);
                add(&format!("FMI {version:?}"), &course, &found, &recording);
            }
        }
        let found = in_structured_text(&mut structured_text(), &recording);
        add("Structured Text", &course, &found, &recording);
        if left == 0 {
            break;
        }
    }
    let _ = std::fs::remove_dir_all(&folder);
}
