//! Which keys a kind of crane has: circuit and structure decide.

use super::{Choices, CircuitChoice, StructureChoice};

/// Sections of self-contained cranes only: pump, valves, drive, and the published tests.
const OF_SELF_CONTAINED: [&str; 24] = [
    "pump",
    "holding_valve",
    "return_valve",
    "check_valve",
    "lines",
    "relief",
    "accumulator",
    "motor",
    "controller",
    "estimator",
    "scheduled_lqr",
    "learning",
    "tip",
    "motion",
    "start",
    "oscillation",
    "drive",
    "switching_valve",
    "temperature",
    "sensors",
    "fieldbus",
    "virtual",
    "supervision",
    "base",
];
/// Sections of valve-controlled cranes only.
const OF_VALVE_CONTROLLED: [&str; 4] = ["valve", "hoses", "trapped_air", "supply"];
/// Keys of beam booms only.
const OF_BEAM: [&str; 5] =
    ["length_mm", "mass_kg", "youngs_modulus_gpa", "second_moment_cm4", "damping_ratio"];
/// Sections of the links.
pub(crate) const LINKS: [&str; 3] = ["link_1", "link_2", "link_3"];

impl Choices {
    /// The reason why a crane with these choices and this number of segments or links does not have a key; `None` if
    /// it does.
    pub fn excludes(&self, section: &str, name: &str, segments: usize) -> Option<&'static str> {
        let is_valve_controlled = self.circuit == CircuitChoice::ValveControlled;
        let has_links = self.structure == StructureChoice::Links;
        if OF_SELF_CONTAINED.contains(&section) && is_valve_controlled
            || section == "oil" && name.starts_with("air_") && is_valve_controlled
        {
            return Some(
                "it belongs to a self-contained circuit, and circuit.type is valve-controlled",
            );
        }
        if OF_VALVE_CONTROLLED.contains(&section) && !is_valve_controlled {
            return Some(
                "it belongs to a valve-controlled circuit, and circuit.type is self-contained",
            );
        }
        if (section == "boom" && OF_BEAM.contains(&name) || section == "tip") && has_links {
            return Some("it belongs to a beam, and boom.structure is links");
        }
        if let Some(link) = LINKS.iter().position(|known| *known == section) {
            if !has_links {
                return Some("it belongs to a boom of links, and boom.structure is beam");
            }
            if link >= segments {
                return Some("the boom has fewer links: boom.segments says how many");
            }
        }
        None
    }
}
