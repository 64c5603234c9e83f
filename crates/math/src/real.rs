//! Scalar trait of the model: arithmetic, elementary functions and selection without branches.

use core::fmt::Debug;
use core::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// A number type for evaluating the model.
///
/// Model code uses only the operations of this trait: no `if` on a number, no `==`, no conversion back to `f64`. A
/// choice is written with [`select`](Real::select); both of its arms are evaluated, so each must stay finite over the
/// whole domain. (`a < b` does not compile in model code. The compiler then suggests a `PartialOrd` bound; write
/// `a.lt(b)` instead.)
///
/// NaN propagates through every function, including the provided `min`, `max` and `clamp` of `self`.
pub trait Real:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Result of a comparison: a truth value, one per lane, or a recorded condition.
    type Mask: Copy
        + Debug
        + BitAnd<Output = Self::Mask>
        + BitOr<Output = Self::Mask>
        + Not<Output = Self::Mask>;

    /// The constant `value`, rounded to the precision of the type.
    fn lit(value: f64) -> Self;

    /// Whether `self < other`; false where either is NaN.
    fn lt(self, other: Self) -> Self::Mask;
    /// `yes` where `mask` holds, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// Whether `mask` holds in any lane. Only for skipping work whose result every lane would discard. A type that
    /// records operations for code generation answers true.
    fn any(mask: Self::Mask) -> bool;
    /// Whether an iteration whose last change was `self` has not converged to `tolerance`. Derivatives converge one
    /// iteration later than the value: dual numbers always answer true.
    #[inline(always)]
    fn still_changes(self, tolerance: Self) -> Self::Mask {
        tolerance.lt(self)
    }

    /// `self * factor + term` with a single rounding (fused multiply-add).
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// Square root; NaN for negative numbers. Its derivatives at zero are not finite.
    fn sqrt(self) -> Self;
    /// Natural exponential. Beyond ±708 in double precision it stays near 2^±1022 instead of overflowing.
    fn exp(self) -> Self;
    /// Natural logarithm of a positive number; NaN for zero and negative numbers.
    fn ln(self) -> Self;
    /// Hyperbolic tangent, −1 to 1.
    fn tanh(self) -> Self;
    /// Sine and cosine of an angle \[rad\] of at most 1e4 rad in magnitude; larger ones lose accuracy.
    fn sin_cos(self) -> (Self, Self);

    /// Zero.
    #[inline(always)]
    fn zero() -> Self {
        Self::lit(0.0)
    }
    /// One.
    #[inline(always)]
    fn one() -> Self {
        Self::lit(1.0)
    }
    /// Magnitude.
    #[inline(always)]
    fn abs(self) -> Self {
        Self::select(self.lt(Self::zero()), -self, self)
    }
    /// `self * self`.
    #[inline(always)]
    fn square(self) -> Self {
        self * self
    }
    /// The smaller of two numbers; NaN if `self` is NaN, and `self` if `other` is NaN.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::select(other.lt(self), other, self)
    }
    /// The larger of two numbers; NaN if `self` is NaN, and `self` if `other` is NaN.
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(self.lt(other), other, self)
    }
    /// `self` limited to `low..=high`; NaN if `self` is NaN. A limit that is NaN has no effect, and `high` counts if
    /// the limits cross.
    #[inline(always)]
    fn clamp(self, low: Self, high: Self) -> Self {
        self.max(low).min(high)
    }
    /// `self^exponent` for positive `self`, computed as `exp(exponent ln(self))`; NaN for zero and negative `self`.
    #[inline(always)]
    fn powf(self, exponent: Self) -> Self {
        (exponent * self.ln()).exp()
    }
    /// Linear interpolation in a table of equidistant entries at index `place`. Beyond either end the result is the
    /// entry at that end; an empty table gives zero. NaN if `place` is NaN.
    ///
    /// The entries must be finite. Here each is weighted by its hat function, `max(0, 1 − |place − k|)`. Plain
    /// floating point reads only the two entries with a weight other than zero, with the same result.
    fn interpolate(table: &[Self], place: Self) -> Self {
        let last = Self::lit(table.len().saturating_sub(1) as f64);
        let place = place.clamp(Self::zero(), last);
        table.iter().enumerate().fold(Self::zero(), |sum, (k, entry)| {
            let weight = (Self::one() - (place - Self::lit(k as f64)).abs()).max(Self::zero());
            entry.mul_add(weight, sum)
        })
    }
    /// A loop over `rows` with loop-carried values. `body` receives the index, the row and the carried values, and
    /// returns the next carried values and an output row. The result is the last carried values and all output rows.
    ///
    /// Plain numbers, lanes and dual numbers execute the loop. A type that records operations for code generation
    /// records `body` once: all that differs between rows must come from the index, the row or the carried values.
    #[inline(always)]
    fn repeat<const R: usize, const N: usize, const W: usize, const K: usize>(
        rows: &[[Self; R]; K],
        mut carried: [Self; N],
        mut body: impl FnMut(Self, &[Self; R], [Self; N]) -> ([Self; N], [Self; W]),
    ) -> ([Self; N], [[Self; W]; K]) {
        let mut made = [[Self::zero(); W]; K];
        for (k, (row, made)) in rows.iter().zip(&mut made).enumerate() {
            (carried, *made) = body(Self::lit(k as f64), row, carried);
        }
        (carried, made)
    }
    /// Like `repeat`, but executed only if `mask` holds in any lane. Otherwise the carried values are returned
    /// unchanged and the output rows are zero.
    #[inline(always)]
    fn repeat_where<const R: usize, const N: usize, const W: usize, const K: usize>(
        mask: Self::Mask,
        rows: &[[Self; R]; K],
        carried: [Self; N],
        body: impl FnMut(Self, &[Self; R], [Self; N]) -> ([Self; N], [Self; W]),
    ) -> ([Self; N], [[Self; W]; K]) {
        match Self::any(mask) {
            true => Self::repeat(rows, carried, body),
            false => (carried, [[Self::zero(); W]; K]),
        }
    }
    /// Whether the number is neither infinite nor NaN.
    #[inline(always)]
    #[expect(clippy::eq_op, reason = "the difference is zero for finite numbers only")]
    fn is_finite(self) -> Self::Mask {
        // NaN and infinities give NaN, for which the comparison is false
        (self - self).lt(Self::one())
    }
}
