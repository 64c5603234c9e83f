//! Loop bodies as functions: the operations of one row, the values from outside, and loops with equal bodies.

use crate::graph::{Graph, Node, Op};
use std::collections::{BTreeSet, HashMap};
use std::fmt::Write;
use std::mem::discriminant;

/// Results of each loop that are used.
#[derive(Debug, Default)]
pub(crate) struct Needed {
    /// Indices of the states in use, by loop.
    pub(crate) carried: HashMap<u32, BTreeSet<u32>>,
    /// Columns of the outputs in use, by loop.
    pub(crate) made: HashMap<u32, BTreeSet<u32>>,
}

impl Needed {
    fn of(graph: &Graph, order: &[Node]) -> Self {
        let mut needed = Self::default();
        let number = |of: Node| match graph.op(of) {
            Op::Loop(number) => Some(number),
            _ => None,
        };
        for node in order {
            match graph.op(*node) {
                Op::Carry(of, k) => {
                    needed.carried.entry(of).or_default().insert(k);
                }
                Op::Carried(of, k) => {
                    number(of).map(|of| needed.carried.entry(of).or_default().insert(k));
                }
                Op::Made(of, _, k) => {
                    number(of).map(|of| needed.made.entry(of).or_default().insert(k));
                }
                _ => {}
            }
        }
        needed
    }

    fn places(of: &HashMap<u32, BTreeSet<u32>>, number: u32) -> Vec<u32> {
        of.get(&number).into_iter().flatten().copied().collect()
    }

    /// States in use of a loop.
    pub(crate) fn carried(&self, number: u32) -> Vec<u32> {
        Self::places(&self.carried, number)
    }

    /// Outputs in use of a loop.
    pub(crate) fn made(&self, number: u32) -> Vec<u32> {
        Self::places(&self.made, number)
    }
}

/// Operations of a loop for one row.
#[derive(Clone, Debug, Default)]
struct Body {
    /// Text of the operations, independent of outside values and constants.
    form: String,
    /// Constants and outside values, in the order of use.
    outside: Vec<Node>,
}

impl Body {
    fn of(graph: &Graph, order: &[Node], needed: &Needed, number: u32) -> Self {
        let is_inside = |node: Node| {
            let mut scope = graph.scope(node);
            while scope.is_some_and(|of| of != number) {
                scope = scope.and_then(|of| graph.repetition(of).within);
            }
            scope.is_some()
        };
        let inside: Vec<Node> = order.iter().copied().filter(|node| is_inside(*node)).collect();
        let places: HashMap<Node, usize> =
            inside.iter().enumerate().map(|(k, n)| (*n, k)).collect();
        let mut loops: HashMap<u32, usize> = HashMap::new();
        let mut body = Self::default();
        for node in &inside {
            let op = graph.op(*node);
            let _ = write!(body.form, "\n{:?}", discriminant(&op));
            let mut of_loop = |of: u32| {
                let next = loops.len();
                *loops.entry(of).or_insert(next)
            };
            match op {
                Op::Row(of) => body.numbers([of_loop(of)]),
                Op::Read(of, k) if of == number => body.numbers([of_loop(of), k as usize]),
                Op::Read(of, k) => {
                    body.numbers([of_loop(of)]);
                    body.uses(graph, &places, graph.repetition(of).read[k as usize]);
                }
                Op::Carry(of, k) => body.numbers([of_loop(of), k as usize]),
                Op::Loop(of) => {
                    let inner = graph.repetition(of);
                    body.numbers([of_loop(of), inner.count as usize]);
                    let [carried, made] = [needed.carried(of), needed.made(of)];
                    body.numbers(carried.iter().chain(&made).map(|k| *k as usize));
                    let begin = carried.iter().map(|k| inner.begin[*k as usize]);
                    let next = carried.iter().map(|k| inner.next[*k as usize]);
                    let made = made.iter().map(|k| inner.made[*k as usize]);
                    for node in inner.condition.into_iter().chain(begin).chain(next).chain(made) {
                        body.uses(graph, &places, node);
                    }
                }
                Op::Carried(of, k) => {
                    body.uses(graph, &places, of);
                    body.numbers([k as usize]);
                }
                Op::Made(of, row, k) => {
                    body.uses(graph, &places, of);
                    body.numbers([row as usize, k as usize]);
                }
                _ => {
                    let mut operands = graph.operands(*node);
                    // the order of commutative operands depends on what was recorded before: it is normalised
                    let exchanged = match op {
                        Op::Add(..) | Op::Mul(..) | Op::MulAdd(..) | Op::And(..) | Op::Or(..) => 2,
                        _ => 0,
                    };
                    operands[..exchanged]
                        .sort_by_key(|of| places.get(of).copied().unwrap_or(usize::MAX));
                    for operand in operands {
                        body.uses(graph, &places, operand);
                    }
                }
            }
        }
        let of = graph.repetition(number);
        for k in needed.carried(number) {
            body.form += "\nnext";
            body.uses(graph, &places, of.next[k as usize]);
        }
        for k in needed.made(number) {
            body.form += "\nmade";
            body.uses(graph, &places, of.made[k as usize]);
        }
        body
    }

    fn numbers(&mut self, numbers: impl IntoIterator<Item = usize>) {
        numbers.into_iter().for_each(|number| {
            let _ = write!(self.form, " {number}");
        });
    }

    fn uses(&mut self, graph: &Graph, places: &HashMap<Node, usize>, node: Node) {
        if let Some(place) = places.get(&node) {
            let _ = write!(self.form, " #{place}");
            return;
        }
        self.outside.push(node);
        match graph.op(node) {
            Op::Table(number) => {
                let _ = write!(self.form, " table {}", graph.table(number).len());
            }
            op => self.form += if op.is_condition() { " condition" } else { " number" },
        }
    }

    /// Equality pattern of the outside values, and the constants by their bits.
    fn pattern(&self, graph: &Graph) -> String {
        let place = |node: &Node| self.outside.iter().position(|other| other == node);
        let of = |node: &Node| match graph.op(*node) {
            Op::Constant(bits) => format!(" ={bits:x}"),
            _ => format!(" {place:?}", place = place(node)),
        };
        self.outside.iter().map(of).collect()
    }
}

/// A body shared by one or several loops.
#[derive(Clone, Debug, Default)]
pub(crate) struct RepeatedPart {
    /// The loop whose body represents all.
    pub(crate) loop_number: u32,
    /// Number of rows of each loop with this body.
    pub(crate) rows: Vec<u32>,
    /// Outside values, as nodes of the representing loop's body. A constant that is equal in all loops is not among
    /// them.
    pub(crate) taken: Vec<Node>,
}

/// Shared bodies of some nodes, and for each loop its body and its outside values.
#[derive(Debug, Default)]
pub(crate) struct RepeatedParts {
    pub(crate) parts: Vec<RepeatedPart>,
    /// By the loop's index: index of the body, and the outside values in its order.
    pub(crate) of_loop: HashMap<u32, (usize, Vec<Node>)>,
    pub(crate) needed: Needed,
}

impl RepeatedParts {
    /// Bodies of the loops among nodes in topological order.
    ///
    /// Bodies with equal operations are shared; values that differ between them, including constants, become arguments.
    pub(crate) fn of(graph: &Graph, order: &[Node]) -> Self {
        let needed = Needed::of(graph, order);
        let mut all = Self { needed, ..Self::default() };
        let mut forms: Vec<Vec<(u32, Body)>> = Vec::new();
        for node in order {
            let Op::Loop(number) = graph.op(*node) else { continue };
            let body = Body::of(graph, order, &all.needed, number);
            match forms.iter_mut().find(|same| same[0].1.form == body.form) {
                Some(same) => same.push((number, body)),
                None => forms.push(vec![(number, body)]),
            }
        }
        for same in forms {
            if all.shared(graph, &same) {
                continue;
            }
            let mut patterns: Vec<(String, Vec<(u32, Body)>)> = Vec::new();
            for (number, body) in same {
                let pattern = body.pattern(graph);
                match patterns.iter_mut().find(|(known, _)| *known == pattern) {
                    Some((_, same)) => same.push((number, body)),
                    None => patterns.push((pattern, vec![(number, body)])),
                }
            }
            for (_, same) in patterns {
                all.shared(graph, &same);
            }
        }
        all
    }

    /// Adds a shared body for loops with equal operations. There is none if an outside value that differs between the
    /// loops and one that does not are the same node.
    fn shared(&mut self, graph: &Graph, same: &[(u32, Body)]) -> bool {
        let mut columns: Vec<Vec<Node>> = Vec::new();
        // for each use the index of its argument, or `None` for a common constant
        let uses: Vec<Option<usize>> = (0..same[0].1.outside.len())
            .map(|use_| {
                let column: Vec<Node> = same.iter().map(|(_, body)| body.outside[use_]).collect();
                let is_one = column.iter().all(|node| *node == column[0]);
                let is_constant = matches!(graph.op(column[0]), Op::Constant(_) | Op::Truth(_));
                if is_one && is_constant {
                    return None;
                }
                let known = columns.iter().position(|other| *other == column);
                Some(known.unwrap_or_else(|| {
                    columns.push(column);
                    columns.len() - 1
                }))
            })
            .collect();
        let stands_for_all = |body: &Body| {
            let mut seen: HashMap<Node, Option<usize>> = HashMap::new();
            body.outside
                .iter()
                .zip(&uses)
                .all(|(node, of)| *seen.entry(*node).or_insert(*of) == *of)
        };
        let Some(first) = same.iter().position(|(_, body)| stands_for_all(body)) else {
            return false;
        };
        let taken = columns.iter().map(|column| column[first]).collect();
        let part = self.parts.len();
        let rows = same.iter().map(|(number, _)| graph.repetition(*number).count).collect();
        self.parts.push(RepeatedPart { loop_number: same[first].0, rows, taken });
        for (k, (number, _)) in same.iter().enumerate() {
            let given = columns.iter().map(|column| column[k]).collect();
            self.of_loop.insert(*number, (part, given));
        }
        true
    }
}
