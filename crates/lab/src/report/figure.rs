//! Line figures as SVG in the page's colours for light and dark display.

use super::drawing_data::{Drawing, lines_as_csv};
use super::palette::paint;
use crate::LabError;
use plotters::chart::MeshStyle;
use plotters::prelude::*;

/// Line of a figure with its points.
pub struct Series<'a> {
    /// Text in the legend.
    pub name: &'a str,
    /// Points (x, y) in the units of the axes. Points that are not finite are not drawn, nor those of zero or below on
    /// a logarithmic axis.
    pub points: Vec<(f64, f64)>,
    /// Index of its colour in the palette: [`colour_of`](super::colour_of) a strategy, or
    /// [`NEUTRAL`](super::NEUTRAL) for a reference.
    pub colour: usize,
}

impl<'a> Series<'a> {
    /// Lines with their names and points, in the palette's order.
    pub fn list(lines: impl IntoIterator<Item = (&'a str, Vec<(f64, f64)>)>) -> Vec<Self> {
        let numbered = lines.into_iter().enumerate();
        numbered.map(|(colour, (name, points))| Self { name, points, colour }).collect()
    }
}

/// Line figure with one pair of axes.
pub struct Figure<'a> {
    /// Label of the horizontal axis, with its unit.
    pub x: &'a str,
    /// Label of the vertical axis, with its unit.
    pub y: &'a str,
    /// Lines of the figure.
    pub series: Vec<Series<'a>>,
    /// Linear or logarithmic scaling of the axes.
    pub axes: Axes,
}

/// Linear or logarithmic scaling of a figure's axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// Both linear.
    Linear,
    /// Both logarithmic, with a dot at every point.
    Logarithmic,
    /// Horizontal axis logarithmic.
    LogarithmicX,
}

/// Placeholder colours, replaced by the page's own colours for light or dark display.
pub(super) const INK: RGBColor = RGBColor(1, 2, 3);
pub(super) const GRID: RGBColor = RGBColor(4, 5, 6);

/// Oversampling factor, because the backend rounds to whole pixels.
pub(super) const FINE: u32 = 4;
/// Size of the figure, narrow enough for readable text on a phone.
const SIZE: (u32, u32) = (560, 290);
const TEXT: u32 = 16;
/// Height of a line of the legend, which is above the plotted lines.
const LEGEND_LINE: u32 = 22;
/// Height of the axes.
const AXES: f64 = 222.0;
/// Largest number of points per line; more than the pixels only increase the file size.
const MOST_POINTS: usize = 900;

impl Figure<'_> {
    /// Draws the figure as SVG, with its data.
    ///
    /// # Errors
    ///
    /// [`LabError::Figure`] if there is no finite value.
    pub fn drawn(&self) -> Result<Drawing, LabError> {
        let svg = self.svg()?;
        let lines = || self.series.iter().map(|line| (line.name, line.points.as_slice()));
        let names: Vec<&str> = lines().map(|(name, _)| name).collect();
        let says = format!("Over {}, {}: {}.", self.x, self.y, names.join(", "));
        Ok(Drawing { svg, csv: lines_as_csv(self.x, self.y, lines()), says })
    }

    /// Lines with the points that the axes can show, thinned.
    fn drawable(&self) -> Vec<Line<'_>> {
        let finite = |(x, y): &(f64, f64)| {
            let x_fits = self.axes == Axes::Linear || *x > 0.0;
            let y_fits = self.axes != Axes::Logarithmic || *y > 0.0;
            x.is_finite() && y.is_finite() && x_fits && y_fits
        };
        let drawable =
            |line: &Series<'_>| thinned(line.points.iter().copied().filter(finite).collect());
        self.series.iter().map(|line| (line.colour, line.name, drawable(line))).collect()
    }

    fn svg(&self) -> Result<String, LabError> {
        let series = self.drawable();
        let all = || series.iter().flat_map(|(_, _, points)| points.iter().copied());
        if all().next().is_none() {
            return Err(LabError::Figure(format!("nothing to draw over {}", self.x)));
        }
        let extent = |of: fn((f64, f64)) -> f64| {
            all().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                (low.min(v), high.max(v))
            })
        };
        let extents = [extent(|p| p.0), extent(|p| p.1)];
        let legend = if series.len() > 1 { LEGEND_LINE * series.len() as u32 } else { 0 };
        let size = (SIZE.0 * FINE, (SIZE.1 + legend) * FINE);
        let mut svg = String::new();
        self.plot(&mut svg, size, &series, extents, f64::from(legend) / AXES)?;
        Ok(themed(&svg, size))
    }

    /// Plots lines within the extents of both axes; `room` is the height of the legend over that of the plotted lines.
    fn plot(
        &self,
        svg: &mut String,
        size: (u32, u32),
        series: &[Line<'_>],
        [(x_low, x_high), (y_low, y_high)]: [(f64, f64); 2],
        room: f64,
    ) -> Result<(), LabError> {
        let area = SVGBackend::with_string(svg, size).into_drawing_area();
        let failed = |e: &dyn std::fmt::Display| LabError::Figure(e.to_string());
        let mut builder = ChartBuilder::on(&area);
        builder
            .margin(8 * FINE)
            .margin_right(18 * FINE)
            .x_label_area_size(44 * FINE)
            .y_label_area_size(70 * FINE);
        let axis = ("sans-serif", TEXT * FINE).into_font().color(&INK);
        macro_rules! draw {
            ($x:expr, $y:expr) => {{
                let mut chart = builder.build_cartesian_2d($x, $y).map_err(|e| failed(&e))?;
                in_page_style(chart.configure_mesh(), &axis)
                    .x_desc(self.x)
                    .y_desc(self.y)
                    .x_labels(7)
                    .y_labels(6)
                    .x_label_formatter(&|v| tick(*v, x_high - x_low))
                    .y_label_formatter(&|v| tick(*v, y_high - y_low))
                    .draw()
                    .map_err(|e| failed(&e))?;
                for (colour, name, points) in series {
                    let colour = paint(*colour);
                    let style = colour.stroke_width(2 * FINE);
                    let drawn = chart
                        .draw_series(LineSeries::new(points.iter().copied(), style))
                        .map_err(|e| failed(&e))?;
                    drawn.label(*name).legend(move |(x, y)| {
                        PathElement::new([(x, y), (x + 18 * FINE as i32, y)], style)
                    });
                    // dots only if the points are few enough to be distinguished
                    if self.axes == Axes::Logarithmic && points.len() < 100 {
                        let dots =
                            points.iter().map(|p| Circle::new(*p, 3 * FINE, colour.filled()));
                        chart.draw_series(dots).map_err(|e| failed(&e))?;
                    }
                }
                if series.len() > 1 {
                    chart
                        .configure_series_labels()
                        .position(SeriesLabelPosition::UpperRight)
                        .legend_area_size(24 * FINE)
                        .label_font(axis.clone())
                        .background_style(TRANSPARENT)
                        .border_style(TRANSPARENT)
                        .draw()
                        .map_err(|e| failed(&e))?;
                }
            }};
        }
        let pad = 0.06 * (y_high - y_low).max(1e-9 * y_high.abs()).max(1e-12);
        let even = y_low - pad..y_high + pad + room * (y_high - y_low + 2.0 * pad);
        let decades = (x_low * 0.8..x_high * 1.25).log_scale();
        let log_head = 1.4 * (2.0 * y_high / y_low).powf(room);
        match self.axes {
            Axes::Logarithmic => {
                draw!(decades, (y_low * 0.7..y_high * log_head).log_scale())
            }
            Axes::LogarithmicX => draw!(decades, even),
            Axes::Linear => draw!(x_low..x_high, even),
        }
        area.present().map_err(|e| failed(&e))
    }
}

/// Colour, name and points of a line.
type Line<'a> = (usize, &'a str, Vec<(f64, f64)>);

/// A mesh with the colours and the font of the page.
pub(super) fn in_page_style<'a, 'b, X: Ranged, Y: Ranged, DB: DrawingBackend>(
    mut mesh: MeshStyle<'a, 'b, X, Y, DB>,
    font: &TextStyle<'b>,
) -> MeshStyle<'a, 'b, X, Y, DB> {
    mesh.axis_style(INK.stroke_width(FINE))
        .bold_line_style(GRID.stroke_width(FINE))
        .light_line_style(TRANSPARENT)
        .label_style(font.clone())
        .axis_desc_style(font.clone());
    mesh
}

/// Number as a label of an axis.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        let text = format!("{value:.2e}");
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.'));
    }
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

/// Label of a tick on an axis of given length. A sum of steps leaves no exact zero because of rounding.
pub(super) fn tick(value: f64, length: f64) -> String {
    number(if value.abs() < 1e-9 * length { 0.0 } else { value })
}

/// At most [`MOST_POINTS`] points that keep every extreme: minimum and maximum of each interval.
fn thinned(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    if points.len() <= MOST_POINTS {
        return points;
    }
    let stretch = points.len().div_ceil(MOST_POINTS / 2);
    let mut kept = Vec::with_capacity(MOST_POINTS + 2);
    for part in points.chunks(stretch) {
        let by = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        if let (Some(low), Some(high)) = (part.iter().min_by(by), part.iter().max_by(by)) {
            let (first, second) = if low.0 <= high.0 { (low, high) } else { (high, low) };
            kept.push(*first);
            kept.push(*second);
        }
    }
    kept
}

/// SVG with the placeholder colours replaced by the page's, and scaled.
pub(super) fn themed(svg: &str, size: (u32, u32)) -> String {
    svg.replace("#010203", "var(--ink)").replace("#040506", "var(--grid)").replacen(
        &format!("width=\"{}\" height=\"{}\"", size.0, size.1),
        "width=\"100%\" role=\"img\"",
        1,
    )
}
