//! Several runs of the model side by side, one per SIMD lane.
//!
//! A plain array: the compiler turns its loops into the vector instructions of the function they
//! are inlined into. Compiled inside a function with `#[target_feature(enable = "avx2")]`, the
//! same source uses AVX2; the choice can thus be made at run time, which a type bound to one
//! instruction set cannot.

use crate::{
    Real,
    elementary::{self, Binary},
};
use core::array::from_fn;
use core::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// `W` numbers, one per SIMD lane and simulated run; every operation acts lane by lane.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Lanes<const W: usize>(
    /// Number of each lane.
    pub [f64; W],
);

/// One truth value per lane: all bits set, or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C, align(64))]
pub struct LaneMask<const W: usize>([u64; W]);

impl<const W: usize> LaneMask<W> {
    /// Truth value of each lane.
    pub fn to_array(self) -> [bool; W] {
        self.0.map(|bits| bits != 0)
    }
}

impl<const W: usize> Lanes<W> {
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self(from_fn(|i| f(self.0[i])))
    }
}

macro_rules! operator {
    ($Op:ident, $op:ident) => {
        impl<const W: usize> $Op for Lanes<W> {
            type Output = Self;
            #[inline(always)]
            fn $op(self, b: Self) -> Self {
                Self(from_fn(|i| self.0[i].$op(b.0[i])))
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<const W: usize> Neg for Lanes<W> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}

impl<const W: usize> BitAnd for LaneMask<W> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, b: Self) -> Self {
        Self(from_fn(|i| self.0[i] & b.0[i]))
    }
}

impl<const W: usize> BitOr for LaneMask<W> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, b: Self) -> Self {
        Self(from_fn(|i| self.0[i] | b.0[i]))
    }
}

impl<const W: usize> Not for LaneMask<W> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(from_fn(|i| !self.0[i]))
    }
}

impl<const W: usize> Real for Lanes<W> {
    type Mask = LaneMask<W>;

    #[inline(always)]
    fn lit(value: f64) -> Self {
        Self([value; W])
    }
    #[inline(always)]
    fn lt(self, other: Self) -> LaneMask<W> {
        LaneMask(from_fn(|i| if self.0[i] < other.0[i] { u64::MAX } else { 0 }))
    }
    #[inline(always)]
    fn select(mask: LaneMask<W>, yes: Self, no: Self) -> Self {
        // by bit masks, so that no lane branches
        Self(from_fn(|i| {
            let m = mask.0[i];
            f64::from_bits((yes.0[i].to_bits() & m) | (no.0[i].to_bits() & !m))
        }))
    }
    #[inline(always)]
    fn any(mask: LaneMask<W>) -> bool {
        mask.0.iter().fold(0, |bits, lane| bits | lane) != 0
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(from_fn(|i| Real::mul_add(self.0[i], factor.0[i], term.0[i])))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(Real::sqrt)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        elementary::exp(self)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        elementary::ln(self)
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        elementary::tanh(self)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        elementary::sin_cos(self)
    }
}

impl<const W: usize> Binary for Lanes<W> {
    const LN_2: [f64; 2] = f64::LN_2;
    const FRAC_PI_2: [f64; 2] = f64::FRAC_PI_2;
    const ROUNDER: f64 = f64::ROUNDER;
    const LARGEST_EXPONENT: f64 = f64::LARGEST_EXPONENT;

    #[inline(always)]
    fn power_of_two(held: Self) -> Self {
        held.map(Binary::power_of_two)
    }
    #[inline(always)]
    fn turn(held: Self, sin: Self, cos: Self) -> (Self, Self) {
        // one array at a time: arrays of pairs would not be vectorised
        let turned = |i: usize| f64::turn(held.0[i], sin.0[i], cos.0[i]);
        (Self(from_fn(|i| turned(i).0)), Self(from_fn(|i| turned(i).1)))
    }
    #[inline(always)]
    fn split(self) -> (Self, Self) {
        let parts = self.0.map(Binary::split);
        (Self(parts.map(|(m, _)| m)), Self(parts.map(|(_, e)| e)))
    }
}
