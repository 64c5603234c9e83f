//! Statements of generated code, independent of the language.

use crate::graph::Op;
use crate::name::Names;

/// Syntax of a language.
pub(crate) trait Dialect {
    /// Names available at the beginning of a function.
    fn names(&self) -> Names;
    /// Whether a part of an array can be passed as an array.
    fn has_parts(&self) -> bool;
    /// The part of an array that begins at an index.
    fn part(&self, array: &str, first: usize) -> String;
    /// A constant.
    fn constant(&self, value: f64) -> Text;
    /// Whether sine and cosine come from one call, as a named pair.
    fn has_pairs(&self) -> bool;
    /// The index of a loop's row, by its counter.
    fn row(&self, counter: &str) -> Text;
    /// An operation on the texts of its operands.
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

/// A piece of source code with its precedence.
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

    /// The text as an operand at this precedence, in brackets if it is lower.
    pub(crate) fn within(&self, precedence: Precedence) -> String {
        match self.precedence >= precedence {
            true => self.text.clone(),
            false => format!("({})", self.text),
        }
    }

    /// The text as an operand that must have a higher precedence.
    pub(crate) fn inside(&self, precedence: Precedence) -> String {
        match self.precedence > precedence {
            true => self.text.clone(),
            false => format!("({})", self.text),
        }
    }
}

/// Two operands with an operator between them; operators of equal precedence associate to the left.
fn infix(x: &[Text], sign: &str, precedence: Precedence) -> Text {
    Text::new(format!("{} {sign} {}", x[0].within(precedence), x[1].inside(precedence)), precedence)
}

/// Operations with the same syntax in all languages: sums, products, quotients, comparisons; `None` for others.
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

/// Like `infix`, with brackets around `and` and `or` for readability.
pub(crate) fn clear_infix(x: &[Text], sign: &str, precedence: Precedence) -> Text {
    let [a, b] = [0, 1].map(|k| x[k].inside(Precedence::Comparison));
    Text::new(format!("{a} {sign} {b}"), precedence)
}

/// A function call.
pub(crate) fn call(x: &[Text], name: &str) -> Text {
    let arguments: Vec<&str> = x.iter().map(|t| t.text.as_str()).collect();
    Text::whole(format!("{name}({})", arguments.join(", ")))
}

/// Type of a value.
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
    /// Type of an operation's result.
    pub(crate) fn of(op: Op) -> Self {
        match op {
            Op::SinCos(_) => Self::Pair,
            op if op.is_condition() => Self::Condition,
            _ => Self::Number,
        }
    }
}

/// A statement.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Statement {
    /// Definition of a named value.
    Value { kind: Kind, name: String, text: String, comment: Option<String> },
    /// Filling of a table.
    Table { name: String, filled: Vec<Run> },
    /// Linear interpolation in a table from its entry `first` on.
    Interpolation { name: String, table: String, first: usize, length: usize, place: String },
    /// A loop.
    Loop(Loop),
}

/// Consecutive entries of a table.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Run {
    /// `count` entries of another table, from index `first` on.
    Copied { table: String, first: usize, count: usize },
    /// A single entry.
    One(String),
}

impl Run {
    /// Number of entries.
    pub(crate) fn count(&self) -> usize {
        match self {
            Self::Copied { count, .. } => *count,
            Self::One(_) => 1,
        }
    }
}

/// A loop over rows that calls a function for each row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Loop {
    /// Name of its counter, which begins at 0.
    pub(crate) counter: String,
    /// Number of rows.
    pub(crate) count: u32,
    /// Condition for executing the loop.
    pub(crate) condition: Option<String>,
    /// Loop-carried variables: name and initial value.
    pub(crate) carried: Vec<(String, String)>,
    /// Names of the output tables.
    pub(crate) made: Vec<String>,
    /// Index of the function; its results are the loop-carried values, then the row's entries of the output tables.
    pub(crate) function: usize,
    /// Arguments of the function, in the order of its parameters.
    pub(crate) arguments: Vec<String>,
}

impl Loop {
    /// Variables for the function's results, in their order.
    pub(crate) fn results(&self) -> Vec<String> {
        let carried = self.carried.iter().map(|(name, _)| name.clone());
        carried.chain(self.made.iter().map(|name| format!("{name}[{}]", self.counter))).collect()
    }
}

/// Kind of a function's parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ParameterKind {
    /// Index of the row.
    Row,
    /// A number or a condition.
    One(Kind),
    /// An array of this length.
    Table(usize),
}

/// A parameter of a function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Parameter {
    pub(crate) name: String,
    pub(crate) taken: ParameterKind,
}

/// A function with the operations of one row of a loop.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Function {
    /// Name of the source file that it was recorded from.
    pub(crate) origin: String,
    /// Its number among the functions from that file, from 1.
    pub(crate) number: usize,
    /// Names of the source files whose loops call it.
    pub(crate) origins: Vec<String>,
    /// Number of rows of each loop that calls it.
    pub(crate) rows: Vec<u32>,
    /// Parameters.
    pub(crate) parameters: Vec<Parameter>,
    /// Legend of array parameters: entry and quantity.
    pub(crate) legend: Vec<String>,
    /// Statements.
    pub(crate) body: Vec<Statement>,
    /// Results: names and values.
    pub(crate) results: Vec<(String, String)>,
}

/// Table and index of a text of the form `name[index]`.
pub(crate) fn entry(text: &str) -> Option<(&str, usize)> {
    let (table, place) = text.strip_suffix(']')?.rsplit_once('[')?;
    let is_name = |c: char| c.is_ascii_alphanumeric() || "_.->".contains(c);
    let is_whole = table.chars().all(is_name) && !table.starts_with('-');
    Some((table, place.parse().ok().filter(|_| is_whole)?))
}

/// Smallest number of entries for which a loop is written.
pub(crate) const FEWEST: usize = 4;

/// Groups texts into runs of other tables' entries and single ones.
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

/// Groups neighbours that are the entries of one table from 0 on: ranges of their positions with the table's name;
/// `None` for texts that are no table entries.
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
    /// Whether another function differs only in its origin.
    pub(crate) fn is_same_function(&self, other: &Self) -> bool {
        let of = |f: &Self| (f.parameters.clone(), f.body.clone(), f.results.clone());
        of(self) == of(other)
    }

    /// Takes over the loops of an equal function, which is not written.
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

    /// One-sentence description for the generated comment.
    pub(crate) fn explained(&self) -> String {
        let rows: Vec<String> = self.rows.iter().map(u32::to_string).collect();
        let origins: Vec<String> = self.origins.iter().map(|of| of.replace('_', " ")).collect();
        format!(
            "Part of the {}, for each of {} rows.",
            origins.join(" and of the "),
            rows.join(" or ")
        )
    }

    /// Explanation of the names of parameters and results.
    pub(crate) const EXPLAINED: &str = "Parameters: row, index of the row; x, its table entries; a, loop-carried values; \
        b, numbers from outside the loop; is, conditions; r, tables. \
        Results: n, the next loop-carried values; m, the row's entries of the output tables.";
}

/// Breaks a line that exceeds a width at spaces, with indentation.
pub(crate) fn broken(line: &str, width: usize) -> String {
    broken_at_spaces(line, width).replace(TOGETHER, " ")
}

/// A list of parameters or arguments, without line breaks within one.
pub(crate) fn listed(all: &[String]) -> String {
    let whole: Vec<String> = all.iter().map(|text| text.replace(' ', TOGETHER)).collect();
    whole.join(", ")
}

/// Placeholder of a space at which a line is not broken.
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
