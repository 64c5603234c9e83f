//! Performance bounds: figure of the cost of each limit and the strategies' errors, with tables.

use super::document::{Page, document};
use super::drawing_data::{Drawing, figure, rows_as_csv};
use super::palette::{colour_of, paint};
use crate::LabError;
use crate::performance_bounds::{Limit, PerformanceBounds, StrategyError};
use maud::{Markup, html};
use plotters::style::RGBColor;
use std::fmt::Write;

/// Mark of a row in the figure.
#[derive(Clone, Copy, PartialEq)]
enum Mark {
    /// Bar from the start of the axis in a colour of the page, which is none of the strategies'.
    Bound(&'static str),
    /// Bar drawn as an outline.
    Estimate,
    /// Dot in a colour of the palette, with a line from the bound with all limits.
    Strategy(usize),
}

/// Row of the figure.
struct Row {
    name: String,
    /// RMS true error \[mm\].
    value: f64,
    mark: Mark,
}

/// Rows under a heading.
struct Group {
    heading: &'static str,
    rows: Vec<Row>,
}

/// Width of the figure, narrow enough for readable text on a phone.
const WIDTH: f64 = 430.0;
const MARGIN: f64 = 12.0;
/// Heights of a heading, of a row, of a bar, and of the space below the axis.
const HEADING: f64 = 30.0;
const ROW: f64 = 37.0;
const BAR: f64 = 11.0;
const BELOW: f64 = 48.0;
/// Smallest range of the axis in decades, and error below which a value counts as zero \[mm\].
const LEAST_DECADES: f64 = 2.0;
const NOTHING: f64 = 1e-6;

/// Page with the performance bounds of a machine and the errors of the strategies on it.
///
/// # Errors
///
/// [`LabError::Figure`] if there is no finite value.
pub fn bounds_page(
    machine: &str,
    bounds: &PerformanceBounds,
    strategies: &[StrategyError],
) -> Result<Page, LabError> {
    let body = html! {
        p.soft {
            "Course: " (bounds.course) ". RMS of the true piston's tracking error over the whole course, rests included. "
            "Strategies run on the virtual crane, two of them without feedback. Nothing here is a measurement."
        }
        (figure(
            "Least possible tracking error with one limit alone and with all of them (bars), estimates (outlines), \
             and the strategies (dots). The dashed line is the bound with all limits.",
            &drawing(bounds, strategies)?
        ))
        (meaning(bounds))
        h2 { "What each limit costs" }
        (limits(bounds))
        h2 { "Strategies" }
        (strategies_table(strategies))
        h2 { "Conditions" }
        div.wide { table {
            thead { tr { th { "number" } th { "value" } th { "unit" } th { "source" } } }
            tbody { @for c in &bounds.conditions { tr {
                td { (c.name) } td { (digits(c.value)) } td.text { (c.unit) } td.text { (c.source) }
            } } }
        } }
    };
    Ok(document(&format!("Performance bounds: {machine}, {}", bounds.course), &body))
}

fn meaning(bounds: &PerformanceBounds) -> Markup {
    html! {
        ul {
            li { "Motor speed and slew rate: a bound for the crane linearised along the reference, with model and reference known. Optimal control; the
                  duality gap is " (digits(bounds.motor_gap_percent)) " % of the error." }
            li { "Delay, sensor noise, unknown payload: a bound for any linear causal controller if disturbances drift as stated under conditions. That they do is an
                  estimate, and so is the bound on a real machine." }
            li { "Feedforward alone: an estimate. Motor speeds are those of the payload as it is estimated on the way, and no position is fed back. The
                  payload's standard deviation is " (digits(bounds.payload_deviation_kg[0])) " kg before, " (digits(bounds.payload_deviation_kg[1]))
                 " kg when the motion begins and " (digits(bounds.payload_deviation_kg[2])) " kg at its end." }
            li { "Not known ahead: an estimate. Whenever the reference changes its acceleration, or the load is changed, the piston is on the reference and the controller
                  does not know of it before. From when a command can act on it all is known up to the next change. The strategies below know the reference ahead." }
            @if bounds.load_changes > 0 {
                li { "Load changes are linearised about the new load. Where oil stiffens with pressure that holds for small changes only; for others the estimate may be too high or too low." }
            }
        }
    }
}

fn limits(bounds: &PerformanceBounds) -> Markup {
    html! {
        div.wide { table {
            thead { tr { th { "limit" } th { "this alone [mm]" } th { "all but this [mm]" } } }
            tbody {
                tr { td { "none" } td { (digits(bounds.none_mm)) } td {} }
                @for cost in &bounds.limits { tr {
                    td { (cost.limit.name()) } td { (digits(cost.alone_mm)) } td { (digits(cost.all_others_mm)) }
                } }
                tr { td { "all" } td { (digits(bounds.all_mm)) } td {} }
                tr { td { "all, reference and load changes not known ahead" } td { (digits(bounds.not_known_ahead_mm)) } td {} }
            }
        } }
    }
}

fn strategies_table(strategies: &[StrategyError]) -> Markup {
    html! {
        div.wide { table {
            thead { tr { th { "strategy" } th { "RMS true [mm]" } th { "over the bound" } th { "" } } }
            tbody { @for s in strategies { tr {
                td { (s.strategy.name()) }
                td { (s.rms_true_mm.map_or("-".into(), digits)) } td { (s.over_bound.map_or("-".into(), digits)) }
                td.unstable { (s.remark.as_deref().unwrap_or("")) }
            } } }
        } }
    }
}

/// Setting of a limit, as text for its row.
fn setting(bounds: &PerformanceBounds, limit: Limit) -> String {
    let of = |name: &str| bounds.conditions.iter().find(|c| c.name == name);
    let text =
        |name: &str| of(name).map_or(String::new(), |c| format!("{} {}", digits(c.value), c.unit));
    match limit {
        Limit::MotorSpeed => text("largest motor speed"),
        Limit::Slew => text("motor slew rate"),
        Limit::Delay => text("delay from position to motor"),
        Limit::SensorNoise => text("position noise"),
        Limit::UnknownPayload => format!("std {}", text("payload unknown by (std)")),
    }
}

fn groups(bounds: &PerformanceBounds, strategies: &[StrategyError]) -> Vec<Group> {
    let alone = bounds.limits.iter().map(|cost| Row {
        name: format!("{}, {}", cost.limit.name(), setting(bounds, cost.limit)),
        value: cost.alone_mm,
        mark: Mark::Bound("var(--soft)"),
    });
    let all =
        Row { name: "known ahead".into(), value: bounds.all_mm, mark: Mark::Bound("var(--ink)") };
    let not_known_ahead = Row {
        name: "not known ahead".into(),
        value: bounds.not_known_ahead_mm,
        mark: Mark::Estimate,
    };
    let feedforward = Row {
        name: "feedforward alone".into(),
        value: bounds.feedforward_mm,
        mark: Mark::Estimate,
    };
    let run = |s: &StrategyError| Row {
        name: s.strategy.name().into(),
        value: s.rms_true_mm.unwrap_or(f64::NAN),
        mark: Mark::Strategy(colour_of(s.strategy)),
    };
    let mut groups = vec![
        Group { heading: "Least possible with one limit alone", rows: alone.collect() },
        Group { heading: "Least possible with all limits", rows: vec![all, not_known_ahead] },
        Group { heading: "Estimate without position feedback", rows: vec![feedforward] },
    ];
    if !strategies.is_empty() {
        let rows = strategies.iter().map(run).collect();
        groups.push(Group { heading: "Strategies on the virtual crane", rows });
    }
    groups
}

fn drawing(bounds: &PerformanceBounds, strategies: &[StrategyError]) -> Result<Drawing, LabError> {
    let groups = groups(bounds, strategies);
    let svg = svg(&groups, bounds.all_mm)?;
    let rows: Vec<(&str, Vec<f64>)> =
        groups.iter().flat_map(|g| &g.rows).map(|r| (r.name.as_str(), vec![r.value])).collect();
    let csv = rows_as_csv(&["name", "RMS true [mm]"], &rows);
    let said: Vec<String> =
        rows.iter().map(|(name, value)| format!("{name} {} mm", digits(value[0]))).collect();
    Ok(Drawing { svg, csv, says: format!("RMS true: {}.", said.join("; ")) })
}

fn svg(groups: &[Group], all_mm: f64) -> Result<String, LabError> {
    let values = || {
        let all = groups.iter().flat_map(|g| &g.rows).map(|r| r.value);
        all.filter(|v| v.is_finite() && *v >= NOTHING)
    };
    let (low, high) = values().fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
    if high <= 0.0 {
        return Err(LabError::Figure("no error is above zero".into()));
    }
    // from a whole decade below the smallest value to one above the largest
    let first = (low * 0.7).log10().floor().min(high.log10() - LEAST_DECADES);
    let last = (high * 1.2).log10().ceil();
    let x = |v: f64| MARGIN + (WIDTH - 2.0 * MARGIN) * (v.log10() - first) / (last - first);
    let count: usize = groups.iter().map(|g| g.rows.len()).sum();
    let bottom = HEADING * groups.len() as f64 + ROW * count as f64 + 8.0;
    let height = bottom + BELOW;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"100%\" role=\"img\" \
         font-family=\"sans-serif\" font-size=\"14\" fill=\"var(--ink)\">"
    );
    // writing to a String cannot fail
    let decades = (first.ceil() as i32)..=(last.floor() as i32);
    for decade in decades {
        let tick = 10f64.powi(decade);
        let _ = write!(
            svg,
            "<line x1=\"{0:.1}\" x2=\"{0:.1}\" y1=\"4\" y2=\"{bottom:.1}\" stroke=\"var(--grid)\"/>\
             <text x=\"{0:.1}\" y=\"{1:.1}\" text-anchor=\"{2}\" font-size=\"13\">{3}</text>",
            x(tick),
            bottom + 17.0,
            if decade == last as i32 {
                "end"
            } else if f64::from(decade) == first {
                "start"
            } else {
                "middle"
            },
            label(decade),
        );
    }
    let _ = write!(
        svg,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">RMS of the true tracking error [mm]</text>",
        WIDTH / 2.0,
        bottom + 39.0
    );
    let _ = write!(
        svg,
        "<line x1=\"{0:.1}\" x2=\"{0:.1}\" y1=\"4\" y2=\"{bottom:.1}\" stroke=\"var(--ink)\" stroke-width=\"1.5\" \
         stroke-dasharray=\"5 4\"/>",
        x(all_mm.max(NOTHING))
    );
    let mut y = 0.0;
    for group in groups {
        y += HEADING;
        let _ = write!(
            svg,
            "<text x=\"{MARGIN}\" y=\"{:.1}\" font-weight=\"600\" {HALO}>{}</text>",
            y - 9.0,
            group.heading
        );
        for row in &group.rows {
            draw(&mut svg, row, y, x(all_mm.max(NOTHING)), &x);
            y += ROW;
        }
    }
    svg.push_str("</svg>");
    Ok(svg)
}

/// Attributes for text that stays readable over lines.
const HALO: &str =
    "stroke=\"var(--paper)\" stroke-width=\"4\" paint-order=\"stroke\" stroke-linejoin=\"round\"";

/// Draws a row with its upper edge at `y`.
fn draw(svg: &mut String, row: &Row, y: f64, bound: f64, x: &dyn Fn(f64) -> f64) {
    let middle = y + ROW - BAR - 1.0;
    let (top, is_drawn) = (middle - 0.5 * BAR, row.value.is_finite() && row.value >= NOTHING);
    let end = if is_drawn { x(row.value) } else { MARGIN };
    let said = match row.value.is_finite() {
        true if row.value < NOTHING => "0 mm".into(),
        true => format!("{} mm", digits(row.value)),
        false => "unstable".into(),
    };
    // writing to a String cannot fail
    let _ = match row.mark {
        _ if !is_drawn => Ok(()),
        Mark::Bound(paint) => write!(
            svg,
            "<rect x=\"{MARGIN}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{BAR}\" fill=\"{}\"/>",
            (end - MARGIN).max(1.0),
            paint
        ),
        Mark::Estimate => write!(
            svg,
            "<rect x=\"{MARGIN}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{BAR}\" fill=\"none\" stroke=\"var(--soft)\" \
             stroke-width=\"1.5\" stroke-dasharray=\"3 2\"/>",
            (end - MARGIN).max(1.0)
        ),
        Mark::Strategy(place) => write!(
            svg,
            "<line x1=\"{bound:.1}\" x2=\"{end:.1}\" y1=\"{middle:.1}\" y2=\"{middle:.1}\" stroke=\"{0}\" \
             stroke-width=\"2.5\"/><circle cx=\"{end:.1}\" cy=\"{middle:.1}\" r=\"6\" fill=\"{0}\"/>",
            colour(place)
        ),
    };
    let _ = write!(
        svg,
        "<text x=\"{MARGIN}\" y=\"{0:.1}\" {HALO}>{1}</text>\
         <text x=\"{2:.1}\" y=\"{0:.1}\" text-anchor=\"end\" {HALO}>{said}</text>",
        y + 13.0,
        row.name,
        WIDTH - MARGIN
    );
}

fn colour(place: usize) -> String {
    let RGBColor(red, green, blue) = paint(place);
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// Power of ten as a label of the axis.
fn label(decade: i32) -> String {
    match decade {
        -3..=3 => format!("{}", 10f64.powi(decade)),
        _ => format!("1e{decade}"),
    }
}

/// Number with two significant digits; zero below a millionth.
fn digits(value: f64) -> String {
    let size = value.abs();
    if size < NOTHING {
        return "0".into();
    }
    let after = (1 - size.log10().floor() as i32).clamp(0, 7) as usize;
    format!("{value:.after$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Larger errors are farther to the right, and all decades have the same width.
    #[test]
    fn the_axis_is_logarithmic() {
        let row = |name: &str, value: f64| Row {
            name: name.into(),
            value,
            mark: Mark::Bound("var(--soft)"),
        };
        let rows = vec![row("a", 1e-3), row("b", 1e-2), row("c", 1e-1), row("none", 0.0)];
        let svg = svg(&[Group { heading: "bounds", rows }], 1e-2).unwrap();
        let widths: Vec<f64> = svg
            .split("<rect ")
            .skip(1)
            .map(|rect| {
                let width = rect.split("width=\"").nth(1).unwrap();
                width.split('"').next().unwrap().parse().unwrap()
            })
            .collect();
        assert_eq!(widths.len(), 3, "{svg}");
        assert!(widths[0] > 0.0);
        let (first, second) = (widths[1] - widths[0], widths[2] - widths[1]);
        assert!((first - second).abs() < 0.11 && first > 10.0, "{widths:?}");
        assert!(svg.contains("0 mm") && svg.contains("var(--ink)"));
    }

    #[test]
    fn numbers_have_two_significant_digits() {
        for (value, text) in
            [(0.000_063_9, "0.000064"), (0.003, "0.0030"), (25.69, "26"), (3000.0, "3000")]
        {
            assert_eq!(digits(value), text);
        }
        assert_eq!(digits(1e-9), "0");
    }
}
