//! A program that replays what Rust computed and says how far a controller's own arithmetic leads away from it.

use super::literal;
use super::unit::{Declared, Kind, Section, Unit};
use crate::error::ExportError;
use hydroboom_description::{BuildError, Description};
use hydroboom_model::Input;
use hydroboom_model::stepping::published;

/// Steps that are replayed.
const STEPS: usize = 300;
/// The pump's speed at their end \[rev/s\].
const SPEED: f64 = 12.0;

/// The test bench of a crane of three segments.
pub(super) fn test_bench(description: &Description) -> Result<Unit, ExportError> {
    let n = &description.numbers;
    let crane = description.crane::<3>()?;
    let start = description.start_over(n, n.motion_start);
    let mut state = crane.at_rest(&start).map_err(BuildError::from)?;
    let speeds: Vec<f64> = (0..STEPS).map(|k| SPEED * k as f64 / STEPS as f64).collect();
    let (mut strokes, mut pressures_a, mut pressures_pump) = (Vec::new(), Vec::new(), Vec::new());
    for speed in &speeds {
        let input = Input { pump_speed: *speed, holding_valve: 1.0 };
        published(&crane, &mut state, &input, n.simulation_period);
        let seen = crane.outputs(&state);
        strokes.push(seen.stroke);
        pressures_a.push(seen.pressure_a);
        pressures_pump.push(seen.pressure_pump_a);
    }
    // filled by statements: not every tool takes a list as the initial value of an array
    let mut filled = String::new();
    let mut array = |name: &str, values: &[f64], comment: &str| {
        for (k, value) in values.iter().enumerate() {
            filled += &format!("    {name}[{k}] := {};\n", literal(*value));
        }
        let kind = format!("ARRAY[0..{}] OF LREAL", STEPS - 1);
        Declared::new(Section::Local, name, &kind, None, comment)
    };
    let arrays = [
        array("aPump", &speeds, "Pump speed [rev/s]"),
        array("aStroke", &strokes, "Piston position [m]"),
        array("aPressureA", &pressures_a, "p_A [Pa]"),
        array("aPressurePumpA", &pressures_pump, "p_PA [Pa]"),
    ];
    let variable = |section, name: &str, kind: &str, comment: &str| {
        Declared::new(section, name, kind, None, comment)
    };
    let mut variables = vec![
        variable(Section::Local, "bDone", "BOOL", "All steps are done"),
        variable(Section::Local, "fWorst", "LREAL", "Worst difference so far"),
        variable(Section::Local, "bBegun", "BOOL", "Set to FALSE to begin again"),
        variable(Section::Local, "iStep", "DINT", ""),
        variable(Section::Local, "fbHydraulics", "FB_HydraulicModel", ""),
        variable(Section::Local, "fbBoom", "FB_FlexibleBoom", ""),
    ];
    variables.extend(arrays);
    let step = literal(n.simulation_period);
    Ok(Unit {
        kind: Kind::Program,
        name: "PRG_TestBench".into(),
        comment: format!(
            "Replays {STEPS} steps and compares position and pressures with those that Rust computed. Call it until bDone; fWorst is the \
             worst difference, as a share of 0.1 m and 100 bar: 1E-6 or less is right."
        ),
        variables,
        body: format!(
            "\
IF NOT bBegun THEN
    fbBoom(bReset := TRUE, bPrepare := TRUE, fCyl := 0.0E0, tStep := 0.0E0);
    fbHydraulics(bReset := TRUE, bPrepare := TRUE, nPump := 0.0E0, uValve := 1.0E0, xCyl := fbBoom.xCyl,
        vCyl := fbBoom.vCyl, tStep := 0.0E0);
{filled}    iStep := 0;
    fWorst := 0.0E0;
    bDone := FALSE;
    bBegun := TRUE;
END_IF;
IF NOT bDone THEN
    fbHydraulics(bReset := FALSE, bPrepare := FALSE, nPump := aPump[iStep], uValve := 1.0E0, xCyl := fbBoom.xCyl,
        vCyl := fbBoom.vCyl, tStep := {step});
    fbBoom(bReset := FALSE, bPrepare := FALSE, fCyl := fbHydraulics.fCyl, tStep := {step});
    fWorst := MAX(fWorst, ABS(fbBoom.xCyl - aStroke[iStep]) / 1.0E-1);
    fWorst := MAX(fWorst, ABS(fbHydraulics.pA - aPressureA[iStep]) / 1.0E7);
    fWorst := MAX(fWorst, ABS(fbHydraulics.pPA - aPressurePumpA[iStep]) / 1.0E7);
    iStep := iStep + 1;
    bDone := NOT (iStep < {STEPS});
END_IF;
"
        ),
        tasks: Vec::new(),
    })
}
