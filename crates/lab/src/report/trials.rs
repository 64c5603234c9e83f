//! Page of trials: bars of each controller's error, and a table.

use super::document::{Page, document};
use super::drawing_data::{Drawing, figure};
use super::palette::colour_of_controller;
use super::{Bar, Bars};
use crate::closed_loop::controller_choice::ControllerChoice;
use crate::closed_loop::metrics::{MOTOR_ENERGY, TrackingError};
use crate::closed_loop::robustness::Outcome;
use maud::{Markup, html};

/// Page of robustness or input-shaping trials on a crane: bars of each controller's error, and a table. `remark` is a
/// remark on the crane.
pub fn trials_page(crane: &str, remark: Option<&str>, outcomes: &[Outcome]) -> Page {
    let mut names: Vec<&str> = Vec::new();
    for outcome in outcomes {
        if !names.contains(&outcome.trial.as_str()) {
            names.push(&outcome.trial);
        }
    }
    let body = html! {
        p.soft {
            "On \"" (crane) "\". The controllers and the simulation beside the machine know the published model only. "
            "Nothing here is a measurement."
            @if let Some(remark) = remark { " " strong { (remark) } "." }
        }
        h2 { "All trials" }
        (overview(&names, outcomes))
        p.soft { (MOTOR_ENERGY) }
        @for name in &names {
            @let of: Vec<&Outcome> = outcomes.iter().filter(|o| o.trial == *name).collect();
            h2 { (name) }
            @for (axis, caption, value) in FIGURES {
                @if let Some(svg) = bars(axis, value, &of) { (figure(caption, &svg)) }
            }
            (table(&of))
        }
    };
    document(&format!("Trials: {crane}"), &body)
}

/// Error and vibration of all trials in one table, a column per controller.
fn overview(trials: &[&str], outcomes: &[Outcome]) -> Markup {
    let mut controllers: Vec<ControllerChoice> = Vec::new();
    for outcome in outcomes {
        if !controllers.contains(&outcome.controller) {
            controllers.push(outcome.controller);
        }
    }
    let cell = |trial: &str, controller: ControllerChoice, value: Drawn| {
        let of = outcomes.iter().find(|o| o.trial == trial && o.controller == controller);
        match of {
            Some(o) if !o.stable => html! { td.unstable { (o.verdict()) } },
            of => html! { td { (millimetres(of.and_then(value))) } },
        }
    };
    html! {
        @for (title, _, value) in FIGURES {
            h3 { (title) }
            div.wide { table {
                thead { tr { th { "trial" } @for c in &controllers { th { (c.name()) } } } }
                tbody { @for trial in trials {
                    tr { td { (trial) } @for c in &controllers { (cell(trial, *c, value)) } }
                } }
            } }
        }
    }
}

/// Quantity of an outcome that may be drawn.
type Drawn = fn(&Outcome) -> Option<f64>;

/// Error; none if the loop oscillates or the run could not be finished.
fn error(outcome: &Outcome, mm: f64) -> Option<f64> {
    (outcome.stable && mm.is_finite()).then_some(mm)
}

/// Figures of each trial: axis, caption, quantity.
const FIGURES: [(&str, &str, Drawn); 2] = [
    ("RMS true [mm]", "Tracking error; strategies in sustained oscillation are left out.", |o| {
        error(o, o.error.rms_true_mm)
    }),
    (
        "RMS of the tip's vibration at rest [mm]",
        "Residual vibration of the tip while the reference was at rest.",
        |o| o.stable.then_some(o.effort.residual_vibration_mm),
    ),
];

/// Comparable outcomes as bars; none if there is nothing to draw.
fn bars(axis: &str, value: Drawn, of: &[&Outcome]) -> Option<Drawing> {
    let bar = |o: &&Outcome| {
        let to = value(o)?;
        Some(Bar {
            name: o.controller.name(),
            from: 0.0,
            to,
            colour: colour_of_controller(o.controller),
            bounds: None,
        })
    };
    let bars = of.iter().filter_map(bar).collect();
    Bars { x: axis, bars }.drawn().ok()
}

fn millimetres(value: Option<f64>) -> String {
    value.map_or("-".into(), |mm| format!("{mm:.3}"))
}

fn table(rows: &[&Outcome]) -> Markup {
    html! {
        div.wide { table {
            thead { tr {
                th { "strategy" } @for head in TrackingError::HEADS { th { (head) } } th { "motor peak [rpm]" } th { "motor ripple at rest [rpm]" }
                th { "motor energy [kJ]" } th { "tip deflection [mm]" } th { "tip vibration at rest [mm]" } th { "" }
            } }
            tbody { @for o in rows {
                tr {
                    td { (o.marked_name()) } @for mm in o.error.cells() { td { (millimetres(error(o, mm))) } }
                    td { (format!("{:.0}", o.effort.motor_speed_rpm)) } td { (format!("{:.1}", o.effort.motor_ripple_rpm)) }
                    td { (format!("{:.1}", o.effort.energy_kj)) } td { (format!("{:.1}", o.effort.tip_deflection_mm)) }
                    td { (format!("{:.3}", o.effort.residual_vibration_mm)) } td.unstable { (o.verdict()) }
                }
            } }
        } }
    }
}
