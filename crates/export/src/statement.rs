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
    /// An operation on texts.
    fn operation(&self, op: Op, operands: &[Text]) -> Text;
}

/// How strongly a text holds together: what is weaker needs brackets within what is stronger.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Binding {
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
    pub(crate) binding: Binding,
}

impl Text {
    pub(crate) fn new(text: impl Into<String>, binding: Binding) -> Self {
        Self { text: text.into(), binding }
    }

    pub(crate) fn whole(text: impl Into<String>) -> Self {
        Self::new(text, Binding::Whole)
    }

    /// As an operand of something that binds so.
    pub(crate) fn within(&self, binding: Binding) -> String {
        match self.binding >= binding {
            true => self.text.clone(),
            false => format!("({})", self.text),
        }
    }

    /// As an operand that must bind more strongly.
    pub(crate) fn inside(&self, binding: Binding) -> String {
        match self.binding > binding {
            true => self.text.clone(),
            false => format!("({})", self.text),
        }
    }
}

/// Two operands with a sign between them; those that bind alike are done from the left.
fn infix(x: &[Text], sign: &str, binding: Binding) -> Text {
    Text::new(format!("{} {sign} {}", x[0].within(binding), x[1].inside(binding)), binding)
}

/// What all languages write alike: sums, products, quotients, comparisons; none for anything else.
pub(crate) fn arithmetic(op: Op, x: &[Text]) -> Option<Text> {
    Some(match op {
        Op::Add(..) => infix(x, "+", Binding::Sum),
        Op::Sub(..) => infix(x, "-", Binding::Sum),
        Op::Mul(..) => infix(x, "*", Binding::Product),
        Op::Div(..) => infix(x, "/", Binding::Product),
        Op::Less(..) => infix(x, "<", Binding::Comparison),
        _ => return None,
    })
}

/// The same with brackets around all but comparisons' own operands: not everybody knows which of `and` and `or` comes first.
pub(crate) fn clear_infix(x: &[Text], sign: &str, binding: Binding) -> Text {
    let [a, b] = [0, 1].map(|k| x[k].inside(Binding::Comparison));
    Text::new(format!("{a} {sign} {b}"), binding)
}

/// A function of the operands.
pub(crate) fn call(x: &[Text], name: &str) -> Text {
    let arguments: Vec<&str> = x.iter().map(|t| t.text.as_str()).collect();
    Text::whole(format!("{name}({})", arguments.join(", ")))
}

/// A name given to a value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Statement {
    pub(crate) node: Node,
    pub(crate) name: String,
    pub(crate) text: String,
    pub(crate) comment: Option<String>,
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
    let Source { graph, order, results, given, labels } = *source;
    let mut uses: HashMap<Node, usize> = HashMap::new();
    for node in order {
        for operand in graph.op(*node).operands() {
            *uses.entry(operand).or_default() += 1;
        }
    }
    for node in results {
        *uses.entry(*node).or_default() += 1;
    }
    let mut texts: HashMap<Node, Text> = given.clone();
    let mut said = Vec::new();
    let mut labelled: HashSet<Node> = HashSet::new();
    let text_of = |texts: &HashMap<Node, Text>, node: Node| match graph.op(node) {
        Op::Constant(bits) => dialect.constant(f64::from_bits(bits)),
        Op::Truth(holds) => dialect.constant(f64::from(u8::from(holds))),
        _ => texts.get(&node).cloned().unwrap_or_else(|| Text::whole("?")),
    };
    for node in order {
        if given.contains_key(node) {
            continue;
        }
        let op = graph.op(*node);
        let operands: Vec<Text> = op.operands().map(|operand| text_of(&texts, operand)).collect();
        let text = dialect.operation(op, &operands);
        let label = labels.get(node).filter(|_| labelled.insert(*node));
        let is_short = text.text.len() <= LONGEST;
        let once = uses.get(node).copied().unwrap_or(0) <= 1;
        // a pair is a statement of its own, and a member of it a name; without pairs it is the angle they are of
        let is_pair = matches!(op, Op::SinCos(_));
        let is_member = matches!(op, Op::Sin(_) | Op::Cos(_)) && dialect.has_pairs();
        let is_inner = label.is_none() && once && is_short && !is_pair;
        let stays = is_member || is_inner || is_pair && !dialect.has_pairs();
        if stays {
            texts.insert(*node, text);
            continue;
        }
        let name = match (label, op) {
            (Some((name, _)), _) => names.free(name),
            (None, op) if op.is_condition() => names.numbered("is"),
            (None, Op::SinCos(_)) => names.numbered("turn"),
            (None, _) => names.numbered("t"),
        };
        let comment = label.map(|(_, comment)| comment.clone());
        texts.insert(*node, Text::whole(name.clone()));
        said.push(Statement { node: *node, name, text: text.text, comment });
    }
    let results = results.iter().map(|node| text_of(&texts, *node)).collect();
    (said, results)
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
