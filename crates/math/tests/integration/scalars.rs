//! The number types agree with each other and with independent implementations.

use hydroboom_math::{Dual, Lanes, Real};
use num_dual::{DualNum, DualSVec64};

/// `count` points from `low` to `high`, both included.
fn grid(low: f64, high: f64, count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |i| low + (high - low) * i as f64 / (count - 1) as f64)
}

/// Largest error over the grid, each relative to `scale` of the exact value.
fn worst(
    points: impl Iterator<Item = f64>,
    ours: impl Fn(f64) -> f64,
    exact: impl Fn(f64) -> f64,
    scale: impl Fn(f64) -> f64,
) -> f64 {
    points
        .map(|x| {
            let reference = exact(x);
            (ours(x) - reference).abs() / scale(reference)
        })
        .fold(0.0, f64::max)
}

#[test]
fn elementary_functions_keep_their_stated_error() {
    const POINTS: usize = 400_003;
    let size = f64::abs;

    let exp = worst(grid(-708.0, 708.0, POINTS), Real::exp, libm::exp, size).max(worst(
        grid(-1.0, 1.0, POINTS),
        Real::exp,
        libm::exp,
        size,
    ));
    assert!(exp < 1e-15, "exp {exp:e}");

    let tiny = |x: f64| x.abs().max(1e-300);
    let tanh = worst(grid(-25.0, 25.0, POINTS), Real::tanh, libm::tanh, tiny)
        .max(worst(grid(-1.0, 1.0, POINTS), Real::tanh, libm::tanh, tiny))
        .max(worst(grid(-1e-8, 1e-8, POINTS), Real::tanh, libm::tanh, tiny));
    assert!(tanh < 2e-15, "tanh {tanh:e}");

    let at_least_one = |x: f64| x.abs().max(1.0);
    let ln = worst(grid(-300.0, 300.0, POINTS).map(libm::exp10), Real::ln, libm::log, at_least_one)
        .max(worst(grid(0.1, 10.0, POINTS), Real::ln, libm::log, at_least_one));
    assert!(ln < 4e-16, "ln {ln:e}");

    let one = |_| 1.0;
    for (low, high) in [(-10.0, 10.0), (-1e4, 1e4)] {
        let sin = worst(grid(low, high, POINTS), |x| Real::sin_cos(x).0, libm::sin, one);
        let cos = worst(grid(low, high, POINTS), |x| Real::sin_cos(x).1, libm::cos, one);
        assert!(sin < 3e-16 && cos < 3e-16, "sin {sin:e}, cos {cos:e}");
    }
}

#[test]
fn single_precision_functions_are_good_to_single_precision() {
    for x in grid(-20.0, 20.0, 10_008) {
        let single = x as f32;
        let near = |a: f32, b: f64| (f64::from(a) - b).abs() <= 4e-7 * b.abs().max(1e-3);
        let exact = f64::from(single);
        assert!(near(Real::exp(single), exact.exp()), "exp {x}");
        assert!(near(Real::tanh(single), exact.tanh()), "tanh {x}");
        assert!(near(Real::ln(single.abs()), exact.abs().ln()), "ln {x}");
        let (s, c) = Real::sin_cos(single);
        assert!((f64::from(s) - exact.sin()).abs() < 2e-7, "sin {x}: {s}");
        assert!((f64::from(c) - exact.cos()).abs() < 2e-7, "cos {x}: {c}");
    }
}

/// Every operation of the trait once, on positive arguments.
fn everything<T: Real>(a: T, b: T) -> [T; 16] {
    let (sin, cos) = a.sin_cos();
    [
        a + b,
        a - b,
        a * b,
        a / b,
        -a,
        a.sqrt(),
        a.exp(),
        a.ln(),
        a.tanh(),
        sin,
        cos,
        a.min(b),
        a.max(b),
        (a - b).abs(),
        (a + b).clamp(T::lit(-1.0), T::lit(2.5)),
        a.powf(b) + T::select(a.lt(b) | b.lt(T::lit(0.3)), a.square(), b),
    ]
}

#[test]
fn every_lane_gives_the_bits_of_f64() {
    let a: [f64; 8] = [0.01, 0.2, 0.5, 0.9, 1.3, 2.0, 4.4, 17.0];
    let b: [f64; 8] = [0.5, 0.1, 0.5, 1.9, 1.1, 0.25, 3.0, 2.0];
    let lanes = everything(Lanes(a), Lanes(b));
    for i in 0..8 {
        for (k, value) in everything(a[i], b[i]).into_iter().enumerate() {
            assert_eq!(lanes[k].0[i].to_bits(), value.to_bits(), "operation {k}, lane {i}");
        }
    }
}

#[test]
fn nan_passes_through_every_function() {
    for (k, value) in everything(f64::NAN, 0.5).into_iter().enumerate() {
        assert!(value.is_nan(), "operation {k} turned NaN into {value}");
    }
    assert!(!<f64 as Real>::is_finite(f64::NAN) && !<f64 as Real>::is_finite(f64::NEG_INFINITY));
    assert!(<f64 as Real>::is_finite(-1e300));
}

#[test]
fn the_logarithm_outside_of_its_domain_is_nan() {
    for x in [0.0, -0.0, -5e-324, -1e-300, -1.0, f64::MIN, f64::INFINITY, f64::NAN] {
        assert!(Real::ln(x).is_nan(), "ln {x}");
        assert!(Real::ln(x as f32).is_nan(), "ln {x} in single precision");
    }
}

/// Same bits as the standard library's `clamp`, which panics for unordered or NaN bounds.
#[test]
fn limits_are_those_of_the_standard_library_and_never_panic() {
    let values =
        [f64::NAN, f64::NEG_INFINITY, -2.5, -0.0, 0.0, 5e-324, 1.0, f64::MAX, f64::INFINITY];
    for x in values {
        for low in values {
            for high in values {
                let limited = Real::clamp(x, low, high);
                if low <= high {
                    assert_eq!(limited.to_bits(), x.clamp(low, high).to_bits(), "{low} {x} {high}");
                }
                assert!(limited.is_nan() == x.is_nan(), "{low} {x} {high}: {limited}");
            }
        }
    }
}

#[test]
fn derivatives_match_an_independent_dual_number() {
    for (x, y) in [(0.3, 0.7), (1.9, 0.2), (4.0, 2.2)] {
        let ours = everything(Dual::<f64, 2>::variable(x, 0), Dual::variable(y, 1));
        let a = DualSVec64::<2>::from_re(x).derivative(0);
        let b = DualSVec64::<2>::from_re(y).derivative(1);
        let (sin, cos) = a.sin_cos();
        let oracle =
            [a + b, a - b, a * b, a / b, -a, a.sqrt(), a.exp(), a.ln(), a.tanh(), sin, cos];
        for (k, (ours, oracle)) in ours.iter().zip(oracle).enumerate() {
            let slopes = oracle.eps.unwrap_generic(nalgebra::Const::<2>, nalgebra::Const::<1>);
            for (ours, oracle) in ours.slope.iter().zip(&slopes) {
                let error = (ours - oracle).abs();
                assert!(error <= 4e-15 * (1.0 + oracle.abs()), "{k}: {ours} against {oracle}");
            }
        }
    }
}

#[test]
fn derivatives_match_central_differences_on_either_side_of_a_kink() {
    let step = 1e-6;
    for (x, y) in [(0.3, 0.7), (0.7, 0.3), (1.9, 0.2), (1.4, 1.2)] {
        let ours = everything(Dual::<f64, 1>::variable(x, 0), Dual::constant(y));
        let ahead = everything(x + step, y);
        let behind = everything(x - step, y);
        for k in 0..16 {
            let slope = (ahead[k] - behind[k]) / (2.0 * step);
            let ours = ours[k].slope[0];
            assert!((ours - slope).abs() < 1e-8 * (1.0 + slope.abs()), "{k}: {ours} and {slope}");
        }
    }
}
