//! Check of a valve-controlled crane: state of rest with the valve closed, and speeds that the valve gives.

use super::rest_remarks::rest_remarks;
use super::{Check, POSITIONS, warnings};
use crate::output;
use hydroboom_description::{Description, millimetres};
use hydroboom_model::{Circuit, ValveInput};
use miette::{IntoDiagnostic, Result};
use serde_json::{Value, json};

impl Check {
    /// Checks a valve-controlled crane of `N` segments, and prints the result.
    ///
    /// # Errors
    ///
    /// If the crane has no state of rest.
    pub(super) fn valve_controlled<const N: usize>(&self, description: &Description) -> Result<()> {
        let states = POSITIONS
            .iter()
            .map(|share| RestState::new::<N>(description, share * description.numbers.stroke))
            .collect::<Result<Vec<_>>>()?;
        let pressures: Vec<(f64, f64)> =
            states.iter().map(|state| (state.stroke, state.pressure_a)).collect();
        let remarks = rest_remarks(description, &pressures);
        if self.json {
            return output::json(&json!({
                "crane": description.name, "warnings": warnings(description, remarks),
                "at_rest": states.iter().map(RestState::in_json).collect::<Vec<_>>(),
            }));
        }
        remarks.iter().for_each(|remark| output::warn(remark));
        let header = ["stroke [mm]", "p_A [bar]", "tip x, y [m]", "full lift [L/min]", "[mm/s]"];
        let rows: Vec<Vec<String>> = states.iter().map(RestState::cells).collect();
        output::text(&format!(
            "{}: no errors. At rest with the valve closed, and what full travel would lift with:\n{}",
            description.name,
            output::table(&header, &rows)
        ))
    }
}

/// Crane at rest at a piston position with the valve closed, and lifting at full travel of the spool.
struct RestState {
    /// Piston position \[m\].
    stroke: f64,
    /// Piston-side pressure \[Pa\].
    pressure_a: f64,
    /// Position of the tip \[m\].
    tip: [f64; 2],
    /// Flow into the piston side at full travel \[m³/s\].
    full_flow: f64,
    /// Piston speed at full travel \[m/s\].
    full_speed: f64,
}

impl RestState {
    fn new<const N: usize>(description: &Description, stroke: f64) -> Result<Self> {
        let n = &description.numbers;
        let crane = description.valve_crane_over::<f64, N>(n).into_diagnostic()?;
        let start = description.valve_start_over(n, stroke);
        let state = crane.at_rest(&start).into_diagnostic()?;
        let (a, b) = crane.circuit.chambers(&state.circuit);
        let input =
            ValveInput { command: n.spool_full, supply: n.supply_pressure, tank: n.tank_pressure };
        let full_flow = crane.circuit.flows(a, b, 1.0, &input).supply_to_a;
        Ok(Self {
            stroke,
            pressure_a: a,
            tip: crane.boom.tip_position(&crane.boom.pose(&state.boom.angle)),
            full_flow,
            full_speed: full_flow / crane.cylinder.piston_area,
        })
    }

    fn cells(&self) -> Vec<String> {
        let [x, y] = self.tip;
        vec![
            format!("{:.0}", self.stroke * 1e3),
            format!("{:.1}", self.pressure_a * 1e-5),
            format!("{x:.1}, {y:.1}"),
            format!("{:.1}", self.full_flow * 60e3),
            format!("{:.0}", self.full_speed * 1e3),
        ]
    }

    fn in_json(&self) -> Value {
        let [x, y] = self.tip;
        json!({
            "stroke_mm": millimetres(self.stroke), "pressure_a_bar": self.pressure_a * 1e-5,
            "tip_x_m": x, "tip_y_m": y, "full_flow_l_min": self.full_flow * 60e3,
            "full_speed_mm_s": self.full_speed * 1e3,
        })
    }
}
