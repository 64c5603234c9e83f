//! What was planned, as statements: which of it gets a name, and what is written within something else.

use crate::graph::Op;
use crate::name::Names;

/// How a language writes an operation.
pub(crate) trait Dialect {
    /// Names that are free at the beginning of a function.
    fn names(&self) -> Names;
    /// Whether a part of an array can be passed as an array.
    fn has_parts(&self) -> bool;
    /// The part of an array from an entry on.
    fn part(&self, array: &str, first: usize) -> String;
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

/// What a value is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A number.
    Number,
    /// A condition.
    Condition,
    /// A sine and a cosine.
    Pair,
}

impl Kind {
    /// Of an operation's result.
    pub(crate) fn of(op: Op) -> Self {
        match op {
            Op::SinCos(_) => Self::Pair,
            op if op.is_condition() => Self::Condition,
            _ => Self::Number,
        }
    }
}

/// Something that is done.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Statement {
    /// A name given to a value.
    Value { kind: Kind, name: String, text: String, comment: Option<String> },
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

/// A loop over rows, which calls a function for each.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Loop {
    /// Name of its counter, which begins at 0.
    pub(crate) counter: String,
    /// Rows.
    pub(crate) count: u32,
    /// Condition without which nothing is done.
    pub(crate) condition: Option<String>,
    /// What is carried from row to row: name, and what is carried into the first row.
    pub(crate) carried: Vec<(String, String)>,
    /// Names of the tables that it makes.
    pub(crate) made: Vec<String>,
    /// The function, by its place among all; its results are what is carried on, then the row's entries of the tables.
    pub(crate) function: usize,
    /// What the function is given, in the order of its parameters.
    pub(crate) arguments: Vec<String>,
}

impl Loop {
    /// Where the function's results go, in their order.
    pub(crate) fn results(&self) -> Vec<String> {
        let carried = self.carried.iter().map(|(name, _)| name.clone());
        carried.chain(self.made.iter().map(|name| format!("{name}[{}]", self.counter))).collect()
    }
}

/// What a function takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Taken {
    /// The row's number.
    Row,
    /// A number or a condition.
    One(Kind),
    /// An array of so many numbers.
    Table(usize),
}

/// A parameter of a function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Parameter {
    pub(crate) name: String,
    pub(crate) taken: Taken,
}

/// A repeated part: what is done for one row of a loop.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Function {
    /// The source file that it was recorded from, as a name.
    pub(crate) origin: String,
    /// Its number among those from there, from 1 on.
    pub(crate) number: usize,
    /// Parts that loops of call it.
    pub(crate) origins: Vec<String>,
    /// For how many rows loops call it.
    pub(crate) rows: Vec<u32>,
    /// What it takes.
    pub(crate) parameters: Vec<Parameter>,
    /// What has a name of what it takes in an array: the entry, and what it is.
    pub(crate) legend: Vec<String>,
    /// What is done in it.
    pub(crate) body: Vec<Statement>,
    /// What comes out, by name, and the value of it.
    pub(crate) results: Vec<(String, String)>,
}

/// A table and a place in it, of a text that is an entry: `name[place]`.
pub(crate) fn entry(text: &str) -> Option<(&str, usize)> {
    let (table, place) = text.strip_suffix(']')?.rsplit_once('[')?;
    let is_name = |c: char| c.is_ascii_alphanumeric() || "_.->".contains(c);
    let is_whole = table.chars().all(is_name) && !table.starts_with('-');
    Some((table, place.parse().ok().filter(|_| is_whole)?))
}

/// Fewest entries for which a loop is written.
pub(crate) const FEWEST: usize = 4;

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

impl Function {
    /// Whether another one differs in no more than where it is from.
    pub(crate) fn does_the_same_as(&self, other: &Self) -> bool {
        let of = |f: &Self| (f.parameters.clone(), f.body.clone(), f.results.clone());
        of(self) == of(other)
    }

    /// Takes on the loops of another one that does the same, and is not written.
    pub(crate) fn shared_with(&mut self, other: &Self) {
        self.rows.extend(&other.rows);
        self.rows.sort_unstable();
        self.rows.dedup();
        for origin in &other.origins {
            if !self.origins.contains(origin) {
                self.origins.push(origin.clone());
            }
        }
    }

    /// What it is, in a sentence.
    pub(crate) fn explained(&self) -> String {
        let rows: Vec<String> = self.rows.iter().map(u32::to_string).collect();
        let origins: Vec<String> = self.origins.iter().map(|of| of.replace('_', " ")).collect();
        format!(
            "Part of the {}, for each of {} rows.",
            origins.join(" and of the "),
            rows.join(" or ")
        )
    }

    /// What the names of its parameters and results say.
    pub(crate) const EXPLAINED: &str = "Given are row, the row's number; x, its entries of tables; a, what the row before carried on; b, numbers \
        from around the loop; is, conditions; r, tables. Results are n, what is carried on, and m, the row's entries of tables that the \
        loop makes.";
}

/// A line broken where it is longer than a width, at spaces, the rest drawn in.
pub(crate) fn broken(line: &str, width: usize) -> String {
    broken_at_spaces(line, width).replace(TOGETHER, " ")
}

/// A list of parameters or arguments, none of which a line is broken within.
pub(crate) fn listed(all: &[String]) -> String {
    let whole: Vec<String> = all.iter().map(|text| text.replace(' ', TOGETHER)).collect();
    whole.join(", ")
}

/// In place of a space at which a line is not broken.
const TOGETHER: &str = "\u{1}";

fn broken_at_spaces(line: &str, width: usize) -> String {
    let indent = line.len() - line.trim_start().len();
    let (mut whole, mut rest) = (String::new(), line.to_string());
    while rest.len() > width {
        let at = rest[..width].rfind(' ').filter(|at| *at > indent + 8);
        let first = rest.len() - rest.trim_start().len();
        let Some(at) = at.or_else(|| rest[first..].find(' ').map(|at| at + first)) else { break };
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
