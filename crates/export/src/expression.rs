//! Expression: number type that records the operations on it in a graph.

use crate::graph::{Graph, Node, Op};
use crate::name::plain;
use hydroboom_math::Real;
use hydroboom_math::elementary::Binary;
use std::array::from_fn;
use std::cell::RefCell;
use std::ffi::OsStr;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};
use std::panic::Location;
use std::path::Path;

thread_local! {
    /// Graph recorded by this thread; it is not part of the numbers, which are small and copied freely.
    static GRAPH: RefCell<Graph> = RefCell::default();
}

fn push(op: Op) -> Node {
    GRAPH.with_borrow_mut(|graph| graph.push(op))
}

/// Number whose operations are recorded in a graph; valid only within its [`record`].
#[derive(Clone, Copy, Debug)]
pub struct Expression(pub(crate) Node);

/// Condition, as the comparison of two expressions, recorded in a graph.
#[derive(Clone, Copy, Debug)]
pub struct Condition(Node);

impl Expression {
    /// New input of the graph that is being recorded.
    pub fn input() -> Self {
        Self(GRAPH.with_borrow_mut(Graph::input))
    }

    /// Node of the number in the recorded graph.
    pub fn node(self) -> Node {
        self.0
    }
}

/// Records the operations of `work` on [`Expression`]s; returns the graph and the result of `work`.
pub fn record<R>(work: impl FnOnce() -> R) -> (Graph, R) {
    let before = GRAPH.take();
    let result = work();
    (GRAPH.replace(before), result)
}

macro_rules! binary {
    ($Number:ident, $Trait:ident, $name:ident, $Op:ident) => {
        impl $Trait for $Number {
            type Output = Self;
            fn $name(self, other: Self) -> Self {
                Self(push(Op::$Op(self.0, other.0)))
            }
        }
    };
}
binary!(Expression, Add, add, Add);
binary!(Expression, Sub, sub, Sub);
binary!(Expression, Mul, mul, Mul);
binary!(Expression, Div, div, Div);
binary!(Condition, BitAnd, bitand, And);
binary!(Condition, BitOr, bitor, Or);

impl Neg for Expression {
    type Output = Self;
    fn neg(self) -> Self {
        Self(push(Op::Neg(self.0)))
    }
}

impl Not for Condition {
    type Output = Self;
    fn not(self) -> Self {
        Self(push(Op::Not(self.0)))
    }
}

impl Real for Expression {
    type Mask = Condition;

    fn lit(value: f64) -> Self {
        Self(push(Op::Constant(value.to_bits())))
    }
    fn lt(self, other: Self) -> Condition {
        Condition(push(Op::Less(self.0, other.0)))
    }
    fn select(mask: Condition, yes: Self, no: Self) -> Self {
        Self(push(Op::Select(mask.0, yes.0, no.0)))
    }
    /// Always true: generated code may take either branch.
    fn any(_: Condition) -> bool {
        true
    }
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(push(Op::MulAdd(self.0, factor.0, term.0)))
    }
    fn sqrt(self) -> Self {
        Self(push(Op::Sqrt(self.0)))
    }
    fn exp(self) -> Self {
        Self(push(Op::Exp(self.0)))
    }
    fn ln(self) -> Self {
        Self(push(Op::Ln(self.0)))
    }
    fn tanh(self) -> Self {
        Self(push(Op::Tanh(self.0)))
    }
    fn interpolate(table: &[Self], place: Self) -> Self {
        let entries = table.iter().map(|entry| entry.0).collect();
        let table = GRAPH.with_borrow_mut(|graph| graph.tabled(entries));
        Self(push(Op::Interpolate(table, place.0)))
    }
    #[track_caller]
    fn repeat<const R: usize, const N: usize, const W: usize, const K: usize>(
        rows: &[[Self; R]; K],
        carried: [Self; N],
        body: impl FnMut(Self, &[Self; R], [Self; N]) -> ([Self; N], [Self; W]),
    ) -> ([Self; N], [[Self; W]; K]) {
        repeated(Location::caller(), None, rows, carried, body)
    }
    #[track_caller]
    fn repeat_where<const R: usize, const N: usize, const W: usize, const K: usize>(
        mask: Condition,
        rows: &[[Self; R]; K],
        carried: [Self; N],
        body: impl FnMut(Self, &[Self; R], [Self; N]) -> ([Self; N], [Self; W]),
    ) -> ([Self; N], [[Self; W]; K]) {
        repeated(Location::caller(), Some(mask), rows, carried, body)
    }
    fn sin_cos(self) -> (Self, Self) {
        let pair = push(Op::SinCos(self.0));
        (Self(push(Op::Sin(pair))), Self(push(Op::Cos(pair))))
    }
}

/// Largest number of operations of a loop, over all its rows, up to which the loop is unrolled. Larger loops are
/// generated as loops.
pub const MAX_UNROLLED_OPERATIONS: usize = 100;

/// Name of the source file that a loop is recorded from, for naming its generated function.
fn origin(at: &Location<'_>) -> String {
    let path = Path::new(at.file());
    let file = path.file_stem();
    let folder = path.parent().and_then(Path::file_name);
    let name = if file.is_some_and(|file| file == "mod") { folder } else { file };
    plain(&name.map(OsStr::to_string_lossy).unwrap_or_default())
}

/// Records a loop, or unrolls a short one.
fn repeated<const R: usize, const N: usize, const W: usize, const K: usize>(
    at: &Location<'_>,
    mask: Option<Condition>,
    rows: &[[Expression; R]; K],
    carried: [Expression; N],
    mut body: impl FnMut(
        Expression,
        &[Expression; R],
        [Expression; N],
    ) -> ([Expression; N], [Expression; W]),
) -> ([Expression; N], [[Expression; W]; K]) {
    let columns = (0..R).map(|r| rows.iter().map(|row| row[r].0).collect()).collect();
    let begin = carried.map(|number| number.0).to_vec();
    let condition = mask.map(|mask| mask.0);
    let (number, row, read, carry) = GRAPH
        .with_borrow_mut(|graph| graph.begin_loop(origin(at), K as u32, condition, columns, begin));
    let (next, made) =
        body(Expression(row), &from_fn(|k| Expression(read[k])), from_fn(|k| Expression(carry[k])));
    let [next, made] = [&next[..], &made[..]].map(|of| of.iter().map(|n| n.0).collect());
    let (last, looped) = GRAPH.with_borrow_mut(|graph| graph.end_loop(number, next, made));
    if GRAPH.with_borrow(|graph| graph.operations(number)) <= MAX_UNROLLED_OPERATIONS {
        // no node refers to the loop any more, so that it is not printed
        return written_out(mask, rows, carried, body);
    }
    (from_fn(|k| Expression(last[k])), from_fn(|k| from_fn(|w| Expression(looped[k][w]))))
}

/// Records an unrolled loop.
fn written_out<const R: usize, const N: usize, const W: usize, const K: usize>(
    mask: Option<Condition>,
    rows: &[[Expression; R]; K],
    carried: [Expression; N],
    mut body: impl FnMut(
        Expression,
        &[Expression; R],
        [Expression; N],
    ) -> ([Expression; N], [Expression; W]),
) -> ([Expression; N], [[Expression; W]; K]) {
    let mut last = carried;
    let mut made = [[Expression::zero(); W]; K];
    for (k, (row, made)) in rows.iter().zip(&mut made).enumerate() {
        (last, *made) = body(Expression::lit(k as f64), row, last);
    }
    let Some(mask) = mask else { return (last, made) };
    let kept = from_fn(|k| Expression::select(mask, last[k], carried[k]));
    (kept, made.map(|row| row.map(|entry| Expression::select(mask, entry, Expression::zero()))))
}

/// Allows the elementary functions to be recorded with the operations that `f64` executes.
impl Binary for Expression {
    const LN_2: [f64; 2] = f64::LN_2;
    const FRAC_PI_2: [f64; 2] = f64::FRAC_PI_2;
    const ROUNDER: f64 = f64::ROUNDER;
    const LARGEST_EXPONENT: f64 = f64::LARGEST_EXPONENT;

    fn power_of_two(held: Self) -> Self {
        Self(push(Op::PowerOfTwo(held.0)))
    }
    fn turn(held: Self, sin: Self, cos: Self) -> (Self, Self) {
        let turned = |op: fn(Node, Node, Node) -> Op| Self(push(op(held.0, sin.0, cos.0)));
        (turned(Op::TurnedSine), turned(Op::TurnedCosine))
    }
    fn split(self) -> (Self, Self) {
        (Self(push(Op::Mantissa(self.0))), Self(push(Op::Exponent(self.0))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn common_subexpressions_are_merged_and_constants_folded() {
        let (graph, (a, b)) = record(|| {
            let (x, y) = (Expression::input(), Expression::input());
            let two = Expression::lit(1.0) + Expression::lit(1.0);
            (x * y + two, Expression::lit(2.0) + y * (x * Expression::one()))
        });
        assert_eq!(a.node(), b.node());
        // two inputs, the constants one and two, a product, a sum
        assert_eq!(graph.len(), 6, "{graph:?}");
    }

    #[test]
    fn operations_that_affect_rounding_are_not_folded() {
        let (graph, [plus, fused]) = record(|| {
            let x = Expression::input();
            // −0 + 0 is 0; a fused product rounds once
            [x + Expression::zero(), x.mul_add(Expression::lit(3.0), Expression::zero())]
        });
        assert!(matches!(graph.op(plus.node()), Op::Add(..)));
        assert!(matches!(graph.op(fused.node()), Op::MulAdd(..)));
    }

    #[test]
    fn a_nested_recording_does_not_change_the_outer_one() {
        let (outer, _) = record(|| {
            let x = Expression::input();
            let (inner, _) = record(|| Expression::input() + Expression::one());
            assert_eq!(inner.len(), 3);
            x * x
        });
        assert_eq!(outer.len(), 2);
    }
}
