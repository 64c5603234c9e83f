//! Number of operations of generated code.

use crate::graph::{Graph, Node, Op};

/// Number of floating-point operations by kind; an operation in a loop counts once for each row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Number of sums, differences and negations.
    pub sums: usize,
    /// Number of products of two numbers.
    pub products: usize,
    /// Number of fused multiply-adds.
    pub fused: usize,
    /// Number of divisions.
    pub quotients: usize,
    /// Number of square roots.
    pub roots: usize,
    /// Exponentials, logarithms, hyperbolic tangents; a sine and cosine count as one.
    pub functions: usize,
    /// Number of comparisons of two numbers.
    pub comparisons: usize,
    /// Selections of one of two numbers by a condition.
    pub choices: usize,
}

impl Count {
    /// Counts the operations of some nodes of a graph.
    ///
    /// ```
    /// use hydroboom_export::{Count, Expression, record};
    /// let (graph, _) = record(|| {
    ///     let x = Expression::input();
    ///     x * x + x
    /// });
    /// let nodes: Vec<_> = graph.nodes().collect();
    /// assert_eq!(Count::of(&graph, &nodes).flops(), 2);
    /// ```
    pub fn of(graph: &Graph, nodes: &[Node]) -> Self {
        let mut count = Self::default();
        for node in nodes {
            // a node in a loop counts once for each row
            let n = graph.repeats(*node);
            match graph.op(*node) {
                Op::Add(..) | Op::Sub(..) | Op::Neg(_) => count.sums += n,
                Op::Mul(..) => count.products += n,
                Op::MulAdd(..) => count.fused += n,
                Op::Div(..) => count.quotients += n,
                Op::Sqrt(_) => count.roots += n,
                Op::Exp(_) | Op::Ln(_) | Op::Tanh(_) | Op::SinCos(_) => count.functions += n,
                Op::Less(..) => count.comparisons += n,
                Op::Select(..) => count.choices += n,
                // two entries, each with its weight
                Op::Interpolate(..) => count.fused += 2 * n,
                _ => {}
            }
        }
        count
    }

    /// Floating-point operations \[flop\] by the usual convention: a fused multiply-add counts two, a function one.
    /// Comparisons and selections do not count.
    pub fn flops(&self) -> usize {
        self.sums + self.products + 2 * self.fused + self.quotients + self.roots + self.functions
    }
}
