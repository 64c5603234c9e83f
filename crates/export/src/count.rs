//! What a piece of generated code costs.

use crate::graph::{Graph, Node, Op};

/// Operations, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Sums, differences, negatives.
    pub sums: usize,
    /// Products.
    pub products: usize,
    /// Products and sums that are rounded once.
    pub fused: usize,
    /// Quotients.
    pub quotients: usize,
    /// Square roots.
    pub roots: usize,
    /// Exponentials, logarithms, hyperbolic tangents; a sine and cosine count as one.
    pub functions: usize,
    /// Comparisons.
    pub comparisons: usize,
    /// Choices between two numbers.
    pub choices: usize,
}

impl Count {
    /// Of some nodes of a graph.
    pub fn of(graph: &Graph, nodes: &[Node]) -> Self {
        let mut count = Self::default();
        for node in nodes {
            // in a loop, for each of its rows
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

    /// Floating-point operations as they are usually counted: a fused one is two, a function one.
    pub fn flops(&self) -> usize {
        self.sums + self.products + 2 * self.fused + self.quotients + self.roots + self.functions
    }
}
