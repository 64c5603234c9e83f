//! What was planned, as statements: which of it gets a name, and what is written within something else.

use crate::graph::{Graph, Node, Op};
use crate::name::Names;
use std::collections::{HashMap, HashSet};

/// How a language writes an operation.
pub(crate) trait Dialect {
    /// A constant.
    fn constant(&self, value: f64) -> Text;
    /// Whether a sine and cosine come from one call, as a pair with a name.
    fn has_pairs(&self) -> bool;
    /// The number of a loop's row, by its counter.
    fn row(&self, counter: &str) -> Text;
    /// An operation on texts.
    fn operation(&self, op: Op, operands: &[Text]) -> Text;
}

/// Operator precedence, the lowest first: an operand of lower precedence needs brackets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Precedence {
    Choice,
    Or,
    And,
    Comparison,
    Sum,
    Product,
    Sign,
    Whole,
}

/// A piece of source code.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Text {
    pub(crate) text: String,
    pub(crate) precedence: Precedence,
}

impl Text {
    pub(crate) fn new(text: impl Into<String>, precedence: Precedence) -> Self {
        Self { text: text.into(), precedence }
    }

    pub(crate) fn whole(text: impl Into<String>) -> Self {
        Self::new(text, Precedence::Whole)
    }

    /// As an operand of something that binds so.
    pub(crate) fn within(&self, precedence: Precedence) -> String {
        match self.precedence >= precedence {
            true => self.text.clone(),
            false => format!("({})", self.text),
        }
    }

    /// As an operand that must bind more strongly.
    pub(crate) fn inside(&self, precedence: Precedence) -> String {
        match self.precedence > precedence {
            true => self.text.clone(),
            false => format!("({})", self.text),
        }
    }
}

/// Two operands with a sign between them; those that bind alike are done from the left.
fn infix(x: &[Text], sign: &str, precedence: Precedence) -> Text {
    Text::new(format!("{} {sign} {}", x[0].within(precedence), x[1].inside(precedence)), precedence)
}

/// What all languages write alike: sums, products, quotients, comparisons; none for anything else.
pub(crate) fn arithmetic(op: Op, x: &[Text]) -> Option<Text> {
    Some(match op {
        Op::Add(..) => infix(x, "+", Precedence::Sum),
        Op::Sub(..) => infix(x, "-", Precedence::Sum),
        Op::Mul(..) => infix(x, "*", Precedence::Product),
        Op::Div(..) => infix(x, "/", Precedence::Product),
        Op::Less(..) => infix(x, "<", Precedence::Comparison),
        _ => return None,
    })
}

/// The same with brackets around all but comparisons' own operands: not everybody knows which of `and` and `or` comes first.
pub(crate) fn clear_infix(x: &[Text], sign: &str, precedence: Precedence) -> Text {
    let [a, b] = [0, 1].map(|k| x[k].inside(Precedence::Comparison));
    Text::new(format!("{a} {sign} {b}"), precedence)
}

/// A function of the operands.
pub(crate) fn call(x: &[Text], name: &str) -> Text {
    let arguments: Vec<&str> = x.iter().map(|t| t.text.as_str()).collect();
    Text::whole(format!("{name}({})", arguments.join(", ")))
}

/// Something that is done.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Statement {
    /// A name given to a value.
    Value { node: Node, name: String, text: String, comment: Option<String> },
    /// A table is filled.
    Table { name: String, filled: Vec<Run> },
    /// Linear interpolation in a table from its entry `first` on.
    Interpolation { name: String, table: String, first: usize, length: usize, place: String },
    /// A loop.
    Loop(Loop),
}

/// Entries of a table that lie one behind the other.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Run {
    /// So many entries of another table, from an entry on.
    Copied { table: String, first: usize, count: usize },
    /// One entry.
    One(String),
}

impl Run {
    /// How many entries.
    pub(crate) fn count(&self) -> usize {
        match self {
            Self::Copied { count, .. } => *count,
            Self::One(_) => 1,
        }
    }
}

/// A loop over rows.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Loop {
    /// Name of its counter, which begins at 0.
    pub(crate) counter: String,
    /// Rows.
    pub(crate) count: u32,
    /// Condition without which nothing is done.
    pub(crate) condition: Option<String>,
    /// What is carried from row to row.
    pub(crate) carried: Vec<Carried>,
    /// Tables that it makes: name, and the row's entry.
    pub(crate) made: Vec<(String, String)>,
    /// What is done in it.
    pub(crate) body: Vec<Statement>,
}

/// What is carried from row to row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Carried {
    /// Name of it, and of what is carried on.
    pub(crate) names: [String; 2],
    /// What is carried into the first row.
    pub(crate) begin: String,
    /// What is carried on.
    pub(crate) next: String,
}

/// A table and a place in it, of a text that is an entry: `name[place]`.
pub(crate) fn entry(text: &str) -> Option<(&str, usize)> {
    let (table, place) = text.strip_suffix(']')?.rsplit_once('[')?;
    let is_name = |c: char| c.is_ascii_alphanumeric() || "_.->".contains(c);
    let is_whole = table.chars().all(is_name) && !table.starts_with('-');
    Some((table, place.parse().ok().filter(|_| is_whole)?))
}

/// Fewest entries for which a loop is written.
const FEWEST: usize = 4;

/// Texts as runs of other tables' entries, and single ones.
pub(crate) fn runs<'a>(texts: impl IntoIterator<Item = &'a str>) -> Vec<Run> {
    let mut all: Vec<Run> = Vec::new();
    for text in texts {
        let Some((of, place)) = entry(text) else {
            all.push(Run::One(text.into()));
            continue;
        };
        match all.last_mut() {
            Some(Run::Copied { table, first, count })
                if table == of && *first + *count == place =>
            {
                *count += 1;
            }
            _ => all.push(Run::Copied { table: of.into(), first: place, count: 1 }),
        }
    }
    let short = |run: Run| match run {
        Run::Copied { table, first, count } if count < FEWEST => {
            (first..first + count).map(|k| Run::One(format!("{table}[{k}]"))).collect()
        }
        run => vec![run],
    };
    all.into_iter().flat_map(short).collect()
}

/// Neighbours whose names are the entries of a table from 0 on, as ranges of their places, with the table's name; none for what is
/// no table.
pub(crate) fn grouped<'a>(
    names: impl IntoIterator<Item = &'a str>,
) -> Vec<(Option<String>, std::ops::Range<usize>)> {
    let mut all: Vec<(Option<String>, std::ops::Range<usize>)> = Vec::new();
    for (k, name) in names.into_iter().enumerate() {
        match (entry(name), all.last_mut()) {
            (Some((of, place)), Some((Some(table), range)))
                if table == of && range.len() == place =>
            {
                range.end = k + 1;
            }
            (Some((of, 0)), _) => all.push((Some(of.into()), k..k + 1)),
            _ => all.push((None, k..k + 1)),
        }
    }
    all
}

/// Longest text that is written within another one.
const LONGEST: usize = 72;

/// What statements are made from.
pub(crate) struct Source<'a> {
    pub(crate) graph: &'a Graph,
    /// In this order, operands first.
    pub(crate) order: &'a [Node],
    /// What is asked for.
    pub(crate) results: &'a [Node],
    /// What has a text already: inputs, states, what was prepared.
    pub(crate) given: &'a HashMap<Node, Text>,
    /// Names of what is in between.
    pub(crate) labels: &'a HashMap<Node, (String, String)>,
}

/// Statements, and the texts of the results.
pub(crate) fn statements(
    source: &Source<'_>,
    dialect: &dyn Dialect,
    names: &mut Names,
) -> (Vec<Statement>, Vec<Text>) {
    let mut writing = Writing {
        source,
        dialect,
        names,
        uses: uses(source),
        needed: source.order.iter().copied().collect(),
        texts: source.given.clone(),
        tables: HashMap::new(),
        labelled: HashSet::new(),
        loops: HashMap::new(),
        said: HashMap::new(),
    };
    for node in source.order {
        if !source.given.contains_key(node) {
            writing.write(*node);
        }
    }
    let results = source.results.iter().map(|node| writing.text(*node)).collect();
    (writing.said.remove(&None).unwrap_or_default(), results)
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

/// Names of a loop's parts.
#[derive(Default)]
struct LoopNames {
    counter: String,
    carried: HashMap<u32, String>,
    made: HashMap<u32, String>,
}

/// Statements that are being written.
struct Writing<'a, 'b> {
    source: &'a Source<'b>,
    dialect: &'a dyn Dialect,
    names: &'a mut Names,
    uses: HashMap<Node, usize>,
    needed: HashSet<Node>,
    texts: HashMap<Node, Text>,
    /// Where the entries of a table are: name, and place of the first.
    tables: HashMap<Node, (String, usize)>,
    labelled: HashSet<Node>,
    loops: HashMap<u32, LoopNames>,
    /// What is said so far, in each loop and outside of all.
    said: HashMap<Option<u32>, Vec<Statement>>,
}

impl Writing<'_, '_> {
    fn text(&self, node: Node) -> Text {
        match self.source.graph.op(node) {
            Op::Constant(bits) => self.dialect.constant(f64::from_bits(bits)),
            Op::Truth(holds) => self.dialect.constant(f64::from(u8::from(holds))),
            _ => self.texts.get(&node).cloned().unwrap_or_else(|| Text::whole("?")),
        }
    }

    fn say(&mut self, node: Node, statement: Statement) {
        self.said.entry(self.source.graph.scope(node)).or_default().push(statement);
    }

    fn of_loop(&mut self, number: u32) -> &mut LoopNames {
        let names = &mut *self.names;
        self.loops
            .entry(number)
            .or_insert_with(|| LoopNames { counter: names.numbered("i"), ..LoopNames::default() })
    }

    fn write(&mut self, node: Node) {
        let graph = self.source.graph;
        let text = match graph.op(node) {
            Op::Table(number) => return self.table(node, graph.table(number)),
            Op::Loop(number) => return self.repeat(node, number),
            Op::Row(number) => {
                let counter = self.of_loop(number).counter.clone();
                self.dialect.row(&counter)
            }
            Op::Read(number, k) => {
                let table = graph.repetition(number).read[k as usize];
                let counter = self.of_loop(number).counter.clone();
                Text::whole(match self.tables.get(&table) {
                    Some((table, 0)) => format!("{table}[{counter}]"),
                    Some((table, first)) => format!("{table}[{counter} + {first}]"),
                    None => "?".into(),
                })
            }
            Op::Carry(number, k) => Text::whole(self.carried(number, k)),
            Op::Carried(of, k) => {
                let Op::Loop(number) = graph.op(of) else { return };
                Text::whole(self.carried(number, k))
            }
            Op::Made(of, row, k) => {
                let Op::Loop(number) = graph.op(of) else { return };
                let table = self.of_loop(number).made.get(&k).cloned().unwrap_or_default();
                Text::whole(format!("{table}[{row}]"))
            }
            Op::Interpolate(table, place) => {
                let place = self.text(place).text;
                let Op::Table(number) = graph.op(table) else { return };
                let length = graph.table(number).len();
                let (table, first) = self.tables.get(&table).cloned().unwrap_or_default();
                let name = self.names.numbered("t");
                let from = Statement::Interpolation { name, table, first, length, place };
                let Statement::Interpolation { name, .. } = &from else { return };
                let text = Text::whole(name);
                self.say(node, from);
                text
            }
            op => return self.value(node, op),
        };
        self.texts.insert(node, text);
    }

    fn carried(&mut self, number: u32, k: u32) -> String {
        if let Some(name) = self.of_loop(number).carried.get(&k) {
            return name.clone();
        }
        let name = self.names.numbered("a");
        self.of_loop(number).carried.insert(k, name.clone());
        name
    }

    /// A table: where its entries are already, or a new one.
    fn table(&mut self, node: Node, entries: &[Node]) {
        let texts: Vec<Text> = entries.iter().map(|entry| self.text(*entry)).collect();
        let filled = runs(texts.iter().map(|text| text.text.as_str()));
        if let [Run::Copied { table, first, .. }] = filled.as_slice() {
            self.tables.insert(node, (table.clone(), *first));
            return;
        }
        let name = self.names.numbered("r");
        self.tables.insert(node, (name.clone(), 0));
        self.say(node, Statement::Table { name, filled });
    }

    /// A loop whose body is said.
    fn repeat(&mut self, node: Node, number: u32) {
        let graph = self.source.graph;
        let of = graph.repetition(number);
        let live = |needed: &HashSet<Node>, is: &dyn Fn(Op) -> bool| {
            needed.iter().any(|other| is(graph.op(*other)))
        };
        let mut carried = Vec::new();
        for (k, (begin, next)) in of.begin.iter().zip(&of.next).enumerate() {
            let k = k as u32;
            let is = |op| op == Op::Carry(number, k) || op == Op::Carried(node, k);
            if !live(&self.needed, &is) {
                continue;
            }
            let names = [self.carried(number, k), self.names.numbered("n")];
            let (begin, next) = (self.text(*begin).text, self.text(*next).text);
            carried.push(Carried { names, begin, next });
        }
        let mut made = Vec::new();
        for (k, entry) in of.made.iter().enumerate() {
            let is = |op| matches!(op, Op::Made(of, _, column) if of == node && column == k as u32);
            if !live(&self.needed, &is) {
                continue;
            }
            let name = self.names.numbered("m");
            self.of_loop(number).made.insert(k as u32, name.clone());
            made.push((name, self.text(*entry).text));
        }
        let statement = Statement::Loop(Loop {
            counter: self.of_loop(number).counter.clone(),
            count: of.count,
            condition: of.condition.map(|condition| self.text(condition).text),
            carried,
            made,
            body: self.said.remove(&Some(number)).unwrap_or_default(),
        });
        self.say(node, statement);
    }

    /// An operation: within what uses it, or with a name.
    fn value(&mut self, node: Node, op: Op) {
        let operands: Vec<Text> =
            self.source.graph.operands(node).into_iter().map(|n| self.text(n)).collect();
        let text = self.dialect.operation(op, &operands);
        let labels = self.source.labels;
        let label = labels.get(&node).filter(|_| self.labelled.insert(node));
        let is_short = text.text.len() <= LONGEST;
        let once = self.uses.get(&node).copied().unwrap_or(0) <= 1;
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
        self.say(node, Statement::Value { node, name, text: text.text, comment });
    }
}

/// A line broken where it is longer than a width, at spaces, the rest drawn in.
pub(crate) fn broken(line: &str, width: usize) -> String {
    let indent = line.len() - line.trim_start().len();
    let (mut whole, mut rest) = (String::new(), line.to_string());
    while rest.len() > width {
        let at = rest[..width].rfind(' ').filter(|at| *at > indent + 8);
        let Some(at) = at.or_else(|| rest[indent..].find(' ').map(|at| at + indent)) else { break };
        whole += rest[..at].trim_end();
        whole += "\n";
        let tail = rest[at..].trim_start().to_string();
        if tail.is_empty() {
            return whole.trim_end().into();
        }
        rest = format!("{}{tail}", " ".repeat(indent + 4));
        if rest[indent + 4..].find(' ').is_none() {
            break;
        }
    }
    whole + &rest
}
