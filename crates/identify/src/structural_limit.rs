//! Structural limits: omitted effects that a fit attributes to other keys. Such a key belongs to an
//! equivalent model, not to the machine.

use crate::free::Free;
use hydroboom_description::schema::Numbers;

/// Structural limit of some keys.
struct StructuralLimit {
    /// Paths or their prefixes.
    keys: &'static [&'static str],
    /// Whether a model omits the effect.
    is_left_out: fn(&Numbers<f64>) -> bool,
    /// Omitted effect.
    reason: &'static str,
}

/// All structural limits.
const LIMITS: [StructuralLimit; 8] = [
    StructuralLimit {
        keys: &["boom.youngs_modulus_gpa", "boom.second_moment_cm4"],
        is_left_out: |n| n.base_stiffness <= 0.0,
        reason: "only the product of E and the second moment of area is observable, and the compliance of base, pins and cylinder mounts is attributed to the boom",
    },
    // a flexible base takes a share of the flexibility; the product E I represents the total of both
    StructuralLimit {
        keys: &["boom.youngs_modulus_gpa", "boom.second_moment_cm4"],
        is_left_out: |_| true,
        reason: "only the product of E and the second moment of area is observable, and the compliance of pins and cylinder mounts is attributed to the boom",
    },
    StructuralLimit {
        keys: &["boom.damping_ratio", "link_2.joint_damping_ratio", "link_3.joint_damping_ratio"],
        is_left_out: |_| true,
        reason: "friction in pins and base is attributed to the boom's damping",
    },
    StructuralLimit {
        keys: &["friction.bristle_stiffness_n_per_mm"],
        is_left_out: |n| n.base_stiffness <= 0.0,
        reason: "the compliance of base, pins and cylinder mounts is attributed to the seals",
    },
    StructuralLimit {
        keys: &["friction.coulomb_n", "friction.stiction_n"],
        is_left_out: |_| true,
        reason: "hysteresis elsewhere (play of base and pins, air that comes out of the oil and dissolves) is attributed to friction",
    },
    StructuralLimit {
        keys: &["friction.viscous_ns_per_m"],
        is_left_out: |_| true,
        reason: "drag of oil in lines and valves that the model omits is attributed to friction",
    },
    StructuralLimit {
        keys: &["pump.flow_gain", "pump.internal_leakage", "pump.case_leakage"],
        is_left_out: |n| n.slip_at_rest <= 0.0 && n.slip_per_speed <= 0.0,
        reason: "slip in proportion to pressure, and its part that grows with speed, is attributed to delivery and leakage",
    },
    StructuralLimit {
        keys: &["oil.transition_bar"],
        is_left_out: |_| true,
        reason: "air comes out of the oil and dissolves again within seconds: the pressure at which it stiffens is no single number",
    },
];

/// Omitted effect that a fit attributes to a key; none if none is known.
pub(crate) fn limit_of(key: Free, numbers: &Numbers<f64>) -> Option<&'static str> {
    let path = key.path();
    let is_of = |limit: &&StructuralLimit| {
        (limit.is_left_out)(numbers) && limit.keys.iter().any(|begins| path.starts_with(begins))
    };
    LIMITS.iter().find(is_of).map(|limit| limit.reason)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_description::Description;
    use hydroboom_description::schema::KEYS;

    #[test]
    fn every_limit_names_existing_keys() {
        for begins in LIMITS.iter().flat_map(|limit| limit.keys) {
            assert!(KEYS.iter().any(|key| key.path().starts_with(begins)), "{begins}");
        }
    }

    /// Whether the base is flexible or not, only the product of E and I is observable.
    #[test]
    fn a_flexible_base_does_not_separate_e_from_the_second_moment() {
        for base in [0.0, 2e7] {
            let mut model = Description::uia_single_boom().unwrap();
            model.numbers.base_stiffness = base;
            for path in ["boom.youngs_modulus_gpa", "boom.second_moment_cm4"] {
                let reason = limit_of(Free::from_path(path).unwrap(), &model.numbers).unwrap();
                assert!(reason.contains("only the product of E and the second moment"), "{reason}");
                assert_eq!(reason.contains("base"), base == 0.0, "{reason}");
            }
        }
    }
}
