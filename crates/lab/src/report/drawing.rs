//! Drawing of the crane to scale at both ends of its motion.

use super::drawing_data::{Drawing, lines_as_csv};
use crate::{LabError, plant};
use hydroboom_description::{Description, Numbers};
use hydroboom_model::Scheme;

/// Scale \[pixels/m\].
const SCALE: f64 = 150.0;

/// Drawing of the crane to scale as SVG: boom and cylinder at the first and last position of the motion, with
/// dimensions.
///
/// # Errors
///
/// [`LabError::Plant`] if the crane has no state of rest there.
pub fn crane(description: &Description) -> Result<Drawing, LabError> {
    let n = &description.numbers;
    let mut view = View {
        low: [n.base_x.min(0.0) - 0.3, n.base_y - 0.35],
        high: [n.base_x.max(0.0) + 0.3, 0.3_f64],
    };
    let mut poses = Vec::new();
    for stroke in [n.motion_start, n.motion_end] {
        let crane = plant(description, &description.start(stroke), Scheme::Implicit, 1e-3)?;
        let line = crane.boom_line();
        view.include(&line);
        poses.push(Pose { stroke, line, mount: crane.mount() });
    }
    let lines: Vec<(String, Vec<(f64, f64)>)> = poses
        .iter()
        .map(|Pose { stroke, line, .. }| {
            let points = line.iter().map(|[x, y]| (*x, *y)).collect();
            (format!("boom at {:.0} mm", stroke * 1e3), points)
        })
        .collect();
    let lines = lines.iter().map(|(name, points)| (name.as_str(), points.as_slice()));
    let csv = lines_as_csv("x [m]", "y [m]", lines);
    let says = format!(
        "A boom of {:.2} m on its pivot A, lifted by a cylinder from the foot B, with its payload of {:.0} kg at the tip.",
        n.boom_length, n.payload
    );
    Ok(Drawing { svg: svg(n, &view, &poses), csv, says })
}

/// Section of the crane's plane that is drawn: its lower left and upper right corner \[m\].
struct View {
    low: [f64; 2],
    high: [f64; 2],
}

impl View {
    /// Widens the view to a boom's line, with a margin.
    fn include(&mut self, line: &[[f64; 2]]) {
        let Self { low, high } = self;
        for [x, y] in line {
            *low = [low[0].min(x - 0.3), low[1].min(y - 0.3)];
            *high = [high[0].max(x + 0.5), high[1].max(y + 0.3)];
        }
    }

    /// Point of the drawing \[pixels\].
    fn px(&self, [x, y]: [f64; 2]) -> (f64, f64) {
        ((x - self.low[0]) * SCALE, (self.high[1] - y) * SCALE)
    }

    /// Width and height of the drawing \[pixels\].
    fn size(&self) -> (f64, f64) {
        ((self.high[0] - self.low[0]) * SCALE, (self.high[1] - self.low[1]) * SCALE)
    }
}

/// The crane at a piston position \[m\]: the boom's line from bearing to tip, and the cylinder's mount \[m\].
struct Pose {
    stroke: f64,
    line: Vec<[f64; 2]>,
    mount: [f64; 2],
}

fn svg(n: &Numbers<f64>, view: &View, poses: &[Pose]) -> String {
    let (width, height) = view.size();
    let mut svg = format!(
        "<svg viewBox=\"0 0 {width:.0} {height:.0}\" width=\"100%\" role=\"img\" \
         font-family=\"sans-serif\" font-size=\"20\" fill=\"var(--ink)\">"
    );
    let ((ax, ay), (bx, by)) = (view.px([0.0, 0.0]), view.px([n.base_x, n.base_y]));
    svg += &format!(
        "<path d=\"M{ax:.1} {ay:.1} L{ax:.1} {by:.1} L{bx:.1} {by:.1}\" fill=\"none\" \
         stroke=\"var(--grid)\" stroke-width=\"8\"/>"
    );
    for (index, pose) in poses.iter().enumerate() {
        let opacity = if index == 0 { 0.45 } else { 1.0 };
        svg += &boom_and_cylinder(n, view, pose, opacity);
    }
    for (x, y, name) in [(ax, ay, "A"), (bx, by, "B")] {
        svg += &format!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"6\"/><text x=\"{:.1}\" y=\"{:.1}\">{name}</text>",
            x - 22.0,
            y + 5.0
        );
    }
    svg + &dimensions(n, view) + "</svg>"
}

fn boom_and_cylinder(n: &Numbers<f64>, view: &View, pose: &Pose, opacity: f64) -> String {
    let Pose { stroke, line, mount } = pose;
    let colour = "#0072b2";
    let points: Vec<String> =
        line.iter().map(|p| view.px(*p)).map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    let ((bx, by), (cx, cy)) = (view.px([n.base_x, n.base_y]), view.px(*mount));
    let mut svg = format!(
        "<g opacity=\"{opacity}\"><polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" \
         stroke-width=\"7\" stroke-linejoin=\"round\"/>",
        points.join(" ")
    );
    // the barrel takes the cylinder's retracted length, the rod the rest
    let share = n.shortest / (n.shortest + stroke) * 0.9;
    let (mx, my) = (bx + (cx - bx) * share, by + (cy - by) * share);
    svg += &format!(
        "<line x1=\"{bx:.1}\" y1=\"{by:.1}\" x2=\"{cx:.1}\" y2=\"{cy:.1}\" \
         stroke=\"#d55e00\" stroke-width=\"4\"/><line x1=\"{bx:.1}\" y1=\"{by:.1}\" \
         x2=\"{mx:.1}\" y2=\"{my:.1}\" stroke=\"#d55e00\" stroke-width=\"10\"/>"
    );
    // lug of the cylinder mount, from the boom's axis
    for [x, y] in line.iter().skip(1) {
        let (x, y) = view.px([*x, *y]);
        svg += &format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{colour}\"/>");
    }
    if let Some(tip) = line.last() {
        let (x, y) = view.px(*tip);
        svg += &format!(
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"26\" height=\"26\" fill=\"#009e73\"/>\
             <text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">x_cyl = {:.0} mm</text>",
            x - 13.0,
            y - 13.0,
            y - 20.0,
            stroke * 1e3
        );
    }
    svg + &format!("<circle cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"5\"/></g>")
}

/// Dimensions of the base, and a scale bar of one metre.
fn dimensions(n: &Numbers<f64>, view: &View) -> String {
    let (width, height) = view.size();
    let ((ax, ay), (bx, by)) = (view.px([0.0, 0.0]), view.px([n.base_x, n.base_y]));
    let text =
        |x: f64, y: f64, text: String| format!("<text x=\"{x:.1}\" y=\"{y:.1}\">{text}</text>");
    let mut svg = text((ax + bx) / 2.0 - 25.0, by + 24.0, format!("{:.0} mm", n.base_x * 1e3));
    svg += &text(ax - 40.0, (ay + by) / 2.0, format!("{:.0} mm", -n.base_y * 1e3));
    let y = height - 14.0;
    let x = width - 30.0 - SCALE;
    svg += &format!(
        "<path d=\"M{x:.0} {y:.0} h{SCALE:.0} m0 -5 v10 M{x:.0} {:.0} v10\" stroke=\"var(--ink)\" \
         fill=\"none\"/>",
        y - 5.0
    );
    svg += &text(x + SCALE / 2.0 - 14.0, y - 6.0, "1 m".into());
    svg + &text(
        x - 2.2 * SCALE,
        y - 6.0,
        format!("boom {:.0} mm, payload {:.0} kg", n.boom_length * 1e3, n.payload),
    )
}
