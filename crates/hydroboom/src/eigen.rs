//! `hydroboom eigen`

use crate::number;
use crate::{crane_file::CraneFile, output};
use clap::Args;
use hydroboom_description::Description;
use hydroboom_description::schema::FrictionChoice;
use hydroboom_lab::{eigenfrequency, paper};
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// Eigenfrequencies with the load held: oscillation test and linearised crane; the paper's crane beside Table 5.
#[derive(Args)]
#[command(after_help = "Example: hydroboom eigen --stroke-mm 100,200,400 --set boom.segments=10")]
pub struct Eigen {
    #[command(flatten)]
    crane: CraneFile,
    /// Piston positions: 0 to 20000 mm.
    #[arg(long, value_delimiter = ',', default_values_t = paper::EIGEN_STROKE_MM, value_parser = number::within(number::STROKE, "mm"))]
    stroke_mm: Vec<f64>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Eigen {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If the crane file is invalid, or no piston position has an eigenfrequency.
    pub fn run(self) -> Result<()> {
        let description = self.crane.read()?;
        let (mut rows, mut failed) = (Vec::new(), Vec::new());
        for stroke in &self.stroke_mm {
            match eigenfrequency::row(&description, stroke * 1e-3) {
                Ok(row) => rows.push(row),
                Err(error) => failed.push((*stroke, error)),
            }
        }
        // an error at one stroke does not affect the others
        if rows.is_empty()
            && let Some((_, error)) = failed.pop()
        {
            return Err(error).into_diagnostic();
        }
        if !self.crane.is_papers_crane()? {
            rows = rows.into_iter().map(eigenfrequency::Row::without_paper).collect();
        }
        if self.json {
            let failed: Vec<_> = failed
                .iter()
                .map(|(stroke, error)| json!({ "stroke_mm": stroke, "error": error.to_string() }))
                .collect();
            return output::json(&json!({ "eigenfrequency": rows, "failed": failed }));
        }
        let failed: String =
            failed.iter().map(|(stroke, error)| format!("\n{stroke:.0} mm: {error}")).collect();
        output::text(&format!(
            "{}{failed}\n\n{}\n\n{}",
            table(&rows),
            difference(&description, &rows),
            shapes(&description, &rows)
        ))
    }
}

/// Relative difference below which oscillation and linearisation agree.
const SAME: f64 = 0.005;

/// Explanation of the difference between the columns.
fn difference(description: &Description, rows: &[eigenfrequency::Row]) -> String {
    let apart = |row: &eigenfrequency::Row| {
        row.frictionless_hz.map(|hz| (hz / row.linearised_hz - 1.0).abs())
    };
    let largest = rows.iter().filter_map(apart).fold(0.0, f64::max);
    let n = &description.numbers;
    let mut text = format!(
        "The trapped rod-side pressure is {:.1} bar (oscillation.rod_side_bar); the oil stiffens at {:.1} bar (oil.transition_bar).\n\
         Without friction, oscillation and linearisation have the same mode: they differ by {:.1} % at most.",
        n.oscillation_rod_side * 1e-5,
        n.transition * 1e-5,
        largest * 100.0
    );
    for row in rows.iter().filter(|row| apart(row).is_some_and(|apart| apart > SAME)) {
        let [low, high] = row.frictionless_bar;
        text += &format!(
            "\nAt {:.0} mm the drop of {:.1} mm moves p_A from {low:.0} to {high:.0} bar, and the oil's stiffness with it.",
            row.stroke_mm,
            eigenfrequency::SMALL_DROP * 1e3
        );
    }
    for row in rows.iter().filter(|row| row.oscillation_hz.is_none()) {
        text += &format!(
            "\nAt {:.0} mm friction ends the oscillation before two periods are over: it has no frequency there.",
            row.stroke_mm
        );
    }
    let at_rest = match description.choices.friction {
        FrictionChoice::Stribeck => "the smoothed friction law at rest, a stiff damper",
        FrictionChoice::LuGre => "the bristles at rest, a stiff spring with a damper",
    };
    text + &format!(
        "\nWith friction, the oscillation is that of a drop of {:.1} mm, which friction brings to rest; the linearisation takes\n\
             {at_rest}, which holds the piston back, so that the boom bends more and the oil less.",
        description.numbers.oscillation_drop * 1e3
    )
}

/// All oscillatory modes with their mode shapes.
fn shapes(description: &Description, rows: &[eigenfrequency::Row]) -> String {
    let cells: Vec<Vec<String>> = rows
        .iter()
        .flat_map(|row| row.modes.iter().map(move |shaped| (row.stroke_mm, shaped)))
        .map(|(stroke, shaped)| {
            let angles: Vec<String> = shaped.angles.iter().map(|a| format!("{a:.2}")).collect();
            vec![
                format!("{stroke:.0}"),
                format!("{:.3}", shaped.mode.frequency_hz),
                format!("{:.5}", shaped.mode.damping_ratio),
                format!("{:.2}", shaped.pressure_a_bar_per_deg),
                angles.join(" "),
            ]
        })
        .collect();
    // an elastic base adds a coordinate, the last one
    let angles = match description.numbers.base_stiffness > 0.0 {
        true => "angles of the segments, and of the base",
        false => "segments' angles",
    };
    let header = ["x_cyl [mm]", "f [Hz]", "damping", "p_A [bar/deg]", angles];
    format!(
        "Modes of the linearised crane, friction off; mode shapes relative to the outermost segment's angle\n{}",
        output::table(&header, &cells)
    )
}

/// Table 5: eigenfrequencies \[Hz\] with the load held, "paper | here".
pub fn table(rows: &[eigenfrequency::Row]) -> String {
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|r| {
            vec![
                format!("{:.0}", r.stroke_mm),
                output::optional(r.paper_measured_hz, 2),
                output::optional(r.paper_simulated_hz, 2),
                format!("{:.3}", r.linearised_hz),
                output::optional(r.frictionless_hz, 3),
                output::optional(r.oscillation_hz, 3),
                format!("{:.3}", r.linearised_with_friction_hz),
            ]
        })
        .collect();
    let header = [
        "x_cyl [mm]",
        "paper measured",
        "paper simulated",
        "linearised",
        "oscillation",
        "osc. with friction",
        "lin. with friction",
    ];
    let is_beside_paper = rows.iter().any(|row| row.paper_simulated_hz.is_some());
    let title = if is_beside_paper { "Table 5: eigenfrequencies" } else { "Eigenfrequencies" };
    format!(
        "{title} [Hz], load held; friction off unless stated\n{}",
        output::table_beside_paper(&header, &cells)
    )
}
