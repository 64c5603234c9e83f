//! `hydroboom check`

use crate::{benchmark_gains, crane_file::CraneFile, output};
use clap::Args;
use hydroboom_description::Description;
use hydroboom_description::schema::{CircuitChoice, FrictionChoice};
use hydroboom_design::benchmark_design::payload_range;
use hydroboom_design::stability::{
    LoopStability, benchmark_stability, remark_on_ideal_equipment, scheduled_lqr_stability,
    unstable_on_ideal_equipment,
};
use hydroboom_lab::plant;
use hydroboom_model::{Circuit, Scheme, StepLimit, ValveInput};
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
        let mut pressures = Vec::new();
        let has_bristles = description.choices.friction == FrictionChoice::LuGre;
        for share in [0.0, 0.5, 1.0] {
            let start = description.start(share * numbers.stroke);
            let crane = plant(&description, &start, Scheme::Implicit, 1e-3).into_diagnostic()?;
            let outputs = crane.outputs();
            let (law, fastest) = (description.friction_law(), description.fastest_piston());
            let bristle = StepLimit::of_bristles(&law, fastest);
            let limit = StepLimit { bristle, ..crane.step_limit() };
            pressures.push((share * numbers.stroke, outputs.pressure_a));
            let mut row = vec![
                format!("{:.0}", share * numbers.stroke * 1e3),
                format!("{:.1}", outputs.pressure_a * 1e-5),
                format!("{:.2}", outputs.cylinder_force * 1e-3),
                format!("{:.1}", outputs.tip_deflection * 1e3),
                format!("{:.1}", limit.bending * 1e6),
                format!("{:.1}", limit.friction * 1e6),
                format!("{:.1}", limit.chatter * 1e6),
            ];
            if has_bristles {
                row.push(format!("{:.1}", limit.bristle * 1e6));
            }
            rows.push(row);
            values.push(json!({
                "stroke_mm": outputs.stroke * 1e3,
                "pressure_a_bar": outputs.pressure_a * 1e-5,
                "cylinder_force_n": outputs.cylinder_force,
                "tip_deflection_mm": outputs.tip_deflection * 1e3,
                "step_limit_us": {
                    "bending": limit.bending * 1e6,
                    "friction": limit.friction * 1e6,
                    "chatter": limit.chatter * 1e6,
                    "bristle": has_bristles.then_some(limit.bristle * 1e6),
                },
            }));
        }
        let found = found(&description, &pressures);
        let loops = [
            ("benchmark", benchmark_stability(&description, None)),
            ("scheduled LQR", scheduled_lqr_stability(&description, None)),
        ];
        let mut remarks = found;
        for (name, stability) in &loops {
            match stability {
                Ok(stability) if stability.stable => {}
                Ok(unstable) if unstable.is_benchmark() => {
                    remarks.push(format!("{unstable}; {FINDS_GAINS}"))
                }
                Ok(unstable) => remarks.push(format!("{unstable}; {WEIGHTS}")),
                Err(error) => remarks.push(format!("{name}: its loop cannot be computed: {error}")),
            }
        }
        if matches!(&loops[0].1, Ok(benchmark) if benchmark.stable) {
            let little = benchmark_gains::too_little_margin(&description, [numbers.payload; 2])?;
            remarks.extend(little.map(|margins| {
                format!(
                    "benchmark: its gains leave too little margin with {:.0} kg: {margins}; {FINDS_GAINS}",
                    numbers.payload
                )
            }));
        }
        let expected: Vec<LoopStability> =
            loops.iter().filter_map(|(_, of)| of.as_ref().ok().cloned()).collect();
        // an error of the loops is reported above
        let on_ideal = unstable_on_ideal_equipment(&description, &expected).unwrap_or_default();
        remarks.extend(remark_on_ideal_equipment(&on_ideal));
        if self.json {
            let stable = loops.iter().all(|(_, of)| of.as_ref().is_ok_and(|of| of.stable));
            return output::json(&json!({
                "crane": description.name,
                "warnings": all(&description, remarks),
                "stable": stable, "loops": expected, "unstable_on_ideal_equipment": on_ideal,
                "at_rest": values,
            }));
        }
        remarks.iter().for_each(|remark| output::warn(remark));
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
        let bristles = match has_bristles {
            true => format!(
                "\nBristles: 0.7 of 2 g/(sigma_0 |v|), at {:.0} mm/s, which the motor reaches at most.",
                description.fastest_piston() * 1e3
            ),
            false => String::new(),
        };
        let [low, high] = payload_range(&description);
        let payloads = match high > low {
            true => format!(
                "\nLoops are judged with {:.0} kg; `hydroboom design --benchmark` judges the benchmark's over the range of {low:.0} to {high:.0} kg.",
                numbers.payload
            ),
            false => String::new(),
        };
        output::text(&format!(
            "{}: no errors. At rest, and the published scheme's step limits:\n{}{bristles}{payloads}",
            description.name,
            output::table(&header, &rows)
        ))
    }

    /// The same for a valve-controlled crane: state of rest with the valve closed, and speeds that the
    /// valve gives.
    fn valve_controlled<const N: usize>(&self, description: &Description) -> Result<()> {
        let n = &description.numbers;
        let crane = description.valve_crane_over::<f64, N>(n).into_diagnostic()?;
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        let mut pressures = Vec::new();
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
            pressures.push((stroke, a));
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
        let remarks = found(description, &pressures);
        if self.json {
            return output::json(&json!({
                "crane": description.name, "warnings": all(description, remarks),
                "at_rest": values,
            }));
        }
        remarks.iter().for_each(|remark| output::warn(remark));
        let header = ["stroke [mm]", "p_A [bar]", "tip x, y [m]", "full lift [L/min]", "[mm/s]"];
        output::text(&format!(
            "{}: no errors. At rest with the valve closed, and what full travel would lift with:\n{}",
            description.name,
            output::table(&header, &rows)
        ))
    }
}

/// Warnings of a description and further remarks.
fn all(description: &Description, remarks: Vec<String>) -> Vec<String> {
    description.warnings().into_iter().chain(remarks).collect()
}

/// Advice on the gains.
const FINDS_GAINS: &str = "`hydroboom design --benchmark` finds gains";
/// Where the weights of the scheduled LQR are, and its margins.
const WEIGHTS: &str = "its weights are those of [scheduled_lqr]; `hydroboom design` shows its margins at each position";

/// Share of the largest bulk modulus below which the oil is soft.
const SOFT: f64 = 0.9;

/// Remarks on a crane at rest, by piston position \[m\] and piston-side pressure \[Pa\]: soft oil at the
/// pressure of the load.
fn found(description: &Description, pressures: &[(f64, f64)]) -> Vec<String> {
    let n = &description.numbers;
    let oil = description.oil();
    let soft: Vec<String> = pressures
        .iter()
        .map(|(stroke, pressure)| {
            (stroke, pressure, oil.bulk_modulus(*pressure) / n.bulk_modulus_max)
        })
        .filter(|(.., share)| *share < SOFT)
        .map(|(stroke, pressure, share)| {
            format!("{:.0} % at {:.0} mm ({:.1} bar)", share * 100.0, stroke * 1e3, pressure * 1e-5)
        })
        .collect();
    let torque = |pressure: f64| pressure * n.displacement / std::f64::consts::TAU;
    let heaviest = pressures.iter().map(|(_, pressure)| *pressure).fold(0.0, f64::max);
    let too_heavy = torque(heaviest) > n.drive_torque;
    let mut found: Vec<String> = too_heavy
        .then(|| {
            format!(
                "the motor does not lift the load: {:.1} bar at rest take {:.1} N m, and drive.max_torque_nm = {:.1}",
                heaviest * 1e-5,
                torque(heaviest),
                n.drive_torque
            )
        })
        .into_iter()
        .collect();
    if soft.is_empty() {
        return found;
    }
    found.push(format!(
        "the load pressure lies in the oil's soft range: its bulk modulus is {} of the largest; oil.transition_bar = {:.1}, \
         oil.transition_width_bar = {:.1}. The load oscillates slowly there, a little air changes its frequency \
         much, and gains have to be lower",
        soft.join(", "),
        n.transition * 1e-5,
        n.transition_width * 1e-5
    ));
    found
}
