//! Identifiers: the paper's symbols, and names in camel case with their prefixes.

use crate::block::Block;

/// Names of inputs and outputs that follow the paper's symbols.
const KNOWN: [(&str, &str); 37] = [
    ("stroke", "xCyl"),
    ("velocity", "vCyl"),
    ("pressure_pump_a", "pPA"),
    ("pressure_a", "pA"),
    ("pressure_b", "pB"),
    ("pressure_pump_b", "pPB"),
    ("pressure_accumulator", "pAcc"),
    ("gas_volume", "volGas"),
    ("bristle", "zBristle"),
    ("pump_speed", "nPump"),
    ("holding_valve", "uValve"),
    ("cylinder_force", "fCyl"),
    ("angle_1", "phi1"),
    ("angle_2", "phi2"),
    ("angle_3", "phi3"),
    ("angular_velocity_1", "omega1"),
    ("angular_velocity_2", "omega2"),
    ("angular_velocity_3", "omega3"),
    ("tip_x", "xTip"),
    ("tip_y", "yTip"),
    ("tip_deflection", "wTip"),
    ("step", "tStep"),
    ("reference_position", "xRef"),
    ("reference_velocity", "vRef"),
    ("load_pressure", "pL"),
    ("motor_speed_read", "nRead"),
    ("valve_state", "uValveRead"),
    ("status", "nStatus"),
    ("simulated_stroke", "xSim"),
    ("simulated_velocity", "vSim"),
    ("simulated_load_pressure", "pLSim"),
    ("simulation_leads", "uLead"),
    ("motor_speed", "nRef"),
    ("wanted_speed", "nWanted"),
    ("simulated_motor_speed", "nMotor"),
    ("integral", "vInt"),
    ("low_passed", "pLow"),
];

/// `hydraulic_model` as `HydraulicModel`.
pub(super) fn camel(name: &str) -> String {
    let parts = name.split('_').map(|part| part[..1].to_uppercase() + &part[1..]);
    parts.collect()
}

/// Name of a block's function block, as `FB_HydraulicModel` for `hydraulic_model`.
pub fn block_name(block: &Block) -> String {
    format!("FB_{}", camel(&block.name))
}

/// Name of a block's input or output: the paper's symbol if it has one, as `xCyl` for `stroke`, else the name in camel
/// case.
pub fn edge_name(name: &str) -> String {
    let known = KNOWN.iter().find(|(own, _)| *own == name).map(|(_, known)| (*known).to_string());
    known.unwrap_or_else(|| {
        let camel = camel(name);
        camel[..1].to_lowercase() + &camel[1..]
    })
}

/// Name of a Boolean input or output, with the prefix `b` and in camel case, as `bReset`.
pub fn switch_name(name: &str) -> String {
    format!("b{}", camel(name))
}
