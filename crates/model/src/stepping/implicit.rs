//! Diagonally implicit Runge-Kutta step: second order, no step limit from stiffness, fixed cost.
//!
//! The scheme is the two-stage diagonally implicit Runge-Kutta method of Alexander (1977,
//! doi:10.1137/0714068), L-stable and stiffly accurate (its last stage is the new state):
//!
//! ```text
//! Y1 = u + γh f(Y1)
//! Y2 = u + (1 − γ)h f(Y1) + γh f(Y2),   u ← Y2,   γ = 1 − 1/√2
//! ```
//!
//! Each stage takes at most three Newton iterations, and two where that is enough. One linear solution, as
//! in a Rosenbrock method, is not enough. The load-holding valves open over 0.2 bar beyond a dead band that
//! the pump crosses within half a millisecond. A step that jumps over that ramp linearises on its wrong
//! side and chatters; a second look from where it landed does not.
//!
//! Newton's matrix has the stiff terms exactly. They are the circuit's and the friction's derivatives by
//! pressures, bristle and piston (dual numbers), the joints' springs and dampers, and the cylinder force
//! between both. It leaves out gravity, centripetal terms, the turning of the boom within a step and the
//! gas volume's column, which are slow: that costs convergence a little, the solution nothing.
//!
//! Structure keeps the cost linear in the segments. The joints turn the mass matrix M into `S = M + γh b +
//! (γh)² k`, which is [factored](crate::boom::Articulated) joint by joint. The boom acts on the circuit
//! through the piston alone, the circuit on the boom through the cylinder force along `arm`. So the boom is
//! eliminated, `Δv = arm·S⁻¹ rhs + (arm·S⁻¹ arm) γh ΔF`. The remaining system has seven unknowns: five
//! pressures, bristle, piston velocity. A circuit with fewer nodes leaves some of them at rest.

use crate::boom::{Articulated, Boom};
use crate::circuit::{Circuit, Coordinates, SLOW, STIFF, SelfContained};
use crate::crane::{Crane, CraneState};
use crate::hydraulics::{Cylinder, EndStops, Friction, FrictionLaw};
use core::array::from_fn;
use hydroboom_math::{Dual, Factored, Real};

/// γ = 1 − 1/√2, which makes the scheme L-stable.
pub(super) const GAMMA: f64 = 1.0 - core::f64::consts::FRAC_1_SQRT_2;

/// Newton iterations of each stage, at most.
const ITERATIONS: usize = 3;
/// A stage has converged once an iteration changes no pressure by more than this \[Pa\]. The next one would
/// change it by a thousandth of that, far less than the scheme's own error.
const SETTLED: f64 = 1.0;

/// An implicit step whose last iteration still changed a pressure by more than this \[Pa\] has not settled:
/// 0.01 bar. It happens where steps are far too long for an event, such as an end stop struck at full
/// speed. Over a motion at 0.5 ms the largest change is 10 Pa, the usual one 1e-9 Pa.
const UNSETTLED: f64 = 1e3;
/// Largest number of parts that a step is divided into when Newton's method does not converge.
pub const MOST_PARTS: u32 = 256;

/// Unknowns of the reduced system, which are also the directions of differentiation: five nodes,
/// then these.
pub(super) const BRISTLE: usize = STIFF;
pub(super) const PISTON: usize = STIFF + 1;
pub(super) const UNKNOWNS: usize = STIFF + 2;

type D<T> = Dual<T, UNKNOWNS>;

/// The circuit in dual numbers.
type Over<T, C> = <C as Circuit<T>>::Over<D<T>>;

/// Implicit step of second order (Alexander 1977), prepared for one crane.
#[derive(Clone, Copy, Debug)]
pub struct Implicit<T: Real, C: Circuit<T> = SelfContained<T>> {
    circuit: Over<T, C>,
    cylinder: Cylinder<D<T>>,
    end_stops: EndStops<D<T>>,
    friction: Friction<D<T>>,
}

/// The boom of Newton's matrix, at the beginning of the step: within it the pose turns by less
/// than a thousandth, which costs convergence next to nothing.
pub(super) struct Eliminated<T, const N: usize> {
    pub(super) factors: Articulated<T, N>,
    /// Angular accelerations for a unit of the cylinder's force.
    pub(super) answer: [T; N],
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
pub(super) struct Stiff<T> {
    /// Rates of the nodes, then of the bristle.
    rates: [D<T>; PISTON],
    /// Rates of the circuit's other coordinates.
    pub(super) slow: [D<T>; SLOW],
    /// Cylinder force.
    pub(super) force: D<T>,
}

impl<T: Real> Stiff<T> {
    /// Newton's matrix of the reduced system, factored; `push` is the piston's velocity that a unit of cylinder force
    /// gives the boom within `gh`.
    #[inline(always)]
    pub(super) fn factored(&self, gh: T, push: T) -> Factored<T, UNKNOWNS> {
        let mut matrix = [[T::zero(); UNKNOWNS]; UNKNOWNS];
        for row in 0..PISTON {
            matrix[row] = self.rates[row].slope.map(|slope| -(gh * slope));
        }
        matrix[PISTON] = self.force.slope.map(|slope| -(push * slope));
        for (k, row) in matrix.iter_mut().enumerate() {
            row[k] = row[k] + T::one();
        }
        Factored::new(matrix)
    }
}

impl<T: Real, C: Circuit<T>> Implicit<T, C> {
    /// Prepares implicit steps of the given crane; to be used with that crane only.
    pub fn new<const N: usize>(crane: &Crane<T, N, C>) -> Self {
        let constant = &mut D::constant;
        Self {
            circuit: crane.circuit.over(constant),
            cylinder: crane.cylinder.map(&mut *constant),
            end_stops: crane.end_stops.map(&mut *constant),
            friction: crane.friction.map(constant),
        }
    }

    /// One step of `step` \[s\]. Returns the largest change of a pressure \[Pa\] in the last Newton iteration of
    /// either stage; see [`has_settled`].
    #[inline(always)]
    pub fn step<const N: usize>(
        &self,
        crane: &Crane<T, N, C>,
        state: &mut CraneState<T, N, C::State>,
        input: &C::Input,
        step: T,
    ) -> T {
        self.stages(crane, state, input, step).0
    }

    /// As [`step`](Self::step), and returns the state of the first stage too; the second stage is the new state.
    #[inline(always)]
    pub fn stages<const N: usize>(
        &self,
        crane: &Crane<T, N, C>,
        state: &mut CraneState<T, N, C::State>,
        input: &C::Input,
        step: T,
    ) -> (T, CraneState<T, N, C::State>) {
        let gh = T::lit(GAMMA) * step;
        let boom = Self::eliminated(crane, state, gh);
        self.solved(crane, state, input, gh, &boom)
    }

    /// Both stages, with the boom of Newton's matrix.
    #[inline(always)]
    pub(super) fn solved<const N: usize>(
        &self,
        crane: &Crane<T, N, C>,
        state: &mut CraneState<T, N, C::State>,
        input: &C::Input,
        gh: T,
        boom: &Eliminated<T, N>,
    ) -> (T, CraneState<T, N, C::State>) {
        let (mut first, mut base, mut largest) = (*state, *state, T::zero());
        // one loop, for written out the stages are twice the code, in every kind of number
        for stage in 0..2 {
            let (solved, left) = self.stage(crane, &base, &first, input, gh, boom);
            // in this order, for it is NaN if `left` is
            largest = left.max(largest);
            if stage == 0 {
                base = beyond(crane, state, &solved);
                first = solved;
            } else {
                *state = solved;
            }
        }
        (largest, first)
    }

    /// The boom of Newton's matrix at a state.
    #[inline(always)]
    pub(super) fn eliminated<const N: usize>(
        crane: &Crane<T, N, C>,
        state: &CraneState<T, N, C::State>,
        gh: T,
    ) -> Eliminated<T, N> {
        let mut impedance = [T::zero(); N];
        for (entry, joint) in impedance.iter_mut().zip(crane.boom.joints()) {
            *entry = gh * (joint.damping + gh * joint.stiffness);
        }
        if let Some(base) = crane.boom.base() {
            impedance[crane.boom.len()] = gh * (base.damping + gh * base.stiffness);
        }
        Eliminated::new(&crane.boom, &state.boom.angle, &impedance)
    }

    /// Solves `Y = base + γh f(Y)` from a guess. Also returns the largest pressure \[Pa\] that the
    /// last iteration changed.
    #[inline(always)]
    fn stage<const N: usize>(
        &self,
        crane: &Crane<T, N, C>,
        base: &CraneState<T, N, C::State>,
        guess: &CraneState<T, N, C::State>,
        input: &C::Input,
        gh: T,
        eliminated: &Eliminated<T, N>,
    ) -> (CraneState<T, N, C::State>, T) {
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
            y = chosen::<T, N, C>(goes_on, &next, &y, n);
            left = T::select(goes_on, change, left);
        }
        (y, left)
    }

    /// One Newton iteration; returns the largest change of a pressure \[Pa\]. Angles always follow the
    /// angular velocities, `φ = base + γh φ̇`.
    #[inline(always)]
    fn iterate<const N: usize>(
        &self,
        crane: &Crane<T, N, C>,
        base: &CraneState<T, N, C::State>,
        y: &mut CraneState<T, N, C::State>,
        input: &C::Input,
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

        let mut rhs = [T::zero(); UNKNOWNS];
        let (at, from) = (C::coordinates(&y.circuit), C::coordinates(&base.circuit));
        for row in 0..PISTON {
            let gained = match row {
                BRISTLE => y.bristle - base.bristle,
                node => at.stiff[node] - from.stiff[node],
            };
            rhs[row] = gh * stiff.rates[row].value - gained;
        }
        rhs[PISTON] = cylinder.velocity(boom, &free);
        let change = stiff.factored(gh, push).solve(rhs);

        let along = |rate: &D<T>| {
            let terms = rate.slope.iter().zip(change);
            terms.fold(T::zero(), |sum, (slope, change)| sum + *slope * change)
        };
        let force = along(&stiff.force);
        for i in 0..n {
            let omega = y.boom.angular_velocity[i] + free[i] + gh * force * answer[i];
            y.boom.angular_velocity[i] = omega;
            y.boom.angle[i] = base.boom.angle[i] + gh * omega;
        }
        y.circuit = C::from_coordinates(&Coordinates {
            stiff: from_fn(|i| at.stiff[i] + change[i]),
            slow: from_fn(|i| {
                let rate = &stiff.slow[i];
                from.slow[i] + gh * (rate.value + along(rate))
            }),
        });
        y.bristle = y.bristle + change[BRISTLE];
        change[..BRISTLE].iter().fold(T::zero(), |largest, q| largest.max(q.abs()))
    }

    /// The stiff right-hand side with its exact derivatives. Where the piston's velocity changes by
    /// one, its position changes by γh.
    #[inline(always)]
    pub(super) fn stiff(
        &self,
        circuit: &C::State,
        bristle: T,
        stroke: T,
        velocity: T,
        input: &C::Input,
        gh: T,
    ) -> Stiff<T> {
        let q = C::coordinates(circuit);
        let state = Over::<T, C>::from_coordinates(&Coordinates {
            stiff: from_fn(|i| D::variable(q.stiff[i], i)),
            slow: q.slow.map(D::constant),
        });
        let bristle = D::variable(bristle, BRISTLE);
        let velocity = D::variable(velocity, PISTON);
        let mut stroke = D::constant(stroke);
        stroke.slope[PISTON] = gh;
        let input = C::input_over(input, &mut D::constant);

        let rates = self.circuit.state_rates(&state, &input, &self.cylinder, stroke, velocity);
        let rates = Over::<T, C>::coordinates(&rates);
        let (a, b) = self.circuit.chambers(&state);
        let (friction, bristle_rate) = self.friction.evaluate(velocity, bristle);
        let stops = self.end_stops.force(stroke, velocity, self.cylinder.stroke_length);
        Stiff {
            rates: from_fn(|row| match row {
                BRISTLE => bristle_rate,
                node => rates.stiff[node],
            }),
            slow: rates.slow,
            force: self.cylinder.force(a, b) - friction + stops,
        }
    }
}

/// `yes` in the lanes where `mask` holds, `no` in the others.
#[inline(always)]
fn chosen<T: Real, const N: usize, C: Circuit<T>>(
    mask: T::Mask,
    yes: &CraneState<T, N, C::State>,
    no: &CraneState<T, N, C::State>,
    coordinates: usize,
) -> CraneState<T, N, C::State> {
    let mut state = *no;
    for i in 0..coordinates {
        let (a, b) = (&yes.boom, &no.boom);
        state.boom.angle[i] = T::select(mask, a.angle[i], b.angle[i]);
        state.boom.angular_velocity[i] =
            T::select(mask, a.angular_velocity[i], b.angular_velocity[i]);
    }
    let (q, r) = (C::coordinates(&yes.circuit), C::coordinates(&no.circuit));
    state.circuit = C::from_coordinates(&Coordinates {
        stiff: from_fn(|i| T::select(mask, q.stiff[i], r.stiff[i])),
        slow: from_fn(|i| T::select(mask, q.slow[i], r.slow[i])),
    });
    state.bristle = T::select(mask, yes.bristle, no.bristle);
    state
}

/// Whether Newton's method has converged in an implicit step that returned `left` \[Pa\]: at most 1000 Pa.
pub fn has_settled(left: f64) -> bool {
    left <= UNSETTLED
}

impl<C: Circuit<f64>> Implicit<f64, C> {
    /// State after one step of `step` \[s\], divided into as many parts as convergence needs; `None` if it does not
    /// converge in [`MOST_PARTS`] parts.
    pub fn settled<const N: usize>(
        &self,
        crane: &Crane<f64, N, C>,
        state: &CraneState<f64, N, C::State>,
        input: &C::Input,
        step: f64,
    ) -> Option<CraneState<f64, N, C::State>> {
        let mut parts = 1;
        while parts <= MOST_PARTS {
            let mut trial = *state;
            let part = step / f64::from(parts);
            let all = (0..parts).all(|_| has_settled(self.step(crane, &mut trial, input, part)));
            if all {
                return Some(trial);
            }
            parts *= 2;
        }
        None
    }
}

/// What the second stage begins from: u + (1 − γ)h f(Y1), where γh f(Y1) = Y1 − u, so on from `u` through `Y1`.
#[inline(always)]
pub(super) fn beyond<T: Real, const N: usize, C: Circuit<T>>(
    crane: &Crane<T, N, C>,
    from: &CraneState<T, N, C::State>,
    to: &CraneState<T, N, C::State>,
) -> CraneState<T, N, C::State> {
    let share = T::lit((1.0 - GAMMA) / GAMMA);
    let along = |a: T, b: T| a + share * (b - a);
    let mut state = *from;
    for i in 0..crane.boom.coordinates() {
        state.boom.angle[i] = along(from.boom.angle[i], to.boom.angle[i]);
        state.boom.angular_velocity[i] =
            along(from.boom.angular_velocity[i], to.boom.angular_velocity[i]);
    }
    let (q, r) = (C::coordinates(&from.circuit), C::coordinates(&to.circuit));
    state.circuit = C::from_coordinates(&Coordinates {
        stiff: from_fn(|i| along(q.stiff[i], r.stiff[i])),
        slow: from_fn(|i| along(q.slow[i], r.slow[i])),
    });
    state.bristle = along(from.bristle, to.bristle);
    state
}
