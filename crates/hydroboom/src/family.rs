//! `hydroboom motion --family`

use crate::output;
use hydroboom_description::Description;
use hydroboom_lab::family::{Row, Spread, VARIATIONS, family, rows};
use hydroboom_lab::motion_test::Strategy;
use hydroboom_lab::report;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Result};
use serde_json::json;
use std::path::Path;

/// Runs every strategy on `count` virtual cranes drawn around `nominal` with `seed`.
pub fn run(
    model: &Description,
    nominal: &Description,
    count: u64,
    seed: u64,
    out: Option<&Path>,
    as_json: bool,
) -> Result<()> {
    let bar = ProgressBar::new(count).with_style(
        ProgressStyle::with_template("{bar:40} {pos} of {len} cranes, {eta} left")
            .into_diagnostic()?,
    );
    let results = family(model, nominal, count, seed, &|done| bar.set_position(done));
    bar.finish_and_clear();
    let results = results.into_diagnostic()?;
    let rows = rows(model, &results);
    if let Some(folder) = out {
        std::fs::create_dir_all(folder).into_diagnostic()?;
        let page = report::family_page(&nominal.name, results.len(), seed, &rows);
        output::file(&folder.join("family.html"), page.as_bytes())?;
    }
    if as_json {
        let cranes: Vec<_> = results
            .iter()
            .map(|(member, outcomes)| json!({ "values": member.values, "outcomes": outcomes }))
            .collect();
        let names = Strategy::ALL.map(Strategy::name);
        return output::json(&json!({
            "family": rows, "seed": seed, "variations": VARIATIONS,
            "strategies": names, "cranes": cranes,
        }));
    }
    output::text(&format!(
        "{count} virtual cranes around \"{}\", seed {seed}; median (5 .. 95 %), worst\n{}",
        nominal.name,
        table(&rows)
    ))
}

fn table(rows: &[Row]) -> String {
    let spread =
        |s: &Spread| format!("{:.2} ({:.2} .. {:.2}), {:.2}", s.median, s.p5, s.p95, s.worst);
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|r| {
            let gain = &r.improvement_percent;
            let (better, share) = match r.strategy {
                Strategy::BenchmarkClosedLoop => ("-".into(), "-".into()),
                _ => (
                    format!("{:.0} ({:.0} .. {:.0})", gain.median, gain.p5, gain.p95),
                    format!("{:.0}", r.improved_percent),
                ),
            };
            vec![
                r.strategy.name().into(),
                format!("{:.0}", r.speed_mm_s),
                spread(&r.rms_mm),
                spread(&r.peak_mm),
                format!("{:.1}", r.unstable_percent),
                better,
                share,
            ]
        })
        .collect();
    let header = [
        "strategy",
        "mm/s",
        "RMS [mm]",
        "peak [mm]",
        "unstable [%]",
        "better than benchmark by [%]",
        "on [%] of cranes",
    ];
    output::table(&header, &cells)
}
