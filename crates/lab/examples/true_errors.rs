//! True and measured tracking errors of each crane as CSV: `true_errors [--widened] CONTROLLERS COURSES
//! SEED FROM TO [KEY=VALUE ...]`.
//!
//! Controllers are names of strategies or baselines; courses are `slow`, `fast`, or names of scenarios;
//! both are separated by commas. Overrides change the controllers' model. With `--widened` the cranes also
//! vary in the parameters of `monte_carlo::WIDENED`. The columns are those of
//! `docs/notebook/2026-11-28-scheduled-lqr.csv`, followed by the motor's ripple at rest and its slew.

#![expect(clippy::unwrap_used, reason = "an experiment that cannot go on stops")]

use hydroboom_description::Description;
use hydroboom_lab::closed_loop::controller_choice::ControllerChoice;
use hydroboom_lab::closed_loop::metrics::Metrics;
use hydroboom_lab::closed_loop::monte_carlo::{Member, member, widened};
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::closed_loop::simulation::{Case, WIDTH, simulate_side_by_side};
use hydroboom_lab::closed_loop::sustained_oscillation::has_sustained_oscillation;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Numbered cranes that are simulated together.
type Group<'a> = &'a [(u64, Member)];

fn main() {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let is_widened = arguments.first().is_some_and(|argument| argument == "--widened");
    if is_widened {
        arguments.remove(0);
    }
    let [controllers, courses, seed, from, to, overrides @ ..] = &arguments[..] else {
        eprintln!("true_errors [--widened] CONTROLLERS COURSES SEED FROM TO [KEY=VALUE ...]");
        std::process::exit(2);
    };
    let mut model = Description::uia_single_boom().unwrap();
    for assignment in overrides {
        model.set(assignment).unwrap_or_else(|error| refuse(&error));
    }
    let nominal = Description::uia_virtual().unwrap();
    let all = ControllerChoice::all(&model).unwrap_or_else(|error| refuse(&error));
    let controllers: Vec<ControllerChoice> = controllers
        .split(',')
        .map(|name| {
            let names: Vec<_> = all.iter().map(|choice| choice.name()).collect();
            let found = all.iter().find(|choice| choice.name() == name);
            *found.unwrap_or_else(|| {
                refuse(&format!("no controller \"{name}\"; there are {}", names.join(", ")))
            })
        })
        .collect();
    let courses: Vec<CourseChoice> = courses
        .split(',')
        .map(|name| match name {
            "slow" => CourseChoice::Motion(model.numbers.slow),
            "fast" => CourseChoice::Motion(model.numbers.fast),
            other => CourseChoice::Scenario(other.into()),
        })
        .collect();
    for course in &courses {
        course.of(&nominal).unwrap_or_else(|error| refuse(&error));
    }
    let number = |name: &str, text: &str| -> u64 {
        text.parse().unwrap_or_else(|_| refuse(&format!("{name} is a whole number, not {text}")))
    };
    let seed = number("SEED", seed);
    let numbers: Vec<u64> = (number("FROM", from)..number("TO", to)).collect();
    if numbers.is_empty() {
        refuse(&format!("no cranes from {from} to below {to}"));
    }
    let draw = if is_widened { widened } else { member };
    let cranes: Vec<(u64, Member)> =
        numbers.iter().map(|number| (*number, draw(&nominal, seed, *number).unwrap())).collect();
    let mut jobs: Vec<(Group<'_>, &CourseChoice, ControllerChoice)> = Vec::new();
    for group in cranes.chunks(WIDTH) {
        for course in &courses {
            jobs.extend(controllers.iter().map(|controller| (group, course, *controller)));
        }
    }
    println!(
        "course,seed,crane,controller,true_rms_mm,measured_rms_mm,true_peak_mm,sustained_oscillation,motor_speed_rpm,energy_kj,motor_ripple_rpm,motor_slew_rpm_per_s"
    );
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some((group, course, controller)) =
                    jobs.get(next.fetch_add(1, Ordering::Relaxed))
                {
                    run(&model, seed, group, course, *controller);
                }
            });
        }
    });
}

/// Ends the program with an error in the arguments.
fn refuse(what: &dyn std::fmt::Display) -> ! {
    eprintln!("true_errors: {what}");
    std::process::exit(2)
}

/// Simulates up to four cranes together; the last one fills the remaining places.
fn run(
    model: &Description,
    seed: u64,
    group: Group<'_>,
    course: &CourseChoice,
    controller: ControllerChoice,
) {
    let cranes: [&Description; WIDTH] =
        std::array::from_fn(|lane| &group[lane.min(group.len() - 1)].1.crane);
    let courses = cranes.map(|crane| course.of(crane).unwrap());
    let cases: [Case<'_>; WIDTH] = std::array::from_fn(|lane| Case {
        crane: cranes[lane],
        controller,
        course: courses[lane].as_ref(),
    });
    let mut metrics = [Metrics::new(); WIDTH];
    let ends = simulate_side_by_side(model, &cases, |lane, sample| metrics[lane].add(sample));
    for (lane, (crane, _)) in group.iter().enumerate() {
        let Case { course, .. } = cases[lane];
        let m = &metrics[lane];
        let effort = m.effort();
        let ended = ends[lane].is_ok();
        let oscillates =
            !ended || has_sustained_oscillation(model, cases[lane].crane, controller, course, m);
        let error = |value: f64| if ended { format!("{:.5}", value * 1e3) } else { String::new() };
        println!(
            "{},{seed},{crane},{},{},{},{},{oscillates},{:.2},{:.4},{:.3},{:.1}",
            course.name(),
            controller.name(),
            error(m.true_rms()),
            error(m.rms()),
            error(m.true_peak()),
            effort.motor_speed_rpm,
            effort.energy_kj,
            effort.motor_ripple_rpm,
            effort.motor_slew_rpm_per_s,
        );
    }
}
