//! Horizontal bars with names, as in tornado diagrams.

use super::drawing_data::{Drawing, rows_as_csv};
use super::figure::{FINE, INK, in_page_style, themed, tick};
use super::palette::paint;
use crate::LabError;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Bar of a chart, from a start to an end value in the unit of the axis.
pub struct Bar<'a> {
    /// Name at the left of the bar.
    pub name: &'a str,
    /// Start value, in the unit of the axis.
    pub from: f64,
    /// End value, in the unit of the axis; marked by a dot if the bar does not start at zero.
    pub to: f64,
    /// Index of the bar's colour in the palette.
    pub colour: usize,
    /// Lower and upper limit of an interval about the end value; none for no interval.
    pub bounds: Option<(f64, f64)>,
}

/// Bar chart with horizontal bars from top to bottom.
pub struct Bars<'a> {
    /// Label of the axis, with its unit.
    pub x: &'a str,
    /// Bars in their order.
    pub bars: Vec<Bar<'a>>,
}

/// Width of the figure, width of the names' column, and heights of a bar's row and of the axis below.
const WIDTH: u32 = 560;
const NAMES: u32 = 284;
const ROW: u32 = 26;
const BELOW: u32 = 52;

impl Bars<'_> {
    /// Draws the chart as SVG, with its data.
    ///
    /// # Errors
    ///
    /// [`LabError::Figure`] if there is no finite value.
    pub fn drawn(&self) -> Result<Drawing, LabError> {
        let svg = self.svg()?;
        let rows: Vec<(&str, Vec<f64>)> = self
            .bars
            .iter()
            .map(|bar| {
                let (low, high) = bar.bounds.unwrap_or((bar.to, bar.to));
                (bar.name, vec![bar.from, bar.to, low, high])
            })
            .collect();
        let named: Vec<String> = self
            .bars
            .iter()
            .map(|bar| format!("{} {}", bar.name, tick(bar.to, bar.to.abs())))
            .collect();
        let csv = rows_as_csv(&["name", &format!("from: {}", self.x), "to", "low", "high"], &rows);
        Ok(Drawing { svg, csv, says: format!("Bars of {}: {}.", self.x, named.join(", ")) })
    }

    fn svg(&self) -> Result<String, LabError> {
        let ends = || {
            self.bars.iter().flat_map(|b| {
                let (low, high) = b.bounds.unwrap_or((b.to, b.to));
                [b.from, b.to, low, high]
            })
        };
        let (low, high) = ends().fold((0.0_f64, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
        if self.bars.is_empty() || ends().any(|v| !v.is_finite()) || low == high {
            return Err(LabError::Figure(format!("nothing to draw over {}", self.x)));
        }
        let failed = |e: &dyn std::fmt::Display| LabError::Figure(e.to_string());
        let size = (WIDTH * FINE, (ROW * self.bars.len() as u32 + BELOW) * FINE);
        let mut svg = String::new();
        {
            let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            let font = ("sans-serif", 15 * FINE).into_font().color(&INK);
            let pad = 0.04 * (high - low);
            let left = if low < 0.0 { low - pad } else { 0.0 };
            let count = self.bars.len() as f64;
            let mut chart = ChartBuilder::on(&area)
                .margin(6 * FINE)
                .margin_right(18 * FINE)
                .x_label_area_size(40 * FINE)
                .y_label_area_size(NAMES * FINE)
                .build_cartesian_2d(left..high + pad, 0.0..count)
                .map_err(|e| failed(&e))?;
            in_page_style(chart.configure_mesh(), &font)
                .disable_y_mesh()
                .y_labels(0)
                .x_desc(self.x)
                .x_labels(4)
                .x_label_formatter(&|v| tick(*v, high - low))
                .draw()
                .map_err(|e| failed(&e))?;
            let name = font.pos(Pos::new(HPos::Right, VPos::Center));
            for (k, bar) in self.bars.iter().enumerate() {
                let middle = count - k as f64 - 0.5;
                let rectangle = Rectangle::new(
                    [(bar.from, middle - 0.32), (bar.to, middle + 0.32)],
                    paint(bar.colour).mix(0.75).filled(),
                );
                chart.draw_series([rectangle]).map_err(|e| failed(&e))?;
                if bar.from != 0.0 {
                    let dot = Circle::new((bar.to, middle), 4 * FINE, INK.filled());
                    chart.draw_series([dot]).map_err(|e| failed(&e))?;
                }
                if let Some((low, high)) = bar.bounds {
                    let line =
                        PathElement::new([(low, middle), (high, middle)], INK.stroke_width(FINE));
                    chart.draw_series([line]).map_err(|e| failed(&e))?;
                }
                let (x, y) = chart.plotting_area().map_coordinate(&(left, middle));
                area.draw(&Text::new(bar.name, (x - 8 * FINE as i32, y), name.clone()))
                    .map_err(|e| failed(&e))?;
            }
            area.present().map_err(|e| failed(&e))?;
        }
        Ok(themed(&svg, size))
    }
}
