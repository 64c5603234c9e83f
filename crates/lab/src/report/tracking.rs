//! Figures 24 to 27: reference, positions and errors of the compared strategies.

use super::document::{document, figure};
use super::figure::{Axes, Figure, Series};
use crate::LabError;
use crate::motion_test::{Run, Sample, Strategy};
use maud::{Markup, html};

/// What the paper's figures hold against each other.
const COMPARED: [(&str, [Strategy; 2]); 3] = [
    (
        "Figure 25, test 1: open loop",
        [Strategy::VelocityFeedforward, Strategy::SimulationFeedforwardOpenLoop],
    ),
    (
        "Figure 26, test 2: open-loop simulation feedforward against the benchmark",
        [Strategy::SimulationFeedforwardOpenLoop, Strategy::BenchmarkClosedLoop],
    ),
    (
        "Figure 27, test 3: closed loop",
        [Strategy::BenchmarkClosedLoop, Strategy::SimulationFeedforwardClosedLoop],
    ),
];

/// A value of every sample over time \[s\].
pub fn over_time(run: &Run, value: impl Fn(&Sample) -> f64) -> Vec<(f64, f64)> {
    run.samples.iter().map(|s| (s.time, value(s))).collect()
}

/// The figures of one speed on the named plant; `reference` is any run with its reference.
///
/// # Errors
///
/// [`LabError`] when a figure cannot be drawn.
pub fn panels<'a>(
    find: impl Fn(Strategy) -> Option<&'a Run>,
    reference: Option<&'a Run>,
    plant: &str,
) -> Result<Markup, LabError> {
    let Some(reference) = reference else { return Ok(html! {}) };
    let speed = reference.speed * 1e3;
    let wanted = || over_time(reference, |s| s.reference.position * 1e3);
    let position = |series, y| Figure { x: "time [s]", y, series, axes: Axes::Linear }.svg();
    let motion = position(Series::list([("x_ref", wanted())]), "x_ref [mm]")?;
    let mut panels = Vec::new();
    for (title, strategies) in COMPARED {
        let mut positions = vec![Series { name: "reference", points: wanted(), colour: 0 }];
        let mut errors = Vec::new();
        for (index, run) in strategies.into_iter().filter_map(&find).enumerate() {
            let (name, colour) = (run.strategy.name(), index + 1);
            let points = over_time(run, |s| s.reading.stroke * 1e3);
            positions.push(Series { name, points, colour });
            let points = over_time(run, |s| s.error() * 1e3);
            errors.push(Series { name, points, colour });
        }
        panels.push((
            title,
            position(positions, "x_cyl [mm]")?,
            position(errors, "x - x_ref [mm]")?,
        ));
    }
    Ok(html! {
        (figure(&format!("Figure 24: reference at {speed:.0} mm/s."), &motion))
        @for (title, a, b) in &panels {
            h3 { (title) ", " (plant) ", " (format!("{speed:.0} mm/s")) }
            (figure("(a) Piston position.", a))
            (figure("(b) Tracking error.", b))
        }
    })
}

/// A page with the figures of every speed that was run.
///
/// # Errors
///
/// [`LabError`] when a figure cannot be drawn.
pub fn motion_page(crane: &str, plant: &str, runs: &[Run]) -> Result<String, LabError> {
    let mut speeds: Vec<f64> = runs.iter().map(|run| run.speed).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup();
    let mut sections = Vec::new();
    for speed in speeds {
        let of = |strategy: Strategy| {
            runs.iter().find(|run| run.strategy == strategy && run.speed == speed)
        };
        sections.push((speed * 1e3, panels(of, runs.iter().find(|r| r.speed == speed), plant)?));
    }
    let body = html! {
        p.soft { "Simulated: the model steers, " (plant) " follows." }
        @for (speed, figures) in &sections {
            h2 { (format!("{speed:.0} mm/s")) }
            (figures)
        }
    };
    Ok(document(&format!("Motion tests: {crane}"), &body))
}
