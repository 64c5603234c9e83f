//! Free parameters: keys of a crane file that a fit may change.

use crate::error::IdentifyError;
use hydroboom_description::schema::{Choices, KEYS, Key};
use hydroboom_description::{Description, is_of_machine, suggestion};

/// Free parameter, with ln θ as the variable: every such number is positive, and changes are relative.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Free {
    /// Index into the schema's list of numeric keys, [`KEYS`].
    pub place: usize,
}

impl Free {
    /// Free parameter by its path `section.name`; the unit may be omitted.
    ///
    /// # Errors
    ///
    /// [`IdentifyError::Key`] if there is none, with a suggestion.
    pub fn from_path(path: &str) -> Result<Self, IdentifyError> {
        let exact = KEYS.iter().position(|key| key.path() == path);
        let begun: Vec<usize> =
            (0..KEYS.len()).filter(|k| KEYS[*k].path().starts_with(&format!("{path}_"))).collect();
        match (exact, begun.as_slice()) {
            (Some(place), _) => Ok(Self { place }),
            (None, [place]) => Ok(Self { place: *place }),
            (None, several) => {
                let is_named_alone = |name: &str| KEYS.iter().any(|key| key.name == name);
                let suggestion = match several {
                    _ if Choices::allowed(path).is_some() => {
                        ": it is a choice and no number, and cannot be tuned; set it by --set, and compare".into()
                    }
                    [] if is_named_alone(path) => {
                        let with_sections = KEYS.iter().filter(|key| key.name == path).map(Key::path);
                        format!("; did you mean {}?", with_sections.collect::<Vec<_>>().join(" or "))
                    }
                    [] => match suggestion(path) {
                        same if same.contains(&format!("`{path}`")) => {
                            ": it is a key of a crane file, but not one that can be tuned".into()
                        }
                        other => format!("; {}", other.replace('`', "")),
                    },
                    several => {
                        let meant: Vec<String> = several.iter().map(|k| KEYS[*k].path()).collect();
                        format!(": is it {}?", meant.join(" or "))
                    }
                };
                Err(IdentifyError::Key { key: path.into(), suggestion })
            }
        }
    }

    /// Free parameter by its path, if the model's response in a log depends on it: a key of the machine or of its
    /// drive, and no whole number.
    ///
    /// # Errors
    ///
    /// [`IdentifyError::Key`] if there is no such key, if it is a whole number, or if it belongs to controllers,
    /// supervision, tests or equipment.
    pub fn of_model(path: &str) -> Result<Self, IdentifyError> {
        let free = Self::from_path(path)?;
        if KEYS[free.place].is_whole {
            let suggestion =
                " that can be tuned: it is a whole number; set it by --set, and compare".into();
            return Err(IdentifyError::Key { key: free.path(), suggestion });
        }
        if free.is_of_model() {
            return Ok(free);
        }
        let section = KEYS[free.place].section;
        let suggestion = format!(
            " that the model depends on: [{section}] is not the machine's, and a log does not determine it"
        );
        Err(IdentifyError::Key { key: free.path(), suggestion })
    }

    /// Whether the model's response may depend on it: the crane's to the motor speed, or the motor's to its
    /// command.
    fn is_of_model(self) -> bool {
        is_of_machine(KEYS[self.place].section) || self.is_of_drive()
    }

    /// Keys that a log of position and pressures usually determines: stiffness and damping, payload, volumes,
    /// friction, oil, pump and valve. Keys that are zero in the model are left out, because ln θ needs θ > 0.
    pub fn usual(model: &Description) -> Vec<Self> {
        const USUAL: [&str; 26] = [
            "boom.youngs_modulus_gpa",
            "boom.damping_ratio",
            "link_2.joint_stiffness_knm_per_rad",
            "link_2.joint_damping_ratio",
            "link_3.joint_stiffness_knm_per_rad",
            "link_3.joint_damping_ratio",
            "payload.mass_kg",
            "cylinder.dead_volume_a_l",
            "cylinder.dead_volume_b_l",
            "friction.viscous_ns_per_m",
            "friction.coulomb_n",
            "friction.stiction_n",
            "oil.bulk_modulus_max_mpa",
            "oil.transition_bar",
            "pump.flow_gain",
            "pump.internal_leakage_m3_s_sqrtpa",
            "pump.case_leakage_a_m3_s_sqrtpa",
            "pump.volume_a_l",
            "pump.volume_b_l",
            "valve.supply_to_a_m3_s_sqrtpa",
            "valve.supply_to_a_dead_band_percent",
            "valve.a_to_tank_m3_s_sqrtpa",
            "valve.b_to_tank_m3_s_sqrtpa",
            "valve.bandwidth_hz",
            "valve.leakage_l_min_per_bar",
            "trapped_air.rod_side_l",
        ];
        let values = model.numbers.to_array();
        let places =
            USUAL.iter().filter_map(|path| KEYS.iter().position(|key| key.path() == *path));
        places.filter(|place| values[*place] > 0.0).map(|place| Self { place }).collect()
    }

    /// Keys with an effect on a log that other keys can replace. They are fixed unless requested, and their
    /// uncertainty widens the intervals of the free keys.
    pub(crate) fn replaceable(model: &Description) -> Vec<Self> {
        const OTHERS: [&str; 9] = [
            // only its product with E is observable, and E also replaces the flexibility of the base
            "boom.second_moment_cm4",
            "base.stiffness_knm_per_rad",
            "payload.x_mm",
            "boom.mass_kg",
            "link_1.mass_kg",
            "link_2.mass_kg",
            "link_3.mass_kg",
            "friction.bristle_damping_ns_per_m",
            "friction.stribeck_velocity_mm_s",
        ];
        let values = model.numbers.to_array();
        let places =
            OTHERS.iter().filter_map(|path| KEYS.iter().position(|key| key.path() == *path));
        places.filter(|place| values[*place] > 0.0).map(|place| Self { place }).collect()
    }

    /// Path `section.name` of the key, as `payload.mass_kg`.
    pub fn path(self) -> String {
        KEYS[self.place].path()
    }

    /// Value in a description, in the key's SI unit.
    pub fn value(self, model: &Description) -> f64 {
        model.numbers.to_array()[self.place]
    }

    /// Smallest and largest value that a crane file allows, in the key's SI unit.
    pub fn bounds(self) -> (f64, f64) {
        let key = &KEYS[self.place];
        (key.to_si(key.low), key.to_si(key.high))
    }
}
