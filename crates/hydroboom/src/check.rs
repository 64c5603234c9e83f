//! `hydroboom check`

use crate::{crane_file::CraneFile, output};
use clap::Args;
use hydroboom_description::Description;
use hydroboom_description::schema::CircuitChoice;
use hydroboom_lab::plant;
use hydroboom_model::{Circuit, Scheme, ValveInput};
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// Check a crane file: keys, ranges, geometry, static balance, step limits.
#[derive(Args)]
#[command(after_help = "Example: hydroboom check --crane my-crane.toml")]
pub struct Check {
    #[command(flatten)]
    crane: CraneFile,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Check {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let description = self.crane.read_any()?;
        if description.choices.circuit == CircuitChoice::ValveControlled {
            return match description.segment_shares.len() {
                1 => self.valve_controlled::<1>(&description),
                2 => self.valve_controlled::<2>(&description),
                _ => self.valve_controlled::<3>(&description),
            };
        }
        let numbers = &description.numbers;
        let mut rows = Vec::new();
        let mut values = Vec::new();
        for share in [0.0, 0.5, 1.0] {
            let start = description.start(share * numbers.stroke);
            let crane = plant(&description, &start, Scheme::Implicit, 1e-3).into_diagnostic()?;
            let (outputs, limit) = (crane.outputs(), crane.step_limit());
            rows.push(vec![
                format!("{:.0}", outputs.stroke * 1e3),
                format!("{:.1}", outputs.pressure_a * 1e-5),
                format!("{:.2}", outputs.cylinder_force * 1e-3),
                format!("{:.1}", outputs.tip_deflection * 1e3),
                format!("{:.1}", limit.bending * 1e6),
                format!("{:.1}", limit.friction * 1e6),
                format!("{:.1}", limit.chatter * 1e6),
            ]);
            values.push(json!({
                "stroke_mm": outputs.stroke * 1e3,
                "pressure_a_bar": outputs.pressure_a * 1e-5,
                "cylinder_force_n": outputs.cylinder_force,
                "tip_deflection_mm": outputs.tip_deflection * 1e3,
                "step_limit_us": {
                    "bending": limit.bending * 1e6,
                    "friction": limit.friction * 1e6,
                    "chatter": limit.chatter * 1e6,
                },
            }));
        }
        if self.json {
            return output::json(&json!({
                "crane": description.name,
                "warnings": description.warnings(),
                "at_rest": values,
            }));
        }
        let header = [
            "stroke [mm]",
            "p_A [bar]",
            "F_cyl [kN]",
            "tip [mm]",
            "bending [us]",
            "friction [us]",
            "chatter [us]",
        ];
        output::text(&format!(
            "{}: no errors. At rest, and the published scheme's step limits:\n{}",
            description.name,
            output::table(&header, &rows)
        ))
    }

    /// The same for a crane on a valve: what it stands at with the valve closed, and how fast the valve moves it.
    fn valve_controlled<const N: usize>(&self, description: &Description) -> Result<()> {
        let n = &description.numbers;
        let crane = description.valve_crane_over::<f64, N>(n).into_diagnostic()?;
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        for share in [0.0, 0.5, 1.0] {
            let stroke = share * n.stroke;
            let start = description.valve_start_over(n, stroke);
            let state = crane.at_rest(&start).into_diagnostic()?;
            let (a, b) = crane.circuit.chambers(&state.circuit);
            let [x, y] = crane.boom.tip_position(&crane.boom.pose(&state.boom.angle));
            let input = ValveInput {
                command: n.spool_full,
                supply: n.supply_pressure,
                tank: n.tank_pressure,
            };
            let flow = crane.circuit.flows(a, b, 1.0, &input).supply_to_a;
            let speed = flow / crane.cylinder.piston_area;
            let (bar, mm) = (1e-5, 1e3);
            rows.push(vec![
                format!("{:.0}", stroke * mm),
                format!("{:.1}", a * bar),
                format!("{:.1}, {:.1}", x, y),
                format!("{:.1}", flow * 60e3),
                format!("{:.0}", speed * mm),
            ]);
            values.push(json!({
                "stroke_mm": stroke * mm, "pressure_a_bar": a * bar, "tip_x_m": x, "tip_y_m": y,
                "full_flow_l_min": flow * 60e3, "full_speed_mm_s": speed * mm,
            }));
        }
        if self.json {
            return output::json(&json!({
                "crane": description.name, "warnings": description.warnings(), "at_rest": values,
            }));
        }
        let header = ["stroke [mm]", "p_A [bar]", "tip x, y [m]", "full lift [L/min]", "[mm/s]"];
        output::text(&format!(
            "{}: no errors. At rest with the valve closed, and what full travel would lift with:\n{}",
            description.name,
            output::table(&header, &rows)
        ))
    }
}
