//! Check of an FMU's parameters: combinations for which no crane exists.

use crate::block::Variable;
use std::fmt::Write;

/// Pairs of parameters, the first of which must be below the second or not above it, with the error message. A crane
/// file is refused for the same conditions.
const ORDERED: [(&str, bool, &str, &str); 9] = [
    ("cylinder_rod_mm", true, "cylinder_piston_mm", "the rod is not thinner than the piston"),
    (
        "geometry_mount_x_mm",
        false,
        "boom_length_mm",
        "the cylinder's mount lies beyond the end of the boom",
    ),
    (
        "oil_bulk_modulus_min_mpa",
        false,
        "oil_bulk_modulus_max_mpa",
        "the oil would be stiffer at low pressure than at high",
    ),
    (
        "holding_valve_cracking_bar",
        true,
        "holding_valve_opening_bar",
        "load-holding valve 3 would be fully open before it begins to open",
    ),
    (
        "return_valve_cracking_bar",
        true,
        "return_valve_opening_bar",
        "return valve 7 would be fully open before it begins to open",
    ),
    (
        "check_valve_cracking_bar",
        true,
        "check_valve_opening_bar",
        "check valve 8 would be fully open before it begins to open",
    ),
    (
        "relief_cracking_bar",
        true,
        "relief_opening_bar",
        "relief valve 13 would be fully open before it begins to open",
    ),
    (
        "accumulator_precharge_bar",
        true,
        "accumulator_working_bar",
        "the accumulator holds no oil: it is filled to no more than its precharge",
    ),
    ("motion_start_mm", false, "cylinder_stroke_mm", "motion_start_mm lies beyond the stroke"),
];

/// Parameters of the triangle of bearing, foot and mount.
const TRIANGLE: [&str; 6] = [
    "geometry_base_x_mm",
    "geometry_base_y_mm",
    "geometry_mount_x_mm",
    "geometry_mount_y_mm",
    "geometry_shortest_mm",
    "cylinder_stroke_mm",
];

/// The function that checks parameters for impossible values, as far as the block has them.
pub(super) fn impossible(parameters: &[&Variable]) -> String {
    let has = |name: &str| parameters.iter().any(|v| v.name == name);
    let mut body = String::new();
    for (low, is_strict, high, wrong) in ORDERED {
        if has(low) && has(high) {
            let sign = if is_strict { "<" } else { "<=" };
            let _ = writeln!(
                body,
                "    if (!(n->p.{low} {sign} n->p.{high})) {{\n        return \"{wrong}\";\n    }}"
            );
        }
    }
    if TRIANGLE.iter().all(|name| has(name)) {
        let [base_x, base_y, mount_x, mount_y, shortest, stroke] =
            TRIANGLE.map(|name| format!("n->p.{name}"));
        let _ = writeln!(
            body,
            "    {{\n        const double base = sqrt({base_x} * {base_x} + {base_y} * {base_y});\n        \
             const double mount = sqrt({mount_x} * {mount_x} + {mount_y} * {mount_y});\n        \
             if (!({shortest} > fabs(base - mount)) || !({shortest} + {stroke} < base + mount)) {{\n            \
             return \"the cylinder cannot reach from base to boom over its whole stroke\";\n        }}\n    }}"
        );
    }
    format!(
        "\nstatic const char *hb_impossible(const hb_numbers *n)\n{{\n    (void)n;\n{body}    return NULL;\n}}\n"
    )
}
