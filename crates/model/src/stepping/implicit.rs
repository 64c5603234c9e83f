//! An implicit step: second order, no step limit from stiffness, fixed cost.
//!
//! The scheme is the two-stage diagonally implicit Runge-Kutta method of Alexander (1977,
//! doi:10.1137/0714068), L-stable and stiffly accurate (its last stage is the new state):
//!
//! ```text
//! Y1 = u + γh f(Y1)
//! Y2 = u + (1 − γ)h f(Y1) + γh f(Y2),   u ← Y2,   γ = 1 − 1/√2
//! ```
//!
//! Each stage takes at most three Newton iterations, and two where that is enough. One linear solution, as in a Rosenbrock
//! method, was tried and is not enough: the load-holding valves open over 0.2 bar beyond a dead
//! band that the pump crosses within half a millisecond. A step that jumps over that ramp
//! linearises on its wrong side and chatters; a second look from where it landed does not.
//!
//! Newton's matrix holds what is stiff, exactly: the circuit's and the friction's derivatives by
//! pressures, bristle and piston (dual numbers); the joints' springs and dampers; and the cylinder
//! force between both. It leaves out gravity, centripetal terms, the turning of the boom within a
//! step and the gas volume's column, which are slow: that costs convergence a little, the solution
//! nothing.
//!
//! Structure keeps the cost linear in the segments. The joints turn the mass matrix M into
//! `S = M + γh b + (γh)² k`, which is [factored](crate::boom::Articulated) joint by joint. The
//! circuit sees the boom only through the piston, the boom sees the circuit only through the
//! cylinder force along `arm`; so the boom is eliminated,
//! `Δv = arm·S⁻¹ rhs + (arm·S⁻¹ arm) γh ΔF`, and what is left is a system of seven unknowns: five
//! pressures, bristle, piston velocity.

use crate::boom::{Articulated, Boom};
use crate::circuit::{CircuitState, Nodes, SelfContained};
use crate::crane::{Crane, CraneState, Input};
use crate::hydraulics::{Cylinder, EndStops, Friction, FrictionLaw};
use core::array::from_fn;
use hydroboom_math::{Dual, Factored, Real};

/// γ = 1 − 1/√2, which makes the scheme L-stable.
const GAMMA: f64 = 1.0 - core::f64::consts::FRAC_1_SQRT_2;

/// Newton iterations of each stage, at most.
const ITERATIONS: usize = 3;
/// A stage is left alone once an iteration changed no pressure by more than this \[Pa\]: the next one
/// would change it by a thousandth of that, and the scheme's own error is larger by far.
const SETTLED: f64 = 1.0;

/// An implicit step whose last iteration still changed a pressure by more than this \[Pa\] has not
/// settled: 0.01 bar. It happens where steps are far too long for an event, an end stop struck at
/// full speed, say; over a motion at 0.5 ms the largest change is 10 Pa, the usual one 1e-9 Pa.
const UNSETTLED: f64 = 1e3;
/// Parts that a step which does not settle is divided into at most.
pub const MOST_PARTS: u32 = 256;

/// Unknowns of the reduced system, which are also the directions of differentiation: five nodes,
/// then these.
const BRISTLE: usize = 5;
const PISTON: usize = 6;
const UNKNOWNS: usize = 7;

type D<T> = Dual<T, UNKNOWNS>;

/// The step, with the crane's stiff parts in dual numbers.
#[derive(Clone, Copy, Debug)]
pub struct Implicit<T> {
    circuit: SelfContained<D<T>>,
    cylinder: Cylinder<D<T>>,
    end_stops: EndStops<D<T>>,
    friction: Friction<D<T>>,
}

/// The boom of Newton's matrix, at the beginning of the step: within it the pose turns by less
/// than a thousandth, which costs convergence next to nothing.
struct Eliminated<T, const N: usize> {
    factors: Articulated<T, N>,
    /// Angular accelerations for a unit of the cylinder's force.
    answer: [T; N],
}

impl<T: Real, const N: usize> Eliminated<T, N> {
    #[inline(always)]
    fn new(boom: &Boom<T, N>, angle: &[T; N], impedance: &[T; N]) -> Self {
        let pose = boom.pose(angle);
        let factors = boom.articulated(&pose, Some(impedance));
        let answer = factors.solve(boom, &boom.cylinder_pose(&pose).arm);
        Self { factors, answer }
    }
}

/// The stiff part of the right-hand side at one state, with its derivatives.
struct Stiff<T> {
    /// Rates of the nodes, then of the bristle.
    rates: [D<T>; PISTON],
    /// Rate of the gas volume.
    gas: D<T>,
    /// Cylinder force.
    force: D<T>,
}

impl<T: Real> Implicit<T> {
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

    /// One step of `step` \[s\]. Returns how well it was solved: the largest pressure \[Pa\] that
    /// the last iteration of a stage still changed.
    #[inline(always)]
    pub fn step<const N: usize>(
        &self,
        crane: &Crane<T, N>,
        state: &mut CraneState<T, N>,
        input: &Input<T>,
        step: T,
    ) -> T {
        let gh = T::lit(GAMMA) * step;
        let mut impedance = [T::zero(); N];
        for (entry, joint) in impedance.iter_mut().zip(crane.boom.joints()) {
            *entry = gh * (joint.damping + gh * joint.stiffness);
        }
        if let Some(base) = crane.boom.base() {
            impedance[crane.boom.len()] = gh * (base.damping + gh * base.stiffness);
        }
        let boom = Eliminated::new(&crane.boom, &state.boom.angle, &impedance);
        let (first, left) = self.stage(crane, state, state, input, gh, &boom);
        // u + (1 − γ)h f(Y1), where γh f(Y1) = Y1 − u
        let share = T::lit((1.0 - GAMMA) / GAMMA);
        let base = beyond(crane, state, &first, share);
        let (second, left_again) = self.stage(crane, &base, &first, input, gh, &boom);
        *state = second;
        left.max(left_again)
    }

    /// Solves `Y = base + γh f(Y)` from a guess. Also returns the largest pressure \[Pa\] that the
    /// last iteration changed.
    #[inline(always)]
    fn stage<const N: usize>(
        &self,
        crane: &Crane<T, N>,
        base: &CraneState<T, N>,
        guess: &CraneState<T, N>,
        input: &Input<T>,
        gh: T,
        eliminated: &Eliminated<T, N>,
    ) -> (CraneState<T, N>, T) {
        let n = crane.boom.coordinates();
        let mut y = *guess;
        let mut left = T::lit(f64::INFINITY);
        for i in 0..n {
            y.boom.angle[i] = base.boom.angle[i] + gh * y.boom.angular_velocity[i];
        }
        for _ in 0..ITERATIONS {
            let goes_on = left.still_changes(T::lit(SETTLED));
            if !T::any(goes_on) {
                break;
            }
            let mut next = y;
            let change = self.iterate(crane, base, &mut next, input, gh, eliminated);
            // lane by lane, so that none depends on what the others need
            y = chosen(goes_on, &next, &y, n);
            left = T::select(goes_on, change, left);
        }
        (y, left)
    }

    /// One Newton iteration; returns the largest change of a pressure \[Pa\]. Angles always follow the
    /// angular velocities, `φ = base + γh φ̇`.
    #[inline(always)]
    fn iterate<const N: usize>(
        &self,
        crane: &Crane<T, N>,
        base: &CraneState<T, N>,
        y: &mut CraneState<T, N>,
        input: &Input<T>,
        gh: T,
        eliminated: &Eliminated<T, N>,
    ) -> T {
        let boom = &crane.boom;
        let n = boom.coordinates();
        let pose = boom.pose(&y.boom.angle);
        let cylinder = boom.cylinder_pose(&pose);
        let velocity = cylinder.velocity(boom, &y.boom.angular_velocity);
        let stiff = self.stiff(&y.circuit, y.bristle, cylinder.stroke, velocity, input, gh);

        // what the boom's equation lacks, γh (l + arm F) − M (φ̇ − base)
        let mut gained = [T::zero(); N];
        for i in 0..n {
            gained[i] = y.boom.angular_velocity[i] - base.boom.angular_velocity[i];
        }
        let asked = boom.inertial_moments(&pose, &gained);
        let applied = crane.moments(&pose, &cylinder, &y.boom, stiff.force.value);
        let mut lacking = [T::zero(); N];
        for i in 0..n {
            lacking[i] = gh * applied[i] - asked[i];
        }

        // the boom eliminated
        let free = eliminated.factors.solve(boom, &lacking);
        let answer = &eliminated.answer;
        let push = gh * cylinder.velocity(boom, answer);

        let mut matrix = [[T::zero(); UNKNOWNS]; UNKNOWNS];
        let mut rhs = [T::zero(); UNKNOWNS];
        let (at, from) = (y.circuit.nodes.to_array(), base.circuit.nodes.to_array());
        for row in 0..PISTON {
            let rate = &stiff.rates[row];
            matrix[row] = rate.slope.map(|slope| -(gh * slope));
            matrix[row][row] = matrix[row][row] + T::one();
            let gained = match row {
                BRISTLE => y.bristle - base.bristle,
                node => at[node] - from[node],
            };
            rhs[row] = gh * rate.value - gained;
        }
        matrix[PISTON] = stiff.force.slope.map(|slope| -(push * slope));
        matrix[PISTON][PISTON] = matrix[PISTON][PISTON] + T::one();
        rhs[PISTON] = cylinder.velocity(boom, &free);
        let change = Factored::new(matrix).solve(rhs);

        let (mut force, mut gas) = (T::zero(), stiff.gas.value);
        for i in 0..UNKNOWNS {
            force = force + stiff.force.slope[i] * change[i];
            gas = gas + stiff.gas.slope[i] * change[i];
        }
        for i in 0..n {
            let omega = y.boom.angular_velocity[i] + free[i] + gh * force * answer[i];
            y.boom.angular_velocity[i] = omega;
            y.boom.angle[i] = base.boom.angle[i] + gh * omega;
        }
        y.circuit.nodes = Nodes::from_array(from_fn(|i| at[i] + change[i]));
        y.circuit.gas_volume = base.circuit.gas_volume + gh * gas;
        y.bristle = y.bristle + change[BRISTLE];
        change[..BRISTLE].iter().fold(T::zero(), |largest, q| largest.max(q.abs()))
    }

    /// The stiff right-hand side with its exact derivatives. Where the piston's velocity changes by
    /// one, its position changes by γh.
    #[inline(always)]
    fn stiff(
        &self,
        circuit: &CircuitState<T>,
        bristle: T,
        stroke: T,
        velocity: T,
        input: &Input<T>,
        gh: T,
    ) -> Stiff<T> {
        let q = circuit.nodes.to_array();
        let state = CircuitState {
            nodes: Nodes::from_array(from_fn(|i| D::variable(q[i], i))),
            gas_volume: D::constant(circuit.gas_volume),
        };
        let bristle = D::variable(bristle, BRISTLE);
        let velocity = D::variable(velocity, PISTON);
        let mut stroke = D::constant(stroke);
        stroke.slope[PISTON] = gh;
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
}

/// `yes` in the lanes where `mask` holds, `no` in the others.
#[inline(always)]
fn chosen<T: Real, const N: usize>(
    mask: T::Mask,
    yes: &CraneState<T, N>,
    no: &CraneState<T, N>,
    coordinates: usize,
) -> CraneState<T, N> {
    let mut state = *no;
    for i in 0..coordinates {
        let (a, b) = (&yes.boom, &no.boom);
        state.boom.angle[i] = T::select(mask, a.angle[i], b.angle[i]);
        state.boom.angular_velocity[i] =
            T::select(mask, a.angular_velocity[i], b.angular_velocity[i]);
    }
    let (q, r) = (yes.circuit.nodes.to_array(), no.circuit.nodes.to_array());
    state.circuit.nodes = Nodes::from_array(from_fn(|i| T::select(mask, q[i], r[i])));
    state.circuit.gas_volume = T::select(mask, yes.circuit.gas_volume, no.circuit.gas_volume);
    state.bristle = T::select(mask, yes.bristle, no.bristle);
    state
}

impl Implicit<f64> {
    /// Whether a step that returned `left` \[Pa\] has settled.
    pub fn has_settled(left: f64) -> bool {
        left <= UNSETTLED
    }

    /// The state after one step, taken in as many parts as it needs to settle; none where it does
    /// not in [`MOST_PARTS`] either.
    pub fn settled<const N: usize>(
        &self,
        crane: &Crane<f64, N>,
        state: &CraneState<f64, N>,
        input: &Input<f64>,
        step: f64,
    ) -> Option<CraneState<f64, N>> {
        let mut parts = 1;
        while parts <= MOST_PARTS {
            let mut trial = *state;
            let part = step / f64::from(parts);
            let all =
                (0..parts).all(|_| Self::has_settled(self.step(crane, &mut trial, input, part)));
            if all {
                return Some(trial);
            }
            parts *= 2;
        }
        None
    }
}

/// The state reached by going from `from` to `to` and on, `share` times the way.
#[inline(always)]
fn beyond<T: Real, const N: usize>(
    crane: &Crane<T, N>,
    from: &CraneState<T, N>,
    to: &CraneState<T, N>,
    share: T,
) -> CraneState<T, N> {
    let along = |a: T, b: T| a + share * (b - a);
    let mut state = *from;
    for i in 0..crane.boom.coordinates() {
        state.boom.angle[i] = along(from.boom.angle[i], to.boom.angle[i]);
        state.boom.angular_velocity[i] =
            along(from.boom.angular_velocity[i], to.boom.angular_velocity[i]);
    }
    let (q, r) = (from.circuit.nodes.to_array(), to.circuit.nodes.to_array());
    state.circuit.nodes = Nodes::from_array(from_fn(|i| along(q[i], r[i])));
    state.circuit.gas_volume = along(from.circuit.gas_volume, to.circuit.gas_volume);
    state.bristle = along(from.bristle, to.bristle);
    state
}
