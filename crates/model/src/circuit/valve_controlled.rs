//! Valve-controlled cylinder: a 4/3 proportional valve on a supply of given pressure, as in mobile cranes with
//! load-sensing or constant-pressure hydraulics (equations ours; the published crane has none).

use super::{Circuit, Coordinates};
use crate::hydraulics::{Cylinder, Oil, Orifice};
use hydroboom_math::{Real, record};

record! {
    /// Inputs of a valve-controlled circuit, constant over a step.
    pub struct ValveInput<T> {
        /// Command voltage of the valve
        #[unit = "V"]
        pub command: T,
        /// Gauge pressure of the supply, p_P
        #[unit = "Pa"]
        pub supply: T,
        /// Gauge pressure of the tank line, p_T
        #[unit = "Pa"]
        pub tank: T,
    }
}

record! {
    /// State of a valve-controlled circuit: chamber pressures and spool.
    pub struct ValveCircuitState<T> {
        /// Pressure coordinate of the piston side and its hose (see [`Oil`])
        #[unit = "Pa"]
        pub a: T,
        /// Pressure coordinate of the rod side and its hose
        #[unit = "Pa"]
        pub b: T,
        /// Position of the spool as a share of its travel, positive to lift, y
        #[unit = "1"]
        pub spool: T,
        /// Velocity of the spool as a share of its travel, y'
        #[unit = "1/s"]
        pub spool_velocity: T,
    }
}

record! {
    /// Volume flows of a valve-controlled circuit.
    pub struct ValveFlows<T> {
        /// Flow from the supply to the piston side
        #[unit = "m³/s"]
        pub supply_to_a: T,
        /// Flow from the supply to the rod side
        #[unit = "m³/s"]
        pub supply_to_b: T,
        /// Flow from the piston side to the tank
        #[unit = "m³/s"]
        pub a_to_tank: T,
        /// Flow from the rod side to the tank
        #[unit = "m³/s"]
        pub b_to_tank: T,
        /// Leakage past piston or spool, from the piston side to the rod side
        #[unit = "m³/s"]
        pub leakage: T,
    }
}

record! {
    /// One metering edge of a spool.
    ///
    /// It opens in proportion to the spool's travel beyond its overlap, `o = max(0, (|y| − δ)/(1 − δ))`, and
    /// passes `Q = K_V o r(Δp)` (4).
    pub struct ValveEdge<T> {
        /// Flow coefficient of the fully open edge, K_V
        #[unit = "m³/(s·√Pa)"]
        pub coefficient: T,
        /// Overlap (dead band) as a share of the spool's travel, δ
        #[unit = "1"]
        pub dead_band: T,
    }
}

impl<T: Real> ValveEdge<T> {
    /// Flow coefficient K_V max(0, y − δ)/(1 − δ) \[m³/(s·√Pa)\] at a spool position y = `travel` \[1\], a share of
    /// full travel, positive towards this edge. It is not limited beyond full travel.
    #[inline(always)]
    pub fn coefficient(&self, travel: T) -> T {
        let open = (travel - self.dead_band).max(T::zero()) / (T::one() - self.dead_band);
        self.coefficient * open
    }
}

record! {
    /// A 4/3 proportional valve: a spool that follows its command, and four edges.
    ///
    /// ```text
    /// y'' = ω² (y_c − y) − 2 ζ ω y',   y_c = (U − U_0)/(U_1 − U_0)
    /// ```
    pub struct SpoolValve<T> {
        /// Command voltage of the centre position, U_0
        #[unit = "V"]
        pub neutral: T,
        /// Command voltage of full travel in the lifting direction, U_1
        #[unit = "V"]
        pub full: T,
        /// Undamped angular frequency of the spool, ω
        #[unit = "rad/s"]
        pub bandwidth: T,
        /// Damping ratio of the spool, ζ
        #[unit = "1"]
        pub damping: T,
        /// Largest pressure drop that the pressure compensator leaves on an edge from the supply
        #[unit = "Pa"]
        pub compensated_drop: T,
    }
}

impl<T: Real> SpoolValve<T> {
    /// Steady-state spool position y_c \[1\] for a command \[V\]: the command less its neutral value, over the same
    /// difference at full travel, limited to −1..1.
    #[inline(always)]
    pub fn travel(&self, command: T) -> T {
        let share = (command - self.neutral) / (self.full - self.neutral);
        share.min(T::one()).max(-T::one())
    }
}

record! {
    /// A hose between valve and cylinder. It belongs to its chamber's node. For hoses of a few metres the
    /// pressure drop along it is below a tenth of a bar, and its natural frequencies are above 100 Hz.
    pub struct Hose<T> {
        /// Oil volume in the hose
        #[unit = "m³"]
        pub volume: T,
        /// Bulk modulus of the hose's wall: pressure per relative growth of its volume
        #[unit = "Pa"]
        pub wall_modulus: T,
    }
}

record! {
    /// Air shut in with the oil of a chamber, in bubbles or as a cushion, that neither dissolves nor leaves.
    ///
    /// ```text
    /// V_air = V_0 (p_0/(p + p_0))^(1/n)
    /// ```
    pub struct TrappedAir<T> {
        /// Volume of the air on the piston side at atmospheric pressure, V_0
        #[unit = "m³"]
        pub piston_side: T,
        /// Volume of the air on the rod side at atmospheric pressure, V_0
        #[unit = "m³"]
        pub rod_side: T,
        /// Polytropic exponent of the air, n
        #[unit = "1"]
        pub polytropic_exponent: T,
        /// Atmospheric pressure, absolute, p_0
        #[unit = "Pa"]
        pub atmosphere: T,
    }
}

impl<T: Real> TrappedAir<T> {
    /// Volume \[m³\] at a gauge pressure \[Pa\] of air with the volume `amount` \[m³\] at atmospheric pressure, and
    /// its compliance \[m³/Pa\].
    #[inline(always)]
    fn volume(&self, amount: T, pressure: T) -> (T, T) {
        let absolute = pressure + self.atmosphere;
        let volume = amount * (-(absolute / self.atmosphere).ln() / self.polytropic_exponent).exp();
        (volume, volume / (self.polytropic_exponent * absolute))
    }
}

/// A chamber with its hose, at one moment.
struct Chamber<'a, T> {
    /// Pressure coordinate \[Pa\].
    coordinate: T,
    /// Volume of the chamber \[m³\].
    volume: T,
    /// Its hose.
    hose: &'a Hose<T>,
    /// Air shut in \[m³ at atmospheric pressure\].
    air: T,
}

/// Parameters of a valve-controlled circuit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValveControlled<T> {
    /// Oil in all nodes.
    pub oil: Oil<T>,
    /// Spool dynamics and command range of the proportional valve.
    pub valve: SpoolValve<T>,
    /// Metering edge from supply P to the piston side A.
    pub supply_to_a: ValveEdge<T>,
    /// Metering edge from supply P to the rod side B.
    pub supply_to_b: ValveEdge<T>,
    /// Metering edge from the piston side A to tank T.
    pub a_to_tank: ValveEdge<T>,
    /// Metering edge from the rod side B to tank T.
    pub b_to_tank: ValveEdge<T>,
    /// Laminar leakage coefficient from the piston side to the rod side \[m³/(s·Pa)\].
    pub leakage: T,
    /// Hose between valve and piston side.
    pub hose_a: Hose<T>,
    /// Hose between valve and rod side.
    pub hose_b: Hose<T>,
    /// Undissolved air in both chambers.
    pub air: TrappedAir<T>,
    /// Flow law of all metering edges.
    pub orifice: Orifice<T>,
}

impl<T: Real> ValveControlled<T> {
    /// Volume flows \[m³/s\] at gauge pressures `a` and `b` of the chambers \[Pa\], with the spool at `spool` \[1\],
    /// a share of its travel.
    #[inline(always)]
    pub fn flows(&self, a: T, b: T, spool: T, input: &ValveInput<T>) -> ValveFlows<T> {
        // a compensator lets no edge from the supply have more than its drop, and none backwards
        let from_supply = |to: T| {
            let drop = input.supply - to;
            self.orifice.root(drop.min(self.valve.compensated_drop))
        };
        ValveFlows {
            supply_to_a: self.supply_to_a.coefficient(spool) * from_supply(a),
            supply_to_b: self.supply_to_b.coefficient(-spool) * from_supply(b),
            a_to_tank: self.a_to_tank.coefficient(-spool) * self.orifice.root(a - input.tank),
            b_to_tank: self.b_to_tank.coefficient(spool) * self.orifice.root(b - input.tank),
            leakage: self.leakage * (a - b),
        }
    }

    /// Volume that a pascal takes up \[m³/Pa\] in a chamber and its hose, at the chamber's pressure \[Pa\].
    #[inline(always)]
    fn compliance(&self, pressure: T, chamber: &Chamber<'_, T>) -> T {
        let hose = chamber.hose;
        let (air, of_air) = self.air.volume(chamber.air, pressure);
        let oil = (chamber.volume + hose.volume - air).max(T::zero());
        oil / self.oil.bulk_modulus(pressure) + hose.volume / hose.wall_modulus + of_air
    }

    /// Rate \[Pa/s\] of a chamber's pressure coordinate, from what flows in and what it grows by \[m³/s\]. While it
    /// cavitates, the coordinate counts the cavity relative to what a pascal takes up, so that a growing volume
    /// rescales it: the rest is as in [`Oil`].
    #[inline(always)]
    fn pressure_rate(&self, chamber: &Chamber<'_, T>, inflow: T, growth: T) -> T {
        let p = self.oil.pressure(chamber.coordinate);
        let rescaled = (p - chamber.coordinate) * growth / self.oil.bulk_modulus(p);
        (inflow - growth + rescaled) / self.compliance(p, chamber)
    }
}

impl<T: Real> Circuit<T> for ValveControlled<T> {
    type State = ValveCircuitState<T>;
    type Input = ValveInput<T>;
    type Over<U: Real> = ValveControlled<U>;

    #[inline(always)]
    fn oil(&self) -> &Oil<T> {
        &self.oil
    }

    #[inline(always)]
    fn chambers(&self, state: &ValveCircuitState<T>) -> (T, T) {
        (self.oil.pressure(state.a), self.oil.pressure(state.b))
    }

    #[inline(always)]
    fn state_rates(
        &self,
        state: &ValveCircuitState<T>,
        input: &ValveInput<T>,
        cylinder: &Cylinder<T>,
        stroke: T,
        velocity: T,
    ) -> ValveCircuitState<T> {
        let (a, b) = self.chambers(state);
        let q = self.flows(a, b, state.spool, input);
        let (into_a, into_b) =
            (q.supply_to_a - q.a_to_tank - q.leakage, q.supply_to_b - q.b_to_tank + q.leakage);
        // the piston makes room in A and takes it from B, as in (A12), (A13)
        let growth_a = velocity * cylinder.piston_area;
        let growth_b = -(velocity * cylinder.rod_side_area);
        let chamber_a = Chamber {
            coordinate: state.a,
            volume: cylinder.volume_a(stroke),
            hose: &self.hose_a,
            air: self.air.piston_side,
        };
        let chamber_b = Chamber {
            coordinate: state.b,
            volume: cylinder.volume_b(stroke),
            hose: &self.hose_b,
            air: self.air.rod_side,
        };
        let (omega, zeta) = (self.valve.bandwidth, self.valve.damping);
        let lag = self.valve.travel(input.command) - state.spool;
        let two = T::lit(2.0);
        ValveCircuitState {
            a: self.pressure_rate(&chamber_a, into_a, growth_a),
            b: self.pressure_rate(&chamber_b, into_b, growth_b),
            spool: state.spool_velocity,
            spool_velocity: omega * (omega * lag - two * zeta * state.spool_velocity),
        }
    }

    #[inline(always)]
    fn coordinates(state: &ValveCircuitState<T>) -> Coordinates<T> {
        let zero = T::zero();
        Coordinates {
            stiff: [state.a, state.b, state.spool, state.spool_velocity, zero],
            slow: [zero],
        }
    }

    #[inline(always)]
    fn from_coordinates(c: &Coordinates<T>) -> ValveCircuitState<T> {
        ValveCircuitState {
            a: c.stiff[0],
            b: c.stiff[1],
            spool: c.stiff[2],
            spool_velocity: c.stiff[3],
        }
    }

    fn over<U: Real>(&self, f: &mut impl FnMut(T) -> U) -> ValveControlled<U> {
        self.map(f)
    }

    #[inline(always)]
    fn input_over<U: Real>(input: &ValveInput<T>, f: &mut impl FnMut(T) -> U) -> ValveInput<U> {
        input.map(f)
    }
}

impl<T> ValveControlled<T> {
    /// Converts every parameter to another number type by `f`.
    pub fn map<U>(self, f: &mut impl FnMut(T) -> U) -> ValveControlled<U> {
        ValveControlled {
            oil: self.oil.map(&mut *f),
            valve: self.valve.map(&mut *f),
            supply_to_a: self.supply_to_a.map(&mut *f),
            supply_to_b: self.supply_to_b.map(&mut *f),
            a_to_tank: self.a_to_tank.map(&mut *f),
            b_to_tank: self.b_to_tank.map(&mut *f),
            leakage: f(self.leakage),
            hose_a: self.hose_a.map(&mut *f),
            hose_b: self.hose_b.map(&mut *f),
            air: self.air.map(&mut *f),
            orifice: self.orifice.map(f),
        }
    }
}
