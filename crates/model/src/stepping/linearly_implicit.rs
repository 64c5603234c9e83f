//! A linearly implicit step: second order, no step limit from stiffness, fixed cost.
//!
//! The scheme is ROS2 (Verwer et al. 1999, doi:10.1137/S1064827597326651), a Rosenbrock W-method:
//!
//! ```text
//! (1 − γh A) k1 = f(u)
//! (1 − γh A) k2 = f(u + h k1) − 2 k1
//! u ← u + h (3 k1 + k2)/2,   γ = 1 + 1/√2
//! ```
//!
//! It is of second order for *any* matrix A and L-stable when A is the Jacobian, so A needs what is
//! stiff and nothing else. Here that is, exactly: the circuit's and the friction's derivatives by
//! pressures, piston position, velocity and bristle (dual numbers); the joints' springs and
//! dampers; and the cylinder force between both. Left out, being slow: gravity, centripetal terms,
//! the turning of the moment arms, the gas volume's column.
//!
//! Structure keeps the cost linear in the segments. The joints' part of A turns the mass matrix M
//! into `S = M + γh b + (γh)² k`, which is [factored](crate::boom::Articulated) joint by joint. The
//! circuit sees the boom only through the piston, the boom sees the circuit only through the
//! cylinder force along `arm`; so the boom is eliminated,
//! `k_v = arm·S⁻¹ rhs + (arm·S⁻¹ arm) ψ`, and what is left is a system of seven unknowns: five
//! pressures, bristle, piston velocity.

use crate::boom::{CylinderPose, Pose};
use crate::circuit::{CircuitState, Nodes, SelfContained};
use crate::crane::{Crane, CraneState, Input};
use crate::hydraulics::{Cylinder, EndStops, Friction, FrictionLaw};
use core::array::from_fn;
use hydroboom_math::{Dual, Factored, Real};

/// γ = 1 + 1/√2: the larger of the two values that make the scheme L-stable. With the smaller the
/// inner stage overshoots stiff components and chatters across the valves (see docs/theory.md).
const GAMMA: f64 = 1.0 + core::f64::consts::FRAC_1_SQRT_2;

/// Directions of differentiation: five nodes, then these.
const BRISTLE: usize = 5;
const STROKE: usize = 6;
const VELOCITY: usize = 7;
const DIRECTIONS: usize = 8;
/// Unknowns of the reduced system: five nodes, bristle, then the piston's velocity.
const PISTON: usize = 6;
const UNKNOWNS: usize = 7;

type D<T> = Dual<T, DIRECTIONS>;

/// The step, with the crane's stiff parts in dual numbers.
#[derive(Clone, Copy, Debug)]
pub struct LinearlyImplicit<T> {
    circuit: SelfContained<D<T>>,
    cylinder: Cylinder<D<T>>,
    end_stops: EndStops<D<T>>,
    friction: Friction<D<T>>,
}

/// The stiff part of the right-hand side at one state.
struct Stiff<T> {
    /// Rates of the nodes, then of the bristle.
    rates: [D<T>; PISTON],
    /// Rate of the gas volume.
    gas: D<T>,
    /// Cylinder force.
    force: D<T>,
}

/// One stage's increments.
struct Stage<T, const N: usize> {
    angle: [T; N],
    angular_velocity: [T; N],
    /// Nodes and bristle, then piston velocity.
    reduced: [T; UNKNOWNS],
    gas: T,
    stroke: T,
}

impl<T: Real> LinearlyImplicit<T> {
    /// Prepares steps of the given crane; to be used with that crane only.
    pub fn new<const N: usize>(crane: &Crane<T, N>) -> Self {
        let constant = &mut D::constant;
        Self {
            circuit: crane.circuit.map(constant),
            cylinder: crane.cylinder.map(&mut *constant),
            end_stops: crane.end_stops.map(&mut *constant),
            friction: crane.friction.map(constant),
        }
    }

    /// The stiff right-hand side with its exact derivatives.
    #[inline(always)]
    fn stiff(
        &self,
        circuit: &CircuitState<T>,
        bristle: T,
        stroke: T,
        velocity: T,
        input: &Input<T>,
    ) -> Stiff<T> {
        let q = circuit.nodes.to_array();
        let state = CircuitState {
            nodes: Nodes::from_array(from_fn(|i| D::variable(q[i], i))),
            gas_volume: D::constant(circuit.gas_volume),
        };
        let bristle = D::variable(bristle, BRISTLE);
        let stroke = D::variable(stroke, STROKE);
        let velocity = D::variable(velocity, VELOCITY);
        let (speed, valve) = (D::constant(input.pump_speed), D::constant(input.holding_valve));

        let p = self.circuit.pressures(&state);
        let flows = self.circuit.flows(&p, speed, valve);
        let rates = self.circuit.rates(&state, &flows, &self.cylinder, stroke, velocity);
        let (friction, bristle_rate) = self.friction.evaluate(velocity, bristle);
        let stops = self.end_stops.force(stroke, velocity, self.cylinder.stroke_length);
        let [pump_a, a, b, pump_b, accumulator] = rates.nodes.to_array();
        Stiff {
            rates: [pump_a, a, b, pump_b, accumulator, bristle_rate],
            gas: rates.gas_volume,
            force: self.cylinder.force(p.a, p.b) - friction + stops,
        }
    }

    /// One step of `step` \[s\].
    #[inline(always)]
    pub fn step<const N: usize>(
        &self,
        crane: &Crane<T, N>,
        state: &mut CraneState<T, N>,
        input: &Input<T>,
        step: T,
    ) {
        let boom = &crane.boom;
        let n = boom.len();
        let gh = T::lit(GAMMA) * step;
        let two = T::lit(2.0);

        // first stage: everything at the step's beginning
        let pose = boom.pose(&state.boom.angle);
        let cylinder = boom.cylinder_pose(&pose);
        let omega = state.boom.angular_velocity;
        let velocity = cylinder.velocity(boom, &omega);
        let stiff = self.stiff(&state.circuit, state.bristle, cylinder.stroke, velocity, input);

        let mut impedance = [T::zero(); N];
        for i in 0..n - 1 {
            let joint = &boom.joints()[i];
            impedance[i] = gh * (joint.damping + gh * joint.stiffness);
        }
        let reduced = Reduced::new(crane, &pose, &cylinder, &impedance, &stiff, gh);

        let mut moments = crane.moments(&pose, &cylinder, &state.boom, stiff.force.value);
        crane.add_spring_moments(&mut moments, &omega, gh);
        let rates: [T; PISTON] = from_fn(|i| stiff.rates[i].value);
        let first = reduced.stage(crane, moments, rates, stiff.gas.value, velocity, &omega);

        // second stage: at the end of an Euler step along the first
        let ahead = moved(crane, state, &first, step);
        let pose_ahead = boom.pose(&ahead.boom.angle);
        let cylinder_ahead = boom.cylinder_pose(&pose_ahead);
        let omega_ahead = ahead.boom.angular_velocity;
        let velocity_ahead = cylinder_ahead.velocity(boom, &omega_ahead);
        let p = crane.circuit.pressures(&ahead.circuit);
        let flows = crane.circuit.flows(&p, input.pump_speed, input.holding_valve);
        let circuit = crane.circuit.rates(
            &ahead.circuit,
            &flows,
            &crane.cylinder,
            cylinder_ahead.stroke,
            velocity_ahead,
        );
        let forces = crane.piston_forces(&p, ahead.bristle, cylinder_ahead.stroke, velocity_ahead);

        // M f − 2 M k1 without another solution for f: with f = k1 + (f − k1) it is
        // l − M' k1 − M k1, M' being the mass matrix ahead; the difference of third order in h
        let mut moments = crane.moments(&pose_ahead, &cylinder_ahead, &ahead.boom, forces.cylinder);
        let asked_ahead = boom.inertial_moments(&pose_ahead, &first.angular_velocity);
        let asked = boom.inertial_moments(&pose, &first.angular_velocity);
        let mut turning = [T::zero(); N];
        for i in 0..n {
            moments[i] = moments[i] - asked_ahead[i] - asked[i];
            turning[i] = omega_ahead[i] - two * first.angle[i];
        }
        crane.add_spring_moments(&mut moments, &turning, gh);

        let [pump_a, a, b, pump_b, accumulator] = circuit.nodes.to_array();
        let rates = [pump_a, a, b, pump_b, accumulator, forces.bristle_rate];
        let second = reduced.stage(
            crane,
            moments,
            from_fn(|i| rates[i] - two * first.reduced[i]),
            circuit.gas_volume - two * first.gas,
            velocity_ahead - two * first.stroke,
            &turning,
        );

        let (first_share, second_share) = (T::lit(1.5) * step, T::lit(0.5) * step);
        *state = moved(crane, &moved(crane, state, &first, first_share), &second, second_share);
    }
}

/// The left-hand sides of both stages: the boom eliminated, seven unknowns left.
struct Reduced<'a, T, const N: usize> {
    boom: crate::boom::Articulated<T, N>,
    arm: &'a [T; N],
    /// How the boom answers a unit of cylinder force, S⁻¹ arm.
    answer: [T; N],
    /// How the piston answers it, arm·S⁻¹ arm.
    compliance: T,
    factors: Factored<T, UNKNOWNS>,
    stiff: &'a Stiff<T>,
    gh: T,
}

impl<'a, T: Real, const N: usize> Reduced<'a, T, N> {
    #[inline(always)]
    fn new(
        crane: &Crane<T, N>,
        pose: &Pose<T, N>,
        cylinder: &'a CylinderPose<T, N>,
        impedance: &[T; N],
        stiff: &'a Stiff<T>,
        gh: T,
    ) -> Self {
        let boom = crane.boom.articulated(pose, Some(impedance));
        let answer = boom.solve(&crane.boom, &cylinder.arm);
        let compliance = cylinder.velocity(&crane.boom, &answer);

        let mut matrix = [[T::zero(); UNKNOWNS]; UNKNOWNS];
        for (row, rate) in stiff.rates.iter().enumerate() {
            for column in 0..PISTON {
                matrix[row][column] = -(gh * rate.slope[column]);
            }
            // the piston moves on with its own increment: k_x = v + γh k_v
            matrix[row][PISTON] = -(gh * (rate.slope[VELOCITY] + gh * rate.slope[STROKE]));
            matrix[row][row] = matrix[row][row] + T::one();
        }
        let force = &stiff.force.slope;
        for column in 0..PISTON {
            matrix[PISTON][column] = -(compliance * gh * force[column]);
        }
        matrix[PISTON][PISTON] =
            T::one() - compliance * gh * (force[VELOCITY] + gh * force[STROKE]);
        let factors = Factored::new(matrix);
        Self { boom, arm: &cylinder.arm, answer, compliance, factors, stiff, gh }
    }

    /// Solves one stage for its increments.
    ///
    /// `moments`, `rates`, `gas`, `stroke_rate` and `turning` are the right-hand sides for angular
    /// velocities (as moments), nodes and bristle, gas volume, piston position and angles.
    #[inline(always)]
    fn stage(
        &self,
        crane: &Crane<T, N>,
        moments: [T; N],
        rates: [T; PISTON],
        gas: T,
        stroke_rate: T,
        turning: &[T; N],
    ) -> Stage<T, N> {
        let n = crane.boom.len();
        let (gh, stiff) = (self.gh, self.stiff);
        let force = &stiff.force.slope;

        let mut alpha = self.boom.solve(&crane.boom, &moments);
        let mut free = T::zero();
        for i in 0..n {
            free = free + self.arm[i] * alpha[i];
        }

        let mut rhs = [T::zero(); UNKNOWNS];
        for i in 0..PISTON {
            rhs[i] = rates[i] + gh * stiff.rates[i].slope[STROKE] * stroke_rate;
        }
        rhs[PISTON] = free + self.compliance * gh * force[STROKE] * stroke_rate;
        let reduced = self.factors.solve(rhs);

        let stroke = stroke_rate + gh * reduced[PISTON];
        let mut push = force[STROKE] * stroke + force[VELOCITY] * reduced[PISTON];
        let mut gas_change = T::zero();
        for i in 0..PISTON {
            push = push + force[i] * reduced[i];
            gas_change = gas_change + stiff.gas.slope[i] * reduced[i];
        }
        let push = gh * push;
        let mut angle = [T::zero(); N];
        for i in 0..n {
            alpha[i] = alpha[i] + self.answer[i] * push;
            angle[i] = turning[i] + gh * alpha[i];
        }
        Stage { angle, angular_velocity: alpha, reduced, gas: gas + gh * gas_change, stroke }
    }
}

/// The state moved for `time` along a stage's increments.
#[inline(always)]
fn moved<T: Real, const N: usize>(
    crane: &Crane<T, N>,
    state: &CraneState<T, N>,
    stage: &Stage<T, N>,
    time: T,
) -> CraneState<T, N> {
    let mut to = *state;
    for i in 0..crane.boom.len() {
        to.boom.angle[i] = state.boom.angle[i] + time * stage.angle[i];
        to.boom.angular_velocity[i] =
            state.boom.angular_velocity[i] + time * stage.angular_velocity[i];
    }
    let q = state.circuit.nodes.to_array();
    to.circuit.nodes = Nodes::from_array(from_fn(|i| q[i] + time * stage.reduced[i]));
    to.circuit.gas_volume = state.circuit.gas_volume + time * stage.gas;
    to.bristle = state.bristle + time * stage.reduced[BRISTLE];
    to
}

impl<T: Real, const N: usize> Crane<T, N> {
    /// Adds the moments that the joints' springs gain in `time` \[s\] at the given turning rates.
    #[inline(always)]
    fn add_spring_moments(&self, moments: &mut [T; N], turning: &[T; N], time: T) {
        for i in 0..self.boom.len() - 1 {
            let torque = time * self.boom.joints()[i].stiffness * (turning[i + 1] - turning[i]);
            moments[i] = moments[i] + torque;
            moments[i + 1] = moments[i + 1] - torque;
        }
    }
}
