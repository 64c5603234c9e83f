//! What was planned, written as statements: which of it gets a name, what is written within something else, and which repeated
//! part becomes a function.

use crate::graph::{Graph, Node, Op};
use crate::name::Names;
use crate::repeated_part::RepeatedParts;
use crate::statement::{
    Dialect, FEWEST, Function, Kind, Loop, Parameter, Run, Statement, Taken, Text, entry, runs,
};
use std::collections::{HashMap, HashSet};

/// Longest text that is written within another one.
const LONGEST: usize = 72;

/// Most numbers of its surroundings that a function takes one by one: as many as x86-64 and Arm pass in registers, and as many as
/// one reads. More come as an array, which is filled before the loop.
pub(crate) const MOST_ONE_BY_ONE: usize = 8;

/// What statements are made from.
pub(crate) struct Source<'a> {
    pub(crate) graph: &'a Graph,
    /// In this order, operands first.
    pub(crate) order: &'a [Node],
    /// What is asked for.
    pub(crate) results: &'a [Node],
    /// What has a text already: inputs, states, what was prepared.
    pub(crate) given: &'a HashMap<Node, Text>,
    /// Arrays that are there already and can be passed as they are: name and length.
    pub(crate) arrays: &'a HashMap<String, usize>,
    /// Names of what is in between.
    pub(crate) labels: &'a HashMap<Node, (String, String)>,
}

/// Statements, and the texts of the results; adds the functions that the statements call, each behind those that it calls.
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

/// How often each node is used. A use inside a loop counts twice, so that a loop-invariant value gets a name before the loop.
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

/// Tables that are passed to a function: looked up in, or read row by row in another function than the one that they are made in.
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

/// A function, and what each loop gives to it.
#[derive(Clone)]
struct Defined {
    function: usize,
    arguments: Vec<Argument>,
}

/// What a loop gives to its function.
#[derive(Clone, Debug)]
enum Argument {
    /// The row's number.
    Row,
    /// The row's entry in the table of this number among those that it reads.
    Entry(u32),
    /// What is carried, by its index.
    Carried(u32),
    /// What the part takes from around the loop, by its place.
    Taken(usize),
    /// Several of that as an array.
    Array(Vec<usize>),
    /// An array as it is.
    Whole(String),
}

/// What the functions of a block have in common.
struct Shared<'a> {
    uses: HashMap<Node, usize>,
    parts: RepeatedParts,
    passed: HashSet<Node>,
    labelled: HashSet<Node>,
    /// By the part.
    defined: HashMap<usize, Defined>,
    functions: &'a mut Vec<Function>,
}

/// Names of what comes out of a loop.
#[derive(Default)]
struct LoopNames {
    carried: HashMap<u32, String>,
    made: HashMap<u32, String>,
}

/// Statements of a function that are being written.
struct Writing<'a, 'b, 'c> {
    source: &'a Source<'b>,
    dialect: &'a dyn Dialect,
    names: &'a mut Names,
    shared: &'a mut Shared<'c>,
    /// The loop for whose row they are.
    scope: Option<u32>,
    texts: HashMap<Node, Text>,
    /// Where the entries of a table are: name, and place of the first.
    tables: HashMap<Node, (String, usize)>,
    /// Arrays that can be passed as they are: name and length.
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

    /// A table: where its entries are already, or a new one.
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

    /// A new array; its name.
    fn filled(&mut self, filled: Vec<Run>) -> String {
        let name = self.names.numbered("r");
        self.arrays.insert(name.clone(), filled.iter().map(Run::count).sum());
        self.said.push(Statement::Table { name: name.clone(), filled });
        name
    }

    /// A loop that calls a function for each of its rows.
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
            Argument::Taken(place) => writing.argument(given[*place]),
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

    /// A number, condition or table as a function is given it.
    fn argument(&self, node: Node) -> String {
        match self.tables.get(&node) {
            Some((table, 0)) => table.clone(),
            Some((table, first)) => self.dialect.part(table, *first),
            None => self.text(node).text,
        }
    }

    /// Writes the function of a repeated part, which a loop gives these nodes.
    fn define(&mut self, part: usize, given: &[Node]) -> Defined {
        let graph = self.source.graph;
        let of = self.shared.parts.parts[part].clone();
        let mut names = self.dialect.names();
        let mut head = Head::default();
        self.own(of.loop_number, &mut names, &mut head);
        let taken = of.taken.iter().enumerate();
        let is_number =
            |node: Node| !matches!(graph.op(node), Op::Table(_)) && !graph.op(node).is_condition();
        let mut numbers: Vec<usize> =
            taken.clone().filter(|(_, node)| is_number(**node)).map(|(place, _)| place).collect();
        // entries of one array come with the array: other loops might give other arrays
        if of.rows.len() == 1 {
            numbers = self.arrays_of(&of.taken, given, numbers, &mut names, &mut head);
        }
        if numbers.len() > MOST_ONE_BY_ONE {
            let name = names.free("b");
            for (k, place) in numbers.iter().enumerate() {
                let text = format!("{name}[{k}]");
                if let Some(known) = self.known(of.taken[*place]) {
                    head.legend.push(format!("{text}: {known}"));
                }
                head.texts.insert(of.taken[*place], Text::whole(text));
            }
            head.arrays.insert(name.clone(), numbers.len());
            head.take(name, Taken::Table(numbers.len()), Argument::Array(numbers));
        } else {
            for place in numbers {
                let node = of.taken[place];
                let name = match self.known(node).filter(|_| of.rows.len() == 1) {
                    Some(known) => names.free(&known),
                    None => names.numbered("b"),
                };
                head.texts.insert(node, Text::whole(name.clone()));
                head.take(name, Taken::One(Kind::Number), Argument::Taken(place));
            }
        }
        for (place, node) in taken {
            match graph.op(*node) {
                Op::Table(number) => {
                    let (name, length) = (names.numbered("r"), graph.table(number).len());
                    head.tables.insert(*node, (name.clone(), 0));
                    head.arrays.insert(name.clone(), length);
                    head.take(name, Taken::Table(length), Argument::Taken(place));
                }
                op if op.is_condition() => {
                    let name = names.numbered("is");
                    head.texts.insert(*node, Text::whole(name.clone()));
                    head.take(name, Taken::One(Kind::Condition), Argument::Taken(place));
                }
                _ => {}
            }
        }
        let Head { parameters, arguments, legend, texts, tables, arrays } = head;
        let mut inner = Writing {
            source: self.source,
            dialect: self.dialect,
            names: &mut names,
            shared: &mut *self.shared,
            scope: Some(of.loop_number),
            texts,
            tables,
            arrays,
            loops: HashMap::new(),
            said: Vec::new(),
        };
        inner.write_all();
        let results = inner.results(of.loop_number);
        let body = inner.said;
        let origin = graph.repetition(of.loop_number).origin.clone();
        let functions = &*self.shared.functions;
        let number = 1 + functions.iter().filter(|other| other.origin == origin).count();
        let mut rows = of.rows;
        rows.sort_unstable();
        rows.dedup();
        let function = Function { origin, number, rows, parameters, legend, body, results };
        let functions = &mut *self.shared.functions;
        let known = functions.iter().position(|other| other.does_the_same_as(&function));
        let place = known.unwrap_or_else(|| {
            functions.push(function);
            functions.len() - 1
        });
        let defined = Defined { function: place, arguments };
        self.shared.defined.insert(part, defined.clone());
        defined
    }

    /// What a function takes of its loop's row: number, entries, what is carried.
    fn own(&self, number: u32, names: &mut Names, head: &mut Head) {
        for node in self.source.order {
            let (name, taken, argument) = match self.source.graph.op(*node) {
                Op::Row(of) if of == number => {
                    let name = names.free("row");
                    head.texts.insert(*node, self.dialect.row(&name));
                    head.take(name, Taken::Row, Argument::Row);
                    continue;
                }
                Op::Read(of, k) if of == number => {
                    (names.numbered("x"), Taken::One(Kind::Number), Argument::Entry(k))
                }
                Op::Carry(of, k) if of == number => {
                    (names.numbered("a"), Taken::One(Kind::Number), Argument::Carried(k))
                }
                _ => continue,
            };
            head.texts.insert(*node, Text::whole(name.clone()));
            head.take(name, taken, argument);
        }
    }

    /// Takes arrays of which several entries are taken as arrays; what is left.
    fn arrays_of(
        &self,
        taken: &[Node],
        given: &[Node],
        numbers: Vec<usize>,
        names: &mut Names,
        head: &mut Head,
    ) -> Vec<usize> {
        let texts: Vec<String> = given.iter().map(|node| self.text(*node).text).collect();
        let array = |place: usize| {
            let found = entry(&texts[place]).filter(|(array, _)| self.arrays.contains_key(*array));
            found.map(|(array, k)| (array.to_string(), k))
        };
        let mut known: Vec<String> = Vec::new();
        for (name, _) in numbers.iter().filter_map(|place| array(*place)) {
            if !known.contains(&name) {
                known.push(name);
            }
        }
        let mut left = numbers;
        for name in known {
            let is_in = |place: &usize| array(*place).is_some_and(|(of, _)| of == name);
            let (inside, others): (Vec<usize>, Vec<usize>) = left.iter().partition(|p| is_in(p));
            if inside.len() < FEWEST {
                continue;
            }
            let own = match plain(&name) {
                Some(own) if self.source.arrays.contains_key(&name) => names.free(own),
                _ => names.numbered("r"),
            };
            for place in inside {
                let Some((_, k)) = array(place) else { continue };
                head.texts.insert(taken[place], Text::whole(format!("{own}[{k}]")));
            }
            let length = self.arrays[&name];
            head.arrays.insert(own.clone(), length);
            head.take(own, Taken::Table(length), Argument::Whole(name));
            left = others;
        }
        left
    }

    /// The name that a node has everywhere.
    fn known(&self, node: Node) -> Option<String> {
        if let Some((name, _)) = self.source.labels.get(&node) {
            return Some(name.clone());
        }
        let text = self.source.given.get(&node)?;
        plain(&text.text).map(str::to_string)
    }

    /// Results of a loop's body: what is carried on, and the row's entries.
    fn results(&mut self, number: u32) -> Vec<(String, String)> {
        let of = self.source.graph.repetition(number);
        let needed = &self.shared.parts.needed;
        let next = needed.carried(number).into_iter().map(|k| ("n", of.next[k as usize]));
        let made = needed.made(number).into_iter().map(|k| ("m", of.made[k as usize]));
        let all: Vec<(&str, Node)> = next.chain(made).collect();
        all.into_iter()
            .map(|(name, node)| (self.names.numbered(name), self.text(node).text))
            .collect()
    }

    /// An operation: within what uses it, or with a name.
    fn value(&mut self, node: Node, op: Op) {
        let operands: Vec<Text> =
            self.source.graph.operands(node).into_iter().map(|n| self.text(n)).collect();
        let text = self.dialect.operation(op, &operands);
        let labels = self.source.labels;
        let label = labels.get(&node).filter(|_| self.shared.labelled.insert(node));
        let is_short = text.text.len() <= LONGEST;
        let once = self.shared.uses.get(&node).copied().unwrap_or(0) <= 1;
        // a pair is a statement of its own, and a member of it a name; without pairs it is the angle they are of
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

/// A name without what it is a member of; none for anything but a name.
fn plain(text: &str) -> Option<&str> {
    let name = text.rsplit("->").next()?;
    let is_name = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    (is_name && name.starts_with(|c: char| c.is_ascii_alphabetic())).then_some(name)
}

/// What a function takes, while it is put together.
#[derive(Default)]
struct Head {
    parameters: Vec<Parameter>,
    arguments: Vec<Argument>,
    legend: Vec<String>,
    texts: HashMap<Node, Text>,
    tables: HashMap<Node, (String, usize)>,
    arrays: HashMap<String, usize>,
}

impl Head {
    fn take(&mut self, name: String, taken: Taken, argument: Argument) {
        self.parameters.push(Parameter { name, taken });
        self.arguments.push(argument);
    }
}
