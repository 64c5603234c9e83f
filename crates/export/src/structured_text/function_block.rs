//! Function block of a block: interface, values derived from the parameters, initial state, and what a call computes.

use super::calls::Calls;
use super::dialect::{StructuredText, literal};
use super::identifier::{block_name, camel, edge_name, switch_name};
use super::line;
use super::lines::{Lines, array, copied, filled};
use super::unit::{Declared, Kind, Section, Unit};
use crate::block::{Block, Entry, Target, Variable};
use crate::error::ExportError;
use crate::graph::{Graph, Node};
use crate::name::{Names, comment};
use crate::plan::Plan;
use crate::statement::{Dialect, Function, Precedence, Run, Statement, Text, grouped, runs};
use crate::writing::{Source, statements};
use std::collections::HashMap;
use std::ops::Range;

/// Unit of Boolean quantities and of a status, which are `BOOL` and `DINT` at a block's interface.
const SWITCH: &str = "0/1";
const STATUS: &str = "code";

/// Type of an input or output.
fn edge_kind(v: &Variable) -> &'static str {
    match v.unit.as_str() {
        SWITCH => "BOOL",
        STATUS => "DINT",
        _ => "LREAL",
    }
}

/// An input or output of a block.
fn edge(section: Section, name: &str, initial: Option<f64>, v: &Variable) -> Declared {
    match edge_kind(v) {
        "LREAL" => declared(section, name, initial, v),
        kind => Declared::new(section, name, kind, None, &comment(&v.meaning)),
    }
}

/// A variable of a block, with its unit in the comment.
fn declared(section: Section, name: &str, initial: Option<f64>, v: &Variable) -> Declared {
    let unit = if v.unit.is_empty() { String::new() } else { format!(" [{}]", comment(&v.unit)) };
    let said = if v.meaning.is_empty() { String::new() } else { comment(&v.meaning) + &unit };
    Declared::new(section, name, "LREAL", initial.map(literal).as_deref(), &said)
}

/// Function block (IEC 61131-3) of a block, without the program organisation units that it calls.
///
/// # Errors
///
/// [`ExportError::Foreign`] if it depends on a quantity outside it, [`ExportError::Constant`] on a number that the
/// language cannot represent.
pub fn function_block(block: &Block) -> Result<Unit, ExportError> {
    Ok(split_units(block)?.1)
}

/// Function block (IEC 61131-3) of a block, after the functions and function blocks that it calls.
///
/// # Errors
///
/// [`ExportError::Foreign`] if it depends on a quantity outside it, [`ExportError::Constant`] on a number that the
/// language cannot represent.
pub fn block_units(block: &Block) -> Result<Vec<Unit>, ExportError> {
    let (mut units, block) = split_units(block)?;
    units.push(block);
    Ok(units)
}

/// The units that a block calls, and the block.
fn split_units(block: &Block) -> Result<(Vec<Unit>, Unit), ExportError> {
    let plan = Plan::of(block)?;
    if let Some(value) = unrepresentable(&block.graph, &plan) {
        return Err(ExportError::Constant { block: block.name.clone(), value });
    }
    let mut names = StructuredText.names();
    for own in ["bReset", "bPrepare", "bReady"] {
        names.free(own);
    }
    let interface = Interface::of(block, &plan, &mut names);
    let mut functions = Vec::new();
    let mut given = interface.parameter_texts();
    let derived = interface.derived(&plan, &mut given, &mut names, &mut functions);
    interface.add_texts(&mut given);
    let entries = interface.entries(&plan, &given, &mut names, &mut functions);

    let calls = Calls { block: &camel(&block.name), functions: &functions };
    let mut lines = Lines::new(&calls);
    let deriving = lines.statements(&derived.statements, &mut names, 1) + &derived.keeping;
    let mut working = String::new();
    for (entry, (said, results)) in block.entries.iter().zip(&entries) {
        working += &lines.statements(said, &mut names, 0);
        working += &interface.assigned(entry, results, &mut lines, &mut names);
    }
    let starting = interface.initial_state();
    let when = if interface.parameters.is_empty() { "" } else { "bPrepare OR " };
    let deriving = match derived.kept.is_empty() {
        true => String::new(),
        false => format!(
            "IF {when}bReset OR NOT bReady THEN\n    (* derived values *)\n{deriving}END_IF;\n"
        ),
    };
    let body = format!(
        "{deriving}IF bReset OR NOT bReady THEN\n    (* initial state *)\n{starting}    bReady := TRUE;\nEND_IF;\n\n{working}"
    );
    let mut variables = interface.variables(&derived.kept);
    variables.extend(lines.declared(&body));
    let bodies: Vec<&[Statement]> = entries
        .iter()
        .map(|(said, _)| said.as_slice())
        .chain([derived.statements.as_slice()])
        .collect();
    let units = calls.units(&bodies);
    let block = Unit {
        kind: Kind::FunctionBlock,
        name: block_name(block),
        comment: format!(
            "{}. SI units but for the parameters, which have those of the crane file.",
            comment(&block.meaning)
        ),
        variables,
        body,
        tasks: Vec::new(),
    };
    Ok((units, block))
}

/// A constant that the language cannot represent.
fn unrepresentable(graph: &Graph, plan: &Plan) -> Option<f64> {
    let all = plan.preparing.iter().chain(plan.entries.iter().flatten());
    let operands = all.flat_map(|node| graph.operands(*node));
    operands.filter_map(|node| graph.constant(node)).find(|value| !value.is_finite())
}

/// Names of variables; entries of a table have its name and their index. The names of states have a prefix.
fn names_of(variables: &[&Variable], prefix: &str, names: &mut Names) -> Vec<String> {
    let mut of = |name: &str, unit: &str| match prefix {
        "" if unit == SWITCH => names.free(&switch_name(name)),
        "" => names.free(&edge_name(name)),
        _ => names.free(&format!("{prefix}{}", camel(&edge_name(name)))),
    };
    let mut all = Vec::new();
    for (table, range) in grouped(variables.iter().map(|v| v.name.as_str())) {
        let v = variables[range.start];
        let name = of(table.as_deref().unwrap_or(&v.name), &v.unit);
        match table {
            Some(_) => all.extend((0..range.len()).map(|k| format!("{name}[{k}]"))),
            None => all.push(name),
        }
    }
    all
}

/// Declarations of variables by `one`, from index and name; those of a table's entries as one array.
fn tabled(names: &[String], one: &dyn Fn(usize, &str) -> Declared) -> Vec<Declared> {
    let of = |(table, range): (Option<String>, Range<usize>)| match table {
        None => one(range.start, &names[range.start]),
        Some(table) => {
            Declared { kind: array(range.len()), initial: None, ..one(range.start, &table) }
        }
    };
    grouped(names.iter().map(String::as_str)).into_iter().map(of).collect()
}

/// A block's quantities with their names in the function block.
struct Interface<'a> {
    block: &'a Block,
    /// Names of the inputs, outputs and states, in the block's order.
    inputs: Vec<String>,
    outputs: Vec<String>,
    states: Vec<String>,
    /// Parameters on which a result depends, and their names.
    parameters: Vec<&'a (Variable, Node)>,
    parameter_names: Vec<String>,
}

/// Values derived from the parameters.
struct Derived {
    statements: Vec<Statement>,
    /// Assignments to the variables that store them.
    keeping: String,
    /// Names and meanings of these variables.
    kept: Vec<(String, Variable)>,
}

impl<'a> Interface<'a> {
    fn of(block: &'a Block, plan: &Plan, names: &mut Names) -> Self {
        let inputs: Vec<&Variable> = block.inputs.iter().map(|(v, _)| v).collect();
        let outputs: Vec<&Variable> = block.outputs.iter().collect();
        let states: Vec<&Variable> = block.states.iter().map(|(v, _)| v).collect();
        let inputs = names_of(&inputs, "", names);
        let outputs = names_of(&outputs, "", names);
        let states = names_of(&states, "s", names);
        let parameters: Vec<&(Variable, Node)> =
            plan.parameters.iter().map(|k| &block.parameters[*k]).collect();
        let parameter_names = parameters.iter().map(|(v, _)| names.free(&v.name)).collect();
        Self { block, inputs, outputs, states, parameters, parameter_names }
    }

    /// Texts by which parameters are read.
    fn parameter_texts(&self) -> HashMap<Node, Text> {
        let all = self.parameters.iter().zip(&self.parameter_names);
        all.map(|((_, node), name)| (*node, Text::whole(name))).collect()
    }

    /// Adds the texts by which inputs and states are read.
    fn add_texts(&self, given: &mut HashMap<Node, Text>) {
        for ((v, node), name) in self.block.inputs.iter().zip(&self.inputs) {
            let text = match v.unit == SWITCH {
                true => format!("SEL({name}, 0.0E0, 1.0E0)"),
                false => name.clone(),
            };
            given.insert(*node, Text::whole(text));
        }
        for ((_, node), name) in self.block.states.iter().zip(&self.states) {
            given.insert(*node, Text::whole(name));
        }
    }

    /// Values derived from the parameters; adds the texts by which they are read.
    fn derived(
        &self,
        plan: &Plan,
        given: &mut HashMap<Node, Text>,
        names: &mut Names,
        functions: &mut Vec<Function>,
    ) -> Derived {
        let (arrays, labels) = (HashMap::new(), HashMap::new());
        let from = Source {
            graph: &self.block.graph,
            order: &plan.preparing,
            results: &plan.prepared,
            given: &*given,
            arrays: &arrays,
            labels: &labels,
        };
        let (statements, results) = statements(&from, &StructuredText, names, functions);
        let mut keeping = String::new();
        let mut kept = Vec::new();
        for (node, text) in plan.prepared.iter().zip(&results) {
            // a parameter is a variable already
            if self.parameters.iter().any(|(_, parameter)| parameter == node) {
                continue;
            }
            let label = self.block.labels.get(node);
            let name = match label {
                Some((name, _)) => names.free(&edge_name(name)),
                None => names.numbered("k"),
            };
            keeping += &line(&format!("{name} := {};", text.text), 1);
            given.insert(*node, Text::whole(&name));
            let meaning = label.map_or(String::new(), |(_, comment)| comment.clone());
            let unnamed =
                Variable { name: String::new(), unit: String::new(), meaning, initial: 0.0 };
            kept.push((name, unnamed));
        }
        Derived { statements, keeping, kept }
    }

    /// Statements of each of the block's entries, and the texts of its results.
    fn entries(
        &self,
        plan: &Plan,
        given: &HashMap<Node, Text>,
        names: &mut Names,
        functions: &mut Vec<Function>,
    ) -> Vec<(Vec<Statement>, Vec<Text>)> {
        let block = self.block;
        let labels: HashMap<Node, (String, String)> = block
            .labels
            .iter()
            .map(|(node, (name, comment))| (*node, (edge_name(name), comment.clone())))
            .collect();
        // inputs cannot be passed by reference
        let arrays: HashMap<String, usize> = grouped(self.states.iter().map(String::as_str))
            .into_iter()
            .filter_map(|(table, range)| Some((table?, range.len())))
            .collect();
        let mut all = Vec::new();
        for (entry, order) in block.entries.iter().zip(&plan.entries) {
            let results: Vec<Node> = entry.results.iter().map(|(_, node)| *node).collect();
            let from = Source {
                graph: &block.graph,
                order,
                results: &results,
                given,
                arrays: &arrays,
                labels: &labels,
            };
            all.push(statements(&from, &StructuredText, names, functions));
        }
        all
    }

    /// Assignments of an entry's results. They are simultaneous: no state changes before the last new value is
    /// computed.
    fn assigned(
        &self,
        entry: &Entry,
        results: &[Text],
        lines: &mut Lines<'_>,
        names: &mut Names,
    ) -> String {
        let (mut first, mut last) = (String::new(), String::new());
        let name_of = |target: &Target| match target {
            Target::State(k) => self.states[*k].as_str(),
            Target::Output(k) => self.outputs[*k].as_str(),
        };
        for (table, range) in grouped(entry.results.iter().map(|(target, _)| name_of(target))) {
            let (target, text) = (entry.results[range.start].0, &results[range.start]);
            match (table, target) {
                (Some(table), _) => {
                    let runs = runs(results[range.clone()].iter().map(|text| text.text.as_str()));
                    let stays = |run: &Run| matches!(run, Run::Copied { table: of, first: 0, .. } if *of == table);
                    if runs.len() == 1 && runs.iter().all(stays) {
                        continue;
                    }
                    let next = names.numbered("next");
                    first += &lines.table(&next, &runs, 0);
                    last += &copied(&table, &next, range.len(), 0);
                }
                (None, Target::State(k)) => {
                    let next = names.numbered("next");
                    first += &line(&format!("{next} := {};", text.text), 0);
                    last += &line(&format!("{} := {next};", self.states[k]), 0);
                    lines.local(&next, "LREAL");
                }
                (None, Target::Output(k)) => {
                    let name = &self.outputs[k];
                    let text = match edge_kind(&self.block.outputs[k]) {
                        "BOOL" => format!("0.5E0 < {}", text.inside(Precedence::Sum)),
                        "DINT" => format!("LREAL_TO_DINT({})", text.text),
                        _ => text.text.clone(),
                    };
                    first += &line(&format!("{name} := {text};"), 0);
                }
            }
        }
        first + &last
    }

    /// Assignments of the initial state.
    fn initial_state(&self) -> String {
        let states = &self.block.states;
        let mut starting = String::new();
        for (table, range) in grouped(self.states.iter().map(String::as_str)) {
            let initial = states[range.start].0.initial;
            match table {
                Some(table) if states[range.clone()].iter().all(|(v, _)| v.initial == initial) => {
                    starting += &filled(&table, range.len(), initial, 1);
                }
                _ => {
                    for k in range {
                        let (name, value) = (&self.states[k], literal(states[k].0.initial));
                        starting += &line(&format!("{name} := {value};"), 1);
                    }
                }
            }
        }
        starting
    }

    /// Declarations of inputs, outputs, states, parameters, and of the variables that store derived values.
    fn variables(&self, kept: &[(String, Variable)]) -> Vec<Declared> {
        let block = self.block;
        let flag = |name, meaning| Declared::new(Section::Input, name, "BOOL", None, meaning);
        let mut variables = vec![flag("bReset", "Restart at the initial values")];
        if !self.parameters.is_empty() {
            variables.push(flag("bPrepare", "A parameter was changed"));
        }
        variables.extend(tabled(&self.inputs, &|k, name| {
            let v = &block.inputs[k].0;
            edge(Section::Input, name, Some(v.initial), v)
        }));
        variables.extend(tabled(&self.outputs, &|k, name| {
            edge(Section::Output, name, None, &block.outputs[k])
        }));
        variables.push(Declared::new(Section::Local, "bReady", "BOOL", None, ""));
        variables.extend(tabled(&self.states, &|k, name| {
            let v = &block.states[k].0;
            declared(Section::Local, name, Some(v.initial), v)
        }));
        let parameters = self.parameters.iter().zip(&self.parameter_names);
        variables.extend(
            parameters.map(|((v, _), name)| declared(Section::Local, name, Some(v.initial), v)),
        );
        variables.extend(kept.iter().map(|(name, v)| declared(Section::Local, name, None, v)));
        variables
    }
}
