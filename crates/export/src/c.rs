//! C99: a header and a source, without allocation; the only library used is that of the mathematical functions.
//!
//! The operations and their order are those of Rust: sums and products, fused products as `fma`, elementary functions
//! by the same polynomials. Both therefore agree to the last bit, if the compiler neither contracts nor reorders
//! (`-ffp-contract=off`, no `-ffast-math`). An `fma` instruction (`-mfma`) in place of a call changes the speed and
//! no bit. Where a library's `fma` rounds twice (newlib), `-DHB_SOFT_FMA` replaces it by a correct one.

mod lines;

use crate::block::{Block, Target, Variable};
use crate::error::ExportError;
use crate::expression::{Expression, record};
use crate::graph::{Node, Op};
use crate::name::{Names, comment};
use crate::plan::Plan;
use crate::statement::{
    Dialect, Function, Precedence, Run, Text, arithmetic, broken, call, clear_infix, grouped, runs,
};
use crate::writing::{Source, statements};
use hydroboom_math::elementary;
use lines::{Lines, each, line};
use std::collections::HashMap;
use std::fmt::Write;

/// Floating-point type of the generated code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// `double`: equal to Rust to the last bit.
    Double,
    /// `float`, with the library's functions.
    Single,
}

/// Keywords of C and C++, and names used by the generated code.
const RESERVED: [&str; 99] = [
    "auto",
    "break",
    "case",
    "char",
    "const",
    "continue",
    "default",
    "do",
    "double",
    "else",
    "enum",
    "extern",
    "float",
    "for",
    "goto",
    "if",
    "inline",
    "int",
    "long",
    "register",
    "restrict",
    "return",
    "short",
    "signed",
    "sizeof",
    "static",
    "struct",
    "switch",
    "typedef",
    "union",
    "unsigned",
    "void",
    "volatile",
    "while",
    "asm",
    "c",
    "p",
    "s",
    "u",
    "y",
    "x",
    "next",
    "errno",
    "signal",
    "turn",
    "i",
    "hb_real",
    // keywords of C++, since the header may be included there
    "alignas",
    "alignof",
    "bitand",
    "bitor",
    "bool",
    "catch",
    "class",
    "compl",
    "concept",
    "const_cast",
    "consteval",
    "constexpr",
    "constinit",
    "co_await",
    "co_return",
    "co_yield",
    "decltype",
    "delete",
    "dynamic_cast",
    "explicit",
    "export",
    "false",
    "friend",
    "mutable",
    "namespace",
    "new",
    "noexcept",
    "not",
    "not_eq",
    "nullptr",
    "operator",
    "or",
    "or_eq",
    "private",
    "protected",
    "public",
    "reinterpret_cast",
    "requires",
    "static_assert",
    "static_cast",
    "template",
    "this",
    "thread_local",
    "throw",
    "true",
    "try",
    "typeid",
    "typename",
    "using",
    "virtual",
    "wchar_t",
    "xor",
];

/// Largest line width.
const WIDTH: usize = 110;

struct C(Precision);

impl Dialect for C {
    fn names(&self) -> Names {
        Names::new(&RESERVED)
    }

    fn has_parts(&self) -> bool {
        true
    }

    fn part(&self, array: &str, first: usize) -> String {
        format!("&{array}[{first}]")
    }

    fn constant(&self, value: f64) -> Text {
        let text = match value {
            v if v.is_nan() => "HB_NAN".into(),
            v if v.is_infinite() => {
                if v > 0.0 { "HB_INFINITY" } else { "-HB_INFINITY" }.to_string()
            }
            v => literal(v, self.0),
        };
        let binding = if text.starts_with('-') { Precedence::Sign } else { Precedence::Whole };
        Text::new(text, binding)
    }

    fn has_pairs(&self) -> bool {
        true
    }

    fn row(&self, counter: &str) -> Text {
        let real = if self.0 == Precision::Double { "double" } else { "float" };
        Text::new(format!("({real}){counter}"), Precedence::Sign)
    }

    fn operation(&self, op: Op, x: &[Text]) -> Text {
        use Precedence::*;
        if let Some(text) = arithmetic(op, x) {
            return text;
        }
        match op {
            Op::Neg(_) => Text::new(format!("-{}", x[0].inside(Sign)), Sign),
            Op::MulAdd(..) => call(x, "HB_FMA"),
            Op::Sqrt(_) => call(x, "HB_SQRT"),
            Op::Exp(_) => call(x, "hb_exp"),
            Op::Ln(_) => call(x, "hb_ln"),
            Op::Tanh(_) => call(x, "hb_tanh"),
            Op::SinCos(_) => call(x, "hb_turn_of"),
            Op::Sin(_) => Text::whole(format!("{}.sine", x[0].within(Whole))),
            Op::Cos(_) => Text::whole(format!("{}.cosine", x[0].within(Whole))),
            Op::Select(..) => {
                let [a, b, c] = [0, 1, 2].map(|k| x[k].inside(Choice));
                Text::new(format!("{a} ? {b} : {c}"), Choice)
            }
            Op::And(..) => clear_infix(x, "&&", And),
            Op::Or(..) => clear_infix(x, "||", Or),
            Op::Not(_) => Text::new(format!("!{}", x[0].inside(Sign)), Sign),
            Op::PowerOfTwo(_) => call(x, "hb_power_of_two"),
            Op::TurnedSine(..) => call(x, "hb_turned_sine"),
            Op::TurnedCosine(..) => call(x, "hb_turned_cosine"),
            Op::Mantissa(_) => call(x, "hb_mantissa"),
            Op::Exponent(_) => call(x, "hb_exponent"),
            // constants and inputs have their own text; arithmetic is handled above
            _ => Text::whole("0"),
        }
    }
}

/// The shortest literal with exactly this value.
fn literal(value: f64, precision: Precision) -> String {
    match precision {
        Precision::Double => format!("{value:?}"),
        Precision::Single => format!("{:?}f", value as f32),
    }
}

/// Prefix of all types and functions with external linkage, so that several cranes can be linked into one program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Prefix(String);

impl Prefix {
    /// Longest prefix: names stay below the 63 characters that C99 and linkers distinguish.
    pub const LONGEST: usize = 24;

    /// A prefix for C names.
    ///
    /// # Errors
    ///
    /// [`ExportError::Prefix`] if it is empty, longer than [`LONGEST`](Self::LONGEST), begins with a digit or an
    /// underscore (reserved for the compiler), or contains anything but ASCII letters, digits and underscores.
    pub fn new(text: &str) -> Result<Self, ExportError> {
        let is_name = text.starts_with(|c: char| c.is_ascii_alphabetic())
            && text.len() <= Self::LONGEST
            && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        match is_name {
            true => Ok(Self(text.into())),
            false => Err(ExportError::Prefix { found: text.into(), longest: Self::LONGEST }),
        }
    }

    /// The prefix as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl Default for Prefix {
    fn default() -> Self {
        Self("hb_".into())
    }
}

/// A header and a source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Files {
    /// `<name>.h`
    pub header: String,
    /// `<name>.c`
    pub source: String,
    /// Names of the functions that the header declares.
    pub functions: Vec<String>,
}

/// Generates header and source of this name for some blocks, with the usual prefix.
///
/// # Errors
///
/// [`ExportError`] if a block depends on a quantity that it does not contain.
pub fn files(blocks: &[Block], name: &str, precision: Precision) -> Result<Files, ExportError> {
    prefixed_files(blocks, name, precision, &Prefix::default())
}

/// Like [`files`], with another prefix.
///
/// # Errors
///
/// [`ExportError`] if a block depends on a quantity that it does not contain.
pub fn prefixed_files(
    blocks: &[Block],
    name: &str,
    precision: Precision,
    own: &Prefix,
) -> Result<Files, ExportError> {
    let mut header = String::new();
    let mut source = String::new();
    let mut functions = Vec::new();
    let own = own.as_str();
    let guard = format!("{own}{name}_h").to_uppercase();
    let real = if precision == Precision::Double { "double" } else { "float" };
    header += &format!(
        "/* Generated by Hydroboom {}; generate it again instead of editing it. */\n#ifndef {guard}\n#define {guard}\n\n\
         #ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
         /* Number type of all computations. */\ntypedef {real} {own}real;\n",
        env!("CARGO_PKG_VERSION")
    );
    source += &format!(
        "/* Generated by Hydroboom {}; generate it again instead of editing it.\n   Compile with -ffp-contract=off: a compiler that \
         fuses by itself rounds otherwise. */\n#include \"{name}.h\"\n#include <math.h>\n{}",
        env!("CARGO_PKG_VERSION"),
        helpers(precision, own)
    );
    let mut names = Names::new(&RESERVED);
    for block in blocks {
        functions.extend(printed(block, precision, own, &mut names, [&mut header, &mut source])?);
    }
    header += &format!("\n#ifdef __cplusplus\n}}\n#endif\n\n#endif /* {guard} */\n");
    Ok(Files { header, source, functions })
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

/// Adds a block to header and source; returns the names of its functions. `inner` holds the source's internal names.
fn printed(
    block: &Block,
    precision: Precision,
    own: &str,
    inner: &mut Names,
    [header, source]: [&mut String; 2],
) -> Result<Vec<String>, ExportError> {
    let plan = Plan::of(block)?;
    let graph = &*block.graph;
    let dialect = C(precision);
    let prefix = format!("{own}{}", block.name);
    let real = format!("{own}real");
    let parameters: Vec<&(Variable, Node)> =
        plan.parameters.iter().map(|k| &block.parameters[*k]).collect();
    let _ = writeln!(header, "\n/* ---- {} ---- */", comment(&block.meaning));
    let fields: Vec<&Variable> = parameters.iter().map(|(v, _)| v).collect();
    structure(
        header,
        own,
        "Parameters; names and units are those of the crane file.",
        &format!("{prefix}_parameters"),
        &fields,
    );

    // values derived from the parameters
    let mut names = Names::new(&RESERVED);
    let given: HashMap<Node, Text> =
        parameters.iter().map(|(v, node)| (*node, Text::whole(format!("p->{}", v.name)))).collect();
    let from = Source {
        graph,
        order: &plan.preparing,
        results: &plan.prepared,
        given: &given,
        arrays: &HashMap::new(),
        labels: &block.labels,
    };
    let mut functions = Vec::new();
    let (said, results) = statements(&from, &dialect, &mut names, &mut functions);
    let mut called = Vec::new();
    name(&functions, own, inner, &mut called);
    let lines = Lines { real: &real, functions: &functions, names: &called };
    let mut preparing = lines.statements(&said);
    let mut repeated = lines.functions(0);
    let mut fields = Names::new(&RESERVED);
    let kept: Vec<(Node, Variable)> = plan
        .prepared
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
        .collect();
    if !parameters.is_empty() {
        let _ = write!(
            header,
            "\n/* Derived values in SI units, computed by {prefix}_prepare. */\ntypedef struct {{\n"
        );
        for (_, v) in &kept {
            match v.meaning.is_empty() {
                true => {
                    let _ = writeln!(header, "    {own}real {};", v.name);
                }
                false => field(header, own, v, &v.name),
            }
        }
        let _ = writeln!(header, "}} {prefix}_prepared;");
    }
    let of =
        |vs: &[(Variable, Node)]| -> Vec<Variable> { vs.iter().map(|(v, _)| v.clone()).collect() };
    let (inputs, states) = (of(&block.inputs), of(&block.states));
    structure(
        header,
        own,
        "Inputs.",
        &format!("{prefix}_input"),
        &inputs.iter().collect::<Vec<_>>(),
    );
    structure(
        header,
        own,
        "What it remembers.",
        &format!("{prefix}_state"),
        &states.iter().collect::<Vec<_>>(),
    );
    structure(
        header,
        own,
        "What it shows.",
        &format!("{prefix}_output"),
        &block.outputs.iter().collect::<Vec<_>>(),
    );

    let mut declarations = Vec::new();
    let mut definitions = String::new();
    let mut declared = |name: &str, arguments: &str, what: &str, body: &str| {
        let name = format!("{prefix}_{name}");
        let signature = format!("void {name}({arguments})");
        declarations.push(name);
        let _ = write!(header, "\n/* {what} */\n{signature};\n");
        let _ = write!(definitions, "\n/* {what} */\n{signature}\n{{\n{body}}}\n");
    };
    let arrays: HashMap<String, usize> = arrays("u", &inputs).chain(arrays("s", &states)).collect();
    let values = |vs: &mut dyn Iterator<Item = &Variable>, to: &str| -> String {
        let vs: Vec<&Variable> = vs.collect();
        let mut all = String::new();
        for (table, range) in grouped(vs.iter().map(|v| v.name.as_str())) {
            let value = |v: &Variable| dialect.constant(v.initial).text;
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
    };
    if !parameters.is_empty() {
        declared(
            "describe",
            &format!("{prefix}_parameters *p"),
            "Sets all parameters to the values of the crane file.",
            &values(&mut parameters.iter().map(|(v, _)| v), "p"),
        );
        for ((_, v), text) in kept.iter().zip(&results) {
            preparing += &line(&format!("c->{} = {};", v.name, text.text));
        }
        declared(
            "prepare",
            &format!("const {prefix}_parameters *p, {prefix}_prepared *c"),
            "Computes the derived values: once, and after each change of a parameter.",
            &preparing,
        );
    }
    if !states.is_empty() {
        declared(
            "start",
            &format!("{prefix}_state *s"),
            "The initial state.",
            &values(&mut states.iter(), "s"),
        );
    }

    for (entry, order) in block.entries.iter().zip(&plan.entries) {
        let mut given: HashMap<Node, Text> = HashMap::new();
        let mut give = |node: Node, text: String| {
            given.entry(node).or_insert_with(|| Text::whole(text));
        };
        block.inputs.iter().for_each(|(v, node)| give(*node, format!("u->{}", v.name)));
        block.states.iter().for_each(|(v, node)| give(*node, format!("s->{}", v.name)));
        kept.iter().for_each(|(node, v)| give(*node, format!("c->{}", v.name)));
        let wanted: Vec<Node> = entry.results.iter().map(|(_, node)| *node).collect();
        let from = Source {
            graph,
            order,
            results: &wanted,
            given: &given,
            arrays: &arrays,
            labels: &block.labels,
        };
        let first = functions.len();
        let mut names = Names::new(&RESERVED);
        let (said, results) = statements(&from, &dialect, &mut names, &mut functions);
        name(&functions, own, inner, &mut called);
        let lines = Lines { real: &real, functions: &functions, names: &called };
        repeated += &lines.functions(first);
        let mut body = lines.statements(&said);
        let moves = entry.results.iter().any(|(target, _)| matches!(target, Target::State(_)));
        // simultaneous update: no state changes before the last new value is computed
        let mut last = String::new();
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
        body += &last;
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
        let meaning = comment(&entry.meaning);
        let meaning = meaning[..1].to_uppercase() + &meaning[1..] + ".";
        declared(&entry.name, &arguments.join(", "), &meaning, &body);
    }
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

/// A recorded function of one number.
fn function(
    own: &str,
    name: &str,
    argument: &str,
    of: impl FnOnce(Expression) -> Vec<Expression>,
) -> String {
    let (graph, (x, results)) = record(|| {
        let x = Expression::input();
        let results: Vec<Node> = of(x).into_iter().map(Expression::node).collect();
        (x.node(), results)
    });
    let order: Vec<Node> =
        graph.nodes().filter(|n| graph.constant(*n).is_none() && *n != x).collect();
    let given = HashMap::from([(x, Text::whole(argument))]);
    let from = Source {
        graph: &graph,
        order: &order,
        results: &results,
        given: &given,
        arrays: &HashMap::new(),
        labels: &HashMap::new(),
    };
    let (dialect, mut functions) = (C(Precision::Double), Vec::new());
    let (said, results) = statements(&from, &dialect, &mut dialect.names(), &mut functions);
    let lines = Lines { real: &format!("{own}real"), functions: &functions, names: &[] };
    let body = lines.statements(&said);
    match results.as_slice() {
        [one] => format!(
            "\nstatic double {name}(double {argument})\n{{\n{body}{}}}\n",
            line(&format!("return {};", one.text))
        ),
        both => {
            let texts: Vec<&str> = both.iter().map(|t| t.text.as_str()).collect();
            let result = line(&format!("const hb_turn both = {{ {} }};", texts.join(", ")));
            format!(
                "\nstatic hb_turn {name}(double {argument})\n{{\n{body}{result}    return both;\n}}\n"
            )
        }
    }
}

/// Helper functions of the generated code.
fn helpers(precision: Precision, own: &str) -> String {
    // no warning about helpers that no block calls
    const UNUSED: &str = "#if defined(__GNUC__)\n#define HB_MAYBE_UNUSED __attribute__((unused))\n#else\n#define HB_MAYBE_UNUSED\n#endif\n";
    let real = format!("{own}real");
    let shared = "\n#define HB_INFINITY INFINITY\n#define HB_NAN NAN\n";
    if precision == Precision::Single {
        let text = "#define HB_FMA fmaf\n#define HB_SQRT sqrtf\n#define hb_exp expf\n#define hb_ln logf\n#define hb_tanh tanhf\n\n\
             /* Sine and cosine of an angle [rad]. */\ntypedef struct {\n    hb_real sine;\n    hb_real cosine;\n} hb_turn;\n\n\
             HB_MAYBE_UNUSED static hb_turn hb_turn_of(float angle)\n{\n    const hb_turn both = { sinf(angle), cosf(angle) };\n    return both;\n}\n";
        let interpolated = include_str!("interpolation.h").replace("HB_REAL", "float");
        return format!("{shared}\n{UNUSED}{text}{interpolated}").replace("hb_real", &real);
    }
    let interpolated = include_str!("interpolation.h").replace("HB_REAL", "double");
    let bits = include_str!("bits.h").replace("hb_real", &real);
    let recorded = [
        function(own, "hb_exp", "value", |x| vec![elementary::exp(x)]),
        function(own, "hb_tanh", "value", |x| vec![elementary::tanh(x)]),
        function(own, "hb_ln", "value", |x| vec![elementary::ln(x)]),
        function(own, "hb_turn_of", "angle", |x| {
            let (sin, cos) = elementary::sin_cos(x);
            vec![sin, cos]
        }),
    ];
    let recorded = recorded.concat().replace("\nstatic ", "\nHB_MAYBE_UNUSED static ");
    format!(
        "#include <stdint.h>\n#include <string.h>\n{shared}#define HB_SQRT sqrt\n\n{UNUSED}\n{bits}{recorded}{interpolated}"
    )
}
