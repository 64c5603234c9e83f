//! From a description to the model, the controller and the motion.

use crate::Description;
use crate::schema::{DeliveryChoice, FrictionChoice, Numbers, ProfileChoice, ReliefChoice};
use hydroboom_control::{Benchmark, HighPass, Motion, MotorLimits, Profile};
use hydroboom_math::Real;
use hydroboom_model::boom::BaseFrame;
use hydroboom_model::hydraulics::{
    Accumulator, CheckValve, Cylinder, Delivery, EndStops, Friction, LuGre, Oil, Orifice,
    PilotCheckValve, Pump, Slip, Stribeck,
};
use hydroboom_model::{
    Beam, Boom, Crane, EquilibriumError, Geometry, LayoutError, SelfContained, Start,
};
use thiserror::Error;

/// Why a description gives no model.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum BuildError {
    /// The boom's type has no room for that many segments.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// There is no state to start from.
    #[error(transparent)]
    Equilibrium(#[from] EquilibriumError),
}

impl Description {
    /// The model, in a type with room for `N` segments.
    ///
    /// # Errors
    ///
    /// [`LayoutError`] when the boom has more segments than `N`, or, for the exact types of up to
    /// three, another number.
    pub fn crane<const N: usize>(&self) -> Result<Crane<f64, N>, LayoutError> {
        self.crane_over(&self.numbers)
    }

    /// The same model over other numbers: with slopes along some keys, say. What there is of it (how many
    /// segments, which friction law, whether its base gives way) follows the description.
    ///
    /// # Errors
    ///
    /// As [`crane`](Self::crane).
    pub fn crane_over<T: Real, const N: usize>(
        &self,
        n: &Numbers<T>,
    ) -> Result<Crane<T, N>, LayoutError> {
        let has = &self.numbers;
        let beam = Beam {
            length: n.boom_length,
            mass: n.boom_mass,
            flexural_rigidity: n.youngs_modulus * n.second_moment,
            damping_ratio: n.damping_ratio,
            payload_mass: n.payload,
            payload_x: n.payload_x,
            payload_y: n.payload_y,
            payload_inertia: n.payload_inertia,
            gravity: n.gravity,
        };
        let geometry = Geometry {
            mount_x: n.mount_x,
            mount_y: n.mount_y,
            base_x: n.base_x,
            base_y: n.base_y,
            shortest: n.shortest,
        };
        let mount_share = has.mount_x / has.boom_length;
        let mut boom = Boom::from_beam(&beam, &geometry, &self.segment_shares, mount_share)?;
        if let Some(base) = self.base_frame(n) {
            boom = boom.on_base(base)?;
        }

        let stribeck_slope = T::one() / n.stribeck_velocity;
        let friction = match self.choices.friction {
            FrictionChoice::Stribeck => Friction::Stribeck(Stribeck {
                viscous: n.viscous,
                coulomb: n.coulomb,
                stiction: n.stiction,
                stribeck_slope,
                steepness: n.steepness,
            }),
            FrictionChoice::LuGre => Friction::LuGre(LuGre {
                viscous: n.viscous,
                coulomb: n.coulomb,
                stiction: n.stiction,
                stribeck_slope,
                bristle_stiffness: n.bristle_stiffness,
                bristle_damping: n.bristle_damping,
            }),
        };

        let circuit = SelfContained {
            oil: Oil {
                bulk_modulus_max: n.bulk_modulus_max,
                bulk_modulus_min: n.bulk_modulus_min,
                transition_pressure: n.transition,
                transition_slope: T::one() / n.transition_width,
                vapour_pressure: n.vapour_pressure,
            },
            dissolved_air: None,
            pump: Pump {
                displacement: n.displacement,
                delivery: match self.choices.delivery {
                    DeliveryChoice::Published => Delivery::Published(n.flow_gain),
                    DeliveryChoice::Computed => Delivery::Computed,
                },
            },
            accumulator: self.accumulator(n).0,
            volume_pump_a: n.volume_pump_a,
            volume_pump_b: n.volume_pump_b,
            internal_leakage: n.internal_leakage,
            slip: (has.slip_at_rest + has.slip_per_speed > 0.0)
                .then_some(Slip { at_rest: n.slip_at_rest, per_speed: n.slip_per_speed }),
            case_leakage_a: n.case_leakage_a,
            case_leakage_b: n.case_leakage_b,
            holding_valve: PilotCheckValve {
                check: CheckValve::new(
                    n.holding_coefficient,
                    n.holding_cracking,
                    n.holding_opening,
                ),
                pilot_ratio: n.holding_ratio,
            },
            return_valve: PilotCheckValve {
                check: CheckValve::new(n.return_coefficient, n.return_cracking, n.return_opening),
                pilot_ratio: n.return_ratio,
            },
            check_valve: CheckValve::new(n.check_coefficient, n.check_cracking, n.check_opening),
            filter: n.filter,
            bleed_orifice: n.bleed_orifice,
            relief: match self.choices.relief {
                ReliefChoice::None => None,
                ReliefChoice::Fitted => {
                    Some(CheckValve::new(n.relief_coefficient, n.relief_cracking, n.relief_opening))
                }
            },
            orifice: Orifice::new(n.laminar_drop),
        };
        Ok(Crane {
            circuit,
            cylinder: cylinder(n),
            end_stops: EndStops { stiffness: n.stop_stiffness, damping: n.stop_damping },
            friction,
            boom,
        })
    }

    /// The base frame, if it is elastic.
    fn base_frame<T: Real>(&self, n: &Numbers<T>) -> Option<BaseFrame<T>> {
        (self.numbers.base_stiffness > 0.0).then(|| BaseFrame {
            inertia: n.base_inertia,
            stiffness: n.base_stiffness,
            damping: T::lit(2.0) * n.base_damping * (n.base_stiffness * n.base_inertia).sqrt(),
            slack: n.base_slack,
        })
    }

    /// The same crane in so many equal segments, on a rigid base.
    pub fn divided(&self, segments: usize) -> Self {
        let mut divided = self.clone();
        divided.segment_shares = vec![1.0; segments];
        divided.numbers.base_stiffness = 0.0;
        divided
    }

    /// Angles the model needs: one for each segment and one for an elastic base frame.
    pub fn coordinates(&self) -> usize {
        self.segment_shares.len() + usize::from(self.numbers.base_stiffness > 0.0)
    }

    fn accumulator<T: Real>(&self, n: &Numbers<T>) -> (Accumulator<T>, T) {
        Accumulator::filled(
            n.accumulator_volume,
            n.residual_volume,
            n.polytropic_exponent,
            n.atmosphere,
            n.precharge,
            n.working_pressure,
        )
    }

    /// A start at the given piston position \[m\], pump sides pre-loaded as described.
    pub fn start(&self, stroke: f64) -> Start {
        self.start_over(&self.numbers, stroke)
    }

    /// The same over other numbers, as [`crane_over`](Self::crane_over).
    pub fn start_over<T: Real>(&self, n: &Numbers<T>, stroke: T) -> Start<T> {
        Start {
            stroke,
            rod_side_pressure: n.rod_side,
            accumulator_pressure: n.working_pressure,
            gas_volume: self.accumulator(n).1,
            preload: n.preload,
        }
    }

    /// The benchmark controller.
    pub fn benchmark(&self) -> Benchmark<f64> {
        let n = &self.numbers;
        let piston_area = std::f64::consts::FRAC_PI_4 * n.piston.powi(2);
        Benchmark {
            proportional: n.proportional,
            integral: n.integral,
            pressure_feedback: n.pressure_feedback,
            high_pass: HighPass::new(n.high_pass_time, n.control_period),
            revolutions_per_metre: piston_area / n.displacement,
            displacement: n.displacement,
            limits: MotorLimits { speed: n.motor_speed, slew: n.motor_slew },
            period: n.control_period,
        }
    }

    /// The cylinder, as the model has it.
    pub fn cylinder(&self) -> Cylinder<f64> {
        cylinder(&self.numbers)
    }

    /// The motion of the tests at a speed \[m/s\].
    pub fn motion(&self, speed: f64) -> Motion<f64> {
        let n = &self.numbers;
        Motion {
            start: n.motion_start,
            end: n.motion_end,
            speed,
            ramp: n.ramp,
            dwell: n.dwell,
            rest: n.rest,
            profile: match self.choices.profile {
                ProfileChoice::Trapezoidal => Profile::Trapezoidal,
                ProfileChoice::SCurve => Profile::SCurve,
            },
        }
    }
}

fn cylinder<T: Real>(n: &Numbers<T>) -> Cylinder<T> {
    Cylinder::from_diameters(n.piston, n.rod, n.stroke, n.dead_volume_a, n.dead_volume_b)
}
