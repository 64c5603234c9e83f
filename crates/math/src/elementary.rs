//! Exponential, hyperbolic tangent, logarithm, sine and cosine from plain arithmetic.
//!
//! Libraries differ in the last bits of these functions, and call one lane at a time. Here they
//! are additions, multiplications, one division and a scaling by a power of two, so that `f64`,
//! every SIMD lane and generated code agree to the last bit, and so that the compiler can
//! vectorise them.
//!
//! Error bounds in `f64`, relative, tested on a fine grid against libm
//! (`elementary_functions_keep_their_stated_error`):
//!
//! | function | domain | bound |
//! |---|---|---|
//! | [`exp`] | -708 .. 708; saturates outside | 4e-16 |
//! | [`tanh`] | all | 8e-16 |
//! | [`ln`] | positive normal numbers | 4e-16 (absolute below 1) |
//! | [`sin_cos`] | -1e4 .. 1e4 rad | 3e-16 absolute |

use crate::Real;

/// A binary floating-point number: what the functions need beyond arithmetic.
pub trait Binary: Real {
    /// ln 2 as a short leading part, exact when multiplied by a small integer, and the rest.
    const LN_2: [f64; 2];
    /// pi/2 as two short leading parts and the rest.
    const FRAC_PI_2: [f64; 3];
    /// Arguments of `exp` are limited to plus and minus this.
    const EXP_LIMIT: f64;

    /// The nearest integer, ties to even, for magnitudes below 2^51 (2^22 in single precision).
    fn round(self) -> Self;
    /// Two to the power of an integer held in `self`.
    fn power_of_two(self) -> Self;
    /// `(m, e)` with `self = m 2^e` and m in sqrt(1/2) .. sqrt(2), for positive normal numbers.
    fn split(self) -> (Self, Self);
}

/// `(2^k, q, p)` with e^x = 2^k (q + p)/(q - p): the diagonal Padé approximant \[6/6\] on
/// |r| <= ln(2)/2, whose truncation error is 2e-19. For |x| beyond 1000 the parts are arbitrary.
#[inline(always)]
fn exp_parts<T: Binary>(x: T) -> (T, T, T) {
    let k = (x * T::lit(core::f64::consts::LOG2_E)).round();
    let r = x - k * T::lit(T::LN_2[0]) - k * T::lit(T::LN_2[1]);
    // coefficients (12-j)! 6! / (12! j! (6-j)!), scaled so that the leading one is 1; pairs of
    // terms are summed separately for a shorter chain of operations
    let y = r * r;
    let y2 = y * y;
    let even = (T::one() + y * T::lit(5.0 / 44.0))
        + y2 * (T::lit(1.0 / 792.0) + y * T::lit(1.0 / 665_280.0));
    let odd = (T::lit(0.5) + y * T::lit(1.0 / 66.0)) + y2 * T::lit(1.0 / 15_840.0);
    (k.power_of_two(), even, r * odd)
}

/// e^x.
#[inline(always)]
pub fn exp<T: Binary>(x: T) -> T {
    let (scale, q, p) = exp_parts(x.clamp(T::lit(-T::EXP_LIMIT), T::lit(T::EXP_LIMIT)));
    scale * ((q + p) / (q - p))
}

/// Hyperbolic tangent, (e^2x - 1)/(e^2x + 1) without cancellation near zero.
#[inline(always)]
pub fn tanh<T: Binary>(x: T) -> T {
    // beyond 20 the result rounds to one
    let (scale, q, p) = exp_parts((x + x).clamp(T::lit(-40.0), T::lit(40.0)));
    // the scale is exactly one near zero, which leaves p/q
    let (less, more) = (scale - T::one(), scale + T::one());
    (less * q + more * p) / (more * q + less * p)
}

/// Natural logarithm, from the series of 2 atanh((m-1)/(m+1)).
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

/// Sine and cosine of an angle \[rad\].
#[inline(always)]
pub fn sin_cos<T: Binary>(x: T) -> (T, T) {
    let n = (x * T::lit(core::f64::consts::FRAC_2_PI)).round();
    let r =
        x - n * T::lit(T::FRAC_PI_2[0]) - n * T::lit(T::FRAC_PI_2[1]) - n * T::lit(T::FRAC_PI_2[2]);

    // Taylor series on |r| <= pi/4: truncated at r^17/17! = 5e-17 and r^18/18! = 2e-18
    const SIN: [f64; 7] = [
        -1.0 / 6.0,
        1.0 / 120.0,
        -1.0 / 5_040.0,
        1.0 / 362_880.0,
        -1.0 / 39_916_800.0,
        1.0 / 6_227_020_800.0,
        -1.0 / 1_307_674_368_000.0,
    ];
    const COS: [f64; 7] = [
        1.0 / 24.0,
        -1.0 / 720.0,
        1.0 / 40_320.0,
        -1.0 / 3_628_800.0,
        1.0 / 479_001_600.0,
        -1.0 / 87_178_291_200.0,
        1.0 / 20_922_789_888_000.0,
    ];
    let y = r * r;
    let sin = r + (r * y) * polynomial(&SIN, y);
    let cos = T::one() - (T::lit(0.5) * y - (y * y) * polynomial(&COS, y));

    // the quarter turn, -2..=2
    let quarter = n - T::lit(4.0) * (n * T::lit(0.25)).round();
    let half = T::lit(0.5);
    let three_halves = T::lit(1.5);
    let size = quarter.abs();
    let swapped = half.lt(size) & size.lt(three_halves);
    let sin_negative = quarter.lt(-half) | three_halves.lt(quarter);
    let cos_negative = half.lt(quarter) | quarter.lt(-three_halves);
    let s = T::select(swapped, cos, sin);
    let c = T::select(swapped, sin, cos);
    // a turn by -2 quarters is the turn by +2: both signs change
    (T::select(sin_negative, -s, s), T::select(cos_negative, -c, c))
}

/// c0 + c1 y + c2 y^2 + ..., summed in pairs for a shorter chain of operations.
#[inline(always)]
fn polynomial<T: Real>(c: &[f64; 7], y: T) -> T {
    let pair = |i: usize| T::lit(c[i]) + y * T::lit(c[i + 1]);
    let y2 = y * y;
    let y4 = y2 * y2;
    (pair(0) + y2 * pair(2)) + y4 * (pair(4) + y2 * T::lit(c[6]))
}
