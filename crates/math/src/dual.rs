//! Dual numbers: forward-mode automatic differentiation.

use crate::Real;
use core::array::from_fn;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// Dual number for forward-mode automatic differentiation: a value with its exact derivatives along `N` directions.
///
/// The inner number is itself any [`Real`]: `Dual<f64, 4>` differentiates one run, `Dual<Lanes<8>, 4>` eight runs at
/// once. At a kink the derivative is that of the branch taken.
#[derive(Clone, Copy, Debug)]
pub struct Dual<T, const N: usize> {
    /// Value.
    pub value: T,
    /// Derivative of the value along each direction.
    pub slope: [T; N],
}

impl<T: Real, const N: usize> Dual<T, N> {
    /// A constant: all derivatives are zero.
    #[inline(always)]
    pub fn constant(value: T) -> Self {
        Self { value, slope: [T::zero(); N] }
    }

    /// An independent variable at `value`, with derivative one in `direction` (0 to N − 1). Any other direction gives
    /// a constant.
    #[inline(always)]
    pub fn variable(value: T, direction: usize) -> Self {
        Self { value, slope: from_fn(|i| if i == direction { T::one() } else { T::zero() }) }
    }

    /// The chain rule: a function of `self` with the given value and slope.
    #[inline(always)]
    fn chain(self, value: T, slope: T) -> Self {
        Self { value, slope: from_fn(|i| self.slope[i] * slope) }
    }

    #[inline(always)]
    fn zip(self, other: Self, value: T, slope: impl Fn(T, T) -> T) -> Self {
        Self { value, slope: from_fn(|i| slope(self.slope[i], other.slope[i])) }
    }
}

impl<T: Real, const N: usize> Add for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self.zip(b, self.value + b.value, |da, db| da + db)
    }
}

impl<T: Real, const N: usize> Sub for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self.zip(b, self.value - b.value, |da, db| da - db)
    }
}

impl<T: Real, const N: usize> Mul for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        self.zip(b, self.value * b.value, |da, db| da.mul_add(b.value, self.value * db))
    }
}

impl<T: Real, const N: usize> Div for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        let inverse = T::one() / b.value;
        // the value by division, so that it equals the inner number's own quotient
        let quotient = self.value / b.value;
        self.zip(b, quotient, |da, db| (-quotient).mul_add(db, da) * inverse)
    }
}

impl<T: Real, const N: usize> Neg for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, slope: from_fn(|i| -self.slope[i]) }
    }
}

impl<T: Real, const N: usize> Real for Dual<T, N> {
    type Mask = T::Mask;

    #[inline(always)]
    fn lit(value: f64) -> Self {
        Self::constant(T::lit(value))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        self.value.lt(other.value)
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        yes.zip(no, T::select(mask, yes.value, no.value), |y, n| T::select(mask, y, n))
    }
    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        T::any(mask)
    }
    #[inline(always)]
    fn still_changes(self, _: Self) -> Self::Mask {
        T::zero().lt(T::one())
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        let slope = |i: usize| {
            let rest = self.value.mul_add(factor.slope[i], term.slope[i]);
            self.slope[i].mul_add(factor.value, rest)
        };
        Self { value: self.value.mul_add(factor.value, term.value), slope: from_fn(slope) }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, T::lit(0.5) / root)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let power = self.value.exp();
        self.chain(power, power)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        self.chain(self.value.ln(), T::one() / self.value)
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        let t = self.value.tanh();
        self.chain(t, T::one() - t.square())
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (self.chain(sin, cos), self.chain(cos, -sin))
    }
}
