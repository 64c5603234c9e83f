//! Statements as lines of Structured Text, with the local variables that they need.

use super::calls::Calls;
use super::dialect::literal;
use super::line;
use super::unit::{Declared, Section};
use crate::name::{Names, comment};
use crate::statement::{Kind, Loop, Run, Statement, listed};
use std::collections::BTreeMap;

/// Type of a table of numbers.
pub(super) fn array(count: usize) -> String {
    format!("ARRAY[0..{}] OF LREAL", count.saturating_sub(1))
}

/// Counter of loops that only copy or fill.
pub(super) const COUNTER: &str = "iEntry";

/// A loop with the statement `what` for each entry of a table; `[iEntry]` is its index.
fn each(depth: usize, count: usize, what: &str) -> String {
    line(&format!("FOR {COUNTER} := 0 TO {} DO", count.saturating_sub(1)), depth)
        + &line(what, depth + 1)
        + &line("END_FOR;", depth)
}

/// Sets all entries of a table to one number.
pub(super) fn filled(table: &str, count: usize, value: f64, depth: usize) -> String {
    each(depth, count, &format!("{table}[{COUNTER}] := {};", literal(value)))
}

/// Copies all entries of a table of the same length.
pub(super) fn copied(to: &str, from: &str, count: usize, depth: usize) -> String {
    each(depth, count, &format!("{to}[{COUNTER}] := {from}[{COUNTER}];"))
}

/// Lines written so far, with the local variables that they need.
pub(super) struct Lines<'a> {
    calls: &'a Calls<'a>,
    /// Name and type of the variables.
    locals: Vec<(String, String)>,
    /// Instances of the function blocks that are called, by type.
    instances: BTreeMap<String, String>,
}

impl<'a> Lines<'a> {
    pub(super) fn new(calls: &'a Calls<'a>) -> Self {
        Self { calls, locals: Vec::new(), instances: BTreeMap::new() }
    }

    /// The local variables, including the counter where a loop copies or fills.
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

    /// The instance of a function block: one serves all calls, since it has no state.
    fn instance(&mut self, kind: &str, names: &mut Names) -> String {
        if let Some(name) = self.instances.get(kind) {
            return name.clone();
        }
        let name = names.free(&self.calls.instance(kind));
        self.local(&name, kind);
        self.instances.insert(kind.into(), name.clone());
        name
    }

    /// Fills a table by runs of other tables' entries, and single numbers.
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

    /// Prints statements at an indentation depth.
    pub(super) fn statements(
        &mut self,
        said: &[Statement],
        names: &mut Names,
        depth: usize,
    ) -> String {
        let mut all = String::new();
        for statement in said {
            all += &match statement {
                Statement::Value { kind, name, text, comment: why } => {
                    let why =
                        why.as_ref().map(|why| line(&format!("(* {} *)", comment(why)), depth));
                    self.local(name, kind_name(*kind));
                    why.unwrap_or_default() + &line(&format!("{name} := {text};"), depth)
                }
                Statement::Table { name, filled } => self.table(name, filled, depth),
                Statement::Interpolation { name, table, length, place, .. } => {
                    self.interpolation(name, [table, place], *length, names, depth)
                }
                Statement::Loop(of) => self.repeated(of, names, depth),
            };
        }
        all
    }

    /// Prints a linear interpolation in a whole table.
    fn interpolation(
        &mut self,
        name: &str,
        [table, place]: [&str; 2],
        length: usize,
        names: &mut Names,
        depth: usize,
    ) -> String {
        self.local(name, "LREAL");
        match length {
            0 => return line(&format!("{name} := 0.0E0;"), depth),
            1 => return line(&format!("{name} := {table}[0];"), depth),
            _ => {}
        }
        let instance = self.instance(&self.calls.interpolation(length), names);
        line(&format!("{instance}(entries := {table}, place := {place});"), depth)
            + &line(&format!("{name} := {instance}.value;"), depth)
    }

    /// Prints a loop, which calls a function for each row.
    fn repeated(&mut self, of: &Loop, names: &mut Names, depth: usize) -> String {
        let Loop { counter, count, condition, carried, made, function, arguments } = of;
        self.local(counter, "DINT");
        let mut text = String::new();
        for (name, begin) in carried {
            self.local(name, "LREAL");
            text += &line(&format!("{name} := {begin};"), depth);
        }
        for name in made {
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
        let called = &self.calls.functions[*function];
        let given = called.parameters.iter().zip(arguments);
        let given: Vec<String> =
            given.map(|(parameter, value)| format!("{} := {value}", parameter.name)).collect();
        let given = listed(&given);
        let kind = self.calls.name(*function);
        let results = of.results();
        match results.as_slice() {
            [to] if self.calls.is_function(*function) => {
                text += &line(&format!("{to} := {kind}({given});"), inner + 1);
            }
            _ => {
                let instance = self.instance(&kind, names);
                text += &line(&format!("{instance}({given});"), inner + 1);
                for (to, (from, _)) in results.iter().zip(&called.results) {
                    text += &line(&format!("{to} := {instance}.{from};"), inner + 1);
                }
            }
        }
        text += &line("END_FOR;", inner);
        if condition.is_some() {
            text += &line("END_IF;", depth);
        }
        text
    }
}

/// Type of a value; this language has no pairs.
pub(super) fn kind_name(kind: Kind) -> &'static str {
    match kind {
        Kind::Condition => "BOOL",
        Kind::Number | Kind::Pair => "LREAL",
    }
}
