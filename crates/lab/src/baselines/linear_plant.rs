//! Linear plant: mass on the oil spring, linearised at mid-stroke and sampled, with two disturbance states.

use crate::LabError;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_description::Description;
use hydroboom_design::operating_points::{OperatingPoint, OperatingPoints};
use nalgebra::{SMatrix, SVector, matrix};

/// Number of states that the motor moves: position, velocity, load pressure.
pub(super) const MOVES: usize = 3;
/// Number of all states. The two others are constant disturbances: an acceleration (friction, another load)
/// and a rate of the load pressure (leakage, another pump flow).
pub(super) const ALL: usize = 5;

/// `z' = A z + B_n (n − n_0) + B_p p_0`, sampled.
pub(super) struct LinearPlant {
    points: OperatingPoints,
    at: OperatingPoint,
    /// Largest motor speed \[rev/s\].
    speed_limit: f64,
    /// State matrix A of the sampled plant, 5 × 5: three states of motion and two disturbances, in SI units.
    pub a: SMatrix<f64, ALL, ALL>,
    /// Input matrix of the sampled plant, 5 × 2: motor speed \[rev/s\], and load pressure at rest \[Pa\].
    pub b: SMatrix<f64, ALL, 2>,
}

impl LinearPlant {
    /// Plant of a description at mid-stroke, sampled with `period` \[s\].
    pub(super) fn new(model: &Description, period: f64) -> Result<Self, LabError> {
        let points = OperatingPoints::new(model)?;
        let at = points.at(0.5 * model.numbers.stroke);
        let spring = at.spring(points.stiffness(at.equilibrium.load_pressure));
        let (a_v, a_p) = (spring.acceleration_by_velocity, spring.acceleration_by_pressure);
        let (c_v, b) = (spring.pressure_by_velocity, spring.pressure_by_speed);
        // the two inputs are added as constant states, so that one matrix exponential discretises the
        // system
        #[rustfmt::skip]
        let whole: SMatrix<f64, 7, 7> = matrix![
            0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0;
            0.0, a_v, a_p, 1.0, 0.0, 0.0, -a_p;
            0.0, c_v, 0.0, 0.0, 1.0, b,   0.0;
            0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0;
            0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0;
            0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0;
            0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0;
        ];
        let sampled = (whole * period).exp();
        Ok(Self {
            points,
            at,
            speed_limit: model.numbers.motor_speed,
            a: sampled.fixed_view::<ALL, ALL>(0, 0).into_owned(),
            b: sampled.fixed_view::<ALL, 2>(0, ALL).into_owned(),
        })
    }

    /// State and input matrix of position, velocity and load pressure.
    pub(super) fn moving(&self) -> (SMatrix<f64, MOVES, MOVES>, SVector<f64, MOVES>) {
        let a = self.a.fixed_view::<MOVES, MOVES>(0, 0).into_owned();
        (a, self.b.fixed_view::<MOVES, 1>(0, 0).into_owned())
    }

    /// Load pressure at rest at a position \[m\], and motor speed that holds it there \[rev/s\].
    pub(super) fn rest(&self, stroke: f64) -> (f64, f64) {
        let rest = self.points.at(stroke).equilibrium;
        (rest.load_pressure, rest.holding_speed)
    }

    /// State and motor speed that a reference with an acceleration \[m/s²\] needs under the given
    /// disturbances.
    pub(super) fn wanted(
        &self,
        reference: &SetPoint<f64>,
        acceleration: f64,
        [push, rate]: [f64; 2],
    ) -> (SVector<f64, MOVES>, f64) {
        let spring = self.at.spring(self.points.stiffness(self.at.equilibrium.load_pressure));
        let rest = self.points.at(reference.position).equilibrium;
        let v = reference.velocity;
        let moving = acceleration - spring.acceleration_by_velocity * v - push;
        let pressure = rest.load_pressure + moving / spring.acceleration_by_pressure;
        let by_travel = (rest.load_pressure_slope - spring.pressure_by_velocity) * v;
        let speed = rest.holding_speed + (by_travel - rate) / spring.pressure_by_speed;
        ([reference.position, v, pressure].into(), speed)
    }

    /// Largest motor speed \[rev/s\].
    pub(super) fn speed_limit(&self) -> f64 {
        self.speed_limit
    }
}
