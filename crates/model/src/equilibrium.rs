//! Static equilibrium of the crane: initial states without transients.

use crate::boom::{Boom, BoomState, MAX_SEGMENTS};
use crate::circuit::{Circuit, CircuitState, Nodes, ValveCircuitState, ValveControlled};
use crate::crane::{Crane, CraneState};
use crate::hydraulics::FrictionLaw;
use core::fmt;
use hydroboom_math::{Dual, Real, solve_pivoted};

/// Initial conditions of an equilibrium of a crane with a self-contained circuit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start<T = f64> {
    /// Piston position from the lower stop \[m\].
    pub stroke: T,
    /// Gauge pressure on the rod side \[Pa\].
    pub rod_side_pressure: T,
    /// Gauge pressure of the accumulator \[Pa\].
    pub accumulator_pressure: T,
    /// Gas volume of the accumulator \[m³\].
    pub gas_volume: T,
    /// Pre-load of the pump sides \[1\], 0 to 1. At 0 they have the accumulator's pressure, as after a long rest with
    /// the load held. At 1 they have the cylinder's, ready to energise the 3/2 valve.
    pub preload: T,
}

/// Initial conditions of an equilibrium of a crane with a valve-controlled circuit, its valve closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValveStart<T = f64> {
    /// Piston position from the lower stop \[m\].
    pub stroke: T,
    /// Gauge pressure on the piston side \[Pa\]. Friction carries the difference to the load's pressure, up to its
    /// static force. `None`: the piston side carries the whole load.
    pub pressure_a: Option<T>,
    /// Gauge pressure on the rod side \[Pa\].
    pub pressure_b: T,
}

/// Reason why a crane has no equilibrium at a piston position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EquilibriumError {
    /// The cylinder cannot have this length: the triangle of bearing, foot and mount does not close.
    OutOfReach {
        /// Requested piston position \[m\].
        stroke: f64,
    },
    /// The static equations have no solution near a straight boom.
    NoBalance {
        /// Requested piston position \[m\].
        stroke: f64,
    },
    /// The load pulls the rod out: holding it would need a pressure below vapour pressure on the piston side.
    LoadPulls {
        /// Gauge pressure that the piston side would need \[Pa\].
        pressure_a: f64,
    },
}

impl fmt::Display for EquilibriumError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfReach { stroke } => write!(
                f,
                "the cylinder cannot reach from base to boom at a stroke of {:.1} mm",
                stroke * 1e3
            ),
            Self::NoBalance { stroke } => write!(
                f,
                "boom and payload find no static balance at a stroke of {:.1} mm",
                stroke * 1e3
            ),
            Self::LoadPulls { pressure_a } => write!(
                f,
                "holding the load would need {:.1} bar on the piston side, below vapour pressure",
                pressure_a * 1e-5
            ),
        }
    }
}

impl core::error::Error for EquilibriumError {}

/// One number for each angle, the base frame's among them, and the cylinder force.
const UNKNOWNS: usize = MAX_SEGMENTS + 2;

impl<const N: usize> Crane<f64, N> {
    /// Equilibrium that carries the load: boom bent under its weight, piston side at the pressure that holds it
    /// without friction.
    ///
    /// With the load held, or the pump standing still and the valve open, this state rests but for leakage.
    ///
    /// # Errors
    ///
    /// [`EquilibriumError::OutOfReach`] if the cylinder cannot have this length, or the piston position is NaN.
    /// [`EquilibriumError::NoBalance`] if no angles balance the weight. [`EquilibriumError::LoadPulls`] if the piston
    /// side would be below vapour pressure.
    pub fn at_rest(&self, start: &Start) -> Result<CraneState<f64, N>, EquilibriumError> {
        let (angle, force) = self.static_balance(start.stroke)?;
        let state = self.resting(start, angle, force);
        let pressure_a = state.circuit.nodes.a;
        if pressure_a < self.circuit.oil.vapour_pressure {
            return Err(EquilibriumError::LoadPulls { pressure_a });
        }
        Ok(state)
    }
}

impl<const N: usize, C: Circuit<f64>> Crane<f64, N, C> {
    /// Angle \[rad\] of the first segment if the boom were straight and rigid, with the piston at `stroke` \[m\].
    ///
    /// # Errors
    ///
    /// [`EquilibriumError::OutOfReach`] if the cylinder cannot have this length, or the piston position is NaN.
    pub fn rigid_angle(&self, stroke: f64) -> Result<f64, EquilibriumError> {
        let mount = &self.boom.mount;
        let inner: f64 =
            self.boom.segments()[..mount.segment].iter().map(|segment| segment.length).sum();
        let [cx, cy] = [inner + mount.on_segment[0], mount.on_segment[1]];
        let [bx, by] = mount.on_base;
        // law of cosines in the triangle of bearing, foot and mount
        let (b, c) = (libm::hypot(bx, by), libm::hypot(cx, cy));
        let length = mount.shortest + stroke;
        let cosine = (b * b + c * c - length * length) / (2.0 * b * c);
        if cosine.is_nan() || cosine.abs() >= 1.0 {
            return Err(EquilibriumError::OutOfReach { stroke });
        }
        Ok(libm::acos(cosine) + libm::atan2(by, bx) - libm::atan2(cy, cx))
    }

    /// Angles and cylinder force of the boom at rest: moments balance on every segment, and the
    /// piston stands at `stroke`. Newton's method with exact derivatives.
    fn static_balance(&self, stroke: f64) -> Result<Balance<N>, EquilibriumError> {
        let n = self.boom.coordinates();
        let mut angle = [self.rigid_angle(stroke)?; N];
        for (i, joint) in self.boom.joints().iter().enumerate() {
            angle[i + 1] = angle[i] + joint.rest;
        }
        if let Some(base) = self.boom.base() {
            // the cylinder pushes: the slack is taken up on the side to which its arm points
            let base_angle = self.boom.len();
            angle[base_angle] = 0.0;
            let arm = self.boom.cylinder_pose(&self.boom.pose(&angle)).arm[base_angle];
            angle[base_angle] = base.slack.copysign(arm);
        }
        let mut force = 0.0;
        // moments are compared with those of the weight, lengths with the cylinder's
        let weight: f64 = self.boom.segments().iter().map(|s| s.mass * self.boom.gravity).sum();
        let length: f64 = self.boom.segments().iter().map(|s| s.length).sum();
        let moment_scale = (weight * length).max(1e-6);
        for _ in 0..50 {
            let (mut matrix, mut step) = self.balance_matrix(&angle, force, stroke);
            let error = step[..n].iter().fold(0.0_f64, |worst, r| worst.max(r.abs()));
            let done = error < 1e-12 * moment_scale && step[n].abs() < 1e-14;
            solve_pivoted(&mut matrix, &mut step, n + 1)
                .ok_or(EquilibriumError::NoBalance { stroke })?;
            for i in 0..n {
                angle[i] += Real::clamp(step[i], -LARGEST_TURN, LARGEST_TURN);
            }
            force += step[n];
            if done {
                return Ok((angle, force));
            }
        }
        // moments of stiff joints cannot be balanced below their rounding error
        let r = imbalance(&self.boom, &angle, force, stroke);
        let error = r[..n].iter().fold(0.0_f64, |worst, r| worst.max(r.abs()));
        if error < 1e-7 * moment_scale && r[n].abs() < 1e-12 {
            Ok((angle, force))
        } else {
            Err(EquilibriumError::NoBalance { stroke })
        }
    }

    /// What the imbalance changes by with angles and force, and what takes it away.
    fn balance_matrix(
        &self,
        angle: &[f64; N],
        force: f64,
        stroke: f64,
    ) -> (Matrix, [f64; UNKNOWNS]) {
        type D = Dual<f64, 1>;
        let n = self.boom.coordinates();
        let boom = self.boom.map(&mut D::constant);
        let constants = angle.map(D::constant);
        let mut matrix = [[0.0; UNKNOWNS]; UNKNOWNS];
        let mut step = [0.0; UNKNOWNS];
        for column in 0..=n {
            let mut varied = constants;
            let mut varied_force = D::constant(force);
            match varied.get_mut(column).filter(|_| column < n) {
                Some(angle) => angle.slope[0] = 1.0,
                None => varied_force.slope[0] = 1.0,
            }
            let r = imbalance(&boom, &varied, varied_force, D::constant(stroke));
            for row in 0..=n {
                matrix[row][column] = r[row].slope[0];
                step[row] = -r[row].value;
            }
        }
        (matrix, step)
    }
}

type Matrix = [[f64; UNKNOWNS]; UNKNOWNS];

/// Angles \[rad\] and cylinder force \[N\] of a boom at rest.
type Balance<const N: usize, T = f64> = ([T; N], T);

/// What is left of the moments on every segment, and of the piston's position, with the boom at angles and
/// the cylinder under a force.
fn imbalance<T: Real, const N: usize>(
    boom: &Boom<T, N>,
    angle: &[T; N],
    force: T,
    stroke: T,
) -> [T; UNKNOWNS] {
    let n = boom.coordinates();
    let pose = boom.pose(angle);
    let cylinder = boom.cylinder_pose(&pose);
    let state = BoomState { angle: *angle, angular_velocity: [T::zero(); N] };
    let mut r = [T::zero(); UNKNOWNS];
    let moments = boom.applied_moments(&pose, &state);
    for i in 0..n {
        r[i] = moments[i] + cylinder.arm[i] * force;
    }
    r[n] = cylinder.stroke - stroke;
    r
}

impl<T: Real, const N: usize> Crane<T, N> {
    /// The state in which the boom stands at angles that balance a cylinder force.
    fn resting(&self, start: &Start<T>, angle: [T; N], force: T) -> CraneState<T, N> {
        let zero = T::zero();
        let pressure_b = start.rod_side_pressure;
        let end_stops = self.end_stops.force(start.stroke, zero, self.cylinder.stroke_length);
        let pressure_a = (force - end_stops + self.cylinder.rod_side_area * pressure_b)
            / self.cylinder.piston_area;
        let loaded = |chamber: T| {
            let rest = start.accumulator_pressure;
            let partly = rest + start.preload * (chamber - rest);
            T::select(start.preload.lt(T::one()), partly, chamber)
        };
        CraneState {
            boom: BoomState { angle, angular_velocity: [zero; N] },
            bristle: zero,
            circuit: CircuitState {
                nodes: Nodes {
                    pump_a: loaded(pressure_a),
                    a: pressure_a,
                    b: pressure_b,
                    pump_b: loaded(pressure_b),
                    accumulator: start.accumulator_pressure,
                },
                gas_volume: start.gas_volume,
            },
        }
    }
}

/// The largest turn of a segment in one step of Newton's method \[rad\]: a soft boom may overshoot.
const LARGEST_TURN: f64 = 0.5;

impl<T: Real, const N: usize> Crane<T, N> {
    /// One Newton step from a state near equilibrium to the equilibrium at `start`, in any number type.
    ///
    /// From an equilibrium of a crane of the same structure it converges to [`at_rest`](Crane::at_rest) in a few
    /// calls. It uses only the angles and the piston side's pressure of the state `near`. Without an equilibrium it
    /// does not converge, or gives NaN.
    pub fn balanced(&self, start: &Start<T>, near: &CraneState<T, N>) -> CraneState<T, N> {
        let zero = T::zero();
        let end_stops = self.end_stops.force(start.stroke, zero, self.cylinder.stroke_length);
        let pressure_a = near.circuit.nodes.a;
        let force = self.cylinder.force(pressure_a, start.rod_side_pressure) + end_stops;
        let (angle, force) = self.balance_step(&near.boom.angle, force, start.stroke);
        self.resting(start, angle, force)
    }

    /// Angles and cylinder force after one step towards the balance, with exact derivatives.
    ///
    /// The order of elimination is fixed. From the tip inwards each segment's moment gives its own angle
    /// through its joint. Then the piston's position gives the first angle, and the moment about the
    /// bearing the force. These pivots are the joints' stiffness and the cylinder's arm, which vanish in no
    /// boom that can stand.
    fn balance_step(&self, angle: &[T; N], force: T, stroke: T) -> Balance<N, T> {
        let n = self.boom.coordinates();
        let over = Dual::<T, 1>::constant;
        let boom = self.boom.map(&mut { over });
        let constants = angle.map(over);
        let mut matrix = [[T::zero(); UNKNOWNS]; UNKNOWNS];
        let mut step = [T::zero(); UNKNOWNS];
        for column in 0..n {
            let mut varied = constants;
            varied[column].slope[0] = T::one();
            let r = imbalance(&boom, &varied, over(force), over(stroke));
            for row in 0..=n {
                matrix[row][column] = r[row].slope[0];
                step[row] = -r[row].value;
            }
        }
        let arm = self.boom.cylinder_pose(&self.boom.pose(angle)).arm;
        for row in 0..n {
            matrix[row][n] = arm[row];
        }
        for pivot in (1..n).rev() {
            let inverse = T::one() / matrix[pivot][pivot];
            for row in (0..pivot).chain([n]) {
                let factor = matrix[row][pivot] * inverse;
                for column in (0..pivot).chain([n]) {
                    matrix[row][column] = matrix[row][column] - factor * matrix[pivot][column];
                }
                step[row] = step[row] - factor * step[pivot];
            }
        }
        // from the piston's position: first angle = (step - matrix[n][n] * force) / matrix[n][0]
        let factor = matrix[0][0] / matrix[n][0];
        let force_step = (step[0] - factor * step[n]) / (matrix[0][n] - factor * matrix[n][n]);
        let mut turn = [T::zero(); N];
        turn[0] = (step[n] - matrix[n][n] * force_step) / matrix[n][0];
        for row in 1..n {
            let mut left = step[row] - matrix[row][n] * force_step;
            for column in 0..row {
                left = left - matrix[row][column] * turn[column];
            }
            turn[row] = left / matrix[row][row];
        }
        let mut turned = *angle;
        for i in 0..n {
            let most = T::lit(LARGEST_TURN);
            turned[i] = turned[i] + turn[i].clamp(-most, most);
        }
        (turned, force + force_step)
    }
}

impl<const P: usize, const N: usize, C: Circuit<Dual<f64, P>>> Crane<Dual<f64, P>, N, C> {
    /// The balance with its exact slopes along the crane's directions and the stroke's.
    ///
    /// At R(φ, F; θ) = 0 the slopes follow from R_φF d(φ, F) = −R_θ dθ: one Newton step in dual numbers, taken
    /// from the balance.
    fn balance_along(
        &self,
        stroke: Dual<f64, P>,
    ) -> Result<Balance<N, Dual<f64, P>>, EquilibriumError> {
        let n = self.boom.coordinates();
        let plain: Crane<f64, N, C::Over<f64>> = self.over(&mut |d: Dual<f64, P>| d.value);
        let (angle, force) = plain.static_balance(stroke.value)?;
        let (matrix, _) = plain.balance_matrix(&angle, force, stroke.value);
        let constant = Dual::<f64, P>::constant;
        let left = imbalance(&self.boom, &angle.map(constant), constant(force), stroke);
        let mut angle = angle.map(constant);
        let mut force = constant(force);
        for direction in 0..P {
            let mut matrix = matrix;
            let mut step: [f64; UNKNOWNS] = core::array::from_fn(|row| -left[row].slope[direction]);
            solve_pivoted(&mut matrix, &mut step, n + 1)
                .ok_or(EquilibriumError::NoBalance { stroke: stroke.value })?;
            for i in 0..n {
                angle[i].slope[direction] = step[i];
            }
            force.slope[direction] = step[n];
        }
        Ok((angle, force))
    }
}

impl<const P: usize, const N: usize> Crane<Dual<f64, P>, N> {
    /// Equilibrium as [`at_rest`](Crane::at_rest), with exact derivatives by the `P` directions of the crane's
    /// parameters and of the start.
    ///
    /// # Errors
    ///
    /// As [`at_rest`](Crane::at_rest).
    pub fn at_rest_along(
        &self,
        start: &Start<Dual<f64, P>>,
    ) -> Result<CraneState<Dual<f64, P>, N>, EquilibriumError> {
        let (angle, force) = self.balance_along(start.stroke)?;
        let state = self.resting(start, angle, force);
        let pressure_a = state.circuit.nodes.a.value;
        match pressure_a < self.circuit.oil.vapour_pressure.value {
            true => Err(EquilibriumError::LoadPulls { pressure_a }),
            false => Ok(state),
        }
    }
}

/// State of a crane with a valve-controlled circuit.
pub type ValveCraneState<T, const N: usize> = CraneState<T, N, ValveCircuitState<T>>;

impl<T: Real, const N: usize> Crane<T, N, ValveControlled<T>> {
    /// The state in which the boom stands at angles that balance a cylinder force.
    fn resting_at_valve(
        &self,
        start: &ValveStart<T>,
        angle: [T; N],
        force: T,
    ) -> ValveCraneState<T, N> {
        let zero = T::zero();
        let end_stops = self.end_stops.force(start.stroke, zero, self.cylinder.stroke_length);
        let needed = force - end_stops + self.cylinder.rod_side_area * start.pressure_b;
        let surplus = match start.pressure_a {
            Some(pressure) => self.cylinder.piston_area * pressure - needed,
            None => zero,
        };
        // friction opposes what there is too much of
        let (held, bristle) = self.friction.at_rest(surplus);
        CraneState {
            boom: BoomState { angle, angular_velocity: [zero; N] },
            bristle,
            circuit: ValveCircuitState {
                a: (needed + held) / self.cylinder.piston_area,
                b: start.pressure_b,
                spool: zero,
                spool_velocity: zero,
            },
        }
    }
}

impl<const N: usize> Crane<f64, N, ValveControlled<f64>> {
    /// Equilibrium with the valve closed.
    ///
    /// # Errors
    ///
    /// [`EquilibriumError::OutOfReach`] if the cylinder cannot have this length, or the piston position is NaN.
    /// [`EquilibriumError::NoBalance`] if no angles balance the weight. [`EquilibriumError::LoadPulls`] if the piston
    /// side would be below vapour pressure.
    pub fn at_rest(&self, start: &ValveStart) -> Result<ValveCraneState<f64, N>, EquilibriumError> {
        let (angle, force) = self.static_balance(start.stroke)?;
        let state = self.resting_at_valve(start, angle, force);
        match state.circuit.a < self.circuit.oil.vapour_pressure {
            true => Err(EquilibriumError::LoadPulls { pressure_a: state.circuit.a }),
            false => Ok(state),
        }
    }
}

impl<const P: usize, const N: usize> Crane<Dual<f64, P>, N, ValveControlled<Dual<f64, P>>> {
    /// Equilibrium with the valve closed, with exact derivatives by the `P` directions of the crane's parameters and
    /// of the start.
    ///
    /// # Errors
    ///
    /// [`EquilibriumError`] if geometry or load permit no such state.
    pub fn at_rest_along(
        &self,
        start: &ValveStart<Dual<f64, P>>,
    ) -> Result<ValveCraneState<Dual<f64, P>, N>, EquilibriumError> {
        let (angle, force) = self.balance_along(start.stroke)?;
        let state = self.resting_at_valve(start, angle, force);
        let pressure_a = state.circuit.a.value;
        match pressure_a < self.circuit.oil.vapour_pressure.value {
            true => Err(EquilibriumError::LoadPulls { pressure_a }),
            false => Ok(state),
        }
    }
}
