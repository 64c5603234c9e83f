//! Reduced model of the machine for estimation and control: a load on boom and oil in series, with pre-sliding
//! friction.
//!
//! ```text
//! y' = w                                              load, in the piston's travel; the piston is at x = y + γ p
//! w' = a_p(x, m) (p − p_0(x, m) − p_v w − f + d)       pressures: at rest, viscous, friction, disturbance
//! p' = β/(V + γ A β) (D (n − n_l(p) + r) − A w)        β(p + p_h; T), V = V_0 + A x, p_h = (A_r/A_p) p_B
//! f' = σ w (1 − f sgn(w)/p_C)                          Dahl's friction
//! ```
//!
//! Sources. Piston-side pressure build-up: equation (6) with oil (7) of doi:10.3390/act14020080. Boom
//! compliance in series and equivalent mass: a fit to the linearised crane (`reduced_model_fit` in the
//! crate `hydroboom-design`). Friction: P. Dahl, *A solid friction model*, 1968.

use hydroboom_math::{Real, record};
use hydroboom_model::hydraulics::Oil;

/// Number of coefficients of a [`Polynomial`] over the stroke.
pub const COEFFICIENTS: usize = 6;
/// Number of states: motion, unknown inputs and estimated parameters.
pub const STATES: usize = 8;

record! {
    /// State vector of the estimator: motion, unknown inputs and parameters.
    pub struct MachineState<T> {
        /// Position of the load in the piston's travel, y
        #[unit = "m"]
        pub position: T,
        /// Velocity of the load in the piston's travel, w
        #[unit = "m/s"]
        pub velocity: T,
        /// Load pressure, p = p_A − (A_r/A_p) p_B
        #[unit = "Pa"]
        pub load_pressure: T,
        /// Pre-sliding friction over the piston's area, f
        #[unit = "Pa"]
        pub friction: T,
        /// Unknown force over the piston's area, positive outwards, d
        #[unit = "Pa"]
        pub disturbance: T,
        /// Unknown flow as a motor speed, positive into the piston side, r
        #[unit = "rev/s"]
        pub unknown_flow: T,
        /// Mass of the payload, m
        #[unit = "kg"]
        pub payload: T,
        /// Pressure at which the oil stiffens, T (p_c1)
        #[unit = "Pa"]
        pub transition_pressure: T,
    }
}

/// Index of each state in the order of [`MachineState`].
pub mod state_index {
    /// Index of the load's position.
    pub const POSITION: usize = 0;
    /// Index of the load's velocity.
    pub const VELOCITY: usize = 1;
    /// Index of the load pressure.
    pub const LOAD_PRESSURE: usize = 2;
    /// Index of the pre-sliding friction.
    pub const FRICTION: usize = 3;
    /// Index of the unknown force.
    pub const DISTURBANCE: usize = 4;
    /// Index of the unknown flow.
    pub const UNKNOWN_FLOW: usize = 5;
    /// Index of the payload.
    pub const PAYLOAD: usize = 6;
    /// Index of the oil's transition pressure.
    pub const TRANSITION_PRESSURE: usize = 7;
}

/// A polynomial of the piston position, `c_0 + c_1 ξ + …`, ξ from −1 to 1 over the stroke.
pub type Polynomial<T> = [T; COEFFICIENTS];

#[inline(always)]
fn value<T: Real>(polynomial: &Polynomial<T>, at: T) -> T {
    let [first, rest @ ..] = polynomial;
    let rest = rest.iter().rev().fold(T::zero(), |sum, c| sum.mul_add(at, *c));
    rest.mul_add(at, *first)
}

#[inline(always)]
fn slope<T: Real>(polynomial: &Polynomial<T>, at: T) -> T {
    let terms = polynomial.iter().enumerate().skip(1).rev();
    terms.fold(T::zero(), |sum, (k, c)| sum.mul_add(at, *c * T::lit(k as f64)))
}

/// Parameters of the reduced model; payload and transition pressure are states instead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReducedModel<T> {
    /// Half the stroke length \[m\].
    pub half_stroke: T,
    /// Coefficients of the load pressure at rest, p_0 = P_0 + P_1 m: of the empty boom \[Pa\] and per mass of payload
    /// \[Pa/kg\].
    pub holding_pressure: [Polynomial<T>; 2],
    /// Coefficients of the equivalent mass over the piston's area, 1/a_p = M_0 + M_1 m: of the boom \[Pa s²/m\] and
    /// per mass of payload \[Pa s²/(m kg)\].
    pub equivalent_mass: [Polynomial<T>; 2],
    /// Coefficients of the boom compliance γ = (C_0 + C_1 m + C_2 m²) a_p² \[m/Pa\], with the payload m \[kg\] and
    /// a_p \[m/(s² Pa)\].
    pub compliance: [Polynomial<T>; 3],
    /// Viscous friction coefficient over the piston's area, p_v \[Pa s/m\].
    pub viscous: T,
    /// Coulomb friction over the piston's area, p_C \[Pa\].
    pub coulomb: T,
    /// Pre-sliding stiffness of the seals over the piston's area, σ \[Pa/m\].
    pub presliding_stiffness: T,
    /// Velocity over which friction changes its sign in the model of the crane file \[m/s\].
    pub sliding_velocity: T,
    /// Oil; its transition pressure is a state instead.
    pub oil: Oil<T>,
    /// Oil volume on piston side and pump side with the piston at its lower stop, V_0 \[m³\].
    pub volume: T,
    /// Piston area, A \[m²\].
    pub piston_area: T,
    /// Volume delivered per revolution of the pump, D \[m³/rev\].
    pub displacement: T,
    /// Leakage as a motor speed, per square root of the load pressure \[rev/(s √Pa)\].
    pub leakage: T,
    /// Time constant with which an unknown force decays \[s\]; a longer lasting force counts as payload.
    pub disturbance_time: T,
    /// Largest payload that is estimated \[kg\].
    pub maximum_payload: T,
}

record! {
    /// Coefficients of the reduced model at a piston position and a payload.
    pub struct OperatingPoint<T> {
        /// Load pressure at rest, p_0
        #[unit = "Pa"]
        pub holding_pressure: T,
        /// Derivative of the load pressure at rest by the piston position
        #[unit = "Pa/m"]
        pub holding_slope: T,
        /// Acceleration per pressure, a_p
        #[unit = "m/(s² Pa)"]
        pub acceleration: T,
        /// Boom compliance γ: elastic piston travel relative to the load, per load pressure
        #[unit = "m/Pa"]
        pub compliance: T,
        /// Oil volume on piston side and pump side, V
        #[unit = "m³"]
        pub volume: T,
    }
}

impl<T: Real> ReducedModel<T> {
    /// Converts every parameter to another number type by `f`.
    #[inline(always)]
    pub fn map<U: Real>(&self, f: impl Fn(T) -> U + Copy) -> ReducedModel<U> {
        let polynomial = |p: &Polynomial<T>| p.map(f);
        ReducedModel {
            half_stroke: f(self.half_stroke),
            holding_pressure: self.holding_pressure.each_ref().map(polynomial),
            equivalent_mass: self.equivalent_mass.each_ref().map(polynomial),
            compliance: self.compliance.each_ref().map(polynomial),
            viscous: f(self.viscous),
            coulomb: f(self.coulomb),
            presliding_stiffness: f(self.presliding_stiffness),
            sliding_velocity: f(self.sliding_velocity),
            oil: self.oil.map(f),
            volume: f(self.volume),
            piston_area: f(self.piston_area),
            displacement: f(self.displacement),
            leakage: f(self.leakage),
            disturbance_time: f(self.disturbance_time),
            maximum_payload: f(self.maximum_payload),
        }
    }

    /// Coefficients at a piston position \[m\] and a payload \[kg\]; beyond the stroke, polynomials keep their value
    /// at its end.
    #[inline(always)]
    pub fn at(&self, position: T, payload: T) -> OperatingPoint<T> {
        let one = T::one();
        let place = ((position - self.half_stroke) / self.half_stroke).clamp(-one, one);
        let linear = |[empty, per_kg]: &[Polynomial<T>; 2], of: fn(&Polynomial<T>, T) -> T| {
            payload.mul_add(of(per_kg, place), of(empty, place))
        };
        let acceleration = one / linear(&self.equivalent_mass, value);
        let [c0, c1, c2] = self.compliance.each_ref().map(|c| value(c, place));
        let compliance = payload.mul_add(payload.mul_add(c2, c1), c0) * acceleration.square();
        OperatingPoint {
            holding_pressure: linear(&self.holding_pressure, value),
            holding_slope: linear(&self.holding_pressure, slope) / self.half_stroke,
            acceleration,
            compliance,
            volume: self.piston_area.mul_add(position, self.volume),
        }
    }

    /// Payload (p − P_0)/P_1 \[kg\] in equilibrium with a load pressure p \[Pa\] at a piston position \[m\], clamped
    /// to 0 and the largest payload. A NaN pressure or position gives NaN.
    pub fn payload_at_rest(&self, position: T, load_pressure: T) -> T {
        let at = |payload: T| self.at(position, payload).holding_pressure;
        let empty = at(T::zero());
        let share = (load_pressure - empty) / (at(self.maximum_payload) - empty);
        share.clamp(T::zero(), T::one()) * self.maximum_payload
    }

    /// Bulk modulus β \[Pa\] at a load pressure \[Pa\] and a transition pressure \[Pa\]. `rod_side_term` is (A_r/A_p)
    /// p_B \[Pa\].
    #[inline(always)]
    pub fn bulk_modulus(&self, load_pressure: T, transition: T, rod_side_term: T) -> T {
        Oil { transition_pressure: transition, ..self.oil }
            .bulk_modulus(load_pressure + rod_side_term)
    }

    /// Pressure change per inflow volume, β/(V + γ A β) \[Pa/m³\], with the load at rest, oil and boom compliance in
    /// series. `bulk_modulus` is β \[Pa\].
    #[inline(always)]
    pub fn stiffness(&self, at: &OperatingPoint<T>, bulk_modulus: T) -> T {
        bulk_modulus / (at.compliance * self.piston_area).mul_add(bulk_modulus, at.volume)
    }

    /// Leakage as a motor speed, in proportion to the square root of the load pressure \[rev/s\]. A pressure below
    /// 1e4 Pa counts as 1e4 Pa.
    #[inline(always)]
    pub fn leakage(&self, load_pressure: T) -> T {
        // the oil below a tenth of a bar is unknown
        self.leakage * load_pressure.max(T::lit(1e4)).sqrt()
    }

    /// Pump revolutions per piston travel, A/D \[rev/m\].
    #[inline(always)]
    pub fn revolutions_per_metre(&self) -> T {
        self.piston_area / self.displacement
    }

    /// Piston position x = y + γ p \[m\] of a state.
    #[inline(always)]
    pub fn piston(&self, z: &MachineState<T>) -> T {
        let at = self.at(z.position, z.payload);
        at.compliance.mul_add(z.load_pressure, z.position)
    }

    /// Piston velocity x' = w + d(γ p)/dt \[m/s\] of a state at a motor speed \[rev/s\]. `rod_side_term` is (A_r/A_p)
    /// p_B \[Pa\].
    pub fn piston_velocity(&self, z: &MachineState<T>, motor_speed: T, rod_side_term: T) -> T {
        // so short that the step's own lag, half of it, is nothing; so long that a metre in f64 leaves 1e-9 m/s
        let moment = T::lit(1e-6);
        let next = self.step(z, motor_speed, rod_side_term, moment);
        (self.piston(&next) - self.piston(z)) / moment
    }

    /// Load pressure less the holding pressure with pre-sliding friction and unknown force \[Pa\].
    #[inline(always)]
    fn excess_pressure(at: &OperatingPoint<T>, z: &MachineState<T>) -> T {
        z.load_pressure
            - at.holding_pressure
            - at.holding_slope * at.compliance * z.load_pressure
            - z.friction
            + z.disturbance
    }

    /// Acceleration w' of the load \[m/s²\], in the piston's travel.
    pub fn acceleration(&self, z: &MachineState<T>) -> T {
        let at = self.at(z.position, z.payload);
        at.acceleration * (Self::excess_pressure(&at, z) - self.viscous * z.velocity)
    }

    /// State after a step `h` \[s\] at a mean motor speed \[rev/s\]. `rod_side_term` is (A_r/A_p) p_B \[Pa\].
    ///
    /// Linearly implicit: the velocity in its own damping, friction in itself; position and pressure use the new
    /// velocity.
    #[inline(always)]
    pub fn step(
        &self,
        z: &MachineState<T>,
        motor_speed: T,
        rod_side_term: T,
        h: T,
    ) -> MachineState<T> {
        let one = T::one();
        let at = self.at(z.position, z.payload);
        let force = Self::excess_pressure(&at, z);
        let damping = at.acceleration * self.viscous;
        let velocity = (h * at.acceleration).mul_add(force, z.velocity) / h.mul_add(damping, one);
        let bulk_modulus = self.bulk_modulus(z.load_pressure, z.transition_pressure, rod_side_term);
        let turning = motor_speed - self.leakage(z.load_pressure) + z.unknown_flow;
        let inflow = self.displacement * turning - self.piston_area * velocity;
        let moved = h * velocity;
        let bending = self.presliding_stiffness * moved;
        MachineState {
            position: z.position + moved,
            velocity,
            load_pressure: (h * self.stiffness(&at, bulk_modulus)).mul_add(inflow, z.load_pressure),
            friction: (z.friction + bending) / (one + bending.abs() / self.coulomb),
            disturbance: z.disturbance * (one - h / self.disturbance_time),
            ..*z
        }
    }
}
