//! Conversion of planned operations to statements: which results get a name, which are written inline, and which loop
//! bodies become functions.

mod function;

use crate::graph::{Graph, Node, Op};
use crate::name::Names;
use crate::repeated_part::RepeatedParts;
use crate::statement::{Dialect, Function, Kind, Loop, Run, Statement, Text, runs};
use function::{Argument, Defined};
use std::collections::{HashMap, HashSet};

/// Longest text that is written inline.
const LONGEST: usize = 72;

/// Input of the conversion.
pub(crate) struct Source<'a> {
    pub(crate) graph: &'a Graph,
    /// Nodes in topological order.
    pub(crate) order: &'a [Node],
    /// Required results.
    pub(crate) results: &'a [Node],
    /// Nodes that have a text already: inputs, states, prepared values.
    pub(crate) given: &'a HashMap<Node, Text>,
    /// Existing arrays that can be passed unchanged: name and length.
    pub(crate) arrays: &'a HashMap<String, usize>,
    /// Names of intermediate results.
    pub(crate) labels: &'a HashMap<Node, (String, String)>,
}

/// Statements, and the texts of the results. Adds the functions that the statements call, each after those that it
/// calls.
pub(crate) fn statements(
    source: &Source<'_>,
    dialect: &dyn Dialect,
    names: &mut Names,
    functions: &mut Vec<Function>,
) -> (Vec<Statement>, Vec<Text>) {
    let mut shared = Shared {
        uses: uses(source),
        parts: RepeatedParts::of(source.graph, source.order),
        passed: passed(source),
        labelled: HashSet::new(),
        defined: HashMap::new(),
        functions,
    };
    let mut writing = Writing {
        source,
        dialect,
        names,
        shared: &mut shared,
        scope: None,
        texts: source.given.clone(),
        tables: HashMap::new(),
        arrays: source.arrays.clone(),
        loops: HashMap::new(),
        said: Vec::new(),
    };
    writing.write_all();
    let results = source.results.iter().map(|node| writing.text(*node)).collect();
    (writing.said, results)
}

/// Number of uses of each node. A use inside a loop counts twice, so that a loop-invariant value is named before it.
fn uses(source: &Source<'_>) -> HashMap<Node, usize> {
    let Source { graph, order, results, .. } = *source;
    let mut uses: HashMap<Node, usize> = HashMap::new();
    let mut used = |node: Node, within: Option<u32>| {
        *uses.entry(node).or_default() += if graph.scope(node) == within { 1 } else { 2 };
    };
    for node in order {
        let scope = graph.scope(*node);
        match graph.op(*node) {
            Op::Loop(number) => {
                let of = graph.repetition(number);
                of.condition.into_iter().for_each(|n| (0..2).for_each(|_| used(n, scope)));
                of.begin.iter().for_each(|n| used(*n, scope));
                of.next.iter().chain(&of.made).for_each(|n| used(*n, Some(number)));
            }
            Op::Read(..) | Op::Carry(..) | Op::Carried(..) | Op::Made(..) => {}
            _ => graph.operands(*node).into_iter().for_each(|n| used(n, scope)),
        }
    }
    results.iter().for_each(|node| used(*node, None));
    uses
}

/// Tables passed to a function: for interpolation, or for reading row by row in a function other than the one that
/// makes them.
fn passed(source: &Source<'_>) -> HashSet<Node> {
    let graph = source.graph;
    let of = |node: &Node| match graph.op(*node) {
        Op::Interpolate(table, _) => Some(table),
        Op::Read(number, k) => {
            let of = graph.repetition(number);
            let table = of.read[k as usize];
            (graph.scope(table) != of.within).then_some(table)
        }
        _ => None,
    };
    source.order.iter().filter_map(of).collect()
}

/// State shared by all functions of a block.
struct Shared<'a> {
    uses: HashMap<Node, usize>,
    parts: RepeatedParts,
    passed: HashSet<Node>,
    labelled: HashSet<Node>,
    /// Definition of each loop body.
    defined: HashMap<usize, Defined>,
    functions: &'a mut Vec<Function>,
}

/// Names of a loop's results.
#[derive(Default)]
struct LoopNames {
    carried: HashMap<u32, String>,
    made: HashMap<u32, String>,
}

/// A function being written.
struct Writing<'a, 'b, 'c> {
    source: &'a Source<'b>,
    dialect: &'a dyn Dialect,
    names: &'a mut Names,
    shared: &'a mut Shared<'c>,
    /// The loop for whose row the statements are.
    scope: Option<u32>,
    texts: HashMap<Node, Text>,
    /// Location of a table's entries: array name, and index of the first.
    tables: HashMap<Node, (String, usize)>,
    /// Arrays that can be passed unchanged: name and length.
    arrays: HashMap<String, usize>,
    loops: HashMap<Node, LoopNames>,
    said: Vec<Statement>,
}

impl Writing<'_, '_, '_> {
    fn text(&self, node: Node) -> Text {
        let known = self.texts.get(&node).cloned();
        known.unwrap_or_else(|| match self.source.graph.op(node) {
            Op::Constant(bits) => self.dialect.constant(f64::from_bits(bits)),
            Op::Truth(holds) => self.dialect.constant(f64::from(u8::from(holds))),
            _ => Text::whole("?"),
        })
    }

    fn write_all(&mut self) {
        let Source { graph, order, .. } = *self.source;
        for node in order {
            if graph.scope(*node) == self.scope && !self.texts.contains_key(node) {
                self.write(*node);
            }
        }
    }

    fn write(&mut self, node: Node) {
        let graph = self.source.graph;
        let text = match graph.op(node) {
            Op::Table(number) => return self.table(node, graph.table(number)),
            Op::Loop(number) => return self.repeat(node, number),
            Op::Carried(of, k) => Text::whole(self.loops[&of].carried[&k].clone()),
            Op::Made(of, row, k) => Text::whole(format!("{}[{row}]", self.loops[&of].made[&k])),
            Op::Interpolate(table, place) => {
                let place = self.text(place).text;
                let Op::Table(number) = graph.op(table) else { return };
                let length = graph.table(number).len();
                let (table, first) = self.tables[&table].clone();
                let name = self.names.numbered("t");
                let text = Text::whole(name.clone());
                self.said.push(Statement::Interpolation { name, table, first, length, place });
                text
            }
            op => return self.value(node, op),
        };
        self.texts.insert(node, text);
    }

    /// A table: existing entries, or a new array.
    fn table(&mut self, node: Node, entries: &[Node]) {
        let texts: Vec<Text> = entries.iter().map(|entry| self.text(*entry)).collect();
        let filled = runs(texts.iter().map(|text| text.text.as_str()));
        if let [Run::Copied { table, first, .. }] = filled.as_slice() {
            let is_whole = *first == 0 && self.arrays.get(table) == Some(&entries.len());
            if is_whole || self.dialect.has_parts() || !self.shared.passed.contains(&node) {
                self.tables.insert(node, (table.clone(), *first));
                return;
            }
        }
        let name = self.filled(filled);
        self.tables.insert(node, (name, 0));
    }

    /// Adds a new array; returns its name.
    fn filled(&mut self, filled: Vec<Run>) -> String {
        let name = self.names.numbered("r");
        self.arrays.insert(name.clone(), filled.iter().map(Run::count).sum());
        self.said.push(Statement::Table { name: name.clone(), filled });
        name
    }

    /// Writes a loop that calls a function for each of its rows.
    fn repeat(&mut self, node: Node, number: u32) {
        let of = self.source.graph.repetition(number);
        let (part, given) = self.shared.parts.of_loop[&number].clone();
        let defined = match self.shared.defined.get(&part) {
            Some(defined) => defined.clone(),
            None => self.define(part, &given),
        };
        let counter = self.names.numbered("i");
        let mut out = LoopNames::default();
        let mut carried = Vec::new();
        for k in self.shared.parts.needed.carried(number) {
            let name = self.names.numbered("a");
            carried.push((name.clone(), self.text(of.begin[k as usize]).text));
            out.carried.insert(k, name);
        }
        let mut made = Vec::new();
        for k in self.shared.parts.needed.made(number) {
            let name = self.names.numbered("m");
            self.arrays.insert(name.clone(), of.count as usize);
            out.made.insert(k, name.clone());
            made.push(name);
        }
        let argument = |writing: &mut Self, argument: &Argument| match argument {
            Argument::Row => counter.clone(),
            Argument::Entry(k) => match &writing.tables[&of.read[*k as usize]] {
                (table, 0) => format!("{table}[{counter}]"),
                (table, first) => format!("{table}[{counter} + {first}]"),
            },
            Argument::Carried(k) => out.carried[k].clone(),
            Argument::Outside(place) => writing.argument(given[*place]),
            Argument::Array(places) => {
                let texts: Vec<String> =
                    places.iter().map(|place| writing.text(given[*place]).text).collect();
                let all = texts.iter().map(|text| Run::One(text.clone())).collect();
                writing.filled(all)
            }
            Argument::Whole(name) => name.clone(),
        };
        let arguments = defined.arguments.iter().map(|a| argument(self, a)).collect();
        let condition = of.condition.map(|condition| self.text(condition).text);
        let (count, function) = (of.count, defined.function);
        let said = Loop { counter, count, condition, carried, made, function, arguments };
        self.said.push(Statement::Loop(said));
        self.loops.insert(node, out);
    }

    /// A number, condition or table as a function's argument.
    fn argument(&self, node: Node) -> String {
        match self.tables.get(&node) {
            Some((table, 0)) => table.clone(),
            Some((table, first)) => self.dialect.part(table, *first),
            None => self.text(node).text,
        }
    }

    /// Writes an operation inline or with a name.
    fn value(&mut self, node: Node, op: Op) {
        let operands: Vec<Text> =
            self.source.graph.operands(node).into_iter().map(|n| self.text(n)).collect();
        let text = self.dialect.operation(op, &operands);
        let labels = self.source.labels;
        let label = labels.get(&node).filter(|_| self.shared.labelled.insert(node));
        let is_short = text.text.len() <= LONGEST;
        let once = self.shared.uses.get(&node).copied().unwrap_or(0) <= 1;
        // a pair is a statement of its own, and its members are names; without pairs its text is the angle
        let is_pair = matches!(op, Op::SinCos(_));
        let has_pairs = self.dialect.has_pairs();
        let is_member = matches!(op, Op::Sin(_) | Op::Cos(_)) && has_pairs;
        let is_inner = label.is_none() && once && is_short && !is_pair;
        if is_member || is_inner || is_pair && !has_pairs {
            self.texts.insert(node, text);
            return;
        }
        let name = match (label, op) {
            (Some((name, _)), _) => self.names.free(name),
            (None, op) if op.is_condition() => self.names.numbered("is"),
            (None, Op::SinCos(_)) => self.names.numbered("turn"),
            (None, _) => self.names.numbered("t"),
        };
        let comment = label.map(|(_, comment)| comment.clone());
        self.texts.insert(node, Text::whole(name.clone()));
        self.said.push(Statement::Value { kind: Kind::of(op), name, text: text.text, comment });
    }
}
