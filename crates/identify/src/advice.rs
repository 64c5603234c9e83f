//! Experiment design: the experiment that would determine a parameter that a log does not determine.

use crate::free::Free;

/// Description of the experiment that determines a key best, as plain text for a report. It depends on the key's
/// section of the crane file: friction, boom, payload, oil, pump, valve and so on. The advice is engineering
/// judgement, and no computed optimal design.
pub fn experiment_for(key: Free) -> &'static str {
    let path = key.path();
    let (section, name) = path.split_once('.').unwrap_or((&path, ""));
    match section {
        "friction" => {
            "cycles at several speeds, the slowest of a few mm/s, with reversals: friction shows in the step of the \
             load pressure between out and back"
        }
        "boom" if name.starts_with("damping") => {
            "an oscillation test with the valves closed, logged until the oscillation has decayed: a motion's friction hides \
             the boom's own damping"
        }
        "boom" | "link_1" | "link_2" | "link_3" => {
            "an oscillation test with the valves closed, at two piston positions: stiffness and mass change the \
             frequency differently over the stroke"
        }
        "payload" | "geometry" => {
            "the load held still at three piston positions: the holding pressures determine masses and lever arms"
        }
        "cylinder" | "hoses" | "oil" => {
            "an oscillation test with the valves closed at the two ends of the stroke, and at two rod-side pressures. \
             Oil and volume have the same effect on the frequency unless the volume changes"
        }
        "pump" if name.contains("leakage") || name.starts_with("slip") => {
            "the motor at rest with the valves open, and slow motions under load: the piston sinks by the leaked volume"
        }
        "pump" => {
            "steady motions at two speeds and two loads: delivery and leakage depend differently on the pressure"
        }
        "accumulator" => {
            "a whole stroke out and back, and a night at rest: its pressure against the rod's volume"
        }
        "valve" => {
            "steps of the command to several openings, up and down: dead band, gain and lag each show alone"
        }
        "holding_valve" | "return_valve" | "check_valve" | "relief" | "lines" => {
            "pressures on both sides of the valve while the flow through it grows slowly from nothing"
        }
        _ => "an experiment in which nothing else of the same effect changes",
    }
}
