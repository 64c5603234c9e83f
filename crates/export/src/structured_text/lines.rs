//! Statements as lines of Structured Text, and the variables that they need.

use super::{line, literal, unit::Declared, unit::Section};
use crate::graph::Graph;
use crate::name::{Names, comment};
use crate::statement::{Carried, Loop, Run, Statement};

/// Type of a table of numbers.
pub(super) fn array(count: usize) -> String {
    format!("ARRAY[0..{}] OF LREAL", count.saturating_sub(1))
}

/// Counter of the loops that copy and fill, which have nothing else in them.
pub(super) const COUNTER: &str = "iEntry";

/// Something for each entry of a table; `[iEntry]` is its place.
fn each(depth: usize, count: usize, what: &str) -> String {
    line(&format!("FOR {COUNTER} := 0 TO {} DO", count.saturating_sub(1)), depth)
        + &line(what, depth + 1)
        + &line("END_FOR;", depth)
}

/// All entries of a table set to one number.
pub(super) fn filled(table: &str, count: usize, value: f64, depth: usize) -> String {
    each(depth, count, &format!("{table}[{COUNTER}] := {};", literal(value)))
}

/// All entries of a table taken from those of another one of the same length.
pub(super) fn copied(to: &str, from: &str, count: usize, depth: usize) -> String {
    each(depth, count, &format!("{to}[{COUNTER}] := {from}[{COUNTER}];"))
}

/// Lines that are written, and the local variables that they need so far.
pub(super) struct Lines<'a> {
    graph: &'a Graph,
    /// Name and type of the variables.
    pub(super) locals: Vec<(String, String)>,
}

impl<'a> Lines<'a> {
    pub(super) fn new(graph: &'a Graph) -> Self {
        Self { graph, locals: Vec::new() }
    }

    /// The variables that were needed, and the counter where a loop copies or fills.
    pub(super) fn declared(self, body: &str) -> Vec<Declared> {
        let mut locals = self.locals;
        if body.contains(COUNTER) {
            locals.push((COUNTER.into(), "DINT".into()));
        }
        let of =
            |(name, kind): (String, String)| Declared::new(Section::Local, &name, &kind, None, "");
        locals.into_iter().map(of).collect()
    }

    pub(super) fn local(&mut self, name: &str, kind: impl Into<String>) {
        self.locals.push((name.into(), kind.into()));
    }

    /// A table filled by runs of other tables' entries, and single numbers.
    pub(super) fn table(&mut self, name: &str, runs: &[Run], depth: usize) -> String {
        let count: usize = runs.iter().map(Run::count).sum();
        self.local(name, array(count));
        let mut text = String::new();
        let mut place = 0;
        for run in runs {
            text += &match run {
                Run::One(value) => line(&format!("{name}[{place}] := {value};"), depth),
                Run::Copied { table, first, count } => {
                    let [to, from] = [place, *first].map(|k| match k {
                        0 => COUNTER.to_string(),
                        k => format!("{COUNTER} + {k}"),
                    });
                    each(depth, *count, &format!("{name}[{to}] := {table}[{from}];"))
                }
            };
            place += run.count();
        }
        text
    }

    /// Statements at a depth.
    pub(super) fn statements(
        &mut self,
        said: &[Statement],
        names: &mut Names,
        depth: usize,
    ) -> String {
        let mut all = String::new();
        for statement in said {
            all += &match statement {
                Statement::Value { node, name, text, comment: why } => {
                    let why =
                        why.as_ref().map(|why| line(&format!("(* {} *)", comment(why)), depth));
                    let is_condition = self.graph.op(*node).is_condition();
                    self.local(name, if is_condition { "BOOL" } else { "LREAL" });
                    why.unwrap_or_default() + &line(&format!("{name} := {text};"), depth)
                }
                Statement::Table { name, filled } => self.table(name, filled, depth),
                Statement::Interpolation { name, table, first, length, place } => {
                    self.interpolation(name, [table, place], [*first, *length], names, depth)
                }
                Statement::Loop(of) => self.repeated(of, names, depth),
            };
        }
        all
    }

    /// Linear interpolation between the two entries beside a place, which is taken into the table. Rounding half an entry
    /// below the place gives the first of them: at a whole place either neighbour serves.
    fn interpolation(
        &mut self,
        name: &str,
        [table, place]: [&str; 2],
        [first, length]: [usize; 2],
        names: &mut Names,
        depth: usize,
    ) -> String {
        self.local(name, "LREAL");
        let last = match length {
            0 => return line(&format!("{name} := 0.0E0;"), depth),
            1 => return line(&format!("{name} := {table}[{first}];"), depth),
            length => length - 1,
        };
        let [at, index, share] = ["x", "i", "w"].map(|beginning| names.numbered(beginning));
        for (name, kind) in [(&at, "LREAL"), (&index, "DINT"), (&share, "LREAL")] {
            self.local(name, kind);
        }
        let entry = |k: usize| match k {
            0 => format!("{table}[{index}]"),
            k => format!("{table}[{index} + {k}]"),
        };
        let (low, high) = (entry(first), entry(first + 1));
        [
            format!("{at} := LIMIT(0.0E0, {place}, {});", literal(last as f64)),
            format!("{index} := LIMIT(0, LREAL_TO_DINT({at} - 5.0E-1), {});", last - 1),
            format!("{share} := {at} - DINT_TO_LREAL({index});"),
            format!("{name} := {low} * (1.0E0 - {share}) + {high} * {share};"),
        ]
        .iter()
        .map(|said| line(said, depth))
        .collect()
    }

    /// A loop over rows.
    fn repeated(&mut self, of: &Loop, names: &mut Names, depth: usize) -> String {
        let Loop { counter, count, condition, carried, made, body } = of;
        self.local(counter, "DINT");
        let mut text = String::new();
        for Carried { names: [name, next], begin, .. } in carried {
            self.local(name, "LREAL");
            self.local(next, "LREAL");
            text += &line(&format!("{name} := {begin};"), depth);
        }
        for (name, _) in made {
            self.local(name, array(*count as usize));
            if condition.is_some() {
                text += &filled(name, *count as usize, 0.0, depth);
            }
        }
        let mut inner = depth;
        if let Some(condition) = condition {
            text += &line(&format!("IF {condition} THEN"), depth);
            inner += 1;
        }
        let last = i64::from(*count) - 1;
        text += &line(&format!("FOR {counter} := 0 TO {last} DO"), inner);
        text += &self.statements(body, names, inner + 1);
        for Carried { names: [_, next], next: value, .. } in carried {
            text += &line(&format!("{next} := {value};"), inner + 1);
        }
        for (name, entry) in made {
            text += &line(&format!("{name}[{counter}] := {entry};"), inner + 1);
        }
        for Carried { names: [name, next], .. } in carried {
            text += &line(&format!("{name} := {next};"), inner + 1);
        }
        text += &line("END_FOR;", inner);
        if condition.is_some() {
            text += &line("END_IF;", depth);
        }
        text
    }
}
