//! Construction of model, controller and motion from a description.

use crate::Description;
use crate::schema::{
    CircuitChoice, DeliveryChoice, FrictionChoice, HoldingCheckChoice, Numbers, ProfileChoice,
    ReliefChoice, StructureChoice,
};
use hydroboom_control::actuator_limits::ActuatorLimits;
use hydroboom_control::feedback::benchmark::Benchmark;
use hydroboom_control::feedback::filter::HighPass;
use hydroboom_control::reference::profile::{OutAndBack, RampShape};
use hydroboom_math::Real;
use hydroboom_model::boom::{BaseFrame, Link, Payload, Segment};
use hydroboom_model::circuit::{Hose, SpoolValve, TrappedAir, ValveEdge};
use hydroboom_model::hydraulics::{
    Accumulator, CheckValve, Cylinder, Delivery, EndStops, Friction, LuGre, Oil, Orifice,
    PilotCheckValve, Pump, Slip, Stribeck,
};
use hydroboom_model::{
    Beam, Boom, Crane, EquilibriumError, Geometry, LayoutError, SelfContained, Start,
    ValveControlled, ValveStart,
};
use thiserror::Error;

/// Reason why no model can be built from a description.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum BuildError {
    /// The boom's type has no room for this number of segments.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The crane has another kind of circuit than required.
    #[error(
        "this needs a crane with a {needed} circuit, and its circuit.type is {found}",
        needed = needed.name(),
        found = found.name()
    )]
    Circuit {
        /// Required kind.
        needed: CircuitChoice,
        /// Kind of the crane.
        found: CircuitChoice,
    },
    /// There is no equilibrium to start from.
    #[error(transparent)]
    Equilibrium(#[from] EquilibriumError),
}

impl Description {
    /// Model of the crane, in a type with room for `N` coordinates.
    ///
    /// ```
    /// use hydroboom_description::Description;
    /// use hydroboom_model::{Input, Scheme, Simulation};
    ///
    /// let description = Description::uia_single_boom()?;
    /// let crane = description.crane::<3>()?;
    /// let rest = crane.at_rest(&description.start(0.25))?;
    /// let mut simulation = Simulation::new(crane, rest, Scheme::Implicit, 1e-3)?;
    /// simulation.advance(&Input { pump_speed: 0.0, holding_valve: 0.0 }, 100)?;
    /// // with the load held and the pump at rest the piston stays within a millimetre
    /// let outputs = simulation.crane().outputs(simulation.state());
    /// assert!((outputs.stroke - 0.25).abs() < 1e-3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`BuildError::Layout`] if the boom has more segments than `N` (for the exact types of up to three: not exactly
    /// `N`). [`BuildError::Circuit`] if the circuit is not self-contained.
    pub fn crane<const N: usize>(&self) -> Result<Crane<f64, N>, BuildError> {
        self.crane_over(&self.numbers)
    }

    /// The model with other numbers of type `T`, for example dual numbers for derivatives by some keys. Its structure
    /// (number of segments, friction law, elastic base) follows the description.
    ///
    /// # Errors
    ///
    /// As [`crane`](Self::crane).
    pub fn crane_over<T: Real, const N: usize>(
        &self,
        n: &Numbers<T>,
    ) -> Result<Crane<T, N>, BuildError> {
        self.need(CircuitChoice::SelfContained)?;
        let has = &self.numbers;
        let circuit = SelfContained {
            oil: oil(n),
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
            holding_valve_checks: self.choices.holding_check == HoldingCheckChoice::Check,
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
        Ok(self.around(circuit, n)?)
    }

    /// Model of a crane with a valve-controlled circuit, with other numbers of type `T`.
    ///
    /// # Errors
    ///
    /// [`BuildError::Layout`] as for [`crane`](Self::crane), [`BuildError::Circuit`] if the circuit is not
    /// valve-controlled.
    pub fn valve_crane_over<T: Real, const N: usize>(
        &self,
        n: &Numbers<T>,
    ) -> Result<Crane<T, N, ValveControlled<T>>, BuildError> {
        self.need(CircuitChoice::ValveControlled)?;
        let edge = |coefficient, dead_band| ValveEdge { coefficient, dead_band };
        let circuit = ValveControlled {
            oil: oil(n),
            valve: SpoolValve {
                neutral: n.spool_neutral,
                full: n.spool_full,
                bandwidth: T::lit(std::f64::consts::TAU) * n.spool_bandwidth,
                damping: n.spool_damping,
                compensated_drop: n.compensated_drop,
            },
            supply_to_a: edge(n.supply_to_a, n.supply_to_a_band),
            supply_to_b: edge(n.supply_to_b, n.supply_to_b_band),
            a_to_tank: edge(n.a_to_tank, n.a_to_tank_band),
            b_to_tank: edge(n.b_to_tank, n.b_to_tank_band),
            leakage: n.valve_leakage,
            hose_a: Hose { volume: n.hose_a, wall_modulus: n.hose_modulus },
            hose_b: Hose { volume: n.hose_b, wall_modulus: n.hose_modulus },
            air: TrappedAir {
                piston_side: n.air_a,
                rod_side: n.air_b,
                polytropic_exponent: n.air_exponent,
                atmosphere: n.air_atmosphere,
            },
            orifice: Orifice::new(n.laminar_drop),
        };
        Ok(self.around(circuit, n)?)
    }

    /// Checks the kind of circuit.
    fn need(&self, needed: CircuitChoice) -> Result<(), BuildError> {
        match self.choices.circuit {
            found if found != needed => Err(BuildError::Circuit { needed, found }),
            _ => Ok(()),
        }
    }

    /// Adds cylinder, friction and boom to a circuit.
    fn around<T: Real, const N: usize, C>(
        &self,
        circuit: C,
        n: &Numbers<T>,
    ) -> Result<Crane<T, N, C>, LayoutError> {
        Ok(Crane {
            circuit,
            cylinder: cylinder(n),
            end_stops: EndStops { stiffness: n.stop_stiffness, damping: n.stop_damping },
            friction: self.friction(n),
            boom: self.boom(n)?,
        })
    }

    fn boom<T: Real, const N: usize>(&self, n: &Numbers<T>) -> Result<Boom<T, N>, LayoutError> {
        let has = &self.numbers;
        let geometry = Geometry {
            mount_x: n.mount_x,
            mount_y: n.mount_y,
            base_x: n.base_x,
            base_y: n.base_y,
            shortest: n.shortest,
        };
        if self.choices.structure == StructureChoice::Links {
            let links = links(n);
            let count = self.segment_shares.len().min(links.len());
            let payload = Payload {
                mass: n.payload,
                x: n.payload_x,
                y: n.payload_y,
                inertia: n.payload_inertia,
            };
            return Boom::from_links(&links[..count], &payload, &geometry, n.gravity);
        }
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
        let mount_share = has.mount_x / has.boom_length;
        let boom = Boom::from_beam(&beam, &geometry, &self.segment_shares, mount_share)?;
        match self.base_frame(n) {
            Some(base) => boom.on_base(base),
            None => Ok(boom),
        }
    }

    fn friction<T: Real>(&self, n: &Numbers<T>) -> Friction<T> {
        let stribeck_slope = T::one() / n.stribeck_velocity;
        match self.choices.friction {
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
        }
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

    /// Description of the crane with `segments` equal segments on a rigid base. The number is not checked here: one
    /// that no boom has fails when the model is built.
    pub fn divided(&self, segments: usize) -> Self {
        let mut divided = self.clone();
        divided.segment_shares = vec![1.0; segments];
        divided.numbers.base_stiffness = 0.0;
        divided
    }

    /// Number of generalised coordinates (angles): one for each segment, and one for an elastic base frame.
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

    /// Initial conditions of an equilibrium at a piston position \[m\], with the pump sides preloaded as described.
    pub fn start(&self, stroke: f64) -> Start {
        self.start_over(&self.numbers, stroke)
    }

    /// Initial conditions at a piston position \[m\] with other numbers, as in [`crane_over`](Self::crane_over).
    pub fn start_over<T: Real>(&self, n: &Numbers<T>, stroke: T) -> Start<T> {
        Start {
            stroke,
            rod_side_pressure: n.rod_side,
            accumulator_pressure: n.working_pressure,
            gas_volume: self.accumulator(n).1,
            preload: n.preload,
        }
    }

    /// Initial conditions of a valve-controlled crane at a piston position \[m\], with the rod side at tank pressure.
    pub fn valve_start_over<T: Real>(&self, n: &Numbers<T>, stroke: T) -> ValveStart<T> {
        ValveStart { stroke, pressure_a: None, pressure_b: n.tank_pressure }
    }

    /// Benchmark controller with the gains of the crane file.
    pub fn benchmark(&self) -> Benchmark<f64> {
        self.benchmark_over(&self.numbers)
    }

    /// Benchmark controller with other numbers, as in [`crane_over`](Self::crane_over).
    pub fn benchmark_over<T: Real>(&self, n: &Numbers<T>) -> Benchmark<T> {
        let piston_area = T::lit(std::f64::consts::FRAC_PI_4) * n.piston.square();
        Benchmark {
            proportional: n.proportional,
            integral: n.integral,
            pressure_feedback: n.pressure_feedback,
            high_pass: HighPass::new(n.high_pass_time, n.control_period),
            revolutions_per_metre: piston_area / n.displacement,
            displacement: n.displacement,
            limits: ActuatorLimits { speed: n.motor_speed, slew: n.motor_slew },
            period: n.control_period,
        }
    }

    /// Cylinder of the crane: areas, stroke and dead volumes.
    pub fn cylinder(&self) -> Cylinder<f64> {
        cylinder(&self.numbers)
    }

    /// Friction law of the cylinder.
    pub fn friction_law(&self) -> Friction<f64> {
        self.friction(&self.numbers)
    }

    /// Oil of the crane, without dissolved air.
    pub fn oil(&self) -> Oil<f64> {
        oil(&self.numbers)
    }

    /// Largest piston velocity \[m/s\], n_max K_VP/A_p: at the motor's largest speed, without leakage.
    pub fn fastest_piston(&self) -> f64 {
        let n = &self.numbers;
        n.motor_speed * n.displacement / self.cylinder().piston_area
    }

    /// Out-and-back reference motion of the tests, at a speed \[m/s\].
    pub fn motion(&self, speed: f64) -> OutAndBack<f64> {
        let n = &self.numbers;
        OutAndBack {
            start: n.motion_start,
            end: n.motion_end,
            speed,
            ramp: n.ramp,
            dwell: n.dwell,
            rest: n.rest,
            profile: match self.choices.profile {
                ProfileChoice::Trapezoidal => RampShape::Trapezoidal,
                ProfileChoice::SCurve => RampShape::SCurve,
            },
        }
    }
}

fn cylinder<T: Real>(n: &Numbers<T>) -> Cylinder<T> {
    Cylinder::from_diameters(n.piston, n.rod, n.stroke, n.dead_volume_a, n.dead_volume_b)
}

fn oil<T: Real>(n: &Numbers<T>) -> Oil<T> {
    Oil {
        bulk_modulus_max: n.bulk_modulus_max,
        bulk_modulus_min: n.bulk_modulus_min,
        transition_pressure: n.transition,
        transition_slope: T::one() / n.transition_width,
        vapour_pressure: n.vapour_pressure,
    }
}

/// All possible links; the first one has a free pivot.
fn links<T: Real>(n: &Numbers<T>) -> [Link<T>; 3] {
    let zero = T::zero();
    [
        Link {
            body: Segment {
                length: n.link_1_length,
                mass: n.link_1_mass,
                centre_x: n.link_1_x,
                centre_y: n.link_1_y,
                inertia: n.link_1_inertia,
            },
            joint_stiffness: zero,
            joint_damping: zero,
            joint_angle: zero,
        },
        Link {
            body: Segment {
                length: n.link_2_length,
                mass: n.link_2_mass,
                centre_x: n.link_2_x,
                centre_y: n.link_2_y,
                inertia: n.link_2_inertia,
            },
            joint_stiffness: n.link_2_stiffness,
            joint_damping: n.link_2_damping,
            joint_angle: n.link_2_angle,
        },
        Link {
            body: Segment {
                length: n.link_3_length,
                mass: n.link_3_mass,
                centre_x: n.link_3_x,
                centre_y: n.link_3_y,
                inertia: n.link_3_inertia,
            },
            joint_stiffness: n.link_3_stiffness,
            joint_damping: n.link_3_damping,
            joint_angle: n.link_3_angle,
        },
    ]
}
