//! A state at rest to start from, so that nothing rings at t = 0.

use crate::boom::{BoomState, MAX_SEGMENTS};
use crate::circuit::{CircuitState, Nodes};
use crate::crane::{Crane, CraneState};
use core::fmt;
use hydroboom_math::{Dual, solve_pivoted};

/// Where to start from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Piston position \[m\].
    pub stroke: f64,
    /// Gauge pressure trapped or resting on the rod side \[Pa\].
    pub rod_side_pressure: f64,
    /// Gauge pressure of the accumulator \[Pa\].
    pub accumulator_pressure: f64,
    /// Gas volume of the accumulator \[m³\].
    pub gas_volume: f64,
    /// How far the pump sides have been pre-loaded, 0 to 1: from the accumulator's pressure, as
    /// after a long rest with the load held, to the cylinder's, ready to energise the 3/2 valve.
    pub preload: f64,
}

/// Why there is no state of rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EquilibriumError {
    /// The cylinder cannot have this length: its mounts are too far apart or too near.
    OutOfReach {
        /// Piston position asked for \[m\].
        stroke: f64,
    },
    /// The static equations have no solution near a straight boom.
    NoBalance {
        /// Piston position asked for \[m\].
        stroke: f64,
    },
    /// The load would have to be held by suction.
    LoadPulls {
        /// Pressure the piston side would need \[Pa\].
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
    /// The state at rest that carries the load: boom bent under its weight, piston side at the
    /// pressure that holds it without help of friction.
    ///
    /// With the load held, or the pump standing still and the valve open, this state rests but for
    /// leakage.
    ///
    /// # Errors
    ///
    /// [`EquilibriumError`] where the geometry or the load admit no such state.
    pub fn at_rest(&self, start: &Start) -> Result<CraneState<f64, N>, EquilibriumError> {
        let (angle, force) = self.static_balance(start.stroke)?;
        let vapour = self.circuit.oil.vapour_pressure;
        let pressure_b = start.rod_side_pressure;
        let end_stops = self.end_stops.force(start.stroke, 0.0, self.cylinder.stroke_length);
        let pressure_a = (force - end_stops + self.cylinder.rod_side_area * pressure_b)
            / self.cylinder.piston_area;
        if pressure_a < vapour {
            return Err(EquilibriumError::LoadPulls { pressure_a });
        }
        let loaded = |chamber: f64| match start.preload < 1.0 {
            true => {
                let rest = start.accumulator_pressure;
                rest + start.preload * (chamber - rest)
            }
            false => chamber,
        };
        let (pump_a, pump_b) = (loaded(pressure_a), loaded(pressure_b));
        Ok(CraneState {
            boom: BoomState { angle, angular_velocity: [0.0; N] },
            bristle: 0.0,
            circuit: CircuitState {
                nodes: Nodes {
                    pump_a,
                    a: pressure_a,
                    b: pressure_b,
                    pump_b,
                    accumulator: start.accumulator_pressure,
                },
                gas_volume: start.gas_volume,
            },
        })
    }

    /// Angle \[rad\] of the boom, were it straight and rigid, with the piston at `stroke` \[m\].
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
    fn static_balance(&self, stroke: f64) -> Result<([f64; N], f64), EquilibriumError> {
        type D = Dual<f64, 1>;
        let n = self.boom.coordinates();
        let boom = self.boom.map(&mut D::constant);
        let residual = |angle: &[D; N], force: D| {
            let pose = boom.pose(angle);
            let cylinder = boom.cylinder_pose(&pose);
            let state = BoomState { angle: *angle, angular_velocity: [D::constant(0.0); N] };
            let mut r = [D::constant(0.0); UNKNOWNS];
            let moments = boom.applied_moments(&pose, &state);
            for i in 0..n {
                r[i] = moments[i] + cylinder.arm[i] * force;
            }
            r[n] = cylinder.stroke - D::constant(stroke);
            r
        };

        let mut angle = [self.rigid_angle(stroke)?; N];
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
                let r = residual(&varied, varied_force);
                for row in 0..=n {
                    matrix[row][column] = r[row].slope[0];
                    step[row] = -r[row].value;
                }
            }
            let error = step[..n].iter().fold(0.0_f64, |worst, r| worst.max(r.abs()));
            let done = error < 1e-12 * moment_scale && step[n].abs() < 1e-14;
            solve_pivoted(&mut matrix, &mut step, n + 1)
                .ok_or(EquilibriumError::NoBalance { stroke })?;
            for i in 0..n {
                // a soft boom may overshoot: no more than a tenth of a turn at a time
                angle[i] += step[i].clamp(-0.5, 0.5);
            }
            force += step[n];
            if done {
                return Ok((angle, force));
            }
        }
        // moments of stiff joints cannot be balanced below their rounding error
        let r = residual(&angle.map(D::constant), D::constant(force));
        let error = r[..n].iter().fold(0.0_f64, |worst, r| worst.max(r.value.abs()));
        if error < 1e-7 * moment_scale && r[n].value.abs() < 1e-12 {
            Ok((angle, force))
        } else {
            Err(EquilibriumError::NoBalance { stroke })
        }
    }
}
