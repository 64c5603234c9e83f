//! Statements and functions as lines of C.

use super::WIDTH;
use crate::name::comment;
use crate::statement::{Function, Kind, Loop, ParameterKind, Run, Statement, broken, listed};

/// A line within a function.
pub(super) fn line(text: &str) -> String {
    inner_line(text, 1)
}

/// A line at an indentation depth.
fn inner_line(text: &str, depth: usize) -> String {
    broken(&format!("{}{text}", "    ".repeat(depth)), WIDTH) + "\n"
}

/// A loop with the statement `what` for each entry `i` of a table.
pub(super) fn each(depth: usize, count: usize, what: &str) -> String {
    inner_line(&format!("for (int i = 0; i < {count}; i++) {{"), depth)
        + &inner_line(what, depth + 1)
        + &inner_line("}", depth)
}

/// Context for printing statements.
pub(super) struct Lines<'a> {
    /// Name of the floating-point type.
    pub(super) real: &'a str,
    /// Functions of the block.
    pub(super) functions: &'a [Function],
    /// Names of these functions.
    pub(super) names: &'a [String],
}

impl Lines<'_> {
    /// Declares and fills a table.
    pub(super) fn table(&self, name: &str, filled: &[Run]) -> String {
        let (depth, real) = (1, self.real);
        let count: usize = filled.iter().map(Run::count).sum();
        let one = |run: &Run| match run {
            Run::One(text) => Some(text.clone()),
            Run::Copied { .. } => None,
        };
        if let Some(all) = filled.iter().map(one).collect::<Option<Vec<_>>>() {
            let said = format!("const {real} {name}[{count}] = {{ {} }};", all.join(", "));
            return inner_line(&said, depth);
        }
        let mut text = inner_line(&format!("{real} {name}[{count}];"), depth);
        let mut place = 0;
        for run in filled {
            text += &match run {
                Run::One(value) => inner_line(&format!("{name}[{place}] = {value};"), depth),
                Run::Copied { table, first, count } => {
                    let [to, from] = [place, *first].map(|k| match k {
                        0 => "i".to_string(),
                        k => format!("i + {k}"),
                    });
                    each(depth, *count, &format!("{name}[{to}] = {table}[{from}];"))
                }
            };
            place += run.count();
        }
        text
    }

    /// Prints statements.
    pub(super) fn statements(&self, said: &[Statement]) -> String {
        let mut all = String::new();
        let real = self.real;
        for statement in said {
            all += &match statement {
                Statement::Value { kind, name, text, comment: why } => {
                    let why = why.as_ref().map(|why| line(&format!("/* {} */", comment(why))));
                    let kind = self.kind(*kind);
                    why.unwrap_or_default() + &line(&format!("const {kind} {name} = {text};"))
                }
                Statement::Table { name, filled } => self.table(name, filled),
                Statement::Interpolation { name, table, first, length, place } => {
                    let table =
                        if *first == 0 { table.clone() } else { format!("&{table}[{first}]") };
                    line(&format!(
                        "const {real} {name} = hb_interpolated({table}, {length}, {place});"
                    ))
                }
                Statement::Loop(of) => self.repeated(of),
            };
        }
        all
    }

    fn kind(&self, kind: Kind) -> &str {
        match kind {
            Kind::Number => self.real,
            Kind::Condition => "int",
            Kind::Pair => "hb_turn",
        }
    }

    /// Prints a loop, which calls a function for each row.
    fn repeated(&self, of: &Loop) -> String {
        let Loop { counter, count, condition, carried, made, function, arguments } = of;
        let real = self.real;
        let mut text = String::new();
        for (name, begin) in carried {
            text += &line(&format!("{real} {name} = {begin};"));
        }
        let zero = if condition.is_some() { " = { 0 }" } else { "" };
        for name in made {
            text += &line(&format!("{real} {name}[{count}]{zero};"));
        }
        let rows = match condition {
            Some(condition) => format!("({condition} ? {count} : 0)"),
            None => count.to_string(),
        };
        text += &line(&format!("for (int {counter} = 0; {counter} < {rows}; {counter}++) {{"));
        let mut arguments = arguments.clone();
        let results = of.results();
        let result = match results.as_slice() {
            [one] => format!("{one} = "),
            _ => {
                arguments.extend(results.iter().map(|to| format!("&{to}")));
                String::new()
            }
        };
        let name = &self.names[*function];
        let said = format!("{result}{name}({});", listed(&arguments));
        text + &inner_line(&said, 2) + &line("}")
    }

    /// Prints the function with index `place`.
    pub(super) fn function(&self, place: usize) -> String {
        let Function { parameters, legend, body, results, .. } = &self.functions[place];
        let real = self.real;
        let mut taken: Vec<String> = Vec::new();
        for parameter in parameters {
            let name = &parameter.name;
            taken.push(match parameter.taken {
                ParameterKind::Row => format!("int {name}"),
                ParameterKind::One(kind) => format!("{} {name}", self.kind(kind)),
                ParameterKind::Table(_) => format!("const {real} *{name}"),
            });
        }
        let mut body = self.statements(body);
        let result = match results.as_slice() {
            [(_, one)] => {
                body += &line(&format!("return {one};"));
                real
            }
            _ => {
                taken.extend(results.iter().map(|(name, _)| format!("{real} *{name}")));
                for (name, value) in results {
                    body += &line(&format!("*{name} = {value};"));
                }
                "void"
            }
        };
        let mut said = comment(&self.functions[place].explained());
        for entry in legend {
            said += &format!("\n   {}", comment(entry));
        }
        let signature = format!("static {result} {}({})", self.names[place], listed(&taken));
        format!("\n/* {said} */\n{}\n{{\n{body}}}\n", broken(&signature, WIDTH))
    }

    /// Prints all functions from an index on.
    pub(super) fn functions(&self, first: usize) -> String {
        (first..self.functions.len()).map(|place| self.function(place)).collect()
    }
}
