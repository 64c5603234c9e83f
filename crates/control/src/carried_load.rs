//! What the machine seems to carry while nobody can weigh it.
//!
//! A load is weighed once its pressure is quiet. One that is lost in motion leaves the machine on softer oil with feedback that was designed for the
//! load that was there, too fast for such oil: it swings, is never quiet, and so never weighed. What pushes the machine tells before that,
//! roughly, what it carries; feedback goes by it. The simulated crane does not, for what moves it moves the machine.

use crate::load_balance::HELD_BY_FRICTION;
use hydroboom_math::Real;

/// Time constant in which it is believed \[s\], for it swings.
const BELIEVED: f64 = 0.3;
/// Believed is all that seems to be missing, but of what seems to be there beyond what was weighed no more than this share of the heaviest payload:
/// feedback for a heavier load is slower, and heavier loads stiffen their oil.
const HEAVIER: f64 = 0.125;

/// The payload that the machine seems to carry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CarriedLoad {
    /// By what pushes it \[kg\].
    seems: f64,
    /// Feedback goes by this one \[kg\].
    pub believed: f64,
}

impl CarriedLoad {
    /// A payload that was weighed \[kg\].
    pub fn weighed(payload: f64) -> Self {
        Self { seems: payload, believed: payload }
    }

    /// A period \[s\] in which it seemed to be so much \[kg\], and in which so much was thought to have been weighed \[kg\], so much a pressure \[kg/Pa\],
    /// no more than `heaviest` \[kg\]. True where another one is believed, by a kilogram. What friction may hold is no load.
    pub fn update(
        &mut self,
        seems: f64,
        weighed: f64,
        per_pressure: f64,
        heaviest: f64,
        period: f64,
    ) -> bool {
        let seems = if seems.is_finite() { seems } else { weighed };
        // while it swings it seems to be less than nothing, and more than there can be
        let seems = Real::clamp(seems, -heaviest, 2.0 * heaviest);
        self.seems += (seems - self.seems) * period / BELIEVED;
        let off = (self.seems - weighed).min(HEAVIER * heaviest);
        let held = 0.5 * HELD_BY_FRICTION * per_pressure;
        let share = Real::clamp(off.abs() / held - 1.0, 0.0, 1.0);
        let believed = (weighed + share * off).max(0.0);
        let is_other = (believed - self.believed).abs() > 1.0;
        if is_other {
            self.believed = believed;
        }
        is_other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bar is 5 kg.
    const PER_PRESSURE: f64 = 5e-5;
    const HEAVIEST: f64 = 400.0;
    const PERIOD: f64 = 1e-3;

    /// What is believed after two seconds in which it seemed to be something \[kg\], 200 kg having been weighed.
    fn believed(seems: impl Fn(f64) -> f64) -> f64 {
        let mut load = CarriedLoad::weighed(200.0);
        for k in 0..2000 {
            load.update(seems(PERIOD * f64::from(k)), 200.0, PER_PRESSURE, HEAVIEST, PERIOD);
        }
        load.believed
    }

    #[test]
    fn a_load_that_was_lost_is_missed_though_it_swings() {
        let swings = |time: f64| 100.0 + 60.0 * (16.0 * time).sin();
        assert!((believed(swings) - 100.0).abs() < 15.0, "{}", believed(swings));
    }

    #[test]
    fn what_friction_holds_is_no_load() {
        let friction = 0.4 * HELD_BY_FRICTION * PER_PRESSURE;
        for sign in [-1.0, 1.0] {
            assert_eq!(believed(|_| 200.0 + sign * friction), 200.0);
        }
    }

    #[test]
    fn of_a_heavier_one_a_part_is_believed() {
        assert!((believed(|_| 380.0) - 200.0 - HEAVIER * HEAVIEST).abs() <= 1.0);
        assert_eq!(believed(|_| f64::INFINITY), 200.0);
    }

    #[test]
    fn nothing_that_cannot_be_read_is_believed() {
        assert_eq!(believed(|_| f64::NAN), 200.0);
        assert!(believed(|_| -1e9) >= 0.0);
    }
}
