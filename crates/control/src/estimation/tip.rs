//! Position of the boom's tip from the estimates, with its standard deviation.
//!
//! The tip is that of a rigid boom at the piston position, lowered by what gives way under the load: the boom bends,
//! and the base turns.
//!
//! ```text
//! tip = L e_r(φ) − (w + L C_b M_A) e_t(φ),   φ = φ(x + x_0),   w = (c/E I) ∫ M(s) m(s) ds
//! ```
//!
//! M is the bending moment by payload and boom weight and by their inertia, m that by a unit load at the
//! tip (virtual work). M_A is the moment about the bearing A. Three numbers are the crane's own: c, the
//! boom's bending over that of a uniform beam of the crane file; C_b, the base's compliance; x_0, the
//! stroke's zero. They are stated with a spread, or fitted to a survey.
//!
//! The payload is a mean over time with the inverse of its variance as weight, from the last load change
//! on. Friction that is attributed to payload changes its sign with the direction of motion, and averages
//! out. The difference between this mean and the filter's payload counts in the variance.
//!
//! ```text
//! W ← (1 − T/τ) W + T/P_m,   m̄ ← m̄ + T/(P_m W) (m − m̄)
//! ```
//!
//! Pressures enter by the payload and the acceleration of the Kalman filter only, never as a force of the cylinder:
//! its friction bends nothing. Neither pressures nor piston position observe what gives way; the standard deviation
//! holds as far as the model and the spread of its numbers do.
//!
//! Source: S. Timoshenko, *Strength of Materials*, part 1, 1955 (bending by virtual work).

use super::error_covariance::{Covariance, ERRORS, as_variables, output_deviation};
use super::extended_kalman_filter::{EstimatorState, ExtendedKalmanFilter};
use super::reduced_model::state_index::PAYLOAD;
use super::reduced_model::{MachineState, ReducedModel};
use hydroboom_math::{Dual, Real, record};

record! {
    /// Geometry, mass and stiffness of boom, payload and cylinder, for the position of the tip.
    pub struct TipModel<T> {
        /// Cylinder mount C along the straight boom
        #[unit = "m"]
        pub mount_x: T,
        /// Cylinder mount C across the straight boom, positive upwards
        #[unit = "m"]
        pub mount_y: T,
        /// Cylinder foot B on the base, to the right of the bearing
        #[unit = "m"]
        pub base_x: T,
        /// Cylinder foot B on the base, above the bearing
        #[unit = "m"]
        pub base_y: T,
        /// Distance from B to C with the piston at its lower stop
        #[unit = "m"]
        pub shortest: T,
        /// Length from the bearing to the tip, L
        #[unit = "m"]
        pub length: T,
        /// Mass of the boom without payload
        #[unit = "kg"]
        pub mass: T,
        /// Flexural rigidity, E I
        #[unit = "N m²"]
        pub flexural_rigidity: T,
        /// Payload's centre of mass along the boom, from the bearing
        #[unit = "m"]
        pub payload_x: T,
        /// Payload's centre of mass across the boom, positive upwards
        #[unit = "m"]
        pub payload_y: T,
        /// Acceleration of gravity
        #[unit = "m/s²"]
        pub gravity: T,
    }
}

record! {
    /// Parameters of the tip model that are calibrated for the single crane.
    pub struct TipParameters<T> {
        /// Bending compliance of the boom relative to a uniform beam of the crane file's E I, c
        #[unit = "1"]
        pub bending: T,
        /// Compliance of the base against turning about the boom's bearing, C_b
        #[unit = "rad/(N m)"]
        pub base: T,
        /// Offset added to the measured piston position, x_0
        #[unit = "m"]
        pub stroke_offset: T,
    }
}

record! {
    /// Piston position, payload and acceleration, on which the position of the tip depends.
    pub struct TipLoad<T> {
        /// Piston position
        #[unit = "m"]
        pub piston: T,
        /// Payload
        #[unit = "kg"]
        pub payload: T,
        /// Acceleration of the load in the piston's travel
        #[unit = "m/s²"]
        pub acceleration: T,
    }
}

record! {
    /// Estimated position of the tip, relative to the boom's bearing.
    pub struct TipEstimate<T> {
        /// Horizontal position
        #[unit = "m"]
        pub x: T,
        /// Height
        #[unit = "m"]
        pub y: T,
        /// Standard deviation of the horizontal position
        #[unit = "m"]
        pub deviation_x: T,
        /// Standard deviation of the height
        #[unit = "m"]
        pub deviation_y: T,
    }
}

/// Number of [`TipParameters`].
pub const PARAMETERS: usize = TipParameters::NAMES.len();
/// These, and the payload.
const VARIED: usize = PARAMETERS + 1;

/// Estimator of the tip's position, with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipEstimator<T> {
    /// Geometry and stiffness.
    pub model: TipModel<T>,
    /// Calibrated parameters.
    pub parameters: TipParameters<T>,
    /// Covariance of the calibrated parameters, in the order of [`TipParameters`].
    pub covariance: Covariance<T, PARAMETERS>,
    /// Standard deviation of unmodelled deflection across the boom \[m\].
    pub remainder: T,
    /// Time constant of the payload's mean, τ \[s\].
    pub payload_memory: T,
}

record! {
    /// State of the tip estimator: weighted mean of the payload.
    pub struct TipMemory<T> {
        /// Mean payload, m̄
        #[unit = "kg"]
        pub payload: T,
        /// Weight of the mean, W; 0 before the first period and after a load change
        #[unit = "s/kg²"]
        pub weight: T,
    }
}

impl<T: Real> TipModel<T> {
    /// Position of the tip \[m\], right of and above the bearing. Quasi-static: the boom's own modes are left out.
    ///
    /// Equations in the [module](self). Beyond the reach of the cylinder's triangle the boom stays at the end of it.
    pub fn position(&self, parameters: &TipParameters<T>, load: &TipLoad<T>) -> [T; 2] {
        let (one, half, third) = (T::one(), T::lit(0.5), T::lit(1.0 / 3.0));
        let (length, g) = (self.length, self.gravity);
        // triangle of bearing, foot and mount; beyond its reach the boom stays at the end of it
        let foot = (self.base_x.square() + self.base_y.square()).sqrt();
        let mount = (self.mount_x.square() + self.mount_y.square()).sqrt();
        let cylinder = self.shortest + load.piston + parameters.stroke_offset;
        let sides = foot * mount;
        let nearly_one = T::lit(1.0 - 1e-9);
        let cosine = (foot.square() + mount.square() - cylinder.square()) / (sides + sides);
        let cosine = cosine.clamp(-nearly_one, nearly_one);
        let sine = (one - cosine.square()).sqrt();
        // direction of the foot less that of the mount on the boom
        let along = (self.base_x * self.mount_x + self.base_y * self.mount_y) / sides;
        let across = (self.base_y * self.mount_x - self.base_x * self.mount_y) / sides;
        let (cos, sin) = (cosine * along - sine * across, sine * along + cosine * across);
        // moment arm of the cylinder, and its direction along the boom
        let arm = sides * sine / cylinder;
        let axial = (self.mount_x - self.base_x * cos - self.base_y * sin) / cylinder;
        let turning = load.acceleration / arm;

        // loads across the boom: at the payload, its couple by lying off the axis, and by metre
        let reach = self.payload_x;
        let force = load.payload * (g * cos + turning * reach);
        let couple = -(load.payload * g * self.payload_y * sin);
        let (weight, inertia) = (self.mass / length * g * cos, self.mass / length * turning);
        let moment = force * reach
            + couple
            + half * weight * length.square()
            + third * inertia * length.square() * length;

        // the boom beyond the mount is a cantilever
        let outer = length - self.mount_x;
        let outer_2 = outer.square();
        let inner_end = reach.min(length) - self.mount_x;
        let by_force = inner_end.square() * (third * inner_end + half * (length - reach).abs());
        let by_couple = half * (outer_2 - (outer - inner_end).square());
        let by_weight = T::lit(0.125) * outer_2.square();
        let by_inertia = outer_2.square() * (T::lit(0.125) * length - outer * T::lit(1.0 / 30.0));
        let beyond_mount =
            force * by_force + couple * by_couple + weight * by_weight + inertia * by_inertia;
        // between bearing and mount the moment grows in proportion; off the axis, the cylinder's force adds a couple
        // at the mount
        let lug = self.mount_y * axial / arm;
        let at_mount = force * (reach - self.mount_x)
            + couple
            + half * weight * outer_2
            + inertia * outer_2 * (half * length - outer * T::lit(1.0 / 6.0))
            + lug * moment;
        let within = at_mount * (outer + lug * length) * self.mount_x * third;
        let bent = parameters.bending * (beyond_mount + within) / self.flexural_rigidity;

        let lowered = bent + length * parameters.base * moment;
        [length * cos + lowered * sin, length * sin - lowered * cos]
    }
}

impl<T: Real> TipLoad<T> {
    /// Piston position, payload and acceleration of an estimated state.
    pub fn of(model: &ReducedModel<T>, z: &MachineState<T>) -> Self {
        Self { piston: model.piston(z), payload: z.payload, acceleration: model.acceleration(z) }
    }
}

impl<T: Real> TipEstimator<T> {
    /// One control period, before [`estimate`](Self::estimate): updates the payload's mean, and restarts it where the
    /// innovations show a load change.
    #[inline(always)]
    pub fn update(
        &self,
        memory: &mut TipMemory<T>,
        filter: &ExtendedKalmanFilter<T>,
        state: &EstimatorState<T>,
    ) {
        let is_same_load = filter.innovation_test.is_consistent(state.mean_nis);
        let kept = (T::one() - filter.period / self.payload_memory).max(T::zero());
        let before = T::select(is_same_load, memory.weight * kept, T::zero());
        // a value that is not a number is initialised again
        let before = T::select(before.is_finite(), before, T::zero());
        // a gram: an exactly known payload still has a finite weight
        let variance = state.errors[PAYLOAD][PAYLOAD].max(T::lit(1e-6));
        let new = filter.period / variance;
        let payload = state.estimate.payload;
        let mean = memory.payload + new / (before + new) * (payload - memory.payload);
        memory.weight = before + new;
        memory.payload = T::select(mean.is_finite(), mean, payload);
    }

    /// Position of the tip at the time of the measurement. Standard deviations follow by first-order propagation of
    /// the error covariance and of the parameters' covariance.
    pub fn estimate(
        &self,
        memory: &TipMemory<T>,
        model: &ReducedModel<T>,
        state: &EstimatorState<T>,
    ) -> TipEstimate<T> {
        let (with_slopes, z) = as_variables(model, &state.estimate);
        let mut load = TipLoad::of(&with_slopes, &z);
        let off = load.payload.value - memory.payload;
        load.payload.value = memory.payload;
        let exact = self.model.map(Dual::<T, ERRORS>::constant);
        let found = exact.position(&self.parameters.map(Dual::constant), &load);
        let (slopes, by_payload) = self.slopes(&load.map(|d| d.value));
        // across the boom: its shares of both directions
        let [x, y] = found.each_ref().map(|h| h.value / self.model.length);
        let deviation = |k: usize, share: T| {
            let filter = output_deviation(&state.errors, &found[k].slope).square();
            let parameters = output_deviation(&self.covariance, &slopes[k]).square();
            let remainder = (self.remainder * share).square();
            (filter + parameters + remainder + (by_payload[k] * off).square()).sqrt()
        };
        TipEstimate {
            x: found[0].value,
            y: found[1].value,
            deviation_x: deviation(0, y),
            deviation_y: deviation(1, x),
        }
    }

    /// Derivatives of horizontal position and height \[m\] by the [`TipParameters`], and by the payload \[m/kg\].
    pub fn slopes(&self, load: &TipLoad<T>) -> ([[T; PARAMETERS]; 2], [T; 2]) {
        let mut direction = 0..PARAMETERS;
        let varied =
            self.parameters.map(|v| Dual::<T, VARIED>::variable(v, direction.next().unwrap_or(0)));
        let mut load = load.map(Dual::constant);
        load.payload.slope[PARAMETERS] = T::one();
        let found = self.model.map(Dual::constant).position(&varied, &load);
        let slopes = found.each_ref().map(|d| core::array::from_fn(|i| d.slope[i]));
        (slopes, found.map(|d| d.slope[PARAMETERS]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paper's boom; E I as in its crane file.
    const CRANE: TipModel<f64> = TipModel {
        mount_x: 0.553,
        mount_y: -0.131,
        base_x: 0.42,
        base_y: -1.055,
        shortest: 0.772,
        length: 3.6,
        mass: 86.0,
        flexural_rigidity: 3.27e6,
        payload_x: 3.6,
        payload_y: 0.0,
        gravity: 9.81,
    };
    const STIFF: TipParameters<f64> = TipParameters { bending: 0.0, base: 0.0, stroke_offset: 0.0 };
    const BENDING: TipParameters<f64> = TipParameters { bending: 1.0, ..STIFF };

    /// The crane with its mount at a place along the boom \[m\], and the foot below it: the boom lies level.
    fn level(mount: f64) -> TipModel<f64> {
        TipModel {
            mount_x: mount,
            mount_y: 0.0,
            base_x: mount,
            base_y: -1.0,
            shortest: 1.0,
            ..CRANE
        }
    }

    fn lowered(crane: &TipModel<f64>, parameters: &TipParameters<f64>, load: &TipLoad<f64>) -> f64 {
        let [stiff, found] = [&STIFF, parameters].map(|p| crane.position(p, load));
        (found[0] - stiff[0]).hypot(found[1] - stiff[1])
    }

    /// Held at the bearing itself the boom is a cantilever: w = P L³/(3 E I), and q L⁴/(8 E I) by its own weight.
    #[test]
    fn a_boom_held_at_its_bearing_bends_as_a_cantilever() {
        let crane = level(1e-6);
        let rest = |payload| TipLoad { piston: 0.0, payload, acceleration: 0.0 };
        let empty = lowered(&crane, &BENDING, &rest(0.0));
        let loaded = lowered(&crane, &BENDING, &rest(300.0));
        let (l, ei): (f64, f64) = (3.6, 3.27e6);
        let by_weight = 86.0 * 9.81 / l * l.powi(4) / (8.0 * ei);
        let by_payload = 300.0 * 9.81 * l.powi(3) / (3.0 * ei);
        assert!((empty / by_weight - 1.0).abs() < 1e-5, "{empty} for {by_weight}");
        assert!((loaded / (by_weight + by_payload) - 1.0).abs() < 1e-5, "{loaded}");
    }

    /// A beam on two supports with an overhang a beyond the span c: w = P a² (c + a)/(3 E I).
    #[test]
    fn a_boom_with_an_overhang_bends_as_in_the_handbook() {
        let crane = TipModel { mass: 0.0, ..level(0.6) };
        let load = TipLoad { piston: 0.0, payload: 300.0, acceleration: 0.0 };
        let found = lowered(&crane, &BENDING, &load);
        let wanted = 300.0 * 9.81 * 3.0_f64.powi(2) * 3.6 / (3.0 * 3.27e6);
        assert!((found / wanted - 1.0).abs() < 1e-9, "{found} for {wanted}");
    }

    /// Deflection by virtual work, ∫ M m dx/(E I), with m the moment of a unit force across the tip; integrated
    /// numerically. The moments come from the forces on the boom: cylinder along its axis, bearing, payload off the
    /// boom's axis, own weight and inertia.
    #[test]
    fn deflection_is_the_virtual_work_of_the_moments() {
        let off_axis = TipModel { payload_x: 3.5, payload_y: 0.2, mass: 0.0, ..CRANE };
        // weight and inertia of the span between bearing and mount are left out: a mount on the axis, and near the
        // bearing
        let accelerated = TipModel {
            mount_x: 0.05,
            mount_y: 0.0,
            base_x: 0.05,
            payload_x: 3.5,
            payload_y: 0.2,
            ..CRANE
        };
        let loads = [(200.0, 0.0), (300.0, 0.0), (250.0, 3.0)];
        for (crane, (payload, acceleration)) in
            [(off_axis, loads[0]), (off_axis, loads[1]), (accelerated, loads[2])]
        {
            let load = TipLoad { piston: 0.3, payload, acceleration };
            let [x, y] = crane.position(&STIFF, &load);
            let (cos, sin) = (x / crane.length, y / crane.length);
            let mount = [
                crane.mount_x * cos - crane.mount_y * sin,
                crane.mount_x * sin + crane.mount_y * cos,
            ];
            let cylinder = [mount[0] - crane.base_x, mount[1] - crane.base_y];
            let size = cylinder[0].hypot(cylinder[1]);
            let axis = cylinder.map(|c| c / size);
            let arm = mount[0] * axis[1] - mount[1] * axis[0];
            let across = axis[1] * cos - axis[0] * sin;
            let (l, a, g) = (crane.length, crane.mount_x, crane.gravity);
            let turning = acceleration / arm;
            let force = payload * (g * cos + turning * crane.payload_x);
            let couple = -payload * g * crane.payload_y * sin;
            let (weight, inertia) = (crane.mass / l * g * cos, crane.mass / l * turning);
            // beyond the mount, by the loads further out
            let outer = |x: f64| {
                let by_payload = match x < crane.payload_x {
                    true => force * (crane.payload_x - x) + couple,
                    false => 0.0,
                };
                let by_inertia = l.powi(3) / 3.0 - l * l * x / 2.0 + x.powi(3) / 6.0;
                by_payload + 0.5 * weight * (l - x).powi(2) + inertia * by_inertia
            };
            // before it, by the bearing's reaction, which balances cylinder and load
            let inner = match crane.mass > 0.0 {
                true => [outer(a), l - a],
                false => [(outer(0.0), force), (l, 1.0)]
                    .map(|(moment, load)| a * (moment / arm * across - load)),
            };
            let steps = 100_000;
            let mut work = inner[0] * inner[1] * a / 3.0;
            for k in 0..steps {
                let x = a + (l - a) * (f64::from(k) + 0.5) / f64::from(steps);
                work += outer(x) * (l - x) * (l - a) / f64::from(steps);
            }
            let found = lowered(&crane, &BENDING, &load);
            let wanted = work / crane.flexural_rigidity;
            assert!((found / wanted - 1.0).abs() < 1e-6, "{found} for {wanted} m, {load:?}");
        }
    }

    /// The base turns by the moment about the bearing, and the whole crane with it.
    #[test]
    fn a_base_that_turns_lowers_the_tip_by_its_length() {
        let crane = level(0.6);
        let base = TipParameters { base: 1e-7, ..STIFF };
        let load = TipLoad { piston: 0.0, payload: 300.0, acceleration: 0.0 };
        let moment = 9.81 * (300.0 * 3.6 + 86.0 * 1.8);
        let found = lowered(&crane, &base, &load);
        assert!((found / (3.6 * 1e-7 * moment) - 1.0).abs() < 1e-9, "{found}");
    }

    /// Upwards acceleration of the whole boom by g, as far as it turns about the bearing, doubles the payload's share.
    #[test]
    fn inertia_bends_as_weight_does() {
        let crane = TipModel { mass: 0.0, ..level(0.6) };
        let still = TipLoad { piston: 0.0, payload: 300.0, acceleration: 0.0 };
        let lifted = TipLoad { acceleration: 9.81 * 0.6 / 3.6, ..still };
        let [one, two] = [still, lifted].map(|load| lowered(&crane, &BENDING, &load));
        assert!((two / one - 2.0).abs() < 1e-9, "{one} and {two}");
    }

    #[test]
    fn the_tip_position_is_finite_beyond_the_stroke() {
        let load = TipLoad { piston: 10.0, payload: 300.0, acceleration: 0.0 };
        assert!(CRANE.position(&BENDING, &load).into_iter().all(f64::is_finite));
    }
}
