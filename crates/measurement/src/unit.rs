//! Units as people write them.

/// What a unit measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// Length.
    Length,
    /// Speed.
    Speed,
    /// Pressure.
    Pressure,
    /// Rotational speed.
    Rotation,
    /// Angle.
    Angle,
    /// Rate of an angle.
    AngularRate,
    /// Time.
    Time,
    /// Electric tension, of a valve's command.
    Tension,
    /// A share, a switch.
    Share,
}

/// A unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// As people write it.
    pub name: &'static str,
    /// What it measures.
    pub dimension: Dimension,
    /// One of it in SI units (rotation in rev/s, angles in rad).
    pub size: f64,
    /// Other ways to write it, in lower case, as endings of names and in brackets.
    spellings: &'static [&'static str],
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;

impl Unit {
    /// All that are known; those with longer names first, so that endings are found whole.
    pub const ALL: [Self; 24] = [
        Self::of("m/s", Dimension::Speed, 1.0, &["m_s", "mps", "m_per_s"]),
        Self::of("mm/s", Dimension::Speed, 1e-3, &["mm_s", "mmps", "mm_per_s"]),
        Self::of("deg/s", Dimension::AngularRate, DEGREE, &["deg_s", "degps", "°/s"]),
        Self::of("rad/s", Dimension::AngularRate, 1.0, &["rad_s"]),
        Self::of("rev/s", Dimension::Rotation, 1.0, &["rev_s", "rps", "hz"]),
        Self::of("rpm", Dimension::Rotation, 1.0 / 60.0, &["1/min", "rev/min", "u/min", "min-1"]),
        Self::of("mm", Dimension::Length, 1e-3, &[]),
        Self::of("cm", Dimension::Length, 1e-2, &[]),
        Self::of("um", Dimension::Length, 1e-6, &["µm"]),
        Self::of("m", Dimension::Length, 1.0, &[]),
        Self::of("mbar", Dimension::Pressure, 1e2, &[]),
        Self::of("bar", Dimension::Pressure, 1e5, &["barg"]),
        Self::of("kPa", Dimension::Pressure, 1e3, &["kpa"]),
        Self::of("MPa", Dimension::Pressure, 1e6, &["mpa"]),
        Self::of("psi", Dimension::Pressure, 6_894.757_293_168, &[]),
        Self::of("Pa", Dimension::Pressure, 1.0, &["pa"]),
        Self::of("deg", Dimension::Angle, DEGREE, &["°"]),
        Self::of("rad", Dimension::Angle, 1.0, &[]),
        Self::of("ms", Dimension::Time, 1e-3, &[]),
        Self::of("us", Dimension::Time, 1e-6, &["µs"]),
        Self::of("s", Dimension::Time, 1.0, &["sec", "seconds"]),
        Self::of("V", Dimension::Tension, 1.0, &["v", "volt"]),
        Self::of("%", Dimension::Share, 1e-2, &["percent"]),
        Self::of("-", Dimension::Share, 1.0, &["1"]),
    ];

    const fn of(
        name: &'static str,
        dimension: Dimension,
        size: f64,
        spellings: &'static [&'static str],
    ) -> Self {
        Self { name, dimension, size, spellings }
    }

    /// A unit from its name or another way to write it. Mega and milli are told apart.
    pub fn from_text(text: &str) -> Option<Self> {
        let text = text.trim();
        let exact = Self::ALL.into_iter().find(|u| u.name == text);
        let small = text.to_lowercase();
        exact.or_else(|| {
            let is_one =
                |u: &Self| u.name.to_lowercase() == small || u.spellings.contains(&&*small);
            Self::ALL.into_iter().find(is_one)
        })
    }

    /// The unit that a column's name ends with: `p_A_bar`, `p_A [bar]`, `p_A (bar)`; and the name
    /// without it.
    pub fn split(name: &str) -> (String, Option<Self>) {
        let name = name.trim();
        for (open, close) in [('[', ']'), ('(', ')')] {
            if let Some(inner) = name.strip_suffix(close)
                && let Some((before, unit)) = inner.rsplit_once(open)
                && let Some(unit) = Self::from_text(unit)
            {
                return (before.trim().trim_end_matches('_').to_string(), Some(unit));
            }
        }
        let small = name.to_lowercase();
        let mut best: Option<(usize, Self)> = None;
        for unit in Self::ALL {
            let lower = unit.name.to_lowercase().replace('/', "_");
            for spelling in std::iter::once(lower.as_str()).chain(unit.spellings.iter().copied()) {
                let fits = small.strip_suffix(spelling).is_some_and(|rest| rest.ends_with('_'));
                if fits && best.is_none_or(|(length, _)| spelling.len() > length) {
                    best = Some((spelling.len(), unit));
                }
            }
        }
        match best {
            Some((length, unit)) => {
                (name[..name.len() - length].trim_end_matches('_').to_string(), Some(unit))
            }
            None => (name.to_string(), None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_found_however_a_name_is_written() {
        for (name, rest, unit) in [
            ("pressure_a_bar", "pressure_a", Some("bar")),
            ("p_A [bar]", "p_A", Some("bar")),
            ("p_A (MPa)", "p_A", Some("MPa")),
            ("velocity_mm_s", "velocity", Some("mm/s")),
            ("motor_speed_rpm", "motor_speed", Some("rpm")),
            ("stroke_mm", "stroke", Some("mm")),
            ("t_s", "t", Some("s")),
            ("time", "time", None),
            ("p_A", "p_A", None),
            ("MAIN.fPressure", "MAIN.fPressure", None),
        ] {
            let (found, of) = Unit::split(name);
            assert_eq!((found.as_str(), of.map(|u| u.name)), (rest, unit), "{name}");
        }
        assert_eq!(Unit::from_text("MPa").map(|u| u.size), Some(1e6));
        assert_eq!(Unit::from_text("1/min").map(|u| u.name), Some("rpm"));
        assert!(Unit::from_text("furlong").is_none());
    }

    #[test]
    fn the_same_quantity_is_the_same_in_every_unit() {
        // an atmosphere, a metre, a turn a second and a turn, as tables print them
        for (quantity, list) in [
            (101_325.0, &[("Pa", 101_325.0), ("kPa", 101.325), ("MPa", 0.101_325)][..]),
            (101_325.0, &[("mbar", 1013.25), ("bar", 1.013_25), ("psi", 14.695_949)]),
            (1.0, &[("m", 1.0), ("cm", 100.0), ("mm", 1e3), ("um", 1e6)]),
            (1.0, &[("m/s", 1.0), ("mm/s", 1e3), ("rev/s", 1.0), ("rpm", 60.0)]),
            (std::f64::consts::TAU, &[("rad", std::f64::consts::TAU), ("deg", 360.0)]),
            (1.0, &[("s", 1.0), ("ms", 1e3), ("us", 1e6), ("%", 100.0)]),
        ] {
            for (name, count) in list {
                let size = Unit::from_text(name).map_or(0.0, |u| u.size);
                assert!((count * size / quantity - 1.0).abs() < 1e-7, "{name}");
            }
        }
    }
}
