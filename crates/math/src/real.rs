//! The scalar trait.

use core::fmt::Debug;
use core::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// A number the model can be evaluated with.
///
/// Model code uses what is named here and nothing else: no `if` on a number, no `==`, no way back
/// to `f64`. A choice is written with [`select`](Real::select); both of its arms are evaluated, so
/// each must stay finite over the whole domain. (`a < b` does not compile in model code. The
/// compiler then suggests a `PartialOrd` bound; write `a.lt(b)` instead.)
///
/// NaN passes through every function, the provided `min`, `max` and `clamp` of `self` included.
pub trait Real:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The answer to a comparison: a truth value, one per lane, or a recorded condition.
    type Mask: Copy
        + Debug
        + BitAnd<Output = Self::Mask>
        + BitOr<Output = Self::Mask>
        + Not<Output = Self::Mask>;

    /// The constant `value`.
    fn lit(value: f64) -> Self;

    /// Whether `self < other`; false where either is NaN.
    fn lt(self, other: Self) -> Self::Mask;
    /// `yes` where `mask` holds, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// Whether `mask` holds in any lane. For leaving out work that every lane would discard, and for
    /// nothing else: a number that records what is done to it answers yes.
    fn any(mask: Self::Mask) -> bool;
    /// Whether an iteration whose last change was `self` has to go on. Derivatives settle an
    /// iteration later than their value: numbers that carry some always go on.
    #[inline(always)]
    fn still_changes(self, tolerance: Self) -> Self::Mask {
        tolerance.lt(self)
    }

    /// `self * factor + term`, rounded once: one instruction, and one rounding, in place of two.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Natural exponential.
    fn exp(self) -> Self;
    /// Natural logarithm of a positive number.
    fn ln(self) -> Self;
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Sine and cosine of an angle \[rad\].
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
    /// The smaller of two numbers; NaN if `self` is.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::select(other.lt(self), other, self)
    }
    /// The larger of two numbers; NaN if `self` is.
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(self.lt(other), other, self)
    }
    /// `self` limited to `low..=high`; NaN if `self` is.
    #[inline(always)]
    fn clamp(self, low: Self, high: Self) -> Self {
        self.max(low).min(high)
    }
    /// A positive number to any power.
    #[inline(always)]
    fn powf(self, exponent: Self) -> Self {
        (exponent * self.ln()).exp()
    }
    /// Linear interpolation in a table of equidistant entries, `place` entries from the first; beyond either end, the entry at
    /// that end; zero in an empty table. NaN where `place` is.
    ///
    /// The entries must be finite. Here each is weighted by its hat function, `max(0, 1 − |place − k|)`; plain floating point
    /// reads the two entries whose weight is not zero, with the same result.
    fn interpolate(table: &[Self], place: Self) -> Self {
        let last = Self::lit(table.len().saturating_sub(1) as f64);
        let place = place.clamp(Self::zero(), last);
        table.iter().enumerate().fold(Self::zero(), |sum, (k, entry)| {
            let weight = (Self::one() - (place - Self::lit(k as f64)).abs()).max(Self::zero());
            entry.mul_add(weight, sum)
        })
    }
    /// `body` for each of `rows`, from the first to the last: shown the row's number, the row, and what the one before carried on,
    /// it gives what is carried on and a row of its own. Returned is what the last one carried on, and the rows that were made.
    ///
    /// Plain numbers, lanes and duals do just that. A number that records what is done to it records `body` once, as a loop: what
    /// differs from row to row has to come from the row, its number or what is carried.
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
    /// The same where `mask` holds in any lane. Elsewhere nothing is done: what is carried stays as it is, and the rows made are zero.
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
    /// Whether the number is finite.
    #[inline(always)]
    #[expect(clippy::eq_op, reason = "the difference is zero for finite numbers only")]
    fn is_finite(self) -> Self::Mask {
        // NaN and the infinities give NaN, which is not below anything
        (self - self).lt(Self::one())
    }
}
