//! Check of a self-contained crane: state of rest, step limits of the published scheme, loops of the controllers.

use super::load_range::{load_range_remarks, load_range_text};
use super::rest_remarks::{largest, rest_remarks};
use super::{Check, POSITIONS, warnings};
use crate::{benchmark_gains, output};
use hydroboom_description::schema::FrictionChoice;
use hydroboom_description::{Description, millimetres};
use hydroboom_design::benchmark_design::payload_range;
use hydroboom_design::stability::{
    FINDS_GAINS, LOWERS_GAINS, LoopStability, benchmark_stability, remark_on_ideal_equipment,
    scheduled_lqr_stability, unstable_on_ideal_equipment,
};
use hydroboom_design::{DesignError, LoadPressure, load_pressure};
use hydroboom_lab::plant;
use hydroboom_model::{Outputs, Scheme, StepLimit};
use miette::{IntoDiagnostic, Result};
use serde_json::{Value, json};

/// Names of the controllers, and the stability of their loops with the equipment that they expect; an error where the
/// loop cannot be computed.
type Loops = [(&'static str, Result<LoopStability, DesignError>); 2];

impl Check {
    /// Checks a self-contained crane, and prints the result.
    ///
    /// # Errors
    ///
    /// If the crane has no state of rest, or the margins of its benchmark controller cannot be computed.
    pub(super) fn self_contained(&self, description: &Description) -> Result<()> {
        let states = POSITIONS
            .iter()
            .map(|share| RestState::new(description, share * description.numbers.stroke))
            .collect::<Result<Vec<_>>>()?;
        let pressures: Vec<(f64, f64)> =
            states.iter().map(|state| (state.stroke, state.outputs.pressure_a)).collect();
        let mut remarks = rest_remarks(description, &pressures);
        let load = load_pressure(description);
        match &load {
            Ok(load) => {
                remarks.extend(load_range_remarks(description, load, largest(&pressures)));
            }
            Err(error) => {
                remarks.push(format!("the load over the file's ranges cannot be computed: {error}"))
            }
        }
        let load = load.ok();
        let loops = [
            ("benchmark", benchmark_stability(description, None)),
            ("scheduled LQR", scheduled_lqr_stability(description, None)),
        ];
        remarks.extend(loop_remarks(description, &loops)?);
        let expected: Vec<LoopStability> =
            loops.iter().filter_map(|(_, of)| of.as_ref().ok().cloned()).collect();
        // an error of the loops is reported above
        let on_ideal = unstable_on_ideal_equipment(description, &expected).unwrap_or_default();
        remarks.extend(remark_on_ideal_equipment(&on_ideal));
        if self.json {
            let stable = loops.iter().all(|(_, of)| of.as_ref().is_ok_and(|of| of.stable));
            let has_bristles = has_bristles(description);
            return output::json(&json!({
                "crane": description.name,
                "warnings": warnings(description, remarks),
                "stable": stable, "loops": expected, "unstable_on_ideal_equipment": on_ideal,
                "load_pressure_bar": load
                    .map(|load| [load.least, load.nominal, load.most].map(|p| p * 1e-5)),
                "at_rest": states.iter().map(|state| state.in_json(has_bristles)).collect::<Vec<_>>(),
            }));
        }
        remarks.iter().for_each(|remark| output::warn(remark));
        output::text(&text(description, &states, load.as_ref()))
    }
}

/// Crane at rest at a piston position, with the step limits of the published scheme there.
struct RestState {
    /// Piston position \[m\].
    stroke: f64,
    outputs: Outputs<f64>,
    /// Step limits; that of the bristles at the largest piston speed, which the motor gives.
    limit: StepLimit,
}

impl RestState {
    fn new(description: &Description, stroke: f64) -> Result<Self> {
        let start = description.start(stroke);
        let crane = plant(description, &start, Scheme::Implicit, 1e-3).into_diagnostic()?;
        let (law, fastest) = (description.friction_law(), description.fastest_piston());
        let bristle = StepLimit::of_bristles(&law, fastest);
        let limit = StepLimit { bristle, ..crane.step_limit() };
        Ok(Self { stroke, outputs: crane.outputs(), limit })
    }

    fn cells(&self, has_bristles: bool) -> Vec<String> {
        let Self { outputs, limit, .. } = self;
        let mut cells = vec![
            format!("{:.0}", self.stroke * 1e3),
            format!("{:.1}", outputs.pressure_a * 1e-5),
            format!("{:.2}", outputs.cylinder_force * 1e-3),
            format!("{:.1}", outputs.tip_deflection * 1e3),
            format!("{:.1}", limit.bending * 1e6),
            format!("{:.1}", limit.friction * 1e6),
            format!("{:.1}", limit.chatter * 1e6),
        ];
        if has_bristles {
            cells.push(format!("{:.1}", limit.bristle * 1e6));
        }
        cells
    }

    fn in_json(&self, has_bristles: bool) -> Value {
        let Self { outputs, limit, .. } = self;
        json!({
            "stroke_mm": millimetres(self.stroke),
            "pressure_a_bar": outputs.pressure_a * 1e-5,
            "cylinder_force_n": outputs.cylinder_force,
            "tip_deflection_mm": outputs.tip_deflection * 1e3,
            "step_limit_us": {
                "bending": limit.bending * 1e6,
                "friction": limit.friction * 1e6,
                "chatter": limit.chatter * 1e6,
                "bristle": has_bristles.then_some(limit.bristle * 1e6),
            },
        })
    }
}

/// Whether friction has bristles, as LuGre's law.
fn has_bristles(description: &Description) -> bool {
    description.choices.friction == FrictionChoice::LuGre
}

/// Remarks on loops that are unstable or cannot be computed, and on benchmark gains with too little margin.
fn loop_remarks(description: &Description, loops: &Loops) -> Result<Vec<String>> {
    let mut remarks = Vec::new();
    for (name, stability) in loops {
        match stability {
            Ok(stability) if stability.stable => {}
            Ok(unstable) if unstable.is_benchmark() => {
                remarks.push(format!("{unstable}; {FINDS_GAINS}"));
            }
            Ok(unstable) => remarks.push(format!(
                "{unstable}; {LOWERS_GAINS}; `hydroboom design` shows its margins at each position"
            )),
            Err(error) => remarks.push(format!(
                "{name}: its loop cannot be computed: {error}. A number may be wrong by orders of magnitude: \
                 `hydroboom show` lists all"
            )),
        }
    }
    if matches!(&loops[0].1, Ok(benchmark) if benchmark.stable) {
        let payload = description.numbers.payload;
        let little = benchmark_gains::too_little_margin(description, [payload; 2])?;
        remarks.extend(little.map(|margins| {
            format!(
                "benchmark: its gains leave too little margin with {payload:.0} kg: {margins}; {FINDS_GAINS}"
            )
        }));
    }
    Ok(remarks)
}

/// Table of the states of rest, with the load over the file's ranges and the conditions of step limits and loops.
fn text(description: &Description, states: &[RestState], load: Option<&LoadPressure>) -> String {
    let has_bristles = has_bristles(description);
    let mut header = vec![
        "stroke [mm]",
        "p_A [bar]",
        "F_cyl [kN]",
        "tip [mm]",
        "bending [us]",
        "friction [us]",
        "chatter [us]",
    ];
    if has_bristles {
        header.push("bristles [us]");
    }
    let rows: Vec<Vec<String>> = states.iter().map(|state| state.cells(has_bristles)).collect();
    let bristles = match has_bristles {
        true => format!(
            "\nBristles: 0.7 of 2 g/(sigma_0 |v|), at {:.0} mm/s, which the motor reaches at most.",
            description.fastest_piston() * 1e3
        ),
        false => String::new(),
    };
    let [low, high] = payload_range(description);
    let payloads = match high > low {
        true => format!(
            "\nLoops are judged with {:.0} kg; `hydroboom design --benchmark` judges the benchmark's over the range of {low:.0} to {high:.0} kg.",
            description.numbers.payload
        ),
        false => String::new(),
    };
    let load =
        load.map_or_else(String::new, |load| format!("\n{}", load_range_text(description, load)));
    format!(
        "{}: no errors. At rest, and the published scheme's step limits:\n{}{bristles}{load}{payloads}",
        description.name,
        output::table(&header, &rows)
    )
}
