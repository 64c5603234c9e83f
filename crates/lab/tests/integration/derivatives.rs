//! Exact derivatives of the model compared with those by an independent dual-number library.
use core::ops::{Add, Div, Mul, Neg, Sub};
use hydroboom_description::Description;
use hydroboom_math::{Dual, Real};
use hydroboom_model::stepping::{Implicit, Underlying, has_settled};
use hydroboom_model::{Crane, CraneRates, CraneState, Input};
use num_dual::{Dual64, DualNum};

/// Number type of another library with its own rules of differentiation, adapted to the trait `Real`.
#[derive(Clone, Copy, Debug)]
struct Oracle(Dual64);

macro_rules! operator {
    ($Op:ident, $op:ident) => {
        impl $Op for Oracle {
            type Output = Self;
            fn $op(self, other: Self) -> Self {
                Self(self.0.$op(other.0))
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl Neg for Oracle {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Real for Oracle {
    type Mask = bool;
    fn lit(value: f64) -> Self {
        Self(Dual64::from_re(value))
    }
    fn lt(self, other: Self) -> bool {
        self.0.re < other.0.re
    }
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
    fn any(mask: bool) -> bool {
        mask
    }
    fn mul_add(self, factor: Self, term: Self) -> Self {
        self * factor + term
    }
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    fn exp(self) -> Self {
        Self(self.0.exp())
    }
    fn ln(self) -> Self {
        Self(self.0.ln())
    }
    fn tanh(self) -> Self {
        Self(self.0.tanh())
    }
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.0.sin_cos();
        (Self(sin), Self(cos))
    }
}

type Ours = Dual<f64, 1>;

fn listed<T: Copy>(rates: &CraneRates<T, 3>) -> Vec<T> {
    let mut list = rates.angular_acceleration.to_vec();
    list.push(rates.bristle);
    list.extend(rates.circuit.nodes.to_array());
    list.push(rates.circuit.gas_volume);
    list
}

/// Compares the derivatives of all rates along one direction.
fn compare(crane: &Crane<f64, 3>, state: &CraneState<f64, 3>, input: &Input<f64>, slope: &[f64]) {
    let mut slopes = slope.iter().copied().cycle();
    let ours =
        state.map(|value| Ours { value, slope: [slopes.next().unwrap() * value.abs().max(1e-3)] });
    let mut slopes = slope.iter().copied().cycle();
    let theirs = state
        .map(|value| Oracle(Dual64::new(value, slopes.next().unwrap() * value.abs().max(1e-3))));
    let ours = crane.map(&mut Ours::constant).derivative(&ours, &input.map(Ours::constant));
    let theirs = crane.map(&mut Oracle::lit).derivative(&theirs, &input.map(Oracle::lit));
    for (k, (a, b)) in listed(&ours).into_iter().zip(listed(&theirs)).enumerate() {
        let value = (a.value - b.0.re).abs();
        // each rate is a small difference of large terms: accelerations of 1e3 rad/s², 1e9 Pa/s
        let size = if k < 3 { 1e3 } else { 1e9 };
        assert!(value < 1e-10 * (b.0.re.abs() + size), "rate {k}: {} and {}", a.value, b.0.re);
        let slope = (a.slope[0] - b.0.eps).abs();
        assert!(
            slope < 1e-9 * (b.0.eps.abs() + size),
            "slope of rate {k}: {} and {}",
            a.slope[0],
            b.0.eps
        );
    }
}

#[test]
fn derivatives_match_independent_dual_numbers_at_valve_kinks_too() {
    let directions =
        [[1.0, -0.7, 0.3, 0.9, -0.2], [0.1, 0.8, -1.0, 0.4, 0.6], [-0.5, 0.2, 0.9, -1.0, 0.7]];
    for overrides in
        [&[][..], &["friction.law=lugre", "pump.delivery=computed", "relief.valves=fitted"]]
    {
        let mut description = Description::uia_single_boom().unwrap();
        for assignment in overrides {
            description.set(assignment).unwrap();
        }
        let crane = description.crane::<3>().unwrap();
        let circuit = &crane.circuit;
        let valves = [circuit.check_valve, circuit.holding_valve.check, circuit.return_valve.check];
        for stroke in [0.05, 0.25, 0.45] {
            let at_rest = crane.at_rest(&description.start(stroke)).unwrap();
            // pressure drops at the kinks of a valve, at an orifice without flow, and at vapour pressure
            let mut drops = vec![0.0, 1.0, -1.0, 7e5, -7e5];
            for valve in valves {
                let full = valve.cracking_pressure + 1.0 / valve.opening_slope;
                drops.extend([valve.cracking_pressure, full, -valve.cracking_pressure]);
            }
            for drop in drops {
                for (k, direction) in directions.iter().enumerate() {
                    let mut state = at_rest;
                    state.bristle = 3e-5;
                    state.boom.angular_velocity = [0.1, -0.05, 0.2];
                    let q = &mut state.circuit.nodes;
                    match k {
                        0 => q.pump_a = q.a + drop,
                        1 => q.pump_b = q.accumulator + drop,
                        _ => (q.b, q.pump_b) = (circuit.oil.vapour_pressure, q.b + drop),
                    }
                    for holding_valve in [0.0, 1.0] {
                        let input = Input { pump_speed: 12.0, holding_valve };
                        compare(&crane, &state, &input, direction);
                    }
                }
            }
        }
    }
}

/// A step with derivatives that follow the plain step, compared with the same step solved in dual numbers
/// throughout. Newton's matrix omits the boom's rotation within a step. Both therefore stop at a residual
/// of less than a thousandth, and agree to that accuracy.
#[test]
fn slopes_along_the_plain_step_match_a_step_in_dual_numbers() {
    type Two = Dual<f64, 2>;
    const STEP: f64 = 2e-4;
    let description = Description::uia_single_boom().unwrap();
    let crane = description.crane::<3>().unwrap();
    let mut state = crane.at_rest(&description.start_over(&description.numbers, 0.2)).unwrap();
    let plain = Implicit::new(&crane);
    let input = Input { pump_speed: 20.0, holding_valve: 1.0 };
    for _ in 0..600 {
        state = plain.settled(&crane, &state, &input, 5e-4).unwrap();
    }
    let over: Crane<Two, 3> = crane.over(&mut Two::constant);
    let mut whole = state.map(Two::constant);
    // derivatives with respect to the pump's speed and the initial gas volume of the accumulator
    whole.circuit.gas_volume.slope[1] = 1e-3;
    let mut following = whole;
    let mut along = input.map(Two::constant);
    along.pump_speed.slope[0] = 1.0;
    // an unconverged step is no solution; a caller that needs derivatives divides it
    assert!(has_settled(plain.step(&crane, &mut state, &input, STEP)));
    Implicit::new(&over).step(&over, &mut whole, &along, Two::constant(STEP));
    Underlying::new(&over).step(&over, &mut following, &along, STEP);
    let listed = |s: &CraneState<Two, 3>| {
        let nodes = s.circuit.nodes.to_array();
        let boom = [s.boom.angle, s.boom.angular_velocity].concat();
        [boom, nodes.to_vec(), vec![s.circuit.gas_volume]].concat()
    };
    let values: Vec<f64> = listed(&following).iter().map(|d| d.value).collect();
    let wanted: Vec<f64> = listed(&state.map(Two::constant)).iter().map(|d| d.value).collect();
    assert_eq!(values, wanted, "values are those of the plain step");
    for (k, (a, b)) in listed(&following).iter().zip(listed(&whole)).enumerate() {
        for direction in 0..2 {
            let (a, b) = (a.slope[direction], b.slope[direction]);
            assert!(
                (a - b).abs() <= 1e-3 * b.abs(),
                "coordinate {k} along {direction}: {a} for {b}"
            );
        }
    }
    let gas = following.circuit.gas_volume.slope;
    assert!(gas[0] != 0.0 && gas[1] != 1e-3, "the gas does not move: {gas:?}");
}
