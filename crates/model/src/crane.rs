//! Crane assembled from circuit, cylinder and boom: parameters, state, input, outputs, and state equations.

use crate::boom::{Boom, BoomState, CylinderPose, Pose};
use crate::circuit::{Circuit, CircuitState, Flows, Nodes, SelfContained};
use crate::hydraulics::{Cylinder, EndStops, Friction, FrictionLaw};
use hydroboom_math::{Real, record};

/// Parameters of a crane: a boom with at most `N` coordinates, one cylinder, and one hydraulic circuit. Constant
/// during a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crane<T, const N: usize, C = SelfContained<T>> {
    /// Hydraulic circuit that drives the cylinder.
    pub circuit: C,
    /// Areas, stroke and dead volumes of the differential cylinder.
    pub cylinder: Cylinder<T>,
    /// Mechanical stops at both ends of the stroke.
    pub end_stops: EndStops<T>,
    /// Friction law of piston and rod seals.
    pub friction: Friction<T>,
    /// Flexible boom with its payload.
    pub boom: Boom<T, N>,
}

/// State of a crane: every quantity that is integrated in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CraneState<T, const N: usize, S = CircuitState<T>> {
    /// Angles and angular velocities of the boom.
    pub boom: BoomState<T, N>,
    /// Bristle deflection of the friction law \[m\]; zero for laws without memory.
    pub bristle: T,
    /// Pressures and other states of the hydraulic circuit.
    pub circuit: S,
}

/// Rates of change of a [`CraneState`].
#[derive(Clone, Copy, Debug)]
pub struct CraneRates<T, const N: usize, S = CircuitState<T>> {
    /// Angular accelerations \[rad/s²\].
    pub angular_acceleration: [T; N],
    /// Rate of the bristle deflection \[m/s\].
    pub bristle: T,
    /// Rates of the circuit's states, each in its unit per second.
    pub circuit: S,
}

record! {
    /// Inputs of a crane with a self-contained circuit, constant over a step.
    pub struct Input<T> {
        /// Pump speed n, positive when it delivers to the piston side
        #[unit = "rev/s"]
        pub pump_speed: T,
        /// 3/2 valve: 1 energised (load released), 0 not (load held)
        #[unit = "1"]
        pub holding_valve: T,
    }
}

record! {
    /// Outputs of a crane, quantities that machines measure first. Pressures are gauge.
    pub struct Outputs<T> {
        /// Piston position from the lower stop, x_cyl
        #[unit = "m"]
        pub stroke: T,
        /// Piston velocity, v_cyl
        #[unit = "m/s"]
        pub velocity: T,
        /// Gauge pressure on pump side A, p_PA
        #[unit = "Pa"]
        pub pressure_pump_a: T,
        /// Gauge pressure on the piston side, p_A
        #[unit = "Pa"]
        pub pressure_a: T,
        /// Gauge pressure on the rod side, p_B
        #[unit = "Pa"]
        pub pressure_b: T,
        /// Gauge pressure on pump side B, p_PB
        #[unit = "Pa"]
        pub pressure_pump_b: T,
        /// Gauge pressure in the accumulator, p_acc
        #[unit = "Pa"]
        pub pressure_accumulator: T,
        /// Gas volume of the accumulator, V_g
        #[unit = "m³"]
        pub gas_volume: T,
        /// Volume of all cavities, zero while every node is filled with oil
        #[unit = "m³"]
        pub cavity_volume: T,
        /// Force of the cylinder on the boom, F_cyl
        #[unit = "N"]
        pub cylinder_force: T,
        /// Friction force of the cylinder, opposing its motion, F_fr
        #[unit = "N"]
        pub friction_force: T,
        /// Force of the end stops on the piston, positive outwards
        #[unit = "N"]
        pub end_stop_force: T,
        /// Horizontal position of the tip, to the right of the bearing
        #[unit = "m"]
        pub tip_x: T,
        /// Vertical position of the tip, above the bearing
        #[unit = "m"]
        pub tip_y: T,
        /// Distance of the tip from the line of the first segment, positive upwards
        #[unit = "m"]
        pub tip_deflection: T,
    }
}

/// The piston's motion and the forces on it, at one state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PistonForces<T> {
    /// Force of the cylinder on the boom, F_cyl \[N\].
    pub cylinder: T,
    /// Friction, opposing the motion \[N\].
    pub friction: T,
    /// End stops \[N\].
    pub end_stops: T,
    /// Rate of the bristle deflection \[m/s\].
    pub bristle_rate: T,
}

impl<T: Real, const N: usize, C: Circuit<T>> Crane<T, N, C> {
    /// Forces on the piston, equations (9) to (11).
    #[inline(always)]
    pub(crate) fn piston_forces(
        &self,
        (pressure_a, pressure_b): (T, T),
        bristle: T,
        stroke: T,
        velocity: T,
    ) -> PistonForces<T> {
        let (friction, bristle_rate) = self.friction.evaluate(velocity, bristle);
        let end_stops = self.end_stops.force(stroke, velocity, self.cylinder.stroke_length);
        let cylinder = (self.cylinder.force(pressure_a, pressure_b) + end_stops) - friction;
        PistonForces { cylinder, friction, end_stops, bristle_rate }
    }

    /// State derivatives of boom (26), friction and circuit at a state and an input.
    #[inline(always)]
    pub fn derivative(
        &self,
        state: &CraneState<T, N, C::State>,
        input: &C::Input,
    ) -> CraneRates<T, N, C::State> {
        let pose = self.boom.pose(&state.boom.angle);
        let cylinder = self.boom.cylinder_pose(&pose);
        let velocity = cylinder.velocity(&self.boom, &state.boom.angular_velocity);

        let pressures = self.circuit.chambers(&state.circuit);
        // first what takes longest: friction's chain of exponentials waits for the velocity, and
        // the circuit's many short chains run beside it
        let forces = self.piston_forces(pressures, state.bristle, cylinder.stroke, velocity);

        // (26), superposed: the friction in the cylinder's force is the last to be known, and what
        // the boom makes of a force need not wait for it
        let mass_matrix = self.boom.articulated(&pose, None);
        let free = mass_matrix.solve(&self.boom, &self.boom.applied_moments(&pose, &state.boom));
        let answer = mass_matrix.solve(&self.boom, &cylinder.arm);
        let mut angular_acceleration = [T::zero(); N];
        for i in 0..self.boom.coordinates() {
            angular_acceleration[i] = answer[i].mul_add(forces.cylinder, free[i]);
        }

        let circuit = self.circuit.state_rates(
            &state.circuit,
            input,
            &self.cylinder,
            cylinder.stroke,
            velocity,
        );

        CraneRates { angular_acceleration, bristle: forces.bristle_rate, circuit }
    }

    /// Converts every parameter to another number type by `f`.
    pub fn over<U: Real>(&self, f: &mut impl FnMut(T) -> U) -> Crane<U, N, C::Over<U>> {
        Crane {
            circuit: self.circuit.over(f),
            cylinder: self.cylinder.map(&mut *f),
            end_stops: self.end_stops.map(&mut *f),
            friction: self.friction.map(f),
            boom: self.boom.map(f),
        }
    }

    /// Applied moments with the cylinder's, l (24).
    #[inline(always)]
    pub(crate) fn moments(
        &self,
        pose: &Pose<T, N>,
        cylinder: &CylinderPose<T, N>,
        state: &BoomState<T, N>,
        force: T,
    ) -> [T; N] {
        let mut moments = self.boom.applied_moments(pose, state);
        for i in 0..self.boom.coordinates() {
            moments[i] = moments[i] + cylinder.arm[i] * force;
        }
        moments
    }
}

impl<T: Real, const N: usize> Crane<T, N> {
    /// Outputs (positions, gauge pressures, forces) at a state.
    pub fn outputs(&self, state: &CraneState<T, N>) -> Outputs<T> {
        let pose = self.boom.pose(&state.boom.angle);
        let cylinder = self.boom.cylinder_pose(&pose);
        let (stroke, velocity) =
            (cylinder.stroke, cylinder.velocity(&self.boom, &state.boom.angular_velocity));
        let p = self.circuit.pressures(&state.circuit);
        let forces = self.piston_forces((p.a, p.b), state.bristle, stroke, velocity);
        let [tip_x, tip_y] = self.boom.tip_position(&pose);
        let cavities = self.node_volumes(state, stroke).to_array();
        let cavity_volume = state
            .circuit
            .nodes
            .to_array()
            .into_iter()
            .zip(cavities)
            .map(|(q, volume)| self.circuit.oil.cavity_volume(q, volume))
            .fold(T::zero(), |sum, cavity| sum + cavity);
        Outputs {
            stroke,
            velocity,
            pressure_pump_a: p.pump_a,
            pressure_a: p.a,
            pressure_b: p.b,
            pressure_pump_b: p.pump_b,
            pressure_accumulator: p.accumulator,
            gas_volume: state.circuit.gas_volume,
            cavity_volume,
            cylinder_force: forces.cylinder,
            friction_force: forces.friction,
            end_stop_force: forces.end_stops,
            tip_x,
            tip_y,
            tip_deflection: self.boom.tip_deflection(&pose),
        }
    }

    /// Volume flows \[m³/s\] of the circuit at a state and an input.
    pub fn flows(&self, state: &CraneState<T, N>, input: &Input<T>) -> Flows<T> {
        let pressures = self.circuit.pressures(&state.circuit);
        self.circuit.flows(&pressures, input.pump_speed, input.holding_valve)
    }

    /// Volume \[m³\] of each node, cavities included, with the piston at `stroke` \[m\].
    pub fn node_volumes(&self, state: &CraneState<T, N>, stroke: T) -> Nodes<T> {
        Nodes {
            pump_a: self.circuit.volume_pump_a,
            a: self.cylinder.volume_a(stroke),
            b: self.cylinder.volume_b(stroke),
            pump_b: self.circuit.volume_pump_b,
            accumulator: self.circuit.accumulator.oil_volume(state.circuit.gas_volume),
        }
    }
}

impl<T, const N: usize> Crane<T, N> {
    /// Converts every parameter to another number type by `f`.
    pub fn map<U>(self, f: &mut impl FnMut(T) -> U) -> Crane<U, N> {
        Crane {
            circuit: self.circuit.map(f),
            cylinder: self.cylinder.map(&mut *f),
            end_stops: self.end_stops.map(&mut *f),
            friction: self.friction.map(f),
            boom: self.boom.map(f),
        }
    }
}

impl<T, const N: usize> CraneState<T, N> {
    /// Converts every state to another number type by `f`.
    pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> CraneState<U, N> {
        CraneState {
            boom: BoomState {
                angle: self.boom.angle.map(&mut f),
                angular_velocity: self.boom.angular_velocity.map(&mut f),
            },
            bristle: f(self.bristle),
            circuit: self.circuit.map(&mut f),
        }
    }
}
