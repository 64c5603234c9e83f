//! Sensitivities of the implicit step by the implicit function theorem: plain numbers are solved for, derivatives
//! follow.
//!
//! What Newton's method solves, `r(y, θ) = 0`, has the slope `y' = −(∂r/∂y)⁻¹ ∂r/∂θ`. So one evaluation of
//! the residual over numbers with slopes, at the solution, and one plain matrix are enough, for any number
//! of directions. The matrix needs no slopes: its factor, the residual, vanishes there. It leaves out what
//! [`Implicit`] leaves out; the slopes of the step before make up for that, as an iterate does.

use super::implicit::{BRISTLE, Eliminated, GAMMA, Implicit, PISTON, UNKNOWNS, beyond};
use crate::boom::BoomState;
use crate::circuit::{Circuit, Coordinates};
use crate::crane::{Crane, CraneState};
use crate::hydraulics::FrictionLaw;
use core::array::from_fn;
use hydroboom_math::Dual;

/// Implicit steps of a crane whose parameters are dual numbers: values as with plain numbers, derivatives by the
/// implicit function theorem.
#[derive(Clone, Copy, Debug)]
pub struct Underlying<const N: usize, const P: usize, C: Circuit<Dual<f64, P>>> {
    crane: Crane<f64, N, C::Over<f64>>,
    scheme: Implicit<f64, C::Over<f64>>,
}

type State<const N: usize, const P: usize, C> =
    CraneState<Dual<f64, P>, N, <C as Circuit<Dual<f64, P>>>::State>;
type Plain<const N: usize, const P: usize, C> =
    CraneState<f64, N, <<C as Circuit<Dual<f64, P>>>::Over<f64> as Circuit<f64>>::State>;

impl<const N: usize, const P: usize, C: Circuit<Dual<f64, P>>> Underlying<N, P, C> {
    /// Prepares steps of the given crane; to be used with that crane only.
    pub fn new(crane: &Crane<Dual<f64, P>, N, C>) -> Self {
        let crane = crane.over(&mut |number: Dual<f64, P>| number.value);
        Self { crane, scheme: Implicit::new(&crane) }
    }

    /// One step of `step` \[s\] of the crane given to [`new`](Self::new). Returns the remaining change of a pressure
    /// \[Pa\], as [`Implicit::step`] does. The values are those of the plain step.
    pub fn step(
        &self,
        crane: &Crane<Dual<f64, P>, N, C>,
        state: &mut State<N, P, C>,
        input: &C::Input,
        step: f64,
    ) -> f64 {
        let gh = GAMMA * step;
        let mut second = values::<N, P, C>(state);
        let boom = Implicit::<f64, C::Over<f64>>::eliminated(&self.crane, &second, gh);
        let plain = C::input_over(input, &mut |number: Dual<f64, P>| number.value);
        let (left, first) = self.scheme.solved(&self.crane, &mut second, &plain, gh, &boom);
        let stage = |base: &State<N, P, C>, guess: &State<N, P, C>, solved: &Plain<N, P, C>| {
            let mut y = valued::<N, P, C>(guess, solved);
            for i in 0..crane.boom.coordinates() {
                let (angle, from) = (&mut y.boom.angle[i], base.boom.angle[i]);
                let omega = y.boom.angular_velocity[i];
                angle.slope = from_fn(|k| from.slope[k] + gh * omega.slope[k]);
            }
            self.follow(crane, base, &mut y, input, (solved, &plain), gh, &boom);
            y
        };
        let first = stage(state, state, &first);
        let base = beyond(crane, state, &first);
        *state = stage(&base, &first, &second);
        left
    }

    /// Slopes of a stage whose values are solved.
    #[inline(always)]
    #[expect(
        clippy::too_many_arguments,
        reason = "a stage, over plain numbers and over those with slopes"
    )]
    fn follow(
        &self,
        crane: &Crane<Dual<f64, P>, N, C>,
        base: &State<N, P, C>,
        y: &mut State<N, P, C>,
        input: &C::Input,
        (solved, plain): (&Plain<N, P, C>, &<C::Over<f64> as Circuit<f64>>::Input),
        gh: f64,
        eliminated: &Eliminated<f64, N>,
    ) {
        let boom = &crane.boom;
        let n = boom.coordinates();
        // the residual, over numbers with slopes
        let pose = boom.pose(&y.boom.angle);
        let cylinder = boom.cylinder_pose(&pose);
        let velocity = cylinder.velocity(boom, &y.boom.angular_velocity);
        let stroke = cylinder.stroke;
        let rates = crane.circuit.state_rates(&y.circuit, input, &crane.cylinder, stroke, velocity);
        let rates = C::coordinates(&rates);
        let (a, b) = crane.circuit.chambers(&y.circuit);
        let (friction, bristle_rate) = crane.friction.evaluate(velocity, y.bristle);
        let stops = crane.end_stops.force(stroke, velocity, crane.cylinder.stroke_length);
        let force = crane.cylinder.force(a, b) - friction + stops;
        let gained = from_fn(|i| y.boom.angular_velocity[i] - base.boom.angular_velocity[i]);
        let asked = boom.inertial_moments(&pose, &gained);
        let applied = crane.moments(&pose, &cylinder, &y.boom, force);

        // Newton's matrix, over plain ones
        let boom = &self.crane.boom;
        let pose = boom.pose(&solved.boom.angle);
        let cylinder = boom.cylinder_pose(&pose);
        let velocity = cylinder.velocity(boom, &solved.boom.angular_velocity);
        let (stroke, circuit) = (cylinder.stroke, &solved.circuit);
        let stiff = self.scheme.stiff(circuit, solved.bristle, stroke, velocity, plain, gh);
        let push = gh * cylinder.velocity(boom, &eliminated.answer);
        let matrix = stiff.factored(gh, push);
        let along = |slope: &[f64; UNKNOWNS], change: &[f64; UNKNOWNS]| -> f64 {
            slope.iter().zip(change).map(|(slope, change)| slope * change).sum()
        };

        let (mut at, from) = (C::coordinates(&y.circuit), C::coordinates(&base.circuit));
        for k in 0..P {
            let mut lacking = [0.0; N];
            for i in 0..n {
                lacking[i] = gh * applied[i].slope[k] - asked[i].slope[k];
            }
            let free = eliminated.factors.solve(boom, &lacking);
            let rhs: [f64; UNKNOWNS] = from_fn(|row| match row {
                PISTON => cylinder.velocity(boom, &free),
                BRISTLE => {
                    gh * bristle_rate.slope[k] - (y.bristle.slope[k] - base.bristle.slope[k])
                }
                node => {
                    let gained = at.stiff[node].slope[k] - from.stiff[node].slope[k];
                    gh * rates.stiff[node].slope[k] - gained
                }
            });
            let change = matrix.solve(rhs);
            let force = along(&stiff.force.slope, &change);
            for i in 0..n {
                let omega = &mut y.boom.angular_velocity[i].slope[k];
                *omega += free[i] + gh * force * eliminated.answer[i];
                y.boom.angle[i].slope[k] = base.boom.angle[i].slope[k] + gh * *omega;
            }
            for (node, pressure) in at.stiff.iter_mut().enumerate() {
                pressure.slope[k] += change[node];
            }
            for (i, slow) in at.slow.iter_mut().enumerate() {
                let rate = rates.slow[i].slope[k] + along(&stiff.slow[i].slope, &change);
                slow.slope[k] = from.slow[i].slope[k] + gh * rate;
            }
            y.bristle.slope[k] += change[BRISTLE];
        }
        y.circuit = C::from_coordinates(&at);
    }
}

/// A state without its slopes.
fn values<const N: usize, const P: usize, C: Circuit<Dual<f64, P>>>(
    state: &State<N, P, C>,
) -> Plain<N, P, C> {
    let value = |number: Dual<f64, P>| number.value;
    let q = C::coordinates(&state.circuit);
    let boom = &state.boom;
    CraneState {
        boom: BoomState {
            angle: boom.angle.map(value),
            angular_velocity: boom.angular_velocity.map(value),
        },
        bristle: state.bristle.value,
        circuit: C::Over::<f64>::from_coordinates(&Coordinates {
            stiff: q.stiff.map(value),
            slow: q.slow.map(value),
        }),
    }
}

/// A state with the slopes of another one.
fn valued<const N: usize, const P: usize, C: Circuit<Dual<f64, P>>>(
    slopes: &State<N, P, C>,
    plain: &Plain<N, P, C>,
) -> State<N, P, C> {
    let at = |number: Dual<f64, P>, value: f64| Dual { value, ..number };
    let (q, v) = (C::coordinates(&slopes.circuit), C::Over::<f64>::coordinates(&plain.circuit));
    let (boom, values) = (&slopes.boom, &plain.boom);
    CraneState {
        boom: BoomState {
            angle: from_fn(|i| at(boom.angle[i], values.angle[i])),
            angular_velocity: from_fn(|i| at(boom.angular_velocity[i], values.angular_velocity[i])),
        },
        bristle: at(slopes.bristle, plain.bristle),
        circuit: C::from_coordinates(&Coordinates {
            stiff: from_fn(|i| at(q.stiff[i], v.stiff[i])),
            slow: from_fn(|i| at(q.slow[i], v.slow[i])),
        }),
    }
}
