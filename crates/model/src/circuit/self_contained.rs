//! Self-contained electro-hydraulic cylinder: circuit of five pressure nodes with pump, accumulator and load-holding
//! valves (section 3.1, appendix A.1, figures 3 and 6).

use super::{Circuit, Coordinates};
use crate::crane::Input;
use crate::hydraulics::{
    Accumulator, CheckValve, Cylinder, Oil, Orifice, PilotCheckValve, Pump, Slip, in_series,
    three_in_series,
};
use hydroboom_math::{Real, record};

record! {
    /// One number for each of the five pressure nodes.
    pub struct Nodes<T> {
        /// Pump side A, p_PA
        #[unit = "Pa"]
        pub pump_a: T,
        /// Cylinder, piston side, p_A
        #[unit = "Pa"]
        pub a: T,
        /// Cylinder, rod side, p_B
        #[unit = "Pa"]
        pub b: T,
        /// Pump side B, p_PB
        #[unit = "Pa"]
        pub pump_b: T,
        /// Accumulator, p_acc
        #[unit = "Pa"]
        pub accumulator: T,
    }
}

/// State of the self-contained circuit: pressures of its five nodes and the gas volume of its accumulator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CircuitState<T> {
    /// Pressure coordinates \[Pa\]: gauge pressures, or cavities below vapour pressure (see
    /// [`Oil`]).
    pub nodes: Nodes<T>,
    /// Gas volume of the accumulator, V_g \[m³\].
    pub gas_volume: T,
}

record! {
    /// The flows of figure 6.
    pub struct Flows<T> {
        /// Pump flow drawn from side B, Q_P
        #[unit = "m³/s"]
        pub pump: T,
        /// Pump flow delivered to side A, k_flow Q_P
        #[unit = "m³/s"]
        pub pump_delivery: T,
        /// Leakage through the pump from side A to side B, Q_int
        #[unit = "m³/s"]
        pub internal_leakage: T,
        /// Case drain from side A to the accumulator, Q_extA
        #[unit = "m³/s"]
        pub case_leakage_a: T,
        /// Case drain from side B to the accumulator, Q_extB
        #[unit = "m³/s"]
        pub case_leakage_b: T,
        /// From side A through orifice 10 and valve 7 to the accumulator, Q_1
        #[unit = "m³/s"]
        pub bleed: T,
        /// From the accumulator through check valve 8 to side B, Q_out
        #[unit = "m³/s"]
        pub suction: T,
        /// From side B through filter 6, valve 7 and check valve 8 to the accumulator, Q_in
        #[unit = "m³/s"]
        pub return_flow: T,
        /// From pump side A through load-holding valve 3 to the piston side, Q_A
        #[unit = "m³/s"]
        pub to_a: T,
        /// From the rod side through load-holding valve 3 to pump side B, Q_B
        #[unit = "m³/s"]
        pub from_b: T,
        /// From pump side A through relief valve 13 to the accumulator
        #[unit = "m³/s"]
        pub relief_a: T,
        /// From pump side B through relief valve 13 to the accumulator
        #[unit = "m³/s"]
        pub relief_b: T,
    }
}

/// Parameters of the self-contained circuit. The numbers in brackets are those of the paper's figure 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelfContained<T> {
    /// Oil in all nodes, before dissolved air is accounted for.
    pub oil: Oil<T>,
    /// Reduction of the oil's transition pressure p_c1 by dissolved air, for each node \[Pa\]. `None` as published.
    /// Changed from outside, slowly against the pressures.
    pub dissolved_air: Option<Nodes<T>>,
    /// Axial piston pump (11), driven in both directions.
    pub pump: Pump<T>,
    /// Accumulator (9).
    pub accumulator: Accumulator<T>,
    /// Volume of pump side A, V_PA \[m³\].
    pub volume_pump_a: T,
    /// Volume of pump side B, V_PB \[m³\].
    pub volume_pump_b: T,
    /// Leakage between the pump's sides, K_V,int \[m³/(s·√Pa)\].
    pub internal_leakage: T,
    /// Laminar leakage between the pump's sides, in addition to [`internal_leakage`](Self::internal_leakage); `None`
    /// as published.
    pub slip: Option<Slip<T>>,
    /// Case drain of side A, K_V,extA \[m³/(s·√Pa)\].
    pub case_leakage_a: T,
    /// Case drain of side B, K_V,extB \[m³/(s·√Pa)\].
    pub case_leakage_b: T,
    /// Load-holding valves (3), one in each line; port 1 towards the pump.
    pub holding_valve: PilotCheckValve<T>,
    /// Whether the load-holding valves are check valves while shut, as published; if not they block both ways
    /// and open with the 3/2 valve alone.
    pub holding_valve_checks: bool,
    /// Return valves (7), one at each pump side, piloted by the other; port 1 at the accumulator.
    pub return_valve: PilotCheckValve<T>,
    /// Check valves (8), one passing to and one passing from the accumulator.
    pub check_valve: CheckValve<T>,
    /// Filter (6), flow coefficient \[m³/(s·√Pa)\].
    pub filter: T,
    /// Orifice (10), flow coefficient \[m³/(s·√Pa)\].
    pub bleed_orifice: T,
    /// Relief valves (13) of both pump sides, where fitted; the published model has none.
    pub relief: Option<CheckValve<T>>,
    /// Flow law of all orifices and valves.
    pub orifice: Orifice<T>,
}

impl<T: Real> SelfContained<T> {
    /// Oil of each node, with the node's dissolved air.
    #[inline(always)]
    pub fn oils(&self) -> Nodes<Oil<T>> {
        match self.dissolved_air {
            Some(shift) => shift.map(|shift| self.oil.with_dissolved_air(shift)),
            None => Nodes::from_array([self.oil; 5]),
        }
    }

    /// Gauge pressures \[Pa\] of the five nodes.
    #[inline(always)]
    pub fn pressures(&self, state: &CircuitState<T>) -> Nodes<T> {
        state.nodes.map(|q| self.oil.pressure(q))
    }

    /// Volume flows \[m³/s\] (figure 6) at gauge pressures `p` \[Pa\].
    ///
    /// `speed` \[rev/s\] is the pump's, positive when it delivers to side A. `energised` is 1 with the 3/2 valve on,
    /// 0 with it off: the higher cylinder pressure, or the accumulator, then pilots the load-holding valves.
    #[inline(always)]
    pub fn flows(&self, p: &Nodes<T>, speed: T, energised: T) -> Flows<T> {
        let pump = self.pump.flow(speed);
        let k_flow = self.pump.flow_gain(&self.oil, p.pump_a, p.pump_b);

        // r(Δp) between each pair of connected nodes
        let across_pump = self.orifice.root(p.pump_a - p.pump_b);
        let a_to_accumulator = self.orifice.root(p.pump_a - p.accumulator);
        let b_to_accumulator = self.orifice.root(p.pump_b - p.accumulator);
        let into_a = self.orifice.root(p.pump_a - p.a);
        let out_of_b = self.orifice.root(p.b - p.pump_b);

        // (A1) to (A3)
        let mut internal_leakage = self.internal_leakage * across_pump;
        if let Some(slip) = &self.slip {
            internal_leakage = internal_leakage + slip.flow(p.pump_a - p.pump_b, speed);
        }
        let case_leakage_a = self.case_leakage_a * a_to_accumulator;
        let case_leakage_b = self.case_leakage_b * b_to_accumulator;

        // (A7): valve 7 of side A is held open by side B
        let valve_7a = self.return_valve.coefficient(p.accumulator, p.pump_a, p.pump_b);
        let bleed = in_series(self.bleed_orifice, valve_7a) * a_to_accumulator;

        // (A8): the check valve that keeps side B from running dry
        let valve_8 = self.check_valve.coefficient(p.accumulator - p.pump_b);
        let suction = -(valve_8 * b_to_accumulator);

        // (A9): valve 7 of side B is held open by side A
        let valve_7b = self.return_valve.coefficient(p.accumulator, p.pump_b, p.pump_a);
        let valve_8 = self.check_valve.coefficient(p.pump_b - p.accumulator);
        let return_flow = three_in_series(self.filter, valve_7b, valve_8) * b_to_accumulator;

        // (A10), (A11): the 3/2 valve pilots both load-holding valves
        let higher = p.a.max(p.b);
        let pilot = p.accumulator + energised * (higher - p.accumulator);
        let holding = |pump, cylinder| match self.holding_valve_checks {
            true => self.holding_valve.coefficient(pump, cylinder, pilot),
            false => energised * self.holding_valve.check.flow_coefficient,
        };
        let to_a = holding(p.pump_a, p.a) * into_a;
        let from_b = holding(p.pump_b, p.b) * out_of_b;

        let (relief_a, relief_b) = match &self.relief {
            Some(valve) => (
                valve.coefficient(p.pump_a - p.accumulator) * a_to_accumulator,
                valve.coefficient(p.pump_b - p.accumulator) * b_to_accumulator,
            ),
            None => (T::zero(), T::zero()),
        };

        Flows {
            pump,
            pump_delivery: k_flow * pump,
            internal_leakage,
            case_leakage_a,
            case_leakage_b,
            bleed,
            suction,
            return_flow,
            to_a,
            from_b,
            relief_a,
            relief_b,
        }
    }

    /// Net volume flow \[m³/s\] into each node, without the piston's displacement flow.
    #[inline(always)]
    pub fn net_flows(&self, q: &Flows<T>) -> Nodes<T> {
        Nodes {
            // (8)
            pump_a: q.pump_delivery
                - q.internal_leakage
                - q.case_leakage_a
                - q.bleed
                - q.to_a
                - q.relief_a,
            a: q.to_a,
            b: -q.from_b,
            // (9)
            pump_b: q.from_b + q.suction + q.internal_leakage
                - q.pump
                - q.case_leakage_b
                - q.return_flow
                - q.relief_b,
            // (A22)
            accumulator: q.case_leakage_a + q.case_leakage_b - q.suction
                + q.bleed
                + q.return_flow
                + q.relief_a
                + q.relief_b,
        }
    }

    /// Rates of node pressures \[Pa/s\] and gas volume \[m³/s\], with the piston at `stroke` \[m\] moving at
    /// `velocity` \[m/s\].
    #[inline(always)]
    pub fn rates(
        &self,
        state: &CircuitState<T>,
        flows: &Flows<T>,
        cylinder: &Cylinder<T>,
        stroke: T,
        velocity: T,
    ) -> CircuitState<T> {
        let q = state.nodes;
        let into = self.net_flows(flows);

        // (A12), (A13): the piston makes room in A and takes it from B
        let growth_a = velocity * cylinder.piston_area;
        let growth_b = -(velocity * cylinder.rod_side_area);

        // (A20), (A21); a cavity takes the place of the gas below vapour pressure
        let oil = self.oils();
        let p_acc = oil.accumulator.pressure(q.accumulator);
        let beta = oil.accumulator.bulk_modulus(p_acc);
        let (accumulator, gas_volume) =
            self.accumulator.rates(beta, q.accumulator, state.gas_volume, into.accumulator);

        // a division costs as much as eight multiplications: one for both chambers
        let (volume_a, volume_b) = (cylinder.volume_a(stroke), cylinder.volume_b(stroke));
        let per_product = T::one() / (volume_a * volume_b);
        let (per_a, per_b) = (volume_b * per_product, volume_a * per_product);
        let (per_pump_a, per_pump_b) =
            (T::one() / self.volume_pump_a, T::one() / self.volume_pump_b);
        CircuitState {
            nodes: Nodes {
                pump_a: oil.pump_a.pressure_rate(q.pump_a, per_pump_a, into.pump_a),
                a: oil.a.growing_pressure_rate(q.a, per_a, into.a, growth_a),
                b: oil.b.growing_pressure_rate(q.b, per_b, into.b, growth_b),
                pump_b: oil.pump_b.pressure_rate(q.pump_b, per_pump_b, into.pump_b),
                accumulator,
            },
            gas_volume,
        }
    }
}

impl<T> SelfContained<T> {
    /// Converts every parameter to another number type by `f`.
    pub fn map<U>(self, f: &mut impl FnMut(T) -> U) -> SelfContained<U> {
        SelfContained {
            oil: self.oil.map(&mut *f),
            dissolved_air: self.dissolved_air.map(|shift| shift.map(&mut *f)),
            pump: self.pump.map(f),
            accumulator: self.accumulator.map(&mut *f),
            volume_pump_a: f(self.volume_pump_a),
            volume_pump_b: f(self.volume_pump_b),
            internal_leakage: f(self.internal_leakage),
            slip: self.slip.map(|slip| slip.map(&mut *f)),
            case_leakage_a: f(self.case_leakage_a),
            case_leakage_b: f(self.case_leakage_b),
            holding_valve: self.holding_valve.map(f),
            holding_valve_checks: self.holding_valve_checks,
            return_valve: self.return_valve.map(f),
            check_valve: self.check_valve.map(&mut *f),
            filter: f(self.filter),
            bleed_orifice: f(self.bleed_orifice),
            relief: self.relief.map(|valve| valve.map(&mut *f)),
            orifice: self.orifice.map(f),
        }
    }
}

impl<T> CircuitState<T> {
    /// Converts every state to another number type by `f`.
    #[inline(always)]
    pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> CircuitState<U> {
        CircuitState { nodes: self.nodes.map(&mut f), gas_volume: f(self.gas_volume) }
    }
}

impl<T: Real> Circuit<T> for SelfContained<T> {
    type State = CircuitState<T>;
    type Input = Input<T>;
    type Over<U: Real> = SelfContained<U>;

    #[inline(always)]
    fn oil(&self) -> &Oil<T> {
        &self.oil
    }

    #[inline(always)]
    fn chambers(&self, state: &CircuitState<T>) -> (T, T) {
        (self.oil.pressure(state.nodes.a), self.oil.pressure(state.nodes.b))
    }

    #[inline(always)]
    fn state_rates(
        &self,
        state: &CircuitState<T>,
        input: &Input<T>,
        cylinder: &Cylinder<T>,
        stroke: T,
        velocity: T,
    ) -> CircuitState<T> {
        let pressures = self.pressures(state);
        let flows = self.flows(&pressures, input.pump_speed, input.holding_valve);
        self.rates(state, &flows, cylinder, stroke, velocity)
    }

    #[inline(always)]
    fn coordinates(state: &CircuitState<T>) -> Coordinates<T> {
        Coordinates { stiff: state.nodes.to_array(), slow: [state.gas_volume] }
    }

    #[inline(always)]
    fn from_coordinates(coordinates: &Coordinates<T>) -> CircuitState<T> {
        CircuitState {
            nodes: Nodes::from_array(coordinates.stiff),
            gas_volume: coordinates.slow[0],
        }
    }

    fn over<U: Real>(&self, f: &mut impl FnMut(T) -> U) -> SelfContained<U> {
        self.map(f)
    }

    #[inline(always)]
    fn input_over<U: Real>(input: &Input<T>, f: &mut impl FnMut(T) -> U) -> Input<U> {
        input.map(f)
    }
}
