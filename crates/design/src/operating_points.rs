//! Operating points: equilibrium and linearisation of the crane over the stroke.

use crate::hydraulic_spring_fit::{ElasticLoad, HydraulicSpring, hydraulic_spring};
use crate::{DesignError, LinearisedPlant};
use hydroboom_description::Description;
use hydroboom_math::Real;
use hydroboom_model::{Input, Scheme};
use hydroboom_plant::plant;

/// Number of piston positions at which the crane is linearised.
pub const POINTS: usize = 17;
/// Distance of the first and the last from the ends of the stroke \[m\].
const MARGIN: f64 = 0.005;

/// Equilibrium of the crane at a piston position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Equilibrium {
    /// Load pressure at rest, p_0 \[Pa\].
    pub load_pressure: f64,
    /// Derivative of the load pressure by the piston position, p_0' \[Pa/m\].
    pub load_pressure_slope: f64,
    /// Motor speed that compensates leakage, n_0 \[rev/s\].
    pub holding_speed: f64,
}

/// Equilibrium and linearisation of the crane at a piston position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OperatingPoint {
    /// Load pressure and its slope, and motor speed, with the piston at rest at this position.
    pub equilibrium: Equilibrium,
    /// Hydraulic spring with the oil's largest bulk modulus, without leakage.
    pub stiff: HydraulicSpring,
    /// Load at the end of the elastic boom.
    pub load: ElasticLoad,
}

impl OperatingPoint {
    /// Hydraulic spring with a bulk modulus of `share` \[1\] of the largest one: c_v and b are in proportion to it.
    pub fn spring(&self, share: f64) -> HydraulicSpring {
        HydraulicSpring {
            pressure_by_velocity: self.stiff.pressure_by_velocity * share,
            pressure_by_speed: self.stiff.pressure_by_speed * share,
            ..self.stiff
        }
    }

    /// Linear combination with another, number by number: this one and `weight` times the other.
    fn plus(&self, weight: f64, other: &Self) -> Self {
        let sum = |own: f64, other: f64| Real::mul_add(weight, other, own);
        let (e, f) = (&self.equilibrium, &other.equilibrium);
        let (s, t) = (&self.stiff, &other.stiff);
        let (l, m) = (&self.load, &other.load);
        Self {
            equilibrium: Equilibrium {
                load_pressure: sum(e.load_pressure, f.load_pressure),
                load_pressure_slope: sum(e.load_pressure_slope, f.load_pressure_slope),
                holding_speed: sum(e.holding_speed, f.holding_speed),
            },
            stiff: HydraulicSpring {
                acceleration_by_position: sum(
                    s.acceleration_by_position,
                    t.acceleration_by_position,
                ),
                acceleration_by_velocity: sum(
                    s.acceleration_by_velocity,
                    t.acceleration_by_velocity,
                ),
                acceleration_by_pressure: sum(
                    s.acceleration_by_pressure,
                    t.acceleration_by_pressure,
                ),
                pressure_by_velocity: sum(s.pressure_by_velocity, t.pressure_by_velocity),
                pressure_by_speed: sum(s.pressure_by_speed, t.pressure_by_speed),
                // without leakage
                ..HydraulicSpring::default()
            },
            load: ElasticLoad {
                acceleration_by_pressure: sum(
                    l.acceleration_by_pressure,
                    m.acceleration_by_pressure,
                ),
                compliance: sum(l.compliance, m.compliance),
            },
        }
    }
}

/// Operating points over the stroke, with the oil's parameters for interpolation.
#[derive(Clone, Debug, PartialEq)]
pub struct OperatingPoints {
    /// Operating points at equal distances along the stroke.
    pub points: [OperatingPoint; POINTS],
    /// Largest and smallest bulk modulus \[Pa\].
    pub bulk_modulus: [f64; 2],
    /// Transition pressure p_c1 of the oil and the width p_c2 of the transition \[Pa\].
    pub transition: [f64; 2],
    /// Part of the piston-side pressure that balances the rod side, (A_r/A_p) p_B \[Pa\].
    pub rod_side_term: f64,
    stroke: f64,
}

impl OperatingPoints {
    /// Linearises the crane of a description over its stroke.
    ///
    /// # Errors
    ///
    /// [`DesignError::Plant`] if the crane cannot rest at one of the positions, [`DesignError::Eigenvalues`] if its
    /// modes cannot be computed, [`DesignError::NoMode`] if it does not oscillate on its oil there.
    pub fn new(description: &Description) -> Result<Self, DesignError> {
        let n = &description.numbers;
        let at =
            |stroke: f64| plant(description, &description.start(stroke), Scheme::Implicit, 1e-3);
        let mut all = Self {
            points: [OperatingPoint::default(); POINTS],
            bulk_modulus: [n.bulk_modulus_max, n.bulk_modulus_min],
            transition: [n.transition, n.transition_width],
            rod_side_term: rod_side_term(description),
            stroke: n.stroke,
        };
        for k in 0..POINTS {
            let position = all.position(k);
            let crane = at(position)?;
            let step = 0.5 * MARGIN;
            let below = at(position - step)?.load_pressure();
            let above = at(position + step)?.load_pressure();
            let flows = crane.flows(&Input { pump_speed: 0.0, holding_valve: 1.0 });
            // the leakage of side A has to be delivered again
            let lost = flows.internal_leakage + flows.case_leakage_a + flows.bleed;
            let equilibrium = Equilibrium {
                load_pressure: crane.load_pressure(),
                load_pressure_slope: (above - below) / (2.0 * step),
                holding_speed: lost / (n.displacement * n.flow_gain),
            };
            let (spring, load) = hydraulic_spring(&LinearisedPlant::new(description, position)?)?;
            let tight =
                HydraulicSpring { pressure_by_position: 0.0, pressure_by_pressure: 0.0, ..spring };
            let as_it_is = OperatingPoint { equilibrium, stiff: tight, load };
            let share = all.stiffness_at(crane.outputs().pressure_a);
            all.points[k] = OperatingPoint { stiff: as_it_is.spring(1.0 / share), ..as_it_is };
        }
        Ok(all)
    }

    /// Piston position \[m\] of the operating point with index `number`, from 0.
    pub fn position(&self, number: usize) -> f64 {
        MARGIN + number as f64 * self.spacing()
    }

    fn spacing(&self) -> f64 {
        (self.stroke - 2.0 * MARGIN) / (POINTS - 1) as f64
    }

    /// Operating point at a piston position \[m\], by linear interpolation; constant beyond the first and the last
    /// one.
    pub fn at(&self, position: f64) -> OperatingPoint {
        let last = (POINTS - 1) as f64;
        let place = Real::clamp((position - MARGIN) / self.spacing(), 0.0, last);
        let weights = (0..POINTS).map(|k| (1.0 - (place - k as f64).abs()).max(0.0));
        weights
            .zip(&self.points)
            .fold(OperatingPoint::default(), |sum, (weight, point)| sum.plus(weight, point))
    }

    /// Bulk modulus over the largest at a piston-side pressure \[Pa\].
    fn stiffness_at(&self, pressure: f64) -> f64 {
        let ([largest, smallest], [transition, width]) = (self.bulk_modulus, self.transition);
        let lowest = smallest / largest;
        let step = Real::tanh((pressure - transition) / width);
        0.5 * (1.0 + lowest) + 0.5 * (1.0 - lowest) * step
    }

    /// Bulk modulus relative to the largest one \[1\] at a load pressure p \[Pa\]:
    /// `(1 + q)/2 + (1 − q)/2 · tanh((p + p_r − p_c1)/p_c2)`.
    ///
    /// q is the smallest bulk modulus over the largest, and p_r the rod side's term.
    pub fn stiffness(&self, load_pressure: f64) -> f64 {
        self.stiffness_at(load_pressure + self.rod_side_term)
    }
}

/// Part of the piston-side pressure that balances the rod side, (A_r/A_p) p_B \[Pa\], with the crane file's rod-side
/// pressure.
pub fn rod_side_term(description: &Description) -> f64 {
    description.cylinder().area_ratio() * description.numbers.rod_side
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operating_points_are_interpolated_linearly() {
        let points = OperatingPoints::new(&Description::uia_single_boom().unwrap()).unwrap();
        assert_eq!(points.at(points.position(3)).equilibrium, points.points[3].equilibrium);
        let between = points.at(0.5 * (points.position(3) + points.position(4)));
        let mean = |of: fn(&OperatingPoint) -> f64| {
            let wanted = 0.5 * (of(&points.points[3]) + of(&points.points[4]));
            assert!((of(&between) / wanted - 1.0).abs() < 1e-12);
        };
        mean(|p| p.equilibrium.load_pressure);
        mean(|p| p.stiff.pressure_by_speed);
        mean(|p| p.load.compliance);
    }

    /// The natural frequency is proportional to the square root of the stiffness of the oil.
    #[test]
    fn soft_oil_lowers_the_natural_frequency() {
        let points = OperatingPoints::new(&Description::uia_single_boom().unwrap()).unwrap();
        let at = points.at(0.2);
        let [soft, stiff] = [0.25, 1.0].map(|share| at.spring(share).natural_frequency());
        assert!((stiff / soft - 2.0).abs() < 1e-12, "{soft} and {stiff} rad/s");
    }
}
