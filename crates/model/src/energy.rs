//! Energy and power balance of the crane.
//!
//! [`Crane::energy`] is a state function, [`Crane::power`] its rate of change by name: `dE/dt = pump −
//! losses + defects`, exactly. A *defect* belongs to an equation that does not conserve mass. A
//! restriction's volume flow is the same on both sides although the oil's density is not. The pump's k_flow
//! approximates that compression. An inflow Q at pressure p carries `Q (p + ρe)`.

use crate::circuit::Nodes;
use crate::crane::{Crane, CraneState, Input};
use crate::hydraulics::FrictionLaw;
use core::array::from_fn;
use hydroboom_math::{Real, record};

record! {
    /// Energy stored in a crane, by form.
    pub struct Energy<T> {
        /// Kinetic energy of boom and payload
        #[unit = "J"]
        pub kinetic: T,
        /// Gravitational potential energy of boom and payload, zero at the bearing's height
        #[unit = "J"]
        pub gravitational: T,
        /// Elastic energy of the bent joints and the base frame
        #[unit = "J"]
        pub elastic: T,
        /// Energy of compressed oil, and of cavities against the atmosphere
        #[unit = "J"]
        pub oil: T,
        /// Energy of the accumulator's compressed gas
        #[unit = "J"]
        pub gas: T,
        /// Elastic energy of the bristles of the friction law
        #[unit = "J"]
        pub bristles: T,
        /// Elastic energy of the compressed end stops
        #[unit = "J"]
        pub end_stops: T,
    }
}

impl<T: Real> Energy<T> {
    /// Total energy, the sum of all forms \[J\].
    pub fn total(&self) -> T {
        self.to_array().into_iter().fold(T::zero(), |sum, energy| sum + energy)
    }
}

record! {
    /// Power balance of a crane: pump work, losses by component, and what equations that do not conserve mass add.
    pub struct Power<T> {
        /// Power of the pump on the oil, k_flow Q_P p_PA − Q_P p_PB
        #[unit = "W"]
        pub pump: T,
        /// Power lost in the load-holding valves
        #[unit = "W"]
        pub loss_holding_valves: T,
        /// Power lost to internal and case leakage of the pump
        #[unit = "W"]
        pub loss_leakage: T,
        /// Power lost in the lines to and from the accumulator
        #[unit = "W"]
        pub loss_return_lines: T,
        /// Power lost in the relief valves
        #[unit = "W"]
        pub loss_relief: T,
        /// Power lost to friction in the cylinder
        #[unit = "W"]
        pub loss_friction: T,
        /// Power lost in the boom's joints and the base frame
        #[unit = "W"]
        pub loss_joints: T,
        /// Power lost in the end stops
        #[unit = "W"]
        pub loss_end_stops: T,
        /// Power added by orifice equations, which conserve volume and not mass
        #[unit = "W"]
        pub defect_restrictions: T,
        /// Power added by the pump's flow gain k_flow, which does not conserve mass
        #[unit = "W"]
        pub defect_pump: T,
    }
}

impl<T: Real> Power<T> {
    /// Sum of all losses \[W\].
    pub fn losses(&self) -> T {
        self.loss_holding_valves
            + self.loss_leakage
            + self.loss_return_lines
            + self.loss_relief
            + self.loss_friction
            + self.loss_joints
            + self.loss_end_stops
    }

    /// Rate of change of the crane's energy \[W\]: work less losses plus defects.
    pub fn net(&self) -> T {
        self.pump - self.losses() + self.defect_restrictions + self.defect_pump
    }
}

impl<T: Real, const N: usize> Crane<T, N> {
    /// Stored energy \[J\] at a state, by form.
    pub fn energy(&self, state: &CraneState<T, N>) -> Energy<T> {
        let pose = self.boom.pose(&state.boom.angle);
        let stroke = self.boom.cylinder_pose(&pose).stroke;
        let oils = self.circuit.oils().to_array();
        let volumes = self.node_volumes(state, stroke).to_array();
        let mut stored = T::zero();
        let nodes = state.circuit.nodes.to_array();
        for ((q, volume), oil) in nodes.into_iter().zip(volumes).zip(&oils) {
            let p = oil.pressure(q);
            let cavity = oil.cavity_volume(q, volume);
            stored = stored + oil.energy_density(p) * (volume - cavity) - p * cavity;
        }
        let gas = self.circuit.accumulator.gas_energy(
            self.circuit.oil.pressure(state.circuit.nodes.accumulator),
            state.circuit.gas_volume,
        );
        Energy {
            kinetic: self.boom.kinetic_energy(&pose, &state.boom),
            gravitational: self.boom.gravitational_energy(&pose),
            elastic: self.boom.elastic_energy(&state.boom),
            oil: stored,
            gas,
            bristles: self.friction.energy(state.bristle),
            end_stops: self.end_stops.energy(stroke, self.cylinder.stroke_length),
        }
    }

    /// Power balance \[W\] at a state and an input.
    pub fn power(&self, state: &CraneState<T, N>, input: &Input<T>) -> Power<T> {
        let pose = self.boom.pose(&state.boom.angle);
        let cylinder = self.boom.cylinder_pose(&pose);
        let velocity = cylinder.velocity(&self.boom, &state.boom.angular_velocity);
        let p = self.circuit.pressures(&state.circuit);
        let q = self.circuit.flows(&p, input.pump_speed, input.holding_valve);
        let forces = self.piston_forces((p.a, p.b), state.bristle, cylinder.stroke, velocity);

        let (oils, pressures) = (self.circuit.oils().to_array(), p.to_array());
        let density = Nodes::from_array(from_fn(|i| oils[i].energy_density(pressures[i])));
        // each restriction with its pressures and energy densities, from and to
        let to_accumulator_a = (p.pump_a - p.accumulator, density.accumulator - density.pump_a);
        let to_accumulator_b = (p.pump_b - p.accumulator, density.accumulator - density.pump_b);
        let through_pump = (p.pump_a - p.pump_b, density.pump_b - density.pump_a);
        let valve_a = (p.pump_a - p.a, density.a - density.pump_a);
        let valve_b = (p.b - p.pump_b, density.pump_b - density.b);

        let bristle_power = self.friction.stored_power(state.bristle, forces.bristle_rate);
        let spring = self.end_stops.spring_force(cylinder.stroke, self.cylinder.stroke_length);

        Power {
            pump: q.pump_delivery * p.pump_a - q.pump * p.pump_b,
            loss_holding_valves: q.to_a * valve_a.0 + q.from_b * valve_b.0,
            loss_leakage: q.internal_leakage * through_pump.0
                + q.case_leakage_a * to_accumulator_a.0
                + q.case_leakage_b * to_accumulator_b.0,
            loss_return_lines: q.bleed * to_accumulator_a.0
                + (q.return_flow - q.suction) * to_accumulator_b.0,
            loss_relief: q.relief_a * to_accumulator_a.0 + q.relief_b * to_accumulator_b.0,
            loss_friction: forces.friction * velocity - bristle_power,
            loss_joints: self.boom.damping_loss(&state.boom),
            loss_end_stops: (spring - forces.end_stops) * velocity,
            defect_restrictions: q.to_a * valve_a.1
                + q.from_b * valve_b.1
                + q.internal_leakage * through_pump.1
                + (q.case_leakage_a + q.bleed + q.relief_a) * to_accumulator_a.1
                + (q.case_leakage_b + q.return_flow - q.suction + q.relief_b) * to_accumulator_b.1,
            defect_pump: q.pump_delivery * density.pump_a - q.pump * density.pump_b,
        }
    }
}
