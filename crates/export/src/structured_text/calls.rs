//! Loop bodies and linear interpolation as separate program organisation units.
//!
//! A unit with scalar parameters and one result is a `FUNCTION`. A unit with an array or several results is a
//! `FUNCTION_BLOCK` with the arrays as `VAR_IN_OUT`, which are passed by reference. Arrays as inputs of functions do
//! not compile in matiec (beremiz/matiec#9), functions with `VAR_IN_OUT` not in IronPLC (ironplc/ironplc#1672). These
//! function blocks have no state. Arrays have fixed lengths, since the second edition has no others.

use super::dialect::{StructuredText, literal};
use super::identifier::camel;
use super::line;
use super::lines::{Lines, array, kind_name};
use super::unit::{Declared, Kind, Section, Unit};
use crate::name::comment;
use crate::statement::{Dialect, Function, ParameterKind, Statement};
use std::collections::BTreeSet;

/// Units for a block; their names begin with the block's, so that two exports can be used in one project.
pub(super) struct Calls<'a> {
    /// The block's name within the names of its units.
    pub(super) block: &'a str,
    pub(super) functions: &'a [Function],
}

impl Calls<'_> {
    /// Whether a loop body is a `FUNCTION`; otherwise it is a `FUNCTION_BLOCK`.
    pub(super) fn is_function(&self, place: usize) -> bool {
        let Function { parameters, body, results, .. } = &self.functions[place];
        let is_table = |taken| matches!(taken, ParameterKind::Table(_));
        let calls_block = |statement: &Statement| match statement {
            Statement::Interpolation { .. } => true,
            Statement::Loop(of) => !self.is_function(of.function),
            _ => false,
        };
        results.len() == 1
            && !parameters.iter().any(|parameter| is_table(parameter.taken))
            && !body.iter().any(calls_block)
    }

    /// Name of a loop body's unit.
    pub(super) fn name(&self, place: usize) -> String {
        let kind = if self.is_function(place) { "F" } else { "FB" };
        let Function { origin, number, .. } = &self.functions[place];
        format!("{kind}_{}{}{number}", self.block, camel(origin))
    }

    /// Name of the unit that interpolates in a table of `length` entries.
    pub(super) fn interpolation(&self, length: usize) -> String {
        format!("FB_{}Interpolation{length}", self.block)
    }

    /// Name of a function block's instance: the type's name without the block's.
    pub(super) fn instance(&self, kind: &str) -> String {
        format!(
            "fb{}",
            kind.strip_prefix("FB_").and_then(|name| name.strip_prefix(self.block)).unwrap_or(kind)
        )
    }

    /// All units, each after those that it calls; `body` holds the block's own calls.
    pub(super) fn units(&self, body: &[&[Statement]]) -> Vec<Unit> {
        let bodies = self.functions.iter().map(|function| function.body.as_slice());
        let all = bodies.chain(body.iter().copied()).flatten();
        let lengths: BTreeSet<usize> = all
            .filter_map(|statement| match statement {
                Statement::Interpolation { length, .. } if *length > 1 => Some(*length),
                _ => None,
            })
            .collect();
        let lengths = lengths.into_iter().map(|length| self.interpolating(length));
        lengths.chain((0..self.functions.len()).map(|place| self.unit(place))).collect()
    }

    /// Linear interpolation between the two entries around an index, which is clamped to the table. Rounding the
    /// index minus one half gives the first of them: at an integer index either neighbour gives the same result.
    fn interpolating(&self, length: usize) -> Unit {
        let last = length - 1;
        let body = [
            format!("x := LIMIT(0.0E0, place, {});", literal(last as f64)),
            format!("i := LIMIT(0, LREAL_TO_DINT(x - 5.0E-1), {});", last - 1),
            "w := x - DINT_TO_LREAL(i);".to_string(),
            "value := entries[i] * (1.0E0 - w) + entries[i + 1] * w;".to_string(),
        ];
        let of = |section, name, kind: &str, said| Declared::new(section, name, kind, None, said);
        Unit {
            kind: Kind::FunctionBlock,
            name: self.interpolation(length),
            comment: format!(
                "Linear interpolation in a table of {length} entries; beyond either end the entry there"
            ),
            variables: vec![
                of(Section::InOut, "entries", &array(length), "Table, not modified"),
                of(Section::Input, "place", "LREAL", "Place in entries from the first"),
                of(Section::Output, "value", "LREAL", ""),
                of(Section::Local, "x", "LREAL", "Place within the table"),
                of(Section::Local, "i", "DINT", "Entry before it"),
                of(Section::Local, "w", "LREAL", "Weight of the entry behind it"),
            ],
            body: body.iter().map(|said| line(said, 0)).collect(),
            tasks: Vec::new(),
        }
    }

    fn unit(&self, place: usize) -> Unit {
        let Function { parameters, legend, body, results, .. } = &self.functions[place];
        let name = self.name(place);
        let is_function = self.is_function(place);
        let mut names = StructuredText.names();
        let inner = results.iter().map(|(name, _)| name).chain(parameters.iter().map(|p| &p.name));
        inner.for_each(|name| {
            names.free(name);
        });
        let mut lines = Lines::new(self);
        let mut text = lines.statements(body, &mut names, 0);
        for (result, value) in results {
            let to = if is_function { &name } else { result };
            text += &line(&format!("{to} := {value};"), 0);
        }
        let mut variables = Vec::new();
        if is_function {
            variables.push(Declared::new(Section::Result, &name, "LREAL", None, ""));
        }
        for parameter in parameters {
            let (section, kind) = match parameter.taken {
                ParameterKind::Row => (Section::Input, "DINT".to_string()),
                ParameterKind::One(kind) => (Section::Input, kind_name(kind).to_string()),
                ParameterKind::Table(length) => (Section::InOut, array(length)),
            };
            variables.push(Declared::new(section, &parameter.name, &kind, None, ""));
        }
        if !is_function {
            let result = |name: &String| Declared::new(Section::Output, name, "LREAL", None, "");
            variables.extend(results.iter().map(|(name, _)| result(name)));
        }
        variables.extend(lines.declared(&text));
        let said: Vec<String> = legend.iter().map(|said| comment(said)).collect();
        let explained = comment(&self.functions[place].explained());
        Unit {
            kind: if is_function { Kind::Function } else { Kind::FunctionBlock },
            name,
            comment: [vec![explained, Function::EXPLAINED.to_string()], said].concat().join(" "),
            variables,
            body: text,
            tasks: Vec::new(),
        }
    }
}
