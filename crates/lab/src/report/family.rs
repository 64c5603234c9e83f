//! Results of the strategies over a family of virtual cranes: box plots and tables.

use super::document::{Page, document};
use super::drawing_data::{Drawing, figure, rows_as_csv};
use super::palette::{colour_of_controller, paint};
use super::pareto::{Pareto, ParetoPoint};
use crate::closed_loop::metrics::{MOTOR_ENERGY, TrackingError};
use crate::closed_loop::monte_carlo::{Percentiles, Row, variations};
use hydroboom_control::strategy::Strategy;
use maud::{Markup, html};
use plotters::style::RGBColor;
use std::fmt::Write;

/// Page with box plots and tables of `rows` over a family of `count` cranes drawn with `seed`, widened or not. `crane`
/// is the name of the nominal crane.
pub fn family_page(crane: &str, count: usize, seed: u64, is_widened: bool, rows: &[Row]) -> Page {
    let first = rows.first().map(|row| row.controller);
    let courses: Vec<&str> = rows
        .iter()
        .filter(|row| Some(row.controller) == first)
        .map(|row| row.course.as_str())
        .collect();
    let of =
        |course: &str| -> Vec<&Row> { rows.iter().filter(|row| row.course == course).collect() };
    let body = html! {
        p.soft {
            (count) " virtual cranes, drawn with seed " (seed) " around \"" (crane) "\". "
            "The controllers and the simulation beside each know the published model only. "
            "Nothing here is a measurement."
        }
        h2 { "What varies" }
        table {
            thead { tr { th { "quantity" } th { "from" } th { "to" } } }
            tbody { @for v in variations(is_widened) { tr { td { (v.name) } td { (v.low) } td { (v.high) } } } }
        }
        @for course in &courses {
            h2 { (course) }
            (figure(
                "RMS of the true tracking error: box from quarter to three quarters of the cranes with the median, \
                 line from 5 to 95 %, dot for the worst.",
                &boxes("error [mm]", &of(course).iter().map(|r| (*r, r.rms_true_mm)).collect::<Vec<_>>())))
            (figure("Largest true error of each crane, by magnitude: box, line and dot as above.",
                &boxes("error [mm]", &of(course).iter().map(|r| (*r, r.peak_true_mm)).collect::<Vec<_>>())))
            (figure(
                "RMS of the true error over the benchmark's on the same crane, which is 1: left of it the strategy is better.",
                &boxes("times the benchmark's", &of(course).iter()
                    .map(|r| (*r, r.rms_true_over_benchmark)).collect::<Vec<_>>())))
            (pareto(&of(course)))
            (table(&of(course)))
            (beside_the_benchmark(&of(course)))
        }
        p.soft { (MOTOR_ENERGY) }
        (explanation())
    };
    document(&format!("A family of virtual cranes: {crane}"), &body)
}

/// Error over effort (motor speed, and energy), both over the benchmark's on the same crane.
fn pareto(rows: &[&Row]) -> Markup {
    let drawn = |effort: &str, of: fn(&Row) -> Percentiles| {
        let marks = rows
            .iter()
            .map(|row| ParetoPoint {
                name: name(row),
                colour: colour_of_controller(row.controller),
                effort: of(row),
                error: row.rms_true_over_benchmark,
            })
            .collect();
        Pareto { effort, error: "true RMS error, times the benchmark's", marks }.drawn().ok()
    };
    let figures = [
        (
            drawn("largest motor speed, times the benchmark's", |r| r.motor_speed_over_benchmark),
            "largest motor speed",
        ),
        (drawn("motor energy, times the benchmark's", |r| r.energy_over_benchmark), "motor energy"),
    ];
    html! {
        div.pair {
            @for (svg, effort) in figures {
                @if let Some(svg) = svg {
                    (figure(&format!(
                        "True RMS error over {effort}, on the same crane: median, bars from 5 to 95 %. \
                         Lower left is better; the benchmark is at 1, 1."
                    ), &svg))
                }
            }
        }
    }
}

fn name(row: &Row) -> &'static str {
    row.controller.name()
}

fn table(rows: &[&Row]) -> Markup {
    html! {
        div.wide { table {
            thead { tr {
                th { "strategy" } @for head in TrackingError::HEADS { th { (head) ": median (5 .. 95 %), worst" } } th { "motor ripple at rest [rpm]: median (5 .. 95 %), worst" } th { "motor slew, RMS [rpm/s]: median (5 .. 95 %), worst" } th { "oscillating" } th { "not finished" }
            } }
            tbody { @for r in rows {
                tr {
                    td { (name(r)) } @for spread in [r.rms_true_mm, r.rms_measured_mm, r.peak_true_mm, r.peak_measured_mm] { td { (spread.text(3)) } }
                    td { (r.motor_ripple_rpm.text(1)) } td { (r.motor_slew_rpm_per_s.text(0)) } td { (r.oscillating) } td { (r.unfinished) }
                }
            } }
        } }
        @for r in rows.iter().filter(|r| r.periods_without_solution > 0) {
            p.unstable { (name(r)) " computed no command in " (r.periods_without_solution) " control periods: its last plan was held." }
        }
    }
}

/// Ratios to the benchmark on the same crane: error, then largest motor speed and energy.
fn beside_the_benchmark(rows: &[&Row]) -> Markup {
    let retuned = rows.iter().any(|r| r.rms_true_over_retuned_benchmark.is_some());
    let others: Vec<&&Row> =
        rows.iter().filter(|r| r.controller != Strategy::BenchmarkClosedLoop.into()).collect();
    html! {
        p { "Over the benchmark's on the same crane, median (5 .. 95 %), most:" }
        div.wide { table {
            thead { tr {
                th { "strategy" } th { "RMS true" } th { "RMS measured" } th { "less RMS true on [% of the cranes]" }
                @if retuned { th { "RMS true over the retuned benchmark's" } }
            } }
            tbody { @for r in &others {
                tr {
                    td { (name(r)) } td { (r.rms_true_over_benchmark.text(3)) } td { (r.rms_measured_over_benchmark.text(3)) }
                    td { (format!("{:.0}", r.better_percent)) }
                    @if retuned { td { (r.rms_true_over_retuned_benchmark.map_or("-".into(), |s| s.text(2))) } }
                }
            } }
        } }
        div.wide { table {
            thead { tr {
                th { "strategy" } th { "largest motor speed" } th { "motor energy" }
            } }
            tbody { @for r in &others {
                tr {
                    td { (name(r)) } td { (r.motor_speed_over_benchmark.text(3)) }
                    td { (r.energy_over_benchmark.text(3)) }
                }
            } }
        } }
    }
}

/// Explanation from the loop's equations why simulation feedforward in an unchanged closed loop can
/// increase the error.
fn explanation() -> Markup {
    html! {
        h2 { "Where simulation feedforward reduces the error, and where it increases it" }
        p {
            "In open loop it includes what velocity feedforward omits: the oil's compression and the "
            "pump's losses. It needs no sensor, and reduces the error as far as the model is correct there."
        }
        p {
            "In closed loop the published scheme adds the simulation's speed to an unchanged PI and "
            "pressure feedback. With plant G (to position " i { "G" sub { "x" } } " and load pressure "
            i { "G" sub { "p" } } "), PI " i { "C" } ", pressure feedback " i { "F" }
            " and loop L = C G" sub { "x" } " + F G" sub { "p" } ", the benchmark's error is "
            "E = (1 − G" sub { "x" } " u" sub { "FF" } " + F G" sub { "p" } ")/(1 + L) of the reference. "
            "Where the model equals the plant, simulation feedforward changes it to"
        }
        p { "E' = (E + F G" sub { "p" } ")/(1 + L)." }
        p {
            "The first term is the benchmark's error, reduced by the loop a second time. "
            "The second is new: the plant's pressure feedback opposes the load pressure that the "
            "simulation, which has its own pressure feedback, requires. The motion is damped "
            "twice. Where the loop is fast the first term dominates, in ramps and corners the second. The "
            "remedy is feedback of the difference from the simulation."
        }
        p {
            "The scheduled LQR (ours) needs no simulated crane for that: it feeds back the difference between the \
             estimated state and the "
            "inverse dynamics of the reference, so that nothing is damped twice."
        }
    }
}

const WIDTH: f64 = 560.0;
/// Width of the names' column; the longest name takes 274.
const LEFT: f64 = 288.0;
const LINE: f64 = 34.0;
/// Width of a decade above which further numbers are printed.
const ROOMY: f64 = 110.0;

/// Box plots over a logarithmic axis, as SVG.
fn boxes(axis: &str, rows: &[(&Row, Percentiles)]) -> Drawing {
    let table: Vec<(&str, Vec<f64>)> = rows
        .iter()
        .map(|(r, s)| (name(r), vec![s.p5, s.p25, s.median, s.p75, s.p95, s.worst]))
        .collect();
    let median = format!("median: {axis}");
    let csv = rows_as_csv(&["name", "5 %", "25 %", &median, "75 %", "95 %", "worst"], &table);
    let named: Vec<String> =
        rows.iter().map(|(r, s)| format!("{} {:.2}", name(r), s.median)).collect();
    let says = format!("Medians of {axis}: {}.", named.join(", "));
    Drawing { svg: boxes_svg(axis, rows), csv, says }
}

fn boxes_svg(axis: &str, rows: &[(&Row, Percentiles)]) -> String {
    let positive = |v: f64| v.max(1e-3);
    let low = rows.iter().map(|(_, s)| positive(s.p5)).fold(f64::INFINITY, f64::min) * 0.8;
    let high = rows.iter().map(|(_, s)| positive(s.worst)).fold(0.0, f64::max) * 1.25;
    if !(low.is_finite() && high > low) {
        return String::new();
    }
    let x = |v: f64| LEFT + (WIDTH - LEFT - 20.0) * (positive(v) / low).ln() / (high / low).ln();
    let bottom = 10.0 + LINE * rows.len() as f64;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {}\" width=\"100%\" \
         role=\"img\" font-family=\"sans-serif\" font-size=\"15\" fill=\"var(--ink)\">",
        bottom + 42.0
    );
    let mut decade = 10f64.powf(low.log10().floor());
    let roomy = x(10.0 * low) - x(low) > ROOMY;
    while decade < high {
        for step in [1.0, 2.0, 5.0] {
            let tick = decade * step;
            if (low..=high).contains(&tick) {
                let number = if roomy || step == 1.0 { trimmed(tick) } else { String::new() };
                let _ = write!(
                    svg,
                    "<line x1=\"{0:.1}\" x2=\"{0:.1}\" y1=\"4\" y2=\"{bottom}\" stroke=\"var(--grid)\"/>\
                     <text x=\"{0:.1}\" y=\"{1}\" text-anchor=\"middle\">{number}</text>",
                    x(tick),
                    bottom + 17.0,
                );
            }
        }
        decade *= 10.0;
    }
    let _ = write!(
        svg,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{axis}</text>",
        (LEFT + WIDTH) / 2.0,
        bottom + 37.0
    );
    for (k, (row, s)) in rows.iter().enumerate() {
        let y = 10.0 + LINE * (k as f64 + 0.5);
        let (name, RGBColor(red, green, blue)) =
            (name(row), paint(colour_of_controller(row.controller)));
        let colour = format!("#{red:02x}{green:02x}{blue:02x}");
        let (edge, top, end) = (x(s.p25), y - 9.0, y + 9.0);
        let (width, median) = (x(s.p75) - edge, x(s.median));
        let _ = write!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{name}</text>\
             <line x1=\"{:.1}\" x2=\"{:.1}\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"{colour}\" \
             stroke-width=\"2\"/>\
             <rect x=\"{edge:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"18\" \
             fill=\"{colour}\" fill-opacity=\"0.35\" stroke=\"{colour}\" stroke-width=\"1.5\"/>\
             <line x1=\"{median:.1}\" x2=\"{median:.1}\" y1=\"{top:.1}\" y2=\"{end:.1}\" \
             stroke=\"var(--ink)\" stroke-width=\"2.5\"/>\
             <circle cx=\"{:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{colour}\"/>",
            LEFT - 12.0,
            y + 5.0,
            x(s.p5),
            x(s.p95),
            x(s.worst),
        );
    }
    svg.push_str("</svg>");
    svg
}

fn trimmed(tick: f64) -> String {
    if tick >= 1.0 {
        format!("{tick:.0}")
    } else {
        format!("{tick:.3}").trim_end_matches('0').into()
    }
}
