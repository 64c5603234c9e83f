//! Default spreads: plausible ranges of values for which a crane file states no range.
//!
//! One source is the variation between the virtual cranes of the Monte Carlo studies
//! (`lab/src/closed_loop/monte_carlo/variation.rs`). The other is the ranges of estimates in
//! `cranes/uia-single-boom.toml` and `cranes/uia-virtual.toml`.

/// Width of a default range about a key's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Width {
    /// Between these multiples of the value.
    Times(f64, f64),
    /// The value plus these offsets, in the key's unit.
    Plus(f64, f64),
    /// Between these values in the key's unit, extended to contain the current value.
    From(f64, f64),
}

impl Width {
    /// Range about a value, both in the key's unit, without rounding noise.
    pub(crate) fn around(self, value: f64) -> [f64; 2] {
        let [a, b] = match self {
            Self::Times(low, high) => [low * value, high * value],
            Self::Plus(low, high) => [value + low, value + high],
            Self::From(low, high) => [low.min(value), high.max(value)],
        };
        let twelve_digits = |bound: f64| format!("{bound:.11e}").parse().unwrap_or(bound);
        [a.min(b), a.max(b)].map(twelve_digits)
    }
}

/// Default spread of one key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spread {
    /// `section.key`.
    pub path: &'static str,
    /// Width of the range.
    pub width: Width,
    /// Reason for this width.
    pub source: &'static str,
}

const fn spread(path: &'static str, width: Width, source: &'static str) -> Spread {
    Spread { path, width, source }
}

const LEAKAGE: &str = "from a new pump to a worn one, and with the oil's viscosity";
const FRICTION: &str = "seals from crane to crane, with wear and temperature";
const VALVE: &str = "15 to 50 ms of a solenoid seat valve, 5 to 30 ms of short pilot lines";

/// All default spreads; other keys have none.
pub(crate) const SPREADS: [Spread; 22] = [
    spread("payload.mass_kg", Width::Times(0.0, 1.2), "from the empty hook to an overload of 20 %"),
    spread("friction.coulomb_n", Width::Times(0.5, 1.6), FRICTION),
    spread("friction.stiction_n", Width::Times(0.5, 1.6), FRICTION),
    spread("friction.viscous_ns_per_m", Width::Times(0.5, 1.6), FRICTION),
    spread(
        "oil.transition_bar",
        Width::Plus(-15.0, 10.0),
        "air in the oil: 20 to 45 bar about the paper's 35",
    ),
    spread(
        "oil.air_shift_bar",
        Width::From(0.0, 6.0),
        "hysteresis as air dissolves and comes out: the virtual crane's",
    ),
    spread("pump.displacement_cm3", Width::Times(0.97, 1.02), "tolerance of manufacture"),
    spread(
        "pump.flow_gain",
        Width::Times(0.95, 1.05),
        "0.88 to 0.98 about the paper's 0.91, as pressures vary",
    ),
    spread("pump.internal_leakage_m3_s_sqrtpa", Width::Times(0.5, 3.0), LEAKAGE),
    spread("pump.case_leakage_a_m3_s_sqrtpa", Width::Times(0.5, 3.0), LEAKAGE),
    spread("pump.case_leakage_b_m3_s_sqrtpa", Width::Times(0.5, 3.0), LEAKAGE),
    spread("pump.slip_l_min_per_bar", Width::Times(0.5, 3.0), LEAKAGE),
    spread("pump.slip_cm3_per_rev_bar", Width::Times(0.5, 3.0), LEAKAGE),
    spread(
        "accumulator.working_bar",
        Width::Plus(-0.9, 0.3),
        "2.0 to 3.2 bar about the virtual crane's 2.9: gas is lost, and it cools",
    ),
    spread(
        "start.rod_side_bar",
        Width::From(2.0, 60.0),
        "from the accumulator's pressure to what a shut return valve traps (oscillation tests)",
    ),
    spread("start.preload_percent", Width::From(85.0, 100.0), "family of virtual cranes"),
    spread("temperature.oil_c", Width::From(10.0, 60.0), "family of virtual cranes"),
    spread(
        "drive.bandwidth_hz",
        Width::Times(0.15, 1.0),
        "8 to 120 Hz are plausible for a servo drive; 15 to 80 in the family of virtual cranes",
    ),
    spread(
        "drive.dead_time_ms",
        Width::Times(0.0, 3.0),
        "cycles of the drive's own control and of its interface, one more or less",
    ),
    spread("fieldbus.delay_cycles", Width::Plus(0.0, 1.0), "one cycle or two"),
    spread("switching_valve.delay_ms", Width::Times(0.5, 2.0), VALVE),
    spread("switching_valve.pilot_line_ms", Width::Times(0.5, 2.0), VALVE),
];

/// The default spread of a key; `None` if it has none.
pub(crate) fn of(path: &str) -> Option<&'static Spread> {
    SPREADS.iter().find(|spread| spread.path == path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schema::KEYS;

    #[test]
    fn every_default_spread_has_a_key_and_ordered_bounds() {
        for spread in SPREADS {
            assert!(KEYS.iter().any(|key| key.path() == spread.path), "{}", spread.path);
            let [low, high] = spread.width.around(10.0);
            assert!(low <= 10.0 && 10.0 <= high && low < high, "{}", spread.path);
        }
    }
}
