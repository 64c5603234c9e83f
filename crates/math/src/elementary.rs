//! Exponential, hyperbolic tangent, logarithm, sine and cosine from plain arithmetic.
//!
//! Libraries differ in the last bits of these functions, and compute one lane at a time. Here they consist of
//! additions, multiplications, one division and a scaling by a power of two. Hence `f64`, every SIMD lane and
//! generated code agree to the last bit, and the compiler can vectorise them.
//!
//! Error bounds in `f64`, relative, tested on a fine grid against libm
//! (`elementary_functions_keep_their_stated_error`):
//!
//! | function | domain | bound |
//! |---|---|---|
//! | [`exp`] | -708 .. 708; stays near 2^±1022 beyond | 1e-15 |
//! | [`tanh`] | -1e15 .. 1e15 | 2e-15 |
//! | [`ln`] | positive normal numbers | 4e-16 (absolute below 1) |
//! | [`sin_cos`] | -1e4 .. 1e4 rad | 3e-16 absolute |

use crate::Real;

/// Bit-level operations on a binary floating-point number that the functions need beyond arithmetic.
pub trait Binary: Real {
    /// ln 2 as a short leading part, exact when multiplied by a small integer, and the rest.
    const LN_2: [f64; 2];
    /// pi/2 as a short leading part, exact when multiplied by a small integer, and the rest.
    const FRAC_PI_2: [f64; 2];
    /// Adding this to a number below 2^51 (2^22 in single precision) rounds it to the nearest integer, ties to even.
    /// The last bits of the sum hold the integer; subtracting it again yields the integer as a number.
    const ROUNDER: f64;
    /// Largest k for which both 2^k and 2^-k are normal numbers: 1022 in double, 126 in single precision.
    const LARGEST_EXPONENT: f64;

    /// Two to the power of the integer held in the last bits.
    fn power_of_two(held: Self) -> Self;
    /// Sine and cosine rotated by the number of quarter turns held in the last bits.
    fn turn(held: Self, sin: Self, cos: Self) -> (Self, Self);
    /// `(m, e)` with `self = m 2^e` and m in sqrt(1/2) .. sqrt(2), for positive normal numbers. For zero, negative
    /// numbers, infinities and NaN, m is NaN.
    fn split(self) -> (Self, Self);
}

/// `(2^k, q)` with e^2x = 2^k (q + p)/(q - p) and q = p coth p, where |p| <= ln(2)/4 is what is left
/// of x after k ln(2)/2. `held` holds k in its last bits. The scale stays within 2^±`most`.
#[inline(always)]
fn exp_parts<T: Binary>(held: T, p: T, most: f64) -> (T, T) {
    // p coth p is even in p, and is approximated by a polynomial in y. It is exact at zero and at four
    // Chebyshev nodes, with an error of at most 1.2e-15. Its coefficients are those in (2p)²
    const COTH: [f64; 4] = [
        4.0 * 0.083_333_333_333_032_07,
        16.0 * -0.001_388_888_864_517_123_7,
        64.0 * 3.306_816_998_201_503e-5,
        256.0 * -8.206_362_444_022_358e-7,
    ];
    let [c0, c1, c2, c3] = COTH.map(T::lit);
    let y = p * p;
    let y2 = y * y;
    let q = y2.mul_add(y2.mul_add(c3, y.mul_add(c2, c1)), y.mul_add(c0, T::one()));
    // limiting the scale is not on the critical path of operations; limiting x would be
    let limited = held.clamp(T::lit(T::ROUNDER - most), T::lit(T::ROUNDER + most));
    (T::power_of_two(limited), q)
}

/// e^x; range and error bound in the [module](self). NaN for NaN and infinities.
#[inline(always)]
pub fn exp<T: Binary>(x: T) -> T {
    let rounder = T::lit(T::ROUNDER);
    let held = x.mul_add(T::lit(core::f64::consts::LOG2_E), rounder);
    let k = held - rounder;
    let half = T::lit(0.5) * x;
    let p = k.mul_add(T::lit(-0.5 * T::LN_2[1]), k.mul_add(T::lit(-0.5 * T::LN_2[0]), half));
    let (scale, q) = exp_parts(held, p, T::LARGEST_EXPONENT);
    scale * ((q + p) / (q - p))
}

/// Hyperbolic tangent, (e^2x - 1)/(e^2x + 1) without cancellation near zero; range and error bound in the
/// [module](self). NaN for NaN and infinities.
#[inline(always)]
pub fn tanh<T: Binary>(x: T) -> T {
    let rounder = T::lit(T::ROUNDER);
    let held = x.mul_add(T::lit(2.0 * core::f64::consts::LOG2_E), rounder);
    // one constant is accurate enough: where k is large, the derivative is small
    let p = (held - rounder).mul_add(T::lit(-0.5 * core::f64::consts::LN_2), x);
    // beyond 2^60 adding or subtracting one is below the rounding, and the result is one
    let (scale, q) = exp_parts(held, p, 60.0);
    // the scale is exactly one near zero, which leaves p/q
    let (less, more) = (scale - T::one(), scale + T::one());
    less.mul_add(q, more * p) / more.mul_add(q, less * p)
}

/// Natural logarithm of a positive normal number, from the series of 2 atanh((m-1)/(m+1)). NaN for zero, negative
/// numbers, infinities and NaN; inaccurate for subnormal numbers.
#[inline(always)]
pub fn ln<T: Binary>(x: T) -> T {
    let (m, e) = x.split();
    let s = (m - T::one()) / (m + T::one());
    let y = s * s;
    let mut series = T::lit(1.0 / 23.0);
    for k in (1..=10).rev() {
        series = series * y + T::lit(1.0 / f64::from(2 * k + 1));
    }
    let two_s = s + s;
    e * T::lit(T::LN_2[0]) + (two_s + (two_s * y * series + e * T::lit(T::LN_2[1])))
}

/// Sine and cosine of an angle \[rad\]; error bound in the [module](self) for |x| up to 1e4. NaN for NaN and
/// infinities.
#[inline(always)]
pub fn sin_cos<T: Binary>(x: T) -> (T, T) {
    let rounder = T::lit(T::ROUNDER);
    let quarters = x.mul_add(T::lit(core::f64::consts::FRAC_2_PI), rounder);
    let n = quarters - rounder;
    let r = n.mul_add(T::lit(-T::FRAC_PI_2[1]), n.mul_add(T::lit(-T::FRAC_PI_2[0]), x));

    // sin r = r + r³ P(r²), cos r = 1 − r²/2 + r⁴ Q(r²): P and Q interpolate at six Chebyshev nodes on
    // |r| <= pi/4, with errors of 1.4e-17 and 1e-18
    const SIN: [f64; 6] = [
        -0.166_666_666_666_666_66,
        0.008_333_333_333_330_948,
        -0.000_198_412_698_367_567_74,
        2.755_731_610_161_787_4e-6,
        -2.505_113_165_023_518e-8,
        1.591_811_526_326_597_4e-10,
    ];
    const COS: [f64; 6] = [
        0.041_666_666_666_666_664,
        -0.001_388_888_888_888_739_8,
        2.480_158_729_876_456e-5,
        -2.755_731_727_114_514_4e-7,
        2.087_614_614_655_861e-9,
        -1.138_262_364_747_460_4e-11,
    ];
    let y = r * r;
    let sin = (r * y).mul_add(polynomial(&SIN, y), r);
    let cos = (y * y).mul_add(polynomial(&COS, y), T::one() - T::lit(0.5) * y);
    T::turn(quarters, sin, cos)
}

/// c0 + c1 y + c2 y^2 + ..., summed in pairs for a shorter chain of operations.
#[inline(always)]
fn polynomial<T: Binary>(c: &[f64; 6], y: T) -> T {
    let pair = |i: usize| y.mul_add(T::lit(c[i + 1]), T::lit(c[i]));
    let y2 = y * y;
    y2.mul_add(y2.mul_add(pair(4), pair(2)), pair(0))
}
