//! Estimated tip along a cycle: height relative to a rigid boom with bounds, and error.

use super::document::{Page, document};
use super::drawing_data::{Drawing, figure, lines_as_csv};
use super::figure::{FINE, INK, in_page_style, number, themed};
use super::palette::COLOURS;
use crate::LabError;
use crate::closed_loop::tip_accuracy::{Method, TipAccuracy, TipInstant};
use maud::html;
use plotters::prelude::*;

const WIDTH: u32 = 760;
/// Height of the figure, and of its upper part.
const HEIGHT: u32 = 620;
const UPPER: u32 = 360;
/// Number of plotted instants.
const POINTS: usize = 700;
/// Initial time that does not affect the range of the axes \[s\].
const SETTLING: f64 = 2.0;

/// Line with its band.
struct Band {
    name: &'static str,
    colour: RGBColor,
    opacity: f64,
    /// Time \[s\], value and two standard deviations \[mm\]; zero for no band.
    points: Vec<(f64, f64, f64)>,
}

/// Two plots over the same time: height relative to a rigid boom above, error below.
fn svg(course: &[TipInstant]) -> Result<Drawing, LabError> {
    let step = course.len().div_ceil(POINTS).max(1);
    let instants: Vec<&TipInstant> = course.iter().step_by(step).collect();
    let (Some(first), Some(last)) = (instants.first(), instants.last()) else {
        return Err(LabError::Figure("no instant to draw".into()));
    };
    let times = first.time_s..last.time_s;
    let of = |method: Method, from: fn(&TipInstant) -> f64| {
        let k = method as usize;
        let point = move |i: &&TipInstant| {
            (i.time_s, (i.estimated_y_m[k] - from(i)) * 1e3, i.deviation_y_m[k] * 2e3)
        };
        instants.iter().map(point).collect::<Vec<_>>()
    };
    let [blue, orange, green, ..] = COLOURS;
    let rigid = |i: &TipInstant| i.rigid_y_m;
    let truth = |i: &TipInstant| i.true_y_m;
    let band = |name, colour, opacity, points| Band { name, colour, opacity, points };
    let unsurveyed = of(Method::Unsurveyed, rigid);
    let true_tip = instants.iter().map(|i| (i.time_s, (i.true_y_m - i.rigid_y_m) * 1e3, 0.0));
    let above = [
        band("nothing surveyed, 2 sigma", green, 0.13, unsurveyed),
        band("surveyed, 2 sigma", blue, 0.30, of(Method::Surveyed, rigid)),
        band("map of four numbers", orange, 0.0, of(Method::Map, rigid)),
        band("the tip itself", INK, 0.0, true_tip.collect()),
    ];
    let below = [
        band("surveyed", blue, 0.30, of(Method::Surveyed, truth)),
        band("map of four numbers", orange, 0.0, of(Method::Map, truth)),
    ];
    let size = (WIDTH * FINE, HEIGHT * FINE);
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        let (upper, lower) = area.split_vertically(UPPER * FINE);
        draw(&upper, &times, "tip below a rigid boom [mm]", "", (&above, 1.4))?;
        draw(&lower, &times, "error of the height [mm]", "time [s]", (&below, 2.2))?;
        area.present().map_err(|e| LabError::Figure(e.to_string()))?;
    }
    let mut lines: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
    for (part, bands) in
        [("tip below a rigid boom", &above[..]), ("error of the height", &below[..])]
    {
        for band in bands {
            let values = band.points.iter().map(|(t, v, _)| (*t, *v)).collect();
            lines.push((format!("{part}, {}", band.name), values));
            let deviations = band.points.iter().map(|(t, _, d)| (*t, *d)).collect();
            lines.push((format!("{part}, {}: two standard deviations", band.name), deviations));
        }
    }
    let csv =
        lines_as_csv("time [s]", "[mm]", lines.iter().map(|(n, p)| (n.as_str(), p.as_slice())));
    let names = above.iter().map(|band| band.name).collect::<Vec<_>>().join(", ");
    Ok(Drawing { svg: themed(&svg, size), csv, says: format!("Over time [s], [mm]: {names}.") })
}

fn draw(
    area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    times: &std::ops::Range<f64>,
    y: &str,
    x: &str,
    (bands, legend): (&[Band], f64),
) -> Result<(), LabError> {
    let failed = |e: &dyn std::fmt::Display| LabError::Figure(e.to_string());
    // initial bounds are wide and may exceed the axes
    let settled = times.start + SETTLING.min(0.5 * (times.end - times.start));
    let shown = bands.iter().flat_map(|b| &b.points).filter(|(t, ..)| *t >= settled);
    let ends = shown.flat_map(|(_, v, d)| [v - d, v + d]);
    let (low, high) = ends
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if low >= high {
        return Err(LabError::Figure(format!("nothing to draw of {y}")));
    }
    let pad = 0.06 * (high - low);
    // space for the legend above the lines
    let head = pad * (1.0 + legend * bands.len() as f64);
    let within = |value: f64| value.clamp(low - pad, high + head);
    let font = ("sans-serif", 14 * FINE).into_font().color(&INK);
    let mut chart = ChartBuilder::on(area)
        .margin(8 * FINE)
        .margin_right(18 * FINE)
        .x_label_area_size(if x.is_empty() { 22 * FINE } else { 42 * FINE })
        .y_label_area_size(64 * FINE)
        .build_cartesian_2d(times.clone(), low - pad..high + head)
        .map_err(|e| failed(&e))?;
    in_page_style(chart.configure_mesh(), &font)
        .x_desc(x)
        .y_desc(y)
        .x_labels(10)
        .y_labels(6)
        .x_label_formatter(&|v| number(*v))
        .y_label_formatter(&|v| number(*v))
        .draw()
        .map_err(|e| failed(&e))?;
    for Band { name, colour, opacity, points } in bands {
        if *opacity > 0.0 {
            let up = points.iter().map(|(t, v, d)| (*t, within(v + d)));
            let down = points.iter().rev().map(|(t, v, d)| (*t, within(v - d)));
            let outline: Vec<(f64, f64)> = up.chain(down).collect();
            let polygon = Polygon::new(outline, colour.mix(*opacity).filled());
            chart.draw_series([polygon]).map_err(|e| failed(&e))?;
        }
        let style = colour.stroke_width(2 * FINE);
        let line = LineSeries::new(points.iter().map(|(t, v, _)| (*t, within(*v))), style);
        let (fill, has_band) = (colour.mix(*opacity).filled(), *opacity > 0.0);
        let drawn = chart.draw_series(line).map_err(|e| failed(&e))?;
        drawn.label(*name).legend(move |(x, y)| {
            let (half, wide) = (5 * FINE as i32, 18 * FINE as i32);
            let (top, bottom) = if has_band { (y - half, y + half) } else { (y, y) };
            EmptyElement::at((0, 0))
                + Rectangle::new([(x, top), (x + wide, bottom)], fill)
                + PathElement::new([(x, y), (x + wide, y)], style)
        });
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .legend_area_size(24 * FINE)
        .label_font(font)
        .background_style(TRANSPARENT)
        .border_style(TRANSPARENT)
        .draw()
        .map_err(|e| failed(&e))
}

/// Page with the accuracy of the estimated tip over a family, and a cycle of the crane of median error.
///
/// # Errors
///
/// [`LabError::Figure`] if the figure cannot be drawn.
pub fn tip_page(title: &str, found: &TipAccuracy) -> Result<Page, LabError> {
    let drawn = svg(&found.course)?;
    let caption = format!(
        "Crane {}, that of the median RMS error after a survey. Above: height of the tip less that of a rigid boom at the same piston position, truth and estimates with two standard deviations. Below: what \
         is left. The truth is the virtual crane's; pressures alone do not observe the position.",
        found.drawn
    );
    let shown = |value: Option<f64>, digits: usize| {
        value.map_or_else(|| "-".into(), |value| format!("{value:.digits$}"))
    };
    let body = html! {
        p { (format!("{} virtual cranes. Errors of the tip's height in mm: median (5 .. 95 %), worst.", found.cranes.len())) }
        div.wide { table {
            thead { tr { th { "" } th { "bias" } th { "RMS about it" } th { "RMS" } th { "mean sigma" } th { "within 2 sigma [%]" } } }
            tbody {
                @for row in &found.methods { tr {
                    td { (row.method) } td { (row.bias_mm.text(2)) } td { (row.rms_about_mm.text(2)) } td { (row.rms_mm.text(2)) }
                    td { (shown(row.deviation_mm, 2)) } td { (shown(row.coverage_percent, 0)) }
                } }
                tr {
                    td { "left by the survey's noise alone" } td { (found.survey_noise.bias_mm.text(2)) }
                    td { (found.survey_noise.rms_about_mm.text(2)) } td { "-" } td { "-" } td { "-" }
                }
            }
        } }
        h2 { "A cycle" }
        (figure(&caption, &drawn))
    };
    Ok(document(title, &body))
}
