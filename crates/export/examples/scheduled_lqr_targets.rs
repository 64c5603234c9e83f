//! Replays readings and previews of the scheduled LQR on the virtual crane in every exported form, and prints the
//! largest relative difference of each signal from Rust. Then runs the same courses in closed loop with Structured
//! Text in `LREAL` and in `REAL` as the controller. Prints the tracking error, and the consistency of the estimated
//! payload.
//!
//! ```sh
//! cargo run --release -p hydroboom-export --example scheduled_lqr_targets -- 60
//! ```
//!
//! FMUs are tried where `HYDROBOOM_FMPY` names a Python with FMPy. Structured Text is evaluated, about 0.5 ms a period.

#![expect(clippy::unwrap_used, reason = "an example that cannot set up has failed")]
#![allow(dead_code, reason = "the tests use more of what it shares with them")]

#[path = "../tests/integration/evaluator/mod.rs"]
mod evaluator;
#[path = "../tests/integration/recording/mod.rs"]
mod recording;

use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::supervision::frame::{FrameInput, FrameOutput, frame_phase};
use hydroboom_export::c::Precision;
use hydroboom_export::closed_loop::{Case, RustScheduledLqr, Target, TargetError, run};
use hydroboom_export::fmi::Version;
use recording::{
    From, OnPlc, Recording, compiled, cranes, in_c, in_fmu, in_structured_text, nothing, plain,
    recorded, shares_off,
};

/// Payloads \[kg\] and positions \[m\] of the courses, repeated until the duration is reached.
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
        let found = in_structured_text(Precision::Double, &recording);
        add("Structured Text", &course, &found, &recording);
        let found = in_structured_text(Precision::Single, &recording);
        add("Structured Text, REAL", &course, &found, &recording);
        if left == 0 {
            break;
        }
    }
    let _ = std::fs::remove_dir_all(&folder);
    in_closed_loop(seconds);
}

/// A controller that stores its last payload estimate.
struct Weighing {
    inner: Controller,
    /// Payload and its standard deviation \[kg\], while the controller has the load.
    payload: [f64; 2],
    /// Control periods so far.
    periods: usize,
}

/// Rust or Structured Text.
enum Controller {
    Rust(Box<RustScheduledLqr>),
    OnPlc(Box<OnPlc>),
}

impl Target for Weighing {
    fn name(&self) -> &'static str {
        match &self.inner {
            Controller::Rust(rust) => rust.name(),
            Controller::OnPlc(plc) => plc.name(),
        }
    }

    fn look_ahead(&mut self, at: &dyn Fn(f64) -> SetPoint<f64>) {
        match &mut self.inner {
            Controller::Rust(rust) => rust.look_ahead(at),
            Controller::OnPlc(plc) => plc.look_ahead(at),
        }
    }

    fn period(
        &mut self,
        input: &FrameInput<f64>,
        gain: f64,
    ) -> Result<FrameOutput<f64>, TargetError> {
        let (frame, payload) = match &mut self.inner {
            Controller::Rust(rust) => {
                let output = rust.advance(input);
                (output.frame, [output.estimator.payload, output.estimator.payload_deviation])
            }
            Controller::OnPlc(plc) => (plc.period(input, gain)?, plc.payload()),
        };
        self.periods += 1;
        if frame.status == frame_phase::CONTROLLING {
            self.payload = payload;
        }
        Ok(frame)
    }
}

/// Runs the courses with Rust and with Structured Text as the controller.
fn in_closed_loop(seconds: usize) {
    let (model, machine) = cranes();
    let mut left = 1000 * seconds;
    println!(
        "\ncontroller | course | status | RMS error [mm] | largest error [mm] | \
         payload less the true one [kg] | its standard deviation [kg]"
    );
    println!("---|---|---|---|---|---|---");
    for (payload, stroke) in COURSES {
        let case = Case { payload, stroke, ..plain(&model) };
        let rust = || Controller::Rust(Box::new(RustScheduledLqr::new(&model, 800).unwrap()));
        let on_plc = |precision| Controller::OnPlc(Box::new(OnPlc::new(precision, 800)));
        let controllers = [
            ("Rust", rust()),
            ("LREAL", on_plc(Precision::Double)),
            ("REAL", on_plc(Precision::Single)),
        ];
        let mut periods = 0;
        for (name, inner) in controllers {
            let mut target = Weighing { inner, payload: [f64::NAN; 2], periods: 0 };
            let outcome = run(&model, &machine, &case, &mut target).unwrap();
            let [estimate, deviation] = target.payload;
            println!(
                "{name} | {payload} kg from {} mm | {} | {:.3} | {:.3} | {:.2} | {deviation:.2}",
                1e3 * stroke,
                outcome.status,
                1e3 * outcome.rms,
                1e3 * outcome.error,
                estimate - payload,
            );
            periods = target.periods;
        }
        left = left.saturating_sub(periods);
        if left == 0 {
            break;
        }
    }
}
