//! Number type that counts its operations.
//!
//! Its values are bit-identical to `f64`. Each operation of the trait counts as it is written. `min` is a
//! comparison and a selection; `abs` is a comparison, a selection and a negation; an elementary function is
//! one operation. Constants, copies and logic on conditions are not counted.
//!
//! An interpolation counts as two reads and a multiply-add, the cost on a processor that has the table
//! index. The further operations of `f64`, which limit the index and weight both entries, are counted
//! separately.
//! the place and to weight both entries, is kept apart.

use hydroboom_math::Real;
use std::cell::Cell;
use std::fmt;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Kinds of operations.
#[derive(Clone, Copy, Debug)]
pub enum Operation {
    /// Addition or subtraction.
    Add,
    Multiply,
    MultiplyAdd,
    Divide,
    Root,
    Tanh,
    /// Exponential or logarithm, or sine and cosine together.
    Exponential,
    Compare,
    Select,
    Negate,
    /// Read of a table entry for an interpolation.
    Read,
}

/// Names of the kinds, in their order.
pub const KINDS: [&str; 11] =
    ["+ -", "*", "fma", "/", "sqrt", "tanh", "exp ln", "compare", "select", "negate", "read"];

/// Counts of operations.
#[derive(Clone, Copy, Debug, Default)]
pub struct Operations {
    /// Count of each kind.
    pub kinds: [u64; KINDS.len()],
    /// Operations of `f64` in interpolations other than two reads and a multiply-add.
    pub weighting: u64,
}

impl Operations {
    /// Sum over all kinds.
    pub fn sum(&self) -> u64 {
        self.kinds.iter().sum()
    }

    /// Count of one kind.
    pub fn of(&self, kind: Operation) -> u64 {
        self.kinds[kind as usize]
    }

    fn zip(self, other: Self, f: impl Fn(u64, u64) -> u64) -> Self {
        Self {
            kinds: std::array::from_fn(|i| f(self.kinds[i], other.kinds[i])),
            weighting: f(self.weighting, other.weighting),
        }
    }
}

impl Add for Operations {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Operations {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

thread_local! {
    static KINDS_SO_FAR: [Cell<u64>; KINDS.len()] = const { [const { Cell::new(0) }; KINDS.len()] };
    static WEIGHTING_SO_FAR: Cell<u64> = const { Cell::new(0) };
}

fn count(kind: Operation) {
    KINDS_SO_FAR.with(|kinds| kinds[kind as usize].update(|number| number + 1));
}

fn so_far() -> Operations {
    Operations {
        kinds: KINDS_SO_FAR.with(|kinds| kinds.each_ref().map(Cell::get)),
        weighting: WEIGHTING_SO_FAR.get(),
    }
}

/// Result of `work`, and the operations that it took.
pub fn operations<R>(work: impl FnOnce() -> R) -> (R, Operations) {
    let before = so_far();
    let result = work();
    (result, so_far() - before)
}

/// Counted number.
#[derive(Clone, Copy)]
pub struct Counted(pub f64);

impl fmt::Debug for Counted {
    /// Formatted as `f64`, so that whole states can be compared.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl Add for Counted {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        count(Operation::Add);
        Self(self.0 + other.0)
    }
}

impl Sub for Counted {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        count(Operation::Add);
        Self(self.0 - other.0)
    }
}

impl Mul for Counted {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        count(Operation::Multiply);
        Self(self.0 * other.0)
    }
}

impl Div for Counted {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        count(Operation::Divide);
        Self(self.0 / other.0)
    }
}

impl Neg for Counted {
    type Output = Self;
    fn neg(self) -> Self {
        count(Operation::Negate);
        Self(-self.0)
    }
}

impl Real for Counted {
    type Mask = bool;

    fn lit(value: f64) -> Self {
        Self(value)
    }
    fn lt(self, other: Self) -> bool {
        count(Operation::Compare);
        self.0 < other.0
    }
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        count(Operation::Select);
        if mask { yes } else { no }
    }
    fn any(mask: bool) -> bool {
        mask
    }
    fn mul_add(self, factor: Self, term: Self) -> Self {
        count(Operation::MultiplyAdd);
        Self(Real::mul_add(self.0, factor.0, term.0))
    }
    fn sqrt(self) -> Self {
        count(Operation::Root);
        Self(Real::sqrt(self.0))
    }
    fn exp(self) -> Self {
        count(Operation::Exponential);
        Self(Real::exp(self.0))
    }
    fn ln(self) -> Self {
        count(Operation::Exponential);
        Self(Real::ln(self.0))
    }
    fn tanh(self) -> Self {
        count(Operation::Tanh);
        Self(Real::tanh(self.0))
    }
    fn sin_cos(self) -> (Self, Self) {
        count(Operation::Exponential);
        let (sin, cos) = Real::sin_cos(self.0);
        (Self(sin), Self(cos))
    }

    /// The same steps as for `f64`.
    fn interpolate(table: &[Self], place: Self) -> Self {
        let before = so_far();
        let (zero, one) = (Self::zero(), Self::one());
        let last = table.len().saturating_sub(1);
        let place = place.clamp(zero, Self(last as f64));
        let first = (place.0 as usize).min(last.saturating_sub(1));
        let entry = |k: usize| table.get(k).copied().unwrap_or(zero);
        let weight = |k: usize| (one - (place - Self(k as f64)).abs()).max(zero);
        let sum = entry(first).mul_add(weight(first), zero);
        let value = match last {
            0 => sum,
            _ => entry(first + 1).mul_add(weight(first + 1), sum),
        };
        // one of the multiply-adds is counted as such, all other operations separately
        let all = (so_far() - before).sum();
        KINDS_SO_FAR.with(|kinds| kinds.iter().zip(before.kinds).for_each(|(k, n)| k.set(n)));
        for kind in [Operation::Read, Operation::Read, Operation::MultiplyAdd] {
            count(kind);
        }
        WEIGHTING_SO_FAR.set(before.weighting + all - 1);
        value
    }
}
