//! Errors of the time steps over step size and computing time.

use crate::LabError;
use crate::report::drawing_data::figure;
use crate::report::figure::{Axes, Figure, Series};
use crate::study::Study;
use crate::work_precision::{Excitation, Point};
use maud::{Markup, html};

/// Pressure error of a scheme with a step under an excitation \[bar\].
fn error_at(study: &Study, excitation: Excitation, like: &Point) -> String {
    let is = |p: &&Point| {
        p.excitation == excitation && p.scheme == like.scheme && p.step_us == like.step_us
    };
    match study.work_precision.iter().find(is).map(|p| p.pressure_error_bar) {
        Some(bar) if bar.is_finite() => format!("{bar:.2e}"),
        Some(_) => "diverges".into(),
        None => "-".into(),
    }
}

pub(super) fn precision(study: &Study) -> Result<Markup, LabError> {
    let of_motion = |p: &&Point| p.excitation == Excitation::Motion;
    let series = |x: fn(&Point) -> f64| -> Vec<Series<'_>> {
        let of = |name: &str| {
            let points = study.work_precision.iter().filter(of_motion).filter(|p| p.scheme == name);
            points.map(|p| (x(p), p.pressure_error_bar)).collect()
        };
        Series::list(["published", "implicit", "runge-kutta-4"].map(|name| (name, of(name))))
    };
    let y = "largest error of p_A [bar]";
    let steps =
        Figure { x: "step [us]", y, series: series(|p| p.step_us), axes: Axes::Logarithmic };
    let times = Figure {
        x: "computing time per simulated second [ms]",
        y,
        series: series(|p| p.time_ms_per_s),
        axes: Axes::Logarithmic,
    };
    Ok(html! {
        h2 { "Work and precision" }
        p.soft {
            "The first two seconds of the fast motion against Runge-Kutta steps of 1 us, without substeps. "
            "Points that diverged are left out. An error is that of these conditions: where the motor's speed steps, it is larger."
        }
        div.wide { table {
            thead { tr {
                th { "scheme" } th { "step [us]" }
                @for excitation in Excitation::ALL { th { "largest error of p_A [bar], " (excitation.name()) } }
            } }
            tbody { @for p in study.work_precision.iter().filter(of_motion).filter(|p| p.step_us >= 20.0) { tr {
                td { (p.scheme) } td { (format!("{:.0}", p.step_us)) }
                @for excitation in Excitation::ALL { td { (error_at(study, excitation, p)) } }
            } } }
        } }
        (figure("Largest error of p_A over the step size: a line twice as steep is an order more.", &steps.drawn()?))
        (figure("The same over computing time: lower left is better.", &times.drawn()?))
    })
}
