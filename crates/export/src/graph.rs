//! What was recorded: operations, each once, operands before what is made of them.

use hydroboom_math::Real;
use std::collections::HashMap;

/// A number or condition of a graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Node(pub(crate) u32);

/// An operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Op {
    /// A constant, by its bits.
    Constant(u64),
    /// What comes from outside, counted.
    Input(u32),
    /// Sum.
    Add(Node, Node),
    /// Difference.
    Sub(Node, Node),
    /// Product.
    Mul(Node, Node),
    /// Quotient.
    Div(Node, Node),
    /// Negative.
    Neg(Node),
    /// `a b + c`, rounded once.
    MulAdd(Node, Node, Node),
    /// Square root.
    Sqrt(Node),
    /// Exponential.
    Exp(Node),
    /// Natural logarithm.
    Ln(Node),
    /// Hyperbolic tangent.
    Tanh(Node),
    /// Sine and cosine together; used by the two below only.
    SinCos(Node),
    /// The sine of a pair.
    Sin(Node),
    /// The cosine of a pair.
    Cos(Node),
    /// The second where the condition holds, the third elsewhere.
    Select(Node, Node, Node),
    /// Condition: the first is below the second.
    Less(Node, Node),
    /// Both conditions.
    And(Node, Node),
    /// One of the conditions at least.
    Or(Node, Node),
    /// Not the condition.
    Not(Node),
    /// A condition that is known.
    Truth(bool),
    /// Two to the power of the integer in the last bits.
    PowerOfTwo(Node),
    /// Sine of a sine and cosine (second and third) turned by the quarters in the last bits of the first.
    TurnedSine(Node, Node, Node),
    /// Cosine of the same.
    TurnedCosine(Node, Node, Node),
    /// m of x = m 2^e, m in √½ .. √2.
    Mantissa(Node),
    /// e of the same.
    Exponent(Node),
}

impl Op {
    /// What it is made of.
    pub fn operands(self) -> impl Iterator<Item = Node> {
        use Op::*;
        let [a, b, c] = match self {
            Constant(_) | Input(_) | Truth(_) => [None; 3],
            Neg(a) | Sqrt(a) | Exp(a) | Ln(a) | Tanh(a) | SinCos(a) | Sin(a) | Cos(a) | Not(a)
            | PowerOfTwo(a) | Mantissa(a) | Exponent(a) => [Some(a), None, None],
            Add(a, b) | Sub(a, b) | Mul(a, b) | Div(a, b) | Less(a, b) | And(a, b) | Or(a, b) => {
                [Some(a), Some(b), None]
            }
            MulAdd(a, b, c) | Select(a, b, c) | TurnedSine(a, b, c) | TurnedCosine(a, b, c) => {
                [Some(a), Some(b), Some(c)]
            }
        };
        [a, b, c].into_iter().flatten()
    }

    /// Whether it is a condition and not a number.
    pub fn is_condition(self) -> bool {
        matches!(self, Op::Less(..) | Op::And(..) | Op::Or(..) | Op::Not(_) | Op::Truth(_))
    }
}

/// Operations in an order in which they can be done.
///
/// Equal operations are one node; what is made of constants is a constant, by the very functions that `f64` runs with; what
/// changes no bit (a product with one, say) is left out. Sums and products do not depend on the order of their operands,
/// so that is made one. Nothing is rearranged beyond that: what is generated rounds as the model does.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    ops: Vec<Op>,
    known: HashMap<Op, Node>,
    inputs: u32,
}

impl Graph {
    /// The operation of a node.
    pub fn op(&self, node: Node) -> Op {
        self.ops[node.0 as usize]
    }

    /// How many nodes there are.
    pub fn len(&self) -> usize {
        self.ops.len()
    }

    /// Whether nothing was recorded.
    pub fn is_empty(&self) -> bool {
        self.ops.is_empty()
    }

    /// All nodes, operands first.
    pub fn nodes(&self) -> impl DoubleEndedIterator<Item = Node> + use<> {
        (0..self.ops.len() as u32).map(Node)
    }

    /// The value of a constant.
    pub fn constant(&self, node: Node) -> Option<f64> {
        match self.op(node) {
            Op::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// A number from outside.
    pub(crate) fn input(&mut self) -> Node {
        self.inputs += 1;
        self.added(Op::Input(self.inputs - 1))
    }

    /// An operation, made as simple as it is.
    pub(crate) fn push(&mut self, op: Op) -> Node {
        let op = self.ordered(op);
        match self.simpler(op) {
            Some(Simpler::Node(node)) => node,
            Some(Simpler::Number(value)) => self.added(Op::Constant(value.to_bits())),
            Some(Simpler::Truth(holds)) => self.added(Op::Truth(holds)),
            None => self.added(op),
        }
    }

    fn added(&mut self, op: Op) -> Node {
        if let Some(node) = self.known.get(&op) {
            return *node;
        }
        let node = Node(self.ops.len() as u32);
        self.ops.push(op);
        self.known.insert(op, node);
        node
    }

    /// Operands whose order does not count, in one.
    fn ordered(&self, op: Op) -> Op {
        match op {
            Op::Add(a, b) if b < a => Op::Add(b, a),
            Op::Mul(a, b) if b < a => Op::Mul(b, a),
            Op::MulAdd(a, b, c) if b < a => Op::MulAdd(b, a, c),
            Op::And(a, b) if b < a => Op::And(b, a),
            Op::Or(a, b) if b < a => Op::Or(b, a),
            op => op,
        }
    }

    fn truth(&self, node: Node) -> Option<bool> {
        match self.op(node) {
            Op::Truth(holds) => Some(holds),
            _ => None,
        }
    }

    /// What an operation comes to without being done.
    fn simpler(&self, op: Op) -> Option<Simpler> {
        let of = |node: Node| self.constant(node);
        let is = |node: Node, value: f64| of(node).is_some_and(|v| v.to_bits() == value.to_bits());
        let number = |v: f64| Some(Simpler::Number(v));
        match op {
            Op::Add(a, b) => number(of(a)? + of(b)?),
            Op::Sub(a, b) if is(b, 0.0) => Some(Simpler::Node(a)),
            Op::Sub(a, b) => number(of(a)? - of(b)?),
            Op::Mul(a, b) if is(a, 1.0) => Some(Simpler::Node(b)),
            Op::Mul(a, b) if is(b, 1.0) => Some(Simpler::Node(a)),
            Op::Mul(a, b) => number(of(a)? * of(b)?),
            Op::Div(a, b) if is(b, 1.0) => Some(Simpler::Node(a)),
            Op::Div(a, b) => number(of(a)? / of(b)?),
            Op::Neg(a) => match self.op(a) {
                Op::Neg(inner) => Some(Simpler::Node(inner)),
                _ => number(-of(a)?),
            },
            Op::MulAdd(a, b, c) => number(of(a)?.mul_add(of(b)?, of(c)?)),
            Op::Sqrt(a) => number(Real::sqrt(of(a)?)),
            Op::Exp(a) => number(Real::exp(of(a)?)),
            Op::Ln(a) => number(Real::ln(of(a)?)),
            Op::Tanh(a) => number(Real::tanh(of(a)?)),
            Op::Sin(pair) | Op::Cos(pair) => {
                let Op::SinCos(angle) = self.op(pair) else { return None };
                let (sin, cos) = Real::sin_cos(of(angle)?);
                number(if matches!(op, Op::Sin(_)) { sin } else { cos })
            }
            Op::Select(_, a, b) if a == b => Some(Simpler::Node(a)),
            Op::Select(mask, a, b) => {
                self.truth(mask).map(|holds| Simpler::Node(if holds { a } else { b }))
            }
            Op::Less(a, b) => Some(Simpler::Truth(of(a)? < of(b)?)),
            Op::And(a, b) => match (self.truth(a), self.truth(b)) {
                (Some(false), _) | (_, Some(false)) => Some(Simpler::Truth(false)),
                (Some(true), _) => Some(Simpler::Node(b)),
                (_, Some(true)) => Some(Simpler::Node(a)),
                _ => None,
            },
            Op::Or(a, b) => match (self.truth(a), self.truth(b)) {
                (Some(true), _) | (_, Some(true)) => Some(Simpler::Truth(true)),
                (Some(false), _) => Some(Simpler::Node(b)),
                (_, Some(false)) => Some(Simpler::Node(a)),
                _ => None,
            },
            Op::Not(a) => match self.op(a) {
                Op::Not(inner) => Some(Simpler::Node(inner)),
                _ => self.truth(a).map(|holds| Simpler::Truth(!holds)),
            },
            _ => None,
        }
    }
}

/// What an operation came to.
enum Simpler {
    Node(Node),
    Number(f64),
    Truth(bool),
}
