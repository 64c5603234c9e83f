//! Coverage of the uncertainty bounds of log estimates, on logs of virtual cranes whose parameters the
//! filter does not know. The logs are read as `hydroboom estimate` reads them.
//!
//! For courses without a load change.
//!
//! ```sh
//! # seed, first crane, crane after the last
//! cargo run --release -p hydroboom-lab --example log_coverage -- 2027 0 100
//! cargo run --release -p hydroboom-lab --example log_coverage -- 2027 0 100 reversal scheduled-lqr
//! ```

#![expect(clippy::unwrap_used, reason = "an example that cannot set up has failed")]

use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::closed_loop::monte_carlo::member;
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::log_estimation::{ESTIMATES, LogEstimate, estimate};
use hydroboom_lab::virtual_run::{Contents, LogOrder, Task, virtual_run};
use hydroboom_measurement::{Mapping, Measurement, Signals, read};

/// Initial time of a log that is left out \[s\], and spacing of the evaluated instants \[s\].
const SETTLED: f64 = 0.5;
const SPACING: f64 = 0.25;
/// Quantities whose true value is in the log.
const COMPARED: [&str; 6] = [
    "piston_position_mm",
    "piston_velocity_mm_s",
    "load_pressure_bar",
    "payload_kg",
    "tip_x_mm",
    "tip_y_mm",
];

/// Errors of one quantity over all cranes.
#[derive(Clone, Copy, Default)]
struct Errors {
    count: f64,
    within: f64,
    squares: f64,
    deviations: f64,
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [seed, from, to, more @ ..] = &arguments[..] else {
        eprintln!("log_coverage SEED FROM TO [COURSE [STRATEGY]]");
        std::process::exit(2);
    };
    let number = |text: &str| -> u64 { text.parse().unwrap() };
    let (seed, from, to) = (number(seed), number(from), number(to));
    let model = Description::uia_single_boom().unwrap();
    let nominal = Description::uia_virtual().unwrap();
    let course = match more.first().map_or("fast", String::as_str) {
        "fast" => CourseChoice::Motion(model.numbers.fast),
        "slow" => CourseChoice::Motion(model.numbers.slow),
        other => CourseChoice::Scenario(other.into()),
    };
    let strategy = more.get(1).map_or("benchmark-closed-loop", String::as_str);
    let strategy = Strategy::ALL.into_iter().find(|s| s.name() == strategy).unwrap();
    // errors of consistent logs, and of the others
    let mut errors = [[Errors::default(); COMPARED.len()]; 2];
    let (mut consistent, mut refused, mut off) = (0, 0, Vec::new());
    for k in from..to {
        let crane = member(&nominal, seed, k).unwrap().crane;
        let log = logged(&model, &crane, &course, strategy);
        let signals = Signals::of(&log, &Mapping::default().completed(&log).unwrap()).unwrap();
        let found = match estimate(&model, &signals, (None, None)) {
            Ok(found) => found,
            Err(error) => {
                refused += 1;
                eprintln!("crane {k}: {error}");
                continue;
            }
        };
        let is_consistent = found.verdict.is_consistent == Some(true);
        consistent += u32::from(is_consistent);
        off.extend(
            found.verdict.findings.iter().map(|f| format!("crane {k}, {}: {}", f.kind, f.text)),
        );
        compare(&mut errors[usize::from(!is_consistent)], &found, &log, &crane);
        eprintln!("crane {k}: {}", found.verdict.sentence());
    }
    println!("{consistent} of {} logs consistent, {refused} refused", to - from);
    for (which, errors) in ["consistent", "not consistent"].iter().zip(errors) {
        println!(
            "\n| logs that are {which} | instants | within 2 sigma [%] | RMS error | mean sigma |\n|---|---|---|---|---|"
        );
        for (name, e) in COMPARED.iter().zip(errors) {
            println!(
                "| {name} | {} | {:.1} | {:.3} | {:.3} |",
                e.count,
                100.0 * e.within / e.count,
                (e.squares / e.count).sqrt(),
                e.deviations / e.count
            );
        }
    }
    println!("{}", off.join("\n"));
}

/// Log of a crane with its true values.
fn logged(
    model: &Description,
    crane: &Description,
    course: &CourseChoice,
    strategy: Strategy,
) -> Measurement {
    let path = std::env::temp_dir().join(format!("log-coverage-{}.csv", std::process::id()));
    let course = course.of(crane).unwrap();
    let order =
        LogOrder { path: &path, contents: Contents::Truth, estimates: false, interval: 1e-3 };
    let task = Task::Course(course.as_ref(), strategy);
    // a run that is stopped by a fault also leaves a log
    let _ = virtual_run(model, crane, &task, &[order], |_| {});
    let log = read(&path, None).unwrap();
    std::fs::remove_file(&path).unwrap();
    log
}

/// Adds the errors of one log. An estimate refers to the time of the measurement, which the fieldbus
/// delays.
fn compare(
    errors: &mut [Errors; COMPARED.len()],
    found: &LogEstimate,
    log: &Measurement,
    crane: &Description,
) {
    let channel = |name: &str| &log.channel(name).unwrap().values;
    let time = &log.channel("true_stroke_mm").unwrap().time;
    let (a, b) = (channel("true_pressure_a_bar"), channel("true_pressure_b_bar"));
    let (x, v) = (channel("true_stroke_mm"), channel("true_velocity_mm_s"));
    let (tip_x, tip_y) = (channel("true_tip_x_mm"), channel("true_tip_y_mm"));
    let ratio = crane.cylinder().area_ratio();
    let delay = crane.numbers.fieldbus_delay * crane.numbers.control_period;
    let mut next = SETTLED;
    for row in &found.rows {
        if row.time < next {
            continue;
        }
        next = row.time + SPACING;
        let k = time.partition_point(|t| *t < row.time - delay - 1e-6).min(time.len() - 1);
        let truth = [x[k], v[k], a[k] - ratio * b[k], crane.numbers.payload, tip_x[k], tip_y[k]];
        for ((name, truth), e) in COMPARED.iter().zip(truth).zip(errors.iter_mut()) {
            let of = ESTIMATES.iter().position(|(known, _)| known == name).unwrap();
            let (error, deviation) = (row.estimate[of] - truth, row.deviation[of]);
            e.count += 1.0;
            e.within += f64::from(u8::from(error.abs() <= 2.0 * deviation));
            e.squares += error * error;
            e.deviations += deviation;
        }
    }
}
