//! Tracking errors of the strategies on each plant.

use super::optional;
use crate::LabError;
use crate::motion_test::{Row, instability_remarks, remark_on_mark};
use crate::report::tracking;
use crate::study::{NOMINAL, OFF, Study, VIRTUAL};
use hydroboom_control::strategy::Strategy;
use maud::{Markup, html};

/// RMS and peak error of a row.
type RmsAndPeak = [fn(&Row) -> f64; 2];

/// Columns of a plant: its name, whether errors are true or measured, and RMS and peak.
type Columns<'a> = (&'a str, &'static str, RmsAndPeak);

pub(super) fn tracking(study: &Study) -> Result<Markup, LabError> {
    let speeds: Vec<f64> = {
        let mut speeds: Vec<f64> = study.motion.iter().map(|row| row.speed_mm_s).collect();
        speeds.sort_by(f64::total_cmp);
        speeds.dedup();
        speeds
    };
    let plants: Vec<&str> = [NOMINAL, OFF, VIRTUAL]
        .into_iter()
        .filter(|plant| study.motion.iter().any(|row| row.plant == *plant))
        .collect();
    let fast = speeds.last().copied().unwrap_or_default();
    let last = plants.last().copied().unwrap_or(NOMINAL);
    let drawn = |strategy| study.run(last, strategy, fast);
    let title = match last {
        VIRTUAL => "virtual crane".into(),
        other => format!("{other} plant"),
    };
    let columns = columns(study, &plants);
    let beside_paper = study.is_papers_crane;
    let panels = tracking::panels(drawn, drawn(Strategy::VelocityFeedforward), &title)?;
    Ok(html! {
        h2 { @if beside_paper { "Tables 7 to 9: t" } @else { "T" } "racking errors" }
        p.soft {
            "RMS over the whole motion, the rest before and after included" @if beside_paper {
                " (2 s; on the virtual crane calibrated, for the paper does not state its window)"
            }
            ", and the error of largest magnitude, x - x_ref. "
            @if beside_paper { "The paper's values were measured on the real crane. " }
            "Measured errors have the sensor's noise and the fieldbus's delay in them, "
            "true ones are the piston's. Where there is one column for a plant, its sensors are ideal, and both are the same."
        }
        @for speed in &speeds {
            (table(study, *speed, &columns))
        }
        @if let Some(remark) = remark_on_mark(&study.motion) { p.soft { (remark) } }
        @for remark in instability_remarks(&study.motion).iter().chain(&study.unstable_loops()) {
            p { strong { (remark) } "." }
        }
        @if let Some(remark) = &study.remark_on_gains { p { strong { (remark) } "." } }
        p {
            "On the nominal plant the open-loop simulation feedforward repeats the benchmark's closed loop, "
            "because plant and simulation are the same: that column says nothing about a real crane. "
            "On the others nothing corrects the model's error of their pump."
        }
        (panels)
    })
}

/// Columns of each plant; measured errors are left out where they equal the true ones.
fn columns<'a>(study: &Study, plants: &[&'a str]) -> Vec<Columns<'a>> {
    let mut columns: Vec<Columns<'a>> = Vec::new();
    for plant in plants {
        columns.push((*plant, "true", [|r| r.error.rms_true_mm, |r| r.error.peak_true_mm]));
        let mut rows = study.motion.iter().filter(|row| row.plant == *plant);
        if !rows.all(|row| row.stopped.is_some() || row.error.is_measured_truly()) {
            let measured: RmsAndPeak = [|r| r.error.rms_measured_mm, |r| r.error.peak_measured_mm];
            columns.push((*plant, "measured", measured));
        }
    }
    columns
}

/// Errors of all strategies at a speed \[mm/s\].
fn table(study: &Study, speed: f64, columns: &[Columns<'_>]) -> Markup {
    let beside_paper = study.is_papers_crane;
    let find = |plant: &str, strategy: Strategy| {
        study
            .motion
            .iter()
            .find(|r| r.plant == plant && r.strategy == strategy && r.speed_mm_s == speed)
    };
    let cell = |plant: &str, strategy, of: fn(&Row) -> f64| match find(plant, strategy) {
        Some(row) => tracking::here(row, of(row)),
        None => html! { td { "-" } },
    };
    let paper =
        |strategy, of: fn(&Row) -> Option<f64>| optional(find(NOMINAL, strategy).and_then(of), 2);
    html! {
        h3 { (format!("{speed:.0} mm/s")) }
        div.wide { table {
            thead { tr {
                th { "strategy" }
                @if beside_paper { th { "RMS paper [mm]" } }
                @for (plant, name, _) in columns { th { (format!("RMS {name} [mm], {plant}")) } }
                @if beside_paper { th { "peak paper [mm]" } }
                @for (plant, name, _) in columns { th { (format!("peak {name} [mm], {plant}")) } }
            } }
            tbody { @for strategy in Strategy::ALL { tr {
                td { (strategy.name()) }
                @if beside_paper { td { (paper(strategy, |r| r.paper_rms_mm)) } }
                @for (plant, _, [rms, _]) in columns { (cell(plant, strategy, *rms)) }
                @if beside_paper { td { (paper(strategy, |r| r.paper_peak_mm)) } }
                @for (plant, _, [_, peak]) in columns { (cell(plant, strategy, *peak)) }
            } } }
        } }
    }
}
