//! `hydroboom motion --family`

use crate::interruptible::{Interruptible, of_asked};
use crate::machine_choice::MachineChoice;
use crate::output;
use hydroboom_control::strategy::Strategy;
use hydroboom_lab::closed_loop::controller_choice::ControllerChoice;
use hydroboom_lab::closed_loop::metrics::TrackingError;
use hydroboom_lab::closed_loop::monte_carlo::{Row, family, members, rows, variations};
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::report;
use miette::{IntoDiagnostic, Result, bail};
use serde_json::json;
use std::path::Path;

/// Runs every contender along every course on `count` virtual cranes drawn around the chosen machine
/// with `seed`, widened or not.
pub fn run(
    choice: &MachineChoice,
    controllers: &[ControllerChoice],
    courses: &[CourseChoice],
    (count, seed, is_widened): (u64, u64, bool),
    out: Option<&Path>,
    as_json: bool,
) -> Result<()> {
    let (model, nominal) = (&choice.model, &choice.machine);
    let names = courses
        .iter()
        .map(|course| course.of(nominal).map(|course| course.name()))
        .collect::<Result<Vec<_>, _>>()
        .into_diagnostic()?;
    let cranes = members(nominal, (count, seed), is_widened).into_diagnostic()?;
    let work = Interruptible::new(count, "cranes")?;
    let go_on = |share: f64| work.done(share);
    let results = family(model, cranes, controllers, courses, &go_on);
    drop(work);
    let results = results.into_diagnostic()?;
    if results.is_empty() {
        bail!("none of {count} cranes had gone all the way when it was interrupted");
    }
    let rows = rows(controllers, &names, &results);
    if let Some(folder) = out {
        let page = report::family_page(&choice.name(), results.len(), seed, is_widened, &rows);
        output::page_in_folder(folder, "family", &page, Some(seed));
    }
    if as_json {
        let cranes: Vec<_> = results
            .iter()
            .map(|(member, outcomes)| json!({ "values": member.values, "outcomes": outcomes }))
            .collect();
        let strategies: Vec<_> = controllers.iter().map(|c| c.name()).collect();
        return output::json(&json!({
            "asked": count, "family": rows, "seed": seed, "variations": variations(is_widened),
            "strategies": strategies, "courses": names, "cranes": cranes,
            "plant": choice.json(),
        }));
    }
    output::text(&format!(
        "{} virtual cranes {}around \"{}\", seed {seed}; median (5 .. 95 %), worst\n{}\n\nover the benchmark's on the same crane\n{}",
        of_asked(results.len(), count as usize),
        if is_widened { "of a widened family " } else { "" },
        choice.name(),
        table(&rows),
        beside_the_benchmark(&rows)
    ))
}

fn table(rows: &[Row]) -> String {
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|r| {
            vec![
                r.controller.name().into(),
                r.course.clone(),
                r.rms_true_mm.text(3),
                r.rms_measured_mm.text(3),
                r.peak_true_mm.text(2),
                r.peak_measured_mm.text(2),
                r.motor_ripple_rpm.text(1),
                format!("{:.1}", r.unstable_percent),
            ]
        })
        .collect();
    let [rms_true, rms_measured, peak_true, peak_measured] = TrackingError::HEADS;
    output::table(
        &[
            "strategy",
            "course",
            rms_true,
            rms_measured,
            peak_true,
            peak_measured,
            "motor ripple at rest [rpm]",
            "unstable [%]",
        ],
        &cells,
    )
}

/// What each has over the benchmark on the same crane; the re-optimised benchmark only where it is one of them.
fn beside_the_benchmark(rows: &[Row]) -> String {
    let others: Vec<&Row> =
        rows.iter().filter(|r| r.controller != Strategy::BenchmarkClosedLoop.into()).collect();
    let mut header = vec![
        "strategy",
        "course",
        "RMS true",
        "RMS measured",
        "less RMS true on [%]",
        "largest motor speed",
        "motor energy",
    ];
    let mut cells: Vec<Vec<String>> = others
        .iter()
        .map(|r| {
            vec![
                r.controller.name().into(),
                r.course.clone(),
                r.rms_true_over_benchmark.text(3),
                r.rms_measured_over_benchmark.text(3),
                format!("{:.0}", r.better_percent),
                r.motor_speed_over_benchmark.text(3),
                r.energy_over_benchmark.text(3),
            ]
        })
        .collect();
    if others.iter().any(|r| r.rms_true_over_reoptimised_benchmark.is_some()) {
        header.push("RMS true over the re-optimised");
        for (row, cells) in others.iter().zip(&mut cells) {
            let over = row.rms_true_over_reoptimised_benchmark;
            cells.push(over.map_or_else(|| "-".into(), |s| s.text(2)));
        }
    }
    output::table(&header, &cells)
}
