//! IEC 61131-3 Structured Text: a function block for each block.
//!
//! A block starts from its initial values at its first call and whenever `bReset` is set. It recomputes the values
//! derived from its parameters whenever `bPrepare` is set. Most blocks consist of assignments to `LREAL`s, calls of
//! the standard's functions, and comments in `(* *)`. Only the scheduled LQR has arrays, `FOR` loops and units of its
//! own. A fused product is written as product and sum, and functions are those of the PLC: the last digits may differ
//! from Rust.

mod bench;
mod calls;
mod composed;
mod lines;
pub mod plcopen;
mod replays;
mod single;
pub mod twincat;
mod unit;

pub use single::in_single_precision;
pub use unit::{Declared, Form, Kind, Section, Task, Unit};

use crate::block::{Block, Entry, Target, Variable};
use crate::controller::{controller, scheduled_lqr_controller, simulation_feedforward_controller};
use crate::crane::blocks;
use crate::error::ExportError;
use crate::graph::{Graph, Node, Op};
use crate::name::{Names, comment};
use crate::plan::Plan;
use crate::statement::{
    Dialect, Precedence, Run, Statement, Text, arithmetic, broken, call, clear_infix, grouped, runs,
};
use crate::writing::{Source, statements};
use calls::Calls;
use hydroboom_description::Description;
use lines::{COUNTER, Lines, array, copied, filled};
use std::collections::HashMap;
use std::ops::Range;

/// Largest line width.
const WIDTH: usize = 110;

/// Name of the list of global variables; in TwinCAT also the prefix of each.
const GLOBALS: &str = "GVL_Hydroboom";

/// Keywords of the second and third edition, standard types, functions and function blocks, and names that some tools
/// reserve.
const RESERVED: &str = "\
    abs abstract acos action add adr and and_then any any_bit any_date any_derived any_elementary any_int any_magnitude any_num \
    any_real any_string array asin at atan atan2 bit bitadr bool by byte cal calc calcn case char class concat configuration \
    constant continue cos ctd ctu ctud date date_and_time delete dint div do ds dt dword else elsif en end_action end_case \
    end_class end_configuration end_for end_function end_function_block end_if end_interface end_method end_namespace \
    end_program end_property end_repeat end_resource end_step end_struct end_transition end_type end_var end_while eno eq \
    exit exp expt extends f_edge f_trig false final find for from function function_block ge gt if implements in indexof ini \
    initial_step insert int interface internal interval jmp jmpc jmpcn ld ldate ldn ldt le left len limit lint ln log lower_bound \
    lreal lt ltime ltod lword max method mid min mod move mul mux namespace ne non_retain not null of on or or_else overlap \
    override persistent pi plc pointer priority private program property protected public pvoid r r_edge r_trig read_only \
    read_write real ref ref_to reference repeat replace resource ret retain return right rol ror rs s sel sema shl shr sin single \
    sint sizeof sqrt sr st step stn string struct sub super tan task test then this time time_of_day to tod tof ton tp transition \
    true trunc type udint uint ulint union until upper_bound using usint uxint var var_access var_config var_external var_global \
    var_in_out var_input var_output var_temp wchar while with word wstring xint xor xorn xword";

/// Names of inputs and outputs that follow the paper's symbols.
const KNOWN: [(&str, &str); 37] = [
    ("stroke", "xCyl"),
    ("velocity", "vCyl"),
    ("pressure_pump_a", "pPA"),
    ("pressure_a", "pA"),
    ("pressure_b", "pB"),
    ("pressure_pump_b", "pPB"),
    ("pressure_accumulator", "pAcc"),
    ("gas_volume", "volGas"),
    ("bristle", "zBristle"),
    ("pump_speed", "nPump"),
    ("holding_valve", "uValve"),
    ("cylinder_force", "fCyl"),
    ("angle_1", "phi1"),
    ("angle_2", "phi2"),
    ("angle_3", "phi3"),
    ("angular_velocity_1", "omega1"),
    ("angular_velocity_2", "omega2"),
    ("angular_velocity_3", "omega3"),
    ("tip_x", "xTip"),
    ("tip_y", "yTip"),
    ("tip_deflection", "wTip"),
    ("step", "tStep"),
    ("reference_position", "xRef"),
    ("reference_velocity", "vRef"),
    ("load_pressure", "pL"),
    ("motor_speed_read", "nRead"),
    ("valve_state", "uValveRead"),
    ("status", "nStatus"),
    ("simulated_stroke", "xSim"),
    ("simulated_velocity", "vSim"),
    ("simulated_load_pressure", "pLSim"),
    ("simulation_leads", "uLead"),
    ("motor_speed", "nRef"),
    ("wanted_speed", "nWanted"),
    ("simulated_motor_speed", "nMotor"),
    ("integral", "vInt"),
    ("low_passed", "pLow"),
];

struct StructuredText;

impl Dialect for StructuredText {
    fn names(&self) -> Names {
        let reserved: Vec<&str> = RESERVED.split_whitespace().chain([COUNTER]).collect();
        Names::new(&reserved)
    }

    fn has_parts(&self) -> bool {
        false
    }

    /// Not used in this language.
    fn part(&self, array: &str, _first: usize) -> String {
        array.into()
    }

    fn constant(&self, value: f64) -> Text {
        let text = literal(value);
        let binding = if text.starts_with('-') { Precedence::Sign } else { Precedence::Whole };
        Text::new(text, binding)
    }

    fn has_pairs(&self) -> bool {
        false
    }

    fn row(&self, counter: &str) -> Text {
        Text::whole(format!("DINT_TO_LREAL({counter})"))
    }

    fn operation(&self, op: Op, x: &[Text]) -> Text {
        use Precedence::*;
        if let Some(text) = arithmetic(op, x) {
            return text;
        }
        match op {
            // a sign before a bracket or a number only: tools differ in the precedence of other operands
            Op::Neg(_) => Text::new(format!("-{}", x[0].inside(Sign)), Sum),
            Op::MulAdd(..) => {
                let product = format!("{} * {}", x[0].within(Product), x[1].inside(Product));
                Text::new(format!("{product} + {}", x[2].inside(Sum)), Sum)
            }
            Op::Sqrt(_) => call(x, "SQRT"),
            Op::Exp(_) => call(x, "EXP"),
            Op::Ln(_) => call(x, "LN"),
            // clamped to ±20, where tanh is ±1 in double precision: the exponential cannot overflow
            Op::Tanh(_) => Text::new(
                format!(
                    "1.0E0 - 2.0E0 / (EXP(2.0E0 * LIMIT(-2.0E1, {}, 2.0E1)) + 1.0E0)",
                    x[0].text
                ),
                Sum,
            ),
            // sine and cosine are separate functions: the pair is represented by its angle
            Op::SinCos(_) => x[0].clone(),
            Op::Sin(_) => call(x, "SIN"),
            Op::Cos(_) => call(x, "COS"),
            Op::Select(..) => {
                // an expression of two literals has no definite type: not every tool takes the widest
                let of = |k: usize| x[k].text.as_str();
                let bare = [1, 2].iter().all(|k| of(*k).parse::<f64>().is_ok());
                let kind = if bare { "LREAL#" } else { "" };
                Text::whole(format!("SEL({}, {kind}{}, {kind}{})", of(0), of(2), of(1)))
            }
            Op::And(..) => clear_infix(x, "AND", And),
            Op::Or(..) => clear_infix(x, "OR", Or),
            Op::Not(_) => Text::new(format!("NOT {}", x[0].inside(Sign)), Sign),
            _ => Text::whole("0.0E0"),
        }
    }
}

/// A literal that every tool accepts: with a point and an exponent.
fn literal(value: f64) -> String {
    let text = format!("{value:E}");
    match text.split_once('E') {
        Some((digits, exponent)) if !digits.contains('.') => format!("{digits}.0E{exponent}"),
        _ => text,
    }
}

/// `hydraulic_model` as `HydraulicModel`.
fn camel(name: &str) -> String {
    let parts = name.split('_').map(|part| part[..1].to_uppercase() + &part[1..]);
    parts.collect()
}

/// Name of a block's function block, as `FB_HydraulicModel` for `hydraulic_model`.
pub fn block_name(block: &Block) -> String {
    format!("FB_{}", camel(&block.name))
}

/// Name of a block's input or output: the paper's symbol if it has one, as `xCyl` for `stroke`, else the name in camel
/// case.
pub fn edge_name(name: &str) -> String {
    let known = KNOWN.iter().find(|(own, _)| *own == name).map(|(_, known)| (*known).to_string());
    known.unwrap_or_else(|| {
        let camel = camel(name);
        camel[..1].to_lowercase() + &camel[1..]
    })
}

/// Name of a Boolean input or output, with the prefix `b` and in camel case, as `bReset`.
pub fn switch_name(name: &str) -> String {
    format!("b{}", camel(name))
}

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
/// [`ExportError`] if it depends on a quantity outside it, or on a number that the language cannot represent.
pub fn function_block(block: &Block) -> Result<Unit, ExportError> {
    Ok(split_units(block)?.1)
}

/// Function block (IEC 61131-3) of a block, after the functions and function blocks that it calls.
///
/// # Errors
///
/// [`ExportError`] if it depends on a quantity outside it, or on a number that the language cannot represent.
pub fn block_units(block: &Block) -> Result<Vec<Unit>, ExportError> {
    let (mut units, block) = split_units(block)?;
    units.push(block);
    Ok(units)
}

/// The units that a block calls, and the block.
fn split_units(block: &Block) -> Result<(Vec<Unit>, Unit), ExportError> {
    let plan = Plan::of(block)?;
    let graph = &*block.graph;
    if let Some(value) = strange(graph, &plan) {
        return Err(ExportError::Constant { block: block.name.clone(), value });
    }
    let mut names = StructuredText.names();
    for own in ["bReset", "bPrepare", "bReady"] {
        names.free(own);
    }
    let mut named = |variables: &[Variable], beginning: &str| -> Vec<String> {
        let mut of = |name: &str, unit: &str| match beginning {
            "" if unit == SWITCH => names.free(&switch_name(name)),
            "" => names.free(&edge_name(name)),
            _ => names.free(&format!("{beginning}{}", camel(&edge_name(name)))),
        };
        let mut all = Vec::new();
        for (table, range) in grouped(variables.iter().map(|v| v.name.as_str())) {
            let v = &variables[range.start];
            let name = of(table.as_deref().unwrap_or(&v.name), &v.unit);
            match table {
                Some(_) => all.extend((0..range.len()).map(|k| format!("{name}[{k}]"))),
                None => all.push(name),
            }
        }
        all
    };
    let of = |all: &[(Variable, Node)]| -> Vec<Variable> {
        all.iter().map(|(v, _)| v.clone()).collect()
    };
    let (inputs, states) = (of(&block.inputs), of(&block.states));
    let input_names = named(&inputs, "");
    let output_names = named(&block.outputs, "");
    let state_names = named(&states, "s");
    let parameters: Vec<&(Variable, Node)> =
        plan.parameters.iter().map(|k| &block.parameters[*k]).collect();
    let parameter_names: Vec<String> =
        parameters.iter().map(|(v, _)| names.free(&v.name)).collect();

    // values derived from the parameters
    let mut given: HashMap<Node, Text> = parameters
        .iter()
        .zip(&parameter_names)
        .map(|((_, node), name)| (*node, Text::whole(name)))
        .collect();
    let labels = HashMap::new();
    let from = Source {
        graph,
        order: &plan.preparing,
        results: &plan.prepared,
        given: &given,
        arrays: &HashMap::new(),
        labels: &labels,
    };
    let mut functions = Vec::new();
    let (preparing, results) = statements(&from, &StructuredText, &mut names, &mut functions);
    let mut keeping = String::new();
    let mut kept = Vec::new();
    for (node, text) in plan.prepared.iter().zip(&results) {
        // a parameter is a variable already
        if parameters.iter().any(|(_, parameter)| parameter == node) {
            continue;
        }
        let label = block.labels.get(node);
        let name = match label {
            Some((name, _)) => names.free(&edge_name(name)),
            None => names.numbered("k"),
        };
        keeping += &line(&format!("{name} := {};", text.text), 1);
        given.insert(*node, Text::whole(&name));
        let meaning = label.map_or(String::new(), |(_, comment)| comment.clone());
        kept.push((
            name,
            Variable { name: String::new(), unit: String::new(), meaning, initial: 0.0 },
        ));
    }

    block.inputs.iter().zip(&input_names).for_each(|((v, node), name)| {
        let text = match v.unit == SWITCH {
            true => format!("SEL({name}, 0.0E0, 1.0E0)"),
            false => name.clone(),
        };
        given.insert(*node, Text::whole(text));
    });
    block.states.iter().zip(&state_names).for_each(|((_, node), name)| {
        given.insert(*node, Text::whole(name));
    });
    let labels: HashMap<Node, (String, String)> = block
        .labels
        .iter()
        .map(|(node, (name, comment))| (*node, (edge_name(name), comment.clone())))
        .collect();
    // inputs cannot be passed by reference
    let arrays: HashMap<String, usize> = grouped(state_names.iter().map(String::as_str))
        .into_iter()
        .filter_map(|(table, range)| Some((table?, range.len())))
        .collect();
    let mut entry = |(entry, order): (&Entry, &Vec<Node>)| {
        let results: Vec<Node> = entry.results.iter().map(|(_, node)| *node).collect();
        let (results, given, labels) = (&results, &given, &labels);
        let from = Source { graph, order, results, given, arrays: &arrays, labels };
        statements(&from, &StructuredText, &mut names, &mut functions)
    };
    let entries: Vec<(Vec<Statement>, Vec<Text>)> =
        block.entries.iter().zip(&plan.entries).map(&mut entry).collect();

    let calls = Calls { block: &camel(&block.name), functions: &functions };
    let mut lines = Lines::new(&calls);
    let preparing_text = lines.statements(&preparing, &mut names, 1) + &keeping;
    let mut working = String::new();
    for (entry, (said, results)) in block.entries.iter().zip(&entries) {
        working += &lines.statements(said, &mut names, 0);
        // simultaneous update: no state changes before the last new value is computed
        let mut last = String::new();
        let name_of = |target: &Target| match target {
            Target::State(k) => state_names[*k].as_str(),
            Target::Output(k) => output_names[*k].as_str(),
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
                    working += &lines.table(&next, &runs, 0);
                    last += &copied(&table, &next, range.len(), 0);
                }
                (None, Target::State(k)) => {
                    let next = names.numbered("next");
                    working += &line(&format!("{next} := {};", text.text), 0);
                    last += &line(&format!("{} := {next};", state_names[k]), 0);
                    lines.local(&next, "LREAL");
                }
                (None, Target::Output(k)) => {
                    let name = &output_names[k];
                    let text = match edge_kind(&block.outputs[k]) {
                        "BOOL" => format!("0.5E0 < {}", text.inside(Precedence::Sum)),
                        "DINT" => format!("LREAL_TO_DINT({})", text.text),
                        _ => text.text.clone(),
                    };
                    working += &line(&format!("{name} := {text};"), 0);
                }
            }
        }
        working += &last;
    }
    let mut starting = String::new();
    for (table, range) in grouped(state_names.iter().map(String::as_str)) {
        let initial = states[range.start].initial;
        match table {
            Some(table) if states[range.clone()].iter().all(|v| v.initial == initial) => {
                starting += &filled(&table, range.len(), initial, 1);
            }
            _ => {
                for k in range {
                    let (name, value) = (&state_names[k], literal(states[k].initial));
                    starting += &line(&format!("{name} := {value};"), 1);
                }
            }
        }
    }

    let flag = |name, meaning| Declared::new(Section::Input, name, "BOOL", None, meaning);
    let mut variables = vec![flag("bReset", "Restart at the initial values")];
    let has_parameters = !parameters.is_empty();
    if has_parameters {
        variables.push(flag("bPrepare", "A parameter was changed"));
    }
    let tabled = |names: &[String], one: &dyn Fn(usize, &str) -> Declared| -> Vec<Declared> {
        let of = |(table, range): (Option<String>, Range<usize>)| match table {
            None => one(range.start, &names[range.start]),
            Some(table) => {
                Declared { kind: array(range.len()), initial: None, ..one(range.start, &table) }
            }
        };
        grouped(names.iter().map(String::as_str)).into_iter().map(of).collect()
    };
    variables.extend(tabled(&input_names, &|k, name| {
        edge(Section::Input, name, Some(inputs[k].initial), &inputs[k])
    }));
    variables.extend(tabled(&output_names, &|k, name| {
        edge(Section::Output, name, None, &block.outputs[k])
    }));
    variables.push(Declared::new(Section::Local, "bReady", "BOOL", None, ""));
    variables.extend(tabled(&state_names, &|k, name| {
        declared(Section::Local, name, Some(states[k].initial), &states[k])
    }));
    let parameters = parameters.iter().zip(&parameter_names);
    variables.extend(
        parameters.map(|((v, _), name)| declared(Section::Local, name, Some(v.initial), v)),
    );
    variables.extend(kept.iter().map(|(name, v)| declared(Section::Local, name, None, v)));
    let when = if has_parameters { "bPrepare OR " } else { "" };
    let preparing_text = match kept.is_empty() {
        true => String::new(),
        false => format!(
            "IF {when}bReset OR NOT bReady THEN\n    (* derived values *)\n{preparing_text}END_IF;\n"
        ),
    };
    let body = format!(
        "{preparing_text}IF bReset OR NOT bReady THEN\n    (* initial state *)\n{starting}    bReady := TRUE;\nEND_IF;\n\n{working}"
    );
    variables.extend(lines.declared(&body));
    let bodies: Vec<&[Statement]> =
        entries.iter().map(|(said, _)| said.as_slice()).chain([preparing.as_slice()]).collect();
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

/// All program organisation units of a PLC project with simulation feedforward: the recorded blocks, units composed of
/// them, programs, and the tasks that call them. Each comes after those that it uses.
///
/// # Errors
///
/// [`ExportError`] if the crane cannot be exported.
pub fn units(description: &Description) -> Result<Vec<Unit>, ExportError> {
    let [hydraulics, boom] = blocks(description)?;
    let n = &description.numbers;
    let steps = (n.control_period / n.simulation_period).round().max(1.0) as u32;
    let mut all = Vec::new();
    let benchmark = function_block(&controller(description)?)?;
    let feedforward = function_block(&simulation_feedforward_controller(description)?)?;
    for block in [hydraulics, boom] {
        all.push(function_block(&block)?);
    }
    all.extend([benchmark.clone(), feedforward.clone()]);
    let step = literal(n.simulation_period);
    all.push(composed::simulation_feedforward(&feedforward, steps, &step));
    all.extend(block_units(&scheduled_lqr_controller(description)?)?);
    all.push(composed::control_task(&benchmark));
    all.extend([bench::comparison(), bench::test_bench(&replays::replays(description)?)]);
    // last, since it names the programs: some tools resolve only names read before
    all.push(composed::globals(&benchmark, n.control_period));
    Ok(all)
}

/// A comment broken into indented lines.
fn broken_comment(text: &str) -> String {
    broken(&format!("   {text}"), WIDTH)
}

/// A constant that the language cannot represent.
fn strange(graph: &Graph, plan: &Plan) -> Option<f64> {
    let all = plan.preparing.iter().chain(plan.entries.iter().flatten());
    let operands = all.flat_map(|node| graph.operands(*node));
    operands.filter_map(|node| graph.constant(node)).find(|value| !value.is_finite())
}

fn line(text: &str, depth: usize) -> String {
    let indent = "    ".repeat(depth);
    broken(&format!("{indent}{text}"), WIDTH) + "\n"
}
