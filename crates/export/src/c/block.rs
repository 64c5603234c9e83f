//! A block as C: its structures in the header, its functions in header and source.

use super::dialect::{C, RESERVED};
use super::lines::{Lines, each, line};
use super::{Precision, WIDTH};
use crate::block::{Block, Entry, Target, Variable};
use crate::error::ExportError;
use crate::graph::Node;
use crate::name::{Names, comment};
use crate::plan::Plan;
use crate::statement::{Dialect, Function, Run, Text, broken, grouped, runs};
use crate::writing::{Source, statements};
use std::collections::HashMap;
use std::fmt::Write;

/// Adds a block to header and source; returns the names of its functions. `inner` holds the source's internal names.
pub(super) fn printed(
    block: &Block,
    precision: Precision,
    own: &str,
    inner: &mut Names,
    [header, source]: [&mut String; 2],
) -> Result<Vec<String>, ExportError> {
    let plan = Plan::of(block)?;
    let parameters: Vec<&(Variable, Node)> =
        plan.parameters.iter().map(|k| &block.parameters[*k]).collect();
    let _ = writeln!(header, "\n/* ---- {} ---- */", comment(&block.meaning));
    let mut printer = BlockPrinter {
        block,
        dialect: C(precision),
        own,
        prefix: format!("{own}{}", block.name),
        real: format!("{own}real"),
        header,
        definitions: String::new(),
        declarations: Vec::new(),
        functions: Vec::new(),
        called: Vec::new(),
        repeated: String::new(),
    };
    let fields: Vec<&Variable> = parameters.iter().map(|(v, _)| v).collect();
    printer.structure(
        "What describes it; names and units are those of the crane file.",
        "parameters",
        &fields,
    );
    let (preparing, results) = printer.preparing(&plan, &parameters, inner);
    let kept = prepared_variables(block, &plan, &parameters);
    if !parameters.is_empty() {
        printer.prepared_structure(&kept);
    }
    let of =
        |vs: &[(Variable, Node)]| -> Vec<Variable> { vs.iter().map(|(v, _)| v.clone()).collect() };
    let (inputs, states) = (of(&block.inputs), of(&block.states));
    printer.structure("What comes from outside.", "input", &inputs.iter().collect::<Vec<_>>());
    printer.structure("What it remembers.", "state", &states.iter().collect::<Vec<_>>());
    printer.structure("What it shows.", "output", &block.outputs.iter().collect::<Vec<_>>());

    if !parameters.is_empty() {
        printer.parameter_functions(&fields, &kept, preparing, &results);
    }
    if !states.is_empty() {
        let prefix = &printer.prefix;
        let argument = format!("{prefix}_state *s");
        let values = printer.initial_values(&states.iter().collect::<Vec<_>>(), "s");
        printer.declare("start", &argument, "The state to start from.", &values);
    }
    let arrays: HashMap<String, usize> = arrays("u", &inputs).chain(arrays("s", &states)).collect();
    for (entry, order) in block.entries.iter().zip(&plan.entries) {
        printer.entry(entry, order, &kept, &arrays, inner);
    }
    let BlockPrinter { repeated, definitions, declarations, .. } = printer;
    if !repeated.is_empty() {
        let said =
            format!("   Repeated parts: loops call them for their rows. {}", Function::EXPLAINED);
        let said = broken(&said, WIDTH).replace("\n    ", "\n");
        let _ = write!(source, "\n/* {} */\n", said.trim_start());
    }
    *source += &repeated;
    *source += &definitions;
    Ok(declarations)
}

/// A block of which header and source are being printed.
struct BlockPrinter<'a> {
    block: &'a Block,
    dialect: C,
    /// Prefix of all names with external linkage.
    own: &'a str,
    /// Beginning of the names of this block.
    prefix: String,
    /// Name of the floating-point type.
    real: String,
    header: &'a mut String,
    /// Definitions of the functions that the header declares.
    definitions: String,
    /// Names of these functions.
    declarations: Vec<String>,
    /// Functions of repeated parts, and their names.
    functions: Vec<Function>,
    called: Vec<String>,
    /// Definitions of the functions of repeated parts.
    repeated: String,
}

impl BlockPrinter<'_> {
    /// Declares a structure of some variables in the header.
    fn structure(&mut self, what: &str, name: &str, fields: &[&Variable]) {
        let name = format!("{}_{name}", self.prefix);
        structure(self.header, self.own, what, &name, fields);
    }

    /// Prints statements, with the functions of their repeated parts; returns them and the results.
    fn statements(&mut self, from: &Source<'_>, inner: &mut Names) -> (String, Vec<Text>) {
        let first = self.functions.len();
        let mut names = Names::new(&RESERVED);
        let (said, results) = statements(from, &self.dialect, &mut names, &mut self.functions);
        name(&self.functions, self.own, inner, &mut self.called);
        let lines = Lines { real: &self.real, functions: &self.functions, names: &self.called };
        self.repeated += &lines.functions(first);
        (lines.statements(&said), results)
    }

    /// Computation of the values that follow from the parameters.
    fn preparing(
        &mut self,
        plan: &Plan,
        parameters: &[&(Variable, Node)],
        inner: &mut Names,
    ) -> (String, Vec<Text>) {
        let block = self.block;
        let given: HashMap<Node, Text> = parameters
            .iter()
            .map(|(v, node)| (*node, Text::whole(format!("p->{}", v.name))))
            .collect();
        let from = Source {
            graph: &block.graph,
            order: &plan.preparing,
            results: &plan.prepared,
            given: &given,
            arrays: &HashMap::new(),
            labels: &block.labels,
        };
        self.statements(&from, inner)
    }

    /// Declares the structure of the values that follow from the parameters.
    fn prepared_structure(&mut self, kept: &[(Node, Variable)]) {
        let (own, prefix) = (self.own, &self.prefix);
        let header = &mut *self.header;
        let _ = write!(
            header,
            "\n/* What follows from that, in SI units: filled by {prefix}_prepare. */\ntypedef struct {{\n"
        );
        for (_, v) in kept {
            match v.meaning.is_empty() {
                true => {
                    let _ = writeln!(header, "    {own}real {};", v.name);
                }
                false => field(header, own, v, &v.name),
            }
        }
        let _ = writeln!(header, "}} {prefix}_prepared;");
    }

    /// Declares and defines a function of the block.
    fn declare(&mut self, name: &str, arguments: &str, what: &str, body: &str) {
        let name = format!("{}_{name}", self.prefix);
        let signature = format!("void {name}({arguments})");
        self.declarations.push(name);
        let _ = write!(self.header, "\n/* {what} */\n{signature};\n");
        let _ = write!(self.definitions, "\n/* {what} */\n{signature}\n{{\n{body}}}\n");
    }

    /// Sets the members of a structure to their initial values.
    fn initial_values(&self, vs: &[&Variable], to: &str) -> String {
        let mut all = String::new();
        for (table, range) in grouped(vs.iter().map(|v| v.name.as_str())) {
            let value = |v: &Variable| self.dialect.constant(v.initial).text;
            let initial = value(vs[range.start]);
            match table {
                Some(table) if vs[range.clone()].iter().all(|v| value(v) == initial) => {
                    all += &each(1, range.len(), &format!("{to}->{table}[i] = {initial};"));
                }
                _ => {
                    for v in &vs[range] {
                        all += &format!("    {to}->{} = {};\n", v.name, value(v));
                    }
                }
            }
        }
        all
    }

    /// The functions that set the parameters, and work out what follows from them.
    fn parameter_functions(
        &mut self,
        parameters: &[&Variable],
        kept: &[(Node, Variable)],
        mut preparing: String,
        results: &[Text],
    ) {
        let prefix = &self.prefix;
        let described = format!("{prefix}_parameters *p");
        let prepared = format!("const {prefix}_parameters *p, {prefix}_prepared *c");
        let values = self.initial_values(parameters, "p");
        self.declare(
            "describe",
            &described,
            "Sets all parameters to the values of the crane file.",
            &values,
        );
        for ((_, v), text) in kept.iter().zip(results) {
            preparing += &line(&format!("c->{} = {};", v.name, text.text));
        }
        self.declare(
            "prepare",
            &prepared,
            "Works out what follows from the parameters: once, and after each change of one.",
            &preparing,
        );
    }

    /// The function of an entry of the block.
    fn entry(
        &mut self,
        entry: &Entry,
        order: &[Node],
        kept: &[(Node, Variable)],
        arrays: &HashMap<String, usize>,
        inner: &mut Names,
    ) {
        let block = self.block;
        let mut given: HashMap<Node, Text> = HashMap::new();
        let mut give = |node: Node, text: String| {
            given.entry(node).or_insert_with(|| Text::whole(text));
        };
        block.inputs.iter().for_each(|(v, node)| give(*node, format!("u->{}", v.name)));
        block.states.iter().for_each(|(v, node)| give(*node, format!("s->{}", v.name)));
        kept.iter().for_each(|(node, v)| give(*node, format!("c->{}", v.name)));
        let wanted: Vec<Node> = entry.results.iter().map(|(_, node)| *node).collect();
        let from = Source {
            graph: &block.graph,
            order,
            results: &wanted,
            given: &given,
            arrays,
            labels: &block.labels,
        };
        let (mut body, results) = self.statements(&from, inner);
        body += &self.assignments(entry, &results);
        let arguments = self.arguments(entry, &body);
        let meaning = comment(&entry.meaning);
        let meaning = meaning[..1].to_uppercase() + &meaning[1..] + ".";
        self.declare(&entry.name, &arguments, &meaning, &body);
    }

    /// Assigns the results of an entry. The update is simultaneous: no state changes before the last new value is
    /// computed.
    fn assignments(&self, entry: &Entry, results: &[Text]) -> String {
        let Self { block, own, .. } = self;
        let lines = Lines { real: &self.real, functions: &self.functions, names: &self.called };
        let (mut body, mut last) = (String::new(), String::new());
        let name_of = |target: &Target| match target {
            Target::State(k) => block.states[*k].0.name.as_str(),
            Target::Output(_) => "",
        };
        for (table, range) in grouped(entry.results.iter().map(|(target, _)| name_of(target))) {
            let Some(table) = table else {
                let (target, text) = (entry.results[range.start].0, &results[range.start].text);
                match target {
                    Target::State(k) => {
                        body += &line(&format!("const {own}real next_{k} = {text};"));
                        last += &line(&format!("s->{} = next_{k};", block.states[k].0.name));
                    }
                    Target::Output(k) => {
                        body += &line(&format!("y->{} = {text};", block.outputs[k].name));
                    }
                }
                continue;
            };
            let filled = runs(results[range.clone()].iter().map(|text| text.text.as_str()));
            let kept = format!("s->{table}");
            let stays =
                |run: &Run| matches!(run, Run::Copied { table, first: 0, .. } if *table == kept);
            if filled.len() == 1 && filled.iter().all(stays) {
                continue;
            }
            body += &lines.table(&format!("next_{table}"), &filled);
            last += &each(1, range.len(), &format!("{kept}[i] = next_{table}[i];"));
        }
        body + &last
    }

    /// Parameters of an entry's function: the structures that its body uses.
    fn arguments(&self, entry: &Entry, body: &str) -> String {
        let prefix = &self.prefix;
        let moves = entry.results.iter().any(|(target, _)| matches!(target, Target::State(_)));
        let uses = |sign: &str| body.contains(sign);
        let mut arguments = Vec::new();
        if uses("c->") {
            arguments.push(format!("const {prefix}_prepared *c"));
        }
        if uses("s->") {
            arguments.push(format!("{}{prefix}_state *s", if moves { "" } else { "const " }));
        }
        if uses("u->") {
            arguments.push(format!("const {prefix}_input *u"));
        }
        if uses("y->") {
            arguments.push(format!("{prefix}_output *y"));
        }
        arguments.join(", ")
    }
}

/// Values that follow from the parameters, with their names in the structure that keeps them.
fn prepared_variables(
    block: &Block,
    plan: &Plan,
    parameters: &[&(Variable, Node)],
) -> Vec<(Node, Variable)> {
    let mut fields = Names::new(&RESERVED);
    plan.prepared
        .iter()
        .map(|node| {
            let parameter = parameters.iter().find(|(_, n)| n == node).map(|(v, _)| v);
            let label = block.labels.get(node);
            let wanted = match (parameter, label) {
                (Some(v), _) => Some(v.name.clone()),
                (None, Some((name, _))) => Some(name.clone()),
                (None, None) => None,
            };
            let meaning = match (parameter, label) {
                (Some(v), _) => v.meaning.clone(),
                (None, Some((_, comment))) => comment.clone(),
                (None, None) => String::new(),
            };
            let name = match wanted {
                Some(wanted) => fields.free(&wanted),
                None => fields.numbered("k"),
            };
            (*node, Variable { name, unit: "SI".into(), meaning, initial: 0.0 })
        })
        .collect()
}

/// Adds a member of a structure, with this name.
fn field(to: &mut String, own: &str, v: &Variable, name: &str) {
    let comment = format!("    /* {} [{}] */", comment(&v.meaning), comment(&v.unit));
    let _ = writeln!(to, "{}\n    {own}real {name};", broken(&comment, WIDTH));
}

fn structure(to: &mut String, own: &str, what: &str, name: &str, fields: &[&Variable]) {
    if fields.is_empty() {
        return;
    }
    let _ = write!(to, "\n/* {what} */\ntypedef struct {{\n");
    for (table, range) in grouped(fields.iter().map(|v| v.name.as_str())) {
        let v = fields[range.start];
        match table {
            Some(table) => field(to, own, v, &format!("{table}[{}]", range.len())),
            None => field(to, own, v, &v.name),
        }
    }
    let _ = writeln!(to, "}} {name};");
}

/// Assigns names to functions without one, independent of the block's name: they are static, and not every compiler
/// distinguishes names beyond 63 characters.
fn name(functions: &[Function], own: &str, inner: &mut Names, names: &mut Vec<String>) {
    for Function { origin, number, .. } in &functions[names.len()..] {
        names.push(inner.free(&format!("{own}{origin}_{number}")));
    }
}

/// Arrays among the members of a structure that can be passed by pointer: name and length.
fn arrays<'a>(
    structure: &'a str,
    members: &'a [Variable],
) -> impl Iterator<Item = (String, usize)> + 'a {
    let all = grouped(members.iter().map(|v| v.name.as_str())).into_iter();
    all.filter_map(move |(array, range)| Some((format!("{structure}->{}", array?), range.len())))
}
