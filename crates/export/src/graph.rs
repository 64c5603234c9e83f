//! Recorded operations as a directed acyclic graph: each operation once, operands before their results.

use hydroboom_math::Real;
use std::collections::HashMap;

/// Vertex of the graph: the number or condition that an operation gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Node(pub(crate) u32);

/// Operation of the graph, with its operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Op {
    /// A constant, by its bits.
    Constant(u64),
    /// An input, by its index.
    Input(u32),
    /// Sum.
    Add(Node, Node),
    /// Difference.
    Sub(Node, Node),
    /// Product.
    Mul(Node, Node),
    /// Quotient.
    Div(Node, Node),
    /// Negation.
    Neg(Node),
    /// Fused multiply-add `a b + c`, rounded once.
    MulAdd(Node, Node, Node),
    /// Square root.
    Sqrt(Node),
    /// Exponential.
    Exp(Node),
    /// Natural logarithm.
    Ln(Node),
    /// Hyperbolic tangent.
    Tanh(Node),
    /// Sine and cosine in one operation; its only uses are [`Op::Sin`] and [`Op::Cos`].
    SinCos(Node),
    /// Sine from an [`Op::SinCos`] node.
    Sin(Node),
    /// Cosine from an [`Op::SinCos`] node.
    Cos(Node),
    /// The second operand if the condition holds, else the third.
    Select(Node, Node, Node),
    /// Condition: the first is below the second.
    Less(Node, Node),
    /// Both conditions.
    And(Node, Node),
    /// At least one of the conditions.
    Or(Node, Node),
    /// Negation of a condition.
    Not(Node),
    /// A constant condition.
    Truth(bool),
    /// Two to the power of the integer in the last bits.
    PowerOfTwo(Node),
    /// Sine rotated by the quarter turns in the last bits of the first operand; second and third are sine and cosine.
    TurnedSine(Node, Node, Node),
    /// Cosine, rotated in the same way.
    TurnedCosine(Node, Node, Node),
    /// m of x = m 2^e, with m in √½ .. √2.
    Mantissa(Node),
    /// e of the same decomposition.
    Exponent(Node),
    /// A table of numbers, by its index.
    Table(u32),
    /// Linear interpolation in the table of the first operand at the index of the second.
    Interpolate(Node, Node),
    /// A loop over the rows of some tables, by its index.
    Loop(u32),
    /// In a loop (by its index): the index of the row.
    Row(u32),
    /// In a loop: the row's entry of the table with this index among those that the loop reads.
    Read(u32, u32),
    /// In a loop: value of a state after the previous row, by its index.
    Carry(u32, u32),
    /// After a loop: final value of a state, by its index.
    Carried(Node, u32),
    /// After a loop: an output, by row and column.
    Made(Node, u32, u32),
}

/// Loop over the rows of tables, with states that are carried from row to row.
#[derive(Clone, Debug)]
pub struct Repetition {
    /// Name of the Rust source file that it was recorded from, for the name of its function.
    pub origin: String,
    /// Number of rows, over which the loop runs.
    pub count: u32,
    /// Condition under which the loop is executed; none if it always is.
    pub condition: Option<Node>,
    /// Index of the enclosing loop; none for an outermost one.
    pub within: Option<u32>,
    /// Tables that the loop reads, each with `count` entries.
    pub read: Vec<Node>,
    /// Values of the carried states before the first row.
    pub begin: Vec<Node>,
    /// Values of the carried states after a row.
    pub next: Vec<Node>,
    /// Nodes of the outputs of a row.
    pub made: Vec<Node>,
}

impl Op {
    /// Operands, without those of tables and loops.
    fn operands(self) -> impl Iterator<Item = Node> {
        use Op::*;
        let [a, b, c] = match self {
            Constant(_) | Input(_) | Truth(_) | Table(_) | Loop(_) | Row(_) | Read(..)
            | Carry(..) => [None; 3],
            Neg(a)
            | Sqrt(a)
            | Exp(a)
            | Ln(a)
            | Tanh(a)
            | SinCos(a)
            | Sin(a)
            | Cos(a)
            | Not(a)
            | PowerOfTwo(a)
            | Mantissa(a)
            | Exponent(a)
            | Carried(a, _)
            | Made(a, ..) => [Some(a), None, None],
            Add(a, b)
            | Sub(a, b)
            | Mul(a, b)
            | Div(a, b)
            | Less(a, b)
            | And(a, b)
            | Or(a, b)
            | Interpolate(a, b) => [Some(a), Some(b), None],
            MulAdd(a, b, c) | Select(a, b, c) | TurnedSine(a, b, c) | TurnedCosine(a, b, c) => {
                [Some(a), Some(b), Some(c)]
            }
        };
        [a, b, c].into_iter().flatten()
    }

    /// Whether the result is a condition and not a number.
    pub fn is_condition(self) -> bool {
        matches!(self, Op::Less(..) | Op::And(..) | Op::Or(..) | Op::Not(_) | Op::Truth(_))
    }
}

/// Directed acyclic graph of recorded operations, in topological order.
///
/// Equal operations share a node. Operations on constants are evaluated by the functions that `f64` uses, and
/// operations without effect on any bit (a product with one) are removed. Operands of sums and products are sorted,
/// since their order has no effect. There are no other transformations, so that generated code rounds as the model
/// does.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    ops: Vec<Op>,
    known: HashMap<Op, Node>,
    inputs: u32,
    tables: Vec<Vec<Node>>,
    known_tables: HashMap<Vec<Node>, u32>,
    loops: Vec<Repetition>,
    /// The loop being recorded.
    open: Option<u32>,
    /// For each node the innermost loop on whose row it depends.
    scopes: Vec<Option<u32>>,
}

impl Graph {
    /// Operation of a node of this graph.
    pub fn op(&self, node: Node) -> Op {
        self.ops[node.0 as usize]
    }

    /// Nodes on which a node depends directly: its operands; in and after a loop, also the results of the loop's rows.
    pub fn operands(&self, node: Node) -> Vec<Node> {
        let carried = |of: &Repetition, k: u32| {
            let k = k as usize;
            [of.begin.get(k), of.next.get(k)].into_iter().flatten().copied().collect::<Vec<_>>()
        };
        match self.op(node) {
            Op::Table(number) => self.table(number).to_vec(),
            Op::Loop(number) => self.repetition(number).condition.into_iter().collect(),
            Op::Read(number, k) => vec![self.repetition(number).read[k as usize]],
            Op::Carry(number, k) => carried(self.repetition(number), k),
            Op::Carried(of, k) => {
                let mut all = carried(self.of_loop(of), k);
                all.push(of);
                all
            }
            Op::Made(of, _, k) => vec![of, self.of_loop(of).made[k as usize]],
            op => op.operands().collect(),
        }
    }

    /// The loop of a node of kind [`Op::Loop`].
    fn of_loop(&self, node: Node) -> &Repetition {
        let Op::Loop(number) = self.op(node) else {
            unreachable!("results of a loop refer to its node: only end_loop creates them")
        };
        self.repetition(number)
    }

    /// Entries of the table with this index.
    pub fn table(&self, number: u32) -> &[Node] {
        &self.tables[number as usize]
    }

    /// Loop with this index.
    pub fn repetition(&self, number: u32) -> &Repetition {
        &self.loops[number as usize]
    }

    /// Index of the innermost loop on whose row a node depends; none for a loop-invariant node.
    pub fn scope(&self, node: Node) -> Option<u32> {
        self.scopes[node.0 as usize]
    }

    /// Number of executions of a node in one evaluation: the product of the rows of all loops around it.
    pub fn repeats(&self, node: Node) -> usize {
        let mut count = 1;
        let mut scope = self.scope(node);
        while let Some(number) = scope {
            let of = self.repetition(number);
            count *= of.count as usize;
            scope = of.within;
        }
        count
    }

    /// Number of operations of a loop, over all rows.
    pub(crate) fn operations(&self, number: u32) -> usize {
        let outside = self.repetition(number).within;
        let outside =
            outside.and_then(|around| self.nodes().find(|n| self.op(*n) == Op::Row(around)));
        let outside = outside.map_or(1, |row| self.repeats(row));
        let is_inside = |node: &Node| {
            let mut scope = self.scope(*node);
            while scope.is_some_and(|of| of != number) {
                scope = scope.and_then(|of| self.repetition(of).within);
            }
            scope.is_some()
        };
        let is_read = |op| matches!(op, Op::Row(_) | Op::Read(..) | Op::Carry(..) | Op::Loop(_));
        let inside = self.nodes().filter(is_inside).filter(|node| !is_read(self.op(*node)));
        inside.map(|node| self.repeats(node) / outside).sum()
    }

    /// Nesting depth of a loop.
    fn depth(&self, scope: Option<u32>) -> usize {
        scope.map_or(0, |number| 1 + self.depth(self.repetition(number).within))
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.ops.len()
    }

    /// Whether the graph has no nodes.
    pub fn is_empty(&self) -> bool {
        self.ops.is_empty()
    }

    /// All nodes in topological order.
    pub fn nodes(&self) -> impl DoubleEndedIterator<Item = Node> + use<> {
        (0..self.ops.len() as u32).map(Node)
    }

    /// Value of a constant; none for any other node.
    pub fn constant(&self, node: Node) -> Option<f64> {
        match self.op(node) {
            Op::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// Adds an input.
    pub(crate) fn input(&mut self) -> Node {
        self.inputs += 1;
        self.added(Op::Input(self.inputs - 1))
    }

    /// Adds an operation after simplification.
    pub(crate) fn push(&mut self, op: Op) -> Node {
        let op = self.ordered(op);
        match self.simpler(op) {
            Some(Simpler::Node(node)) => node,
            Some(Simpler::Number(value)) => self.added(Op::Constant(value.to_bits())),
            Some(Simpler::Truth(holds)) => self.added(Op::Truth(holds)),
            None => self.added(op),
        }
    }

    /// Adds a table of numbers.
    pub(crate) fn tabled(&mut self, entries: Vec<Node>) -> Node {
        let number = match self.known_tables.get(&entries) {
            Some(number) => *number,
            None => {
                let number = self.tables.len() as u32;
                self.tables.push(entries.clone());
                self.known_tables.insert(entries, number);
                number
            }
        };
        self.added(Op::Table(number))
    }

    /// Begins a loop; returns its index, the row index, the row's table entries and the states.
    ///
    /// A column with equal numbers is replaced by that number.
    pub(crate) fn begin_loop(
        &mut self,
        origin: String,
        count: u32,
        condition: Option<Node>,
        columns: Vec<Vec<Node>>,
        begin: Vec<Node>,
    ) -> (u32, Node, Vec<Node>, Vec<Node>) {
        let number = self.loops.len() as u32;
        let carried = begin.len() as u32;
        let within = self.open.replace(number);
        let (next, made, read) = (Vec::new(), Vec::new(), Vec::new());
        self.loops.push(Repetition { origin, count, condition, within, read, begin, next, made });
        let row = self.added(Op::Row(number));
        let mut entries = Vec::new();
        for column in columns {
            entries.push(match column.as_slice() {
                [first, rest @ ..] if rest.iter().all(|entry| entry == first) => *first,
                _ => {
                    let table = self.tabled(column);
                    let read = &mut self.loops[number as usize].read;
                    read.push(table);
                    let place = read.len() as u32 - 1;
                    self.added(Op::Read(number, place))
                }
            });
        }
        let carried = (0..carried).map(|k| self.added(Op::Carry(number, k))).collect();
        (number, row, entries, carried)
    }

    /// Ends the loop; returns the final states and all output rows.
    pub(crate) fn end_loop(
        &mut self,
        number: u32,
        next: Vec<Node>,
        made: Vec<Node>,
    ) -> (Vec<Node>, Vec<Vec<Node>>) {
        let (carried, width) = (next.len() as u32, made.len() as u32);
        let of = &mut self.loops[number as usize];
        (of.next, of.made) = (next, made);
        let count = of.count;
        self.open = of.within;
        let node = self.added(Op::Loop(number));
        let carried = (0..carried).map(|k| self.added(Op::Carried(node, k))).collect();
        let row = |graph: &mut Self, row| {
            (0..width).map(|k| graph.added(Op::Made(node, row, k))).collect()
        };
        let made = (0..count).map(|k| row(self, k)).collect();
        (carried, made)
    }

    /// The innermost loop on whose row an operation depends.
    fn scope_of(&self, node: Node) -> Option<u32> {
        match self.op(node) {
            Op::Row(number) | Op::Read(number, _) | Op::Carry(number, _) => Some(number),
            Op::Loop(number) => self.repetition(number).within,
            Op::Carried(of, _) | Op::Made(of, ..) => self.scope(of),
            _ => {
                let scopes = self.operands(node).into_iter().map(|operand| self.scope(operand));
                scopes.max_by_key(|scope| self.depth(*scope)).flatten()
            }
        }
    }

    fn added(&mut self, op: Op) -> Node {
        if let Some(node) = self.known.get(&op) {
            return *node;
        }
        let node = Node(self.ops.len() as u32);
        self.ops.push(op);
        self.scopes.push(None);
        self.scopes[node.0 as usize] = self.scope_of(node);
        self.known.insert(op, node);
        node
    }

    /// Sorts the operands of commutative operations.
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

    /// Simplification of an operation, if there is one.
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

/// Result of a simplification.
enum Simpler {
    Node(Node),
    Number(f64),
    Truth(bool),
}
