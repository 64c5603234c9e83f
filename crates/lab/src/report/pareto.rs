//! Error over effort: a mark per controller with bars over the family.

use super::drawing_data::{Drawing, rows_as_csv};
use super::figure::{FINE, INK, in_page_style, number, themed, tick};
use super::palette::{COLOURS, paint};
use crate::LabError;
use crate::closed_loop::monte_carlo::Percentiles;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Control effort and tracking error of one controller over a family of cranes.
pub struct ParetoPoint<'a> {
    /// Text in the legend.
    pub name: &'a str,
    /// Index of its colour in the palette. Beyond the palette the colours repeat with triangles as marks.
    pub colour: usize,
    /// Control effort over the family: median, and a bar from the 5th to the 95th percentile.
    pub effort: Percentiles,
    /// Tracking error over the family: median, and a bar from the 5th to the 95th percentile.
    pub error: Percentiles,
}

/// Figure of tracking error over control effort, with a logarithmic error axis.
pub struct Pareto<'a> {
    /// Label of the horizontal axis, with its unit.
    pub effort: &'a str,
    /// Label of the vertical axis, with its unit.
    pub error: &'a str,
    /// Controllers, a mark each.
    pub marks: Vec<ParetoPoint<'a>>,
}

/// Width of the figure, narrow enough for readable text on a phone; heights of the axes and of a line of
/// the legend below.
const WIDTH: u32 = 480;
const HEIGHT: u32 = 340;
const LINE: u32 = 22;
const TEXT: u32 = 16;
/// Smallest range of the axes on both sides of 1, the benchmark's value.
const NEAR_ONE: f64 = 0.05;

impl Pareto<'_> {
    /// Draws the figure as SVG, with its data; controllers without finite percentiles are omitted.
    ///
    /// # Errors
    ///
    /// [`LabError::Figure`] if there is no finite value.
    pub fn drawn(&self) -> Result<Drawing, LabError> {
        let svg = self.svg()?;
        let rows: Vec<(&str, Vec<f64>)> = self
            .marks
            .iter()
            .map(|m| {
                (m.name, [m.effort, m.error].iter().flat_map(|s| [s.p5, s.median, s.p95]).collect())
            })
            .collect();
        let (effort, error) =
            (format!("median: {}", self.effort), format!("median: {}", self.error));
        let header = ["name", "effort, 5 %", &effort, "95 %", "error, 5 %", &error, "95 %"];
        let names: Vec<&str> = self.marks.iter().map(|mark| mark.name).collect();
        let says = format!("{} over {}: {}.", self.error, self.effort, names.join(", "));
        Ok(Drawing { svg, csv: rows_as_csv(&header, &rows), says })
    }

    fn svg(&self) -> Result<String, LabError> {
        let finite =
            |s: &Percentiles| s.p5.is_finite() && s.median.is_finite() && s.p95.is_finite();
        let drawable =
            |m: &&ParetoPoint<'_>| finite(&m.effort) && finite(&m.error) && m.error.p5 > 0.0;
        let marks: Vec<&ParetoPoint<'_>> = self.marks.iter().filter(drawable).collect();
        if marks.is_empty() {
            return Err(LabError::Figure(format!("nothing to draw over {}", self.effort)));
        }
        let extent = |of: fn(&ParetoPoint<'_>) -> Percentiles| {
            let ends = marks.iter().map(|m| of(m));
            ends.fold((1.0_f64, 1.0_f64), |(low, high), s| (low.min(s.p5), high.max(s.p95)))
        };
        let (x_low, x_high) = extent(|m| m.effort);
        let (y_low, y_high) = extent(|m| m.error);
        let pad = (0.06 * (x_high - x_low)).max(NEAR_ONE);
        let room = (y_high / y_low).powf(0.06).max(1.0 + NEAR_ONE);
        let failed = |e: &dyn std::fmt::Display| LabError::Figure(e.to_string());
        let legend = LINE * marks.len() as u32 + LINE / 2;
        let size = (WIDTH * FINE, (HEIGHT + legend) * FINE);
        let mut svg = String::new();
        {
            let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            let (axes, below) = area.split_vertically(HEIGHT * FINE);
            let font = ("sans-serif", TEXT * FINE).into_font().color(&INK);
            let range = (y_low / room..y_high * room).log_scale();
            let mut chart = ChartBuilder::on(&axes)
                .margin(8 * FINE)
                .margin_right(18 * FINE)
                .x_label_area_size(48 * FINE)
                .y_label_area_size(70 * FINE)
                .build_cartesian_2d(x_low - pad..x_high + pad, range)
                .map_err(|e| failed(&e))?;
            in_page_style(chart.configure_mesh(), &font)
                .x_desc(self.effort)
                .y_desc(self.error)
                .x_labels(6)
                .y_labels(6)
                .x_label_formatter(&|v| tick(*v, x_high - x_low))
                .y_label_formatter(&|v| number(*v))
                .draw()
                .map_err(|e| failed(&e))?;
            for mark in &marks {
                let (x, y) = (mark.effort, mark.error);
                let style = paint(mark.colour).stroke_width(2 * FINE);
                let bars =
                    [[(x.p5, y.median), (x.p95, y.median)], [(x.median, y.p5), (x.median, y.p95)]];
                let bars = bars.map(|bar| PathElement::new(bar, style));
                chart.draw_series(bars).map_err(|e| failed(&e))?;
                let at = (x.median, y.median);
                if mark.colour < COLOURS.len() {
                    let dot = Circle::new(at, 5 * FINE, style.filled());
                    chart.draw_series([dot]).map_err(|e| failed(&e))?;
                } else {
                    let triangle = TriangleMarker::new(at, 7 * FINE, style.filled());
                    chart.draw_series([triangle]).map_err(|e| failed(&e))?;
                }
            }
            let fine = |pixels: u32| (pixels * FINE) as i32;
            let left = font.pos(Pos::new(HPos::Left, VPos::Center));
            for (k, mark) in marks.iter().enumerate() {
                let y = fine(LINE * k as u32 + LINE / 2);
                let colour = paint(mark.colour).filled();
                let at = (fine(78), y);
                if mark.colour < COLOURS.len() {
                    below.draw(&Circle::new(at, 5 * FINE, colour)).map_err(|e| failed(&e))?;
                } else {
                    let triangle = TriangleMarker::new(at, 7 * FINE, colour);
                    below.draw(&triangle).map_err(|e| failed(&e))?;
                }
                let name = Text::new(mark.name, (fine(92), y), left.clone());
                below.draw(&name).map_err(|e| failed(&e))?;
            }
            area.present().map_err(|e| failed(&e))?;
        }
        Ok(themed(&svg, size))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(name: &str, colour: usize, effort: [f64; 3], error: [f64; 3]) -> ParetoPoint<'_> {
        let spread = |[p5, median, p95]: [f64; 3]| Percentiles {
            least: p5,
            p5,
            p25: p5,
            median,
            p75: p95,
            p95,
            worst: p95,
        };
        ParetoPoint { name, colour, effort: spread(effort), error: spread(error) }
    }

    /// Less effort is further left, less error further down (a larger y on the page).
    #[test]
    fn less_effort_and_less_error_are_towards_the_lower_left() {
        let marks = vec![
            mark("worse", 0, [0.9, 1.1, 1.2], [0.5, 1.0, 2.0]),
            mark("better", 1, [0.8, 0.9, 1.0], [0.01, 0.02, 0.05]),
            mark("unfinished", 2, [f64::NAN; 3], [0.1, 0.2, 0.3]),
        ];
        let svg = Pareto { effort: "effort [-]", error: "error [-]", marks }.drawn().unwrap().svg;
        let circles: Vec<[f64; 2]> = svg
            .split("<circle ")
            .skip(1)
            .map(|circle| {
                ["cx=\"", "cy=\""].map(|key| {
                    let value = circle.split(key).nth(1).unwrap();
                    value.split('"').next().unwrap().parse().unwrap()
                })
            })
            .collect();
        // two marks, then the legend
        assert_eq!(circles.len(), 4, "{svg}");
        assert!(circles[1][0] < circles[0][0] && circles[1][1] > circles[0][1], "{circles:?}");
        assert!(svg.contains("effort [-]") && svg.contains("var(--ink)"));
        assert!(!svg.contains("unfinished"));
    }
}
