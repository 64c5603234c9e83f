//! FMI: a block as a functional mock-up unit for co-simulation that contains its source.

mod archive;
mod bounds;
mod unit_definition;

pub use archive::{ArchiveError, System, archive, binary};

use crate::block::{Block, ControlPeriod, Variable};
use crate::c::{Precision, files};
use crate::error::ExportError;
use crate::plan::Plan;
use crate::statement::{entry, grouped};
use crate::step_limit::longest_step;
use bounds::Bounds;
use hydroboom_description::Description;
use std::fmt::Write;
use unit_definition::base_unit;

/// Version of the standard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0
    Two,
    /// FMI 3.0
    Three,
}

/// Content of an FMU: the files of its archive without the binary.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Model identifier, which is the name of its files.
    pub identifier: String,
    /// Path in the archive and content, in the archive's order.
    pub files: Vec<(String, String)>,
    /// Version of the standard.
    pub version: Version,
    /// Names of the functions that `sources/hydroboom.c` defines for `sources/fmu.c`.
    functions: Vec<String>,
}

/// A variable of an FMU.
struct Row<'a> {
    name: String,
    /// Value reference: the count of numbers before it.
    reference: usize,
    /// Count of its numbers: one, or the length of an array, supported by FMI 3.0.
    count: usize,
    causality: &'static str,
    variability: &'static str,
    initial: Option<&'static str>,
    /// For the rate of a state: the reference of that state.
    rate_of: Option<usize>,
    bounds: Bounds,
    variable: &'a Variable,
}

impl Row<'_> {
    /// Attributes of both versions, in the order of the standard.
    fn attributes(&self) -> String {
        let initial = self.initial.map_or(String::new(), |i| format!(" initial=\"{i}\""));
        format!(
            "name=\"{}\" valueReference=\"{}\" description=\"{}\" causality=\"{}\" variability=\"{}\"{initial}",
            escaped(&self.name),
            self.reference,
            escaped(&self.variable.meaning),
            self.causality,
            self.variability
        )
    }

    /// Unit, range, nominal value and start value.
    fn values(&self) -> String {
        let unit = match (self.variable.unit.as_str(), display(&self.variable.unit)) {
            ("" | "-" | "1", _) => String::new(),
            (unit, None) => format!(" unit=\"{}\"", escaped(unit)),
            (unit, Some((shown, _))) => {
                format!(" unit=\"{}\" displayUnit=\"{shown}\"", escaped(unit))
            }
        };
        let mut text = unit;
        let Bounds { low, high, nominal } = self.bounds;
        for (name, value) in [("min", low), ("max", high), ("nominal", Some(nominal))] {
            if let Some(value) = value {
                let _ = write!(text, " {name}=\"{value:?}\"");
            }
        }
        match self.initial {
            Some("calculated") => text,
            _ => {
                let start = vec![format!("{:?}", self.variable.initial); self.count];
                format!("{text} start=\"{}\"", start.join(" "))
            }
        }
    }
}

/// Usual display unit, and its size relative to the SI unit.
fn display(unit: &str) -> Option<(&'static str, f64)> {
    const SHOWN: [(&str, &str, f64); 7] = [
        ("Pa", "bar", 1e-5),
        ("m", "mm", 1e3),
        ("m/s", "mm/s", 1e3),
        ("rev/s", "rpm", 60.0),
        ("rad", "deg", 180.0 / std::f64::consts::PI),
        ("N", "kN", 1e-3),
        ("m3", "L", 1e3),
    ];
    SHOWN.iter().find(|(own, ..)| *own == unit).map(|(_, shown, factor)| (*shown, *factor))
}

/// Escapes text for an XML attribute.
fn escaped(text: &str) -> String {
    let mut safe = String::new();
    for c in text.chars() {
        match c {
            '&' => safe += "&amp;",
            '<' => safe += "&lt;",
            '>' => safe += "&gt;",
            '"' => safe += "&quot;",
            // characters that XML 1.0 does not allow
            c if (c as u32) < 32 || matches!(c, '\u{fffe}' | '\u{ffff}') => safe.push(' '),
            c => safe.push(c),
        }
    }
    safe
}

/// A block of a crane as an FMU. With its [`slopes`](crate::slopes) the FMU provides the rates of its states and
/// directional derivatives.
///
/// # Errors
///
/// [`ExportError`] if the block depends on a quantity that it does not contain, or the crane file's step is above the
/// stability limit of the scheme.
pub fn unit(
    block: &Block,
    slopes: Option<&Block>,
    crane: &Description,
    version: Version,
) -> Result<Unit, ExportError> {
    let longest_step = match block.inputs.iter().any(|(v, _)| v.name == "step") {
        true => longest_step(crane)?,
        false => f64::INFINITY,
    };
    let title = crane.name.as_str();
    let plan = Plan::of(block)?;
    let parameters: Vec<&Variable> =
        plan.parameters.iter().map(|k| &block.parameters[*k].0).collect();
    let inputs: Vec<&Variable> = block.inputs.iter().map(|(v, _)| v).collect();
    let states: Vec<&Variable> = block.states.iter().map(|(v, _)| v).collect();
    let row = |causality, variability, initial, name: String, variable, bounds| Row {
        name,
        reference: 0,
        count: 1,
        causality,
        variability,
        initial,
        rate_of: None,
        bounds,
        variable,
    };
    let mut rows: Vec<Row<'_>> = Vec::new();
    let (tunable, continuous, exact) = ("tunable", "continuous", Some("exact"));
    rows.extend(
        parameters
            .iter()
            .map(|v| row("parameter", tunable, exact, v.name.clone(), *v, bounds::of_parameter(v))),
    );
    for (table, range) in grouped(inputs.iter().map(|v| v.name.as_str())) {
        let v = inputs[range.start];
        let bounds = bounds::of_input(v, longest_step);
        let input = |name: String| row("input", continuous, None, name, v, bounds);
        match (table, version) {
            (None, _) if v.name == "step" => {
                rows.push(row("parameter", tunable, exact, v.name.clone(), v, bounds));
            }
            (None, _) => rows.push(input(v.name.clone())),
            (Some(table), Version::Three) => {
                rows.push(Row { count: range.len(), ..input(table) });
            }
            // FMI 2.0 has no arrays: structured names with indices from one
            (Some(table), Version::Two) => {
                rows.extend((1..=range.len()).map(|k| input(format!("{table}[{k}]"))));
            }
        }
    }
    // a state may have the name of an output; states of an estimator are internal
    let states_shown = match states.iter().any(|v| entry(&v.name).is_some()) {
        true => &[],
        false => states.as_slice(),
    };
    rows.extend(states_shown.iter().map(|v| {
        row("local", continuous, exact, format!("state_{}", v.name), *v, bounds::of_state(v))
    }));
    let known = rows.len();
    let calculated = Some("calculated");
    rows.extend(
        block.outputs.iter().map(|v| {
            row("output", continuous, calculated, v.name.clone(), v, bounds::of_output(v))
        }),
    );
    let first_state = parameters.len() + inputs.len();
    // the first outputs of the slopes are the rates, one for each state
    rows.extend(slopes.iter().flat_map(|s| &s.outputs[..states.len()]).enumerate().map(
        |(k, v)| {
            let bounds = bounds::of_output(v);
            let rate_of = Some(first_state + k);
            Row { rate_of, ..row("local", continuous, calculated, v.name.clone(), v, bounds) }
        },
    ));
    let mut reference = 0;
    for row in &mut rows {
        row.reference = reference;
        reference += row.count;
    }

    let all: Vec<Block> = [Some(block), slopes].into_iter().flatten().cloned().collect();
    let code = files(&all, "hydroboom", Precision::Double)?;
    let identifier = format!("hydroboom_{}", block.name);
    let token = token(&identifier, &code.source);
    let counts = [parameters.len(), inputs.len(), states_shown.len(), block.outputs.len()];
    let arrays = rows.iter().filter(|row| row.count > 1).count();
    let [before, after] = glue(block, slopes, counts, arrays, &inputs, &token);
    let after = after + &impossible(&parameters) + &balanced(block, &parameters);
    let functions = match version {
        Version::Two => include_str!("fmi2.c"),
        Version::Three => include_str!("fmi3.c"),
    };
    let layer = include_str!("layer.c")
        .replace("HB_BOUNDS_OF_KNOWN\n", &bounds_of(&rows[..known]))
        .replace("HB_ROWS_OF_ARRAYS\n", &arrays_of(&rows));
    let source = functions.replace("HB_LAYER\n", &format!("{before}\n{layer}"));
    let source =
        source.replacen("#include <math.h>", "#include \"hydroboom.h\"\n#include <math.h>", 1)
            + &after;
    let [step, own_step] = steps(block);
    let about = About { identifier: &identifier, token: &token, title, step, own_step };
    let mut all = vec![(
        "modelDescription.xml".into(),
        match version {
            Version::Two => about.description_2(&rows),
            Version::Three => about.description_3(&rows),
        },
    )];
    if version == Version::Three {
        all.push((
            "sources/buildDescription.xml".into(),
            format!(
                "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiBuildDescription fmiVersion=\"3.0\">\n  <BuildConfiguration \
                 modelIdentifier=\"{identifier}\">\n    <SourceFileSet language=\"C99\" compilerOptions=\"-ffp-contract=off\">\n      \
                 <SourceFile name=\"hydroboom.c\"/>\n      <SourceFile name=\"fmu.c\"/>\n    </SourceFileSet>\n  </BuildConfiguration>\n\
                 </fmiBuildDescription>\n"
            ),
        ));
    }
    all.extend([
        ("sources/hydroboom.h".to_string(), code.header),
        ("sources/hydroboom.c".into(), code.source),
        ("sources/fmu.c".into(), source),
    ]);
    Ok(Unit { identifier, files: all, version, functions: code.functions })
}

/// Settings file with which TwinCAT's FMI target (TE1420) compiles the source of these FMUs.
pub fn twincat_settings() -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"utf-8\" standalone=\"yes\"?>\n\
         <CustomConfigurations xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" xsi:noNamespaceSchemaLocation=\"CustomFmu.xsd\">\n  \
         <FmuConfiguration>\n    <ToolName>{}</ToolName>\n    <AdditionalInclude>$(ProjectDir);$(ProjectDir)sources;</AdditionalInclude>\n    \
         <PreprocessorDefinitions></PreprocessorDefinitions>\n    <ExcludedFromBuild></ExcludedFromBuild>\n    \
         <CodeReplacements></CodeReplacements>\n  </FmuConfiguration>\n</CustomConfigurations>\n",
        tool()
    )
}

/// Generation tool stated in the FMUs.
fn tool() -> String {
    format!("Hydroboom {}", env!("CARGO_PKG_VERSION"))
}

/// Header of a model description.
struct About<'a> {
    identifier: &'a str,
    token: &'a str,
    title: &'a str,
    /// Communication step \[s\].
    step: f64,
    /// The block's own step \[s\]; a communication step is a multiple of it.
    own_step: f64,
}

impl About<'_> {
    fn description_2(&self, rows: &[Row<'_>]) -> String {
        let Self { identifier, token, title, step, .. } = self;
        let has_entries = rows.iter().any(|row| row.name.ends_with(']'));
        let naming = if has_entries { "structured" } else { "flat" };
        // the FMU accepts any multiple of its own step, but FMI 2.0 can declare only variable or fixed steps: masters
        // with variable steps would not choose multiples
        let mut text = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription fmiVersion=\"2.0\" modelName=\"{identifier}\" guid=\"{token}\" \
             description=\"{}\" generationTool=\"{}\" variableNamingConvention=\"{naming}\" numberOfEventIndicators=\"0\">\n  \
             <CoSimulation modelIdentifier=\"{identifier}\" canHandleVariableCommunicationStepSize=\"false\" \
             canBeInstantiatedOnlyOncePerProcess=\"false\" canNotUseMemoryManagementFunctions=\"true\" canGetAndSetFMUstate=\"true\" \
             canSerializeFMUstate=\"true\" providesDirectionalDerivative=\"{}\">\n    <SourceFiles>\n      <File name=\"hydroboom.c\"/>\n      \
             <File name=\"fmu.c\"/>\n    </SourceFiles>\n  </CoSimulation>\n{}  <DefaultExperiment startTime=\"0\" stepSize=\"{step:?}\"/>\n  \
             <ModelVariables>\n",
            escaped(title),
            tool(),
            rates(rows).next().is_some(),
            units_and_categories(rows)
        );
        for row in rows {
            // an index counts from one
            let rate = row.rate_of.map_or(String::new(), |k| format!(" derivative=\"{}\"", k + 1));
            let (attributes, values) = (row.attributes(), row.values());
            let _ = writeln!(
                text,
                "    <ScalarVariable {attributes}><Real{rate}{values}/></ScalarVariable>"
            );
        }
        text += "  </ModelVariables>\n  <ModelStructure>\n";
        let listed = |k: usize| format!("      <Unknown index=\"{}\"/>\n", k + 1);
        let outputs: String = outputs(rows).map(listed).collect();
        let rates: String = rates(rows).map(listed).collect();
        let derivatives = match rates.is_empty() {
            true => String::new(),
            false => format!("    <Derivatives>\n{rates}    </Derivatives>\n"),
        };
        text + &format!(
            "    <Outputs>\n{outputs}    </Outputs>\n{derivatives}    <InitialUnknowns>\n{outputs}{rates}    </InitialUnknowns>\n  \
             </ModelStructure>\n</fmiModelDescription>\n"
        )
    }

    fn description_3(&self, rows: &[Row<'_>]) -> String {
        let Self { identifier, token, title, step, own_step } = self;
        let mut text = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription fmiVersion=\"3.0\" modelName=\"{identifier}\" \
             instantiationToken=\"{token}\" description=\"{}\" generationTool=\"{}\" variableNamingConvention=\"flat\">\n  <CoSimulation \
             modelIdentifier=\"{identifier}\" canHandleVariableCommunicationStepSize=\"true\" fixedInternalStepSize=\"{own_step:?}\" canGetAndSetFMUState=\"true\" \
             canSerializeFMUState=\"true\" providesDirectionalDerivatives=\"{}\"/>\n{}  <DefaultExperiment startTime=\"0\" stepSize=\"{step:?}\"/>\n  <ModelVariables>\n",
            escaped(title),
            tool(),
            rates(rows).next().is_some(),
            units_and_categories(rows)
        );
        for row in rows {
            let rate = row.rate_of.map_or(String::new(), |k| format!(" derivative=\"{k}\""));
            let (attributes, values) = (row.attributes(), row.values());
            let _ = match row.count {
                1 => writeln!(text, "    <Float64 {attributes}{rate}{values}/>"),
                count => writeln!(
                    text,
                    "    <Float64 {attributes}{rate}{values}><Dimension start=\"{count}\"/></Float64>"
                ),
            };
        }
        let _ = writeln!(
            text,
            "    <Float64 name=\"time\" valueReference=\"{}\" description=\"Time\" causality=\"independent\" variability=\"continuous\" unit=\"s\"/>",
            rows.iter().map(|row| row.count).sum::<usize>()
        );
        text += "  </ModelVariables>\n  <ModelStructure>\n";
        let mut list = |kind: &str, place: usize| {
            let reference = rows[place].reference;
            let _ = writeln!(text, "    <{kind} valueReference=\"{reference}\"/>");
        };
        outputs(rows).for_each(|k| list("Output", k));
        rates(rows).for_each(|k| list("ContinuousStateDerivative", k));
        outputs(rows).chain(rates(rows)).for_each(|k| list("InitialUnknown", k));
        text + "  </ModelStructure>\n</fmiModelDescription>\n"
    }
}

fn outputs<'a>(rows: &'a [Row<'_>]) -> impl Iterator<Item = usize> + 'a {
    rows.iter().enumerate().filter(|(_, row)| row.causality == "output").map(|(k, _)| k)
}

fn rates<'a>(rows: &'a [Row<'_>]) -> impl Iterator<Item = usize> + 'a {
    rows.iter().enumerate().filter(|(_, row)| row.rate_of.is_some()).map(|(k, _)| k)
}

fn units_and_categories(rows: &[Row<'_>]) -> String {
    let of = |row: &Row<'_>| row.variable.unit.clone();
    let mut units: Vec<String> = rows.iter().map(of).chain(["s".to_string()]).collect();
    units.retain(|unit| !matches!(unit.as_str(), "" | "-" | "1"));
    units.sort_unstable();
    units.dedup();
    let of = |unit: &String| {
        let shown = display(unit).map_or(String::new(), |(shown, factor)| {
            format!("<DisplayUnit name=\"{shown}\" factor=\"{factor:?}\"/>")
        });
        match base_unit(unit) + &shown {
            inner if inner.is_empty() => format!("    <Unit name=\"{}\"/>\n", escaped(unit)),
            inner => format!("    <Unit name=\"{}\">{inner}</Unit>\n", escaped(unit)),
        }
    };
    let units: String = units.iter().map(of).collect();
    format!(
        "  <UnitDefinitions>\n{units}  </UnitDefinitions>\n  <LogCategories>\n    <Category name=\"logStatusError\"/>\n  </LogCategories>\n"
    )
}

fn has_balance(block: &Block) -> bool {
    block.entries.iter().any(|entry| entry.name == "balance")
}

/// Ranges of the settable variables, as a table in C.
fn bounds_of(rows: &[Row<'_>]) -> String {
    let of = |row: &Row<'_>| {
        let Bounds { low, high, nominal } = row.bounds;
        let (low, high) = (low.unwrap_or(-f64::MAX), high.unwrap_or(f64::MAX));
        format!("    {{ \"{}\", {low:?}, {high:?}, {nominal:?} }},\n", row.name)
    };
    rows.iter().flat_map(|row| std::iter::repeat_n(row, row.count)).map(of).collect()
}

/// The variables that are arrays, as a table in C.
fn arrays_of(rows: &[Row<'_>]) -> String {
    let arrays = rows.iter().filter(|row| row.count > 1);
    arrays.map(|row| format!("    {{ {}u, {}u }},\n", row.reference, row.count)).collect()
}

/// Pairs of parameters, the first of which must be below the second or not above it, with the error message. A crane
/// file is refused for the same conditions.
const ORDERED: [(&str, bool, &str, &str); 9] = [
    ("cylinder_rod_mm", true, "cylinder_piston_mm", "the rod is not thinner than the piston"),
    (
        "geometry_mount_x_mm",
        false,
        "boom_length_mm",
        "the cylinder's mount lies beyond the end of the boom",
    ),
    (
        "oil_bulk_modulus_min_mpa",
        false,
        "oil_bulk_modulus_max_mpa",
        "the oil would be stiffer at low pressure than at high",
    ),
    (
        "holding_valve_cracking_bar",
        true,
        "holding_valve_opening_bar",
        "load-holding valve 3 would be fully open before it begins to open",
    ),
    (
        "return_valve_cracking_bar",
        true,
        "return_valve_opening_bar",
        "return valve 7 would be fully open before it begins to open",
    ),
    (
        "check_valve_cracking_bar",
        true,
        "check_valve_opening_bar",
        "check valve 8 would be fully open before it begins to open",
    ),
    (
        "relief_cracking_bar",
        true,
        "relief_opening_bar",
        "relief valve 13 would be fully open before it begins to open",
    ),
    (
        "accumulator_precharge_bar",
        true,
        "accumulator_working_bar",
        "the accumulator holds no oil: it is filled to no more than its precharge",
    ),
    ("motion_start_mm", false, "cylinder_stroke_mm", "motion_start_mm lies beyond the stroke"),
];

/// Parameters of the triangle of bearing, foot and mount.
const TRIANGLE: [&str; 6] = [
    "geometry_base_x_mm",
    "geometry_base_y_mm",
    "geometry_mount_x_mm",
    "geometry_mount_y_mm",
    "geometry_shortest_mm",
    "cylinder_stroke_mm",
];

/// The function that checks parameters for impossible values, as far as the block has them.
fn impossible(parameters: &[&Variable]) -> String {
    let has = |name: &str| parameters.iter().any(|v| v.name == name);
    let mut body = String::new();
    for (low, is_strict, high, wrong) in ORDERED {
        if has(low) && has(high) {
            let sign = if is_strict { "<" } else { "<=" };
            let _ = writeln!(
                body,
                "    if (!(n->p.{low} {sign} n->p.{high})) {{\n        return \"{wrong}\";\n    }}"
            );
        }
    }
    if TRIANGLE.iter().all(|name| has(name)) {
        let [base_x, base_y, mount_x, mount_y, shortest, stroke] =
            TRIANGLE.map(|name| format!("n->p.{name}"));
        let _ = writeln!(
            body,
            "    {{\n        const double base = sqrt({base_x} * {base_x} + {base_y} * {base_y});\n        \
             const double mount = sqrt({mount_x} * {mount_x} + {mount_y} * {mount_y});\n        \
             if (!({shortest} > fabs(base - mount)) || !({shortest} + {stroke} < base + mount)) {{\n            \
             return \"the cylinder cannot reach from base to boom over its whole stroke\";\n        }}\n    }}"
        );
    }
    format!(
        "\nstatic const char *hb_impossible(const hb_numbers *n)\n{{\n    (void)n;\n{body}    return NULL;\n}}\n"
    )
}

/// The functions of Newton's method to equilibrium, for a block that has them.
fn balanced(block: &Block, parameters: &[&Variable]) -> String {
    if !has_balance(block) {
        return String::new();
    }
    let prefix = format!("hb_{}", block.name);
    let vapour = parameters.iter().find(|v| v.name == "oil_vapour_pressure_bar");
    let vapour = vapour
        .and_then(|v| bounds::key(&v.name))
        .map_or("0.0".into(), |key| format!("{:?} * n->p.oil_vapour_pressure_bar", key.factor));
    format!(
        "\nstatic void hb_restart({prefix}_state *s)\n{{\n    {prefix}_start(s);\n}}\n\n\
         static void hb_balance(hb_numbers *n)\n{{\n    {prefix}_balance(&n->c, &n->s);\n}}\n\n\
         static int hb_pulls(const hb_numbers *n)\n{{\n    return n->s.pressure_a < {vapour};\n}}\n"
    )
}

/// Communication step \[s\], and the step of which it must be a multiple. Both are the control period, or the model's
/// step with the multiple of it that is about a millisecond.
fn steps(block: &Block) -> [f64; 2] {
    match block.period {
        None => {
            let own = block.inputs.iter().find(|(v, _)| v.name == "step");
            let step = own.map_or(1e-3, |(v, _)| v.initial);
            [step * (1e-3 / step).round().max(1.0), step]
        }
        Some(period) => [period.length; 2],
    }
}

/// GUID or token, which identifies the source of an FMU.
fn token(identifier: &str, source: &str) -> String {
    let hash = |begin: u64| {
        let bytes = identifier.bytes().chain(source.bytes());
        bytes.fold(begin, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
    };
    format!("{{{:016x}{:016x}}}", hash(0xcbf2_9ce4_8422_2325), hash(0x8422_2325_cbf2_9ce4))
}

/// Connection of the FMI layer to a block: definitions before it, functions after it.
fn glue(
    block: &Block,
    slopes: Option<&Block>,
    counts: [usize; 4],
    arrays: usize,
    inputs: &[&Variable],
    token: &str,
) -> [String; 2] {
    let prefix = format!("hb_{}", block.name);
    let [parameters, given, states, outputs] = counts;
    let rates = if slopes.is_some() { states } else { 0 };
    let balances = u8::from(has_balance(block));
    let framed = u8::from(block.period.is_some());
    let before = format!(
        "#define HB_TOKEN \"{token}\"\n#define HB_PARAMETERS {parameters}u\n#define HB_INPUTS {given}u\n#define HB_STATES {states}u\n\
         #define HB_OUTPUTS {outputs}u\n#define HB_RATES {rates}u\n#define HB_BALANCES {balances}\n#define HB_FRAMED {framed}\n#define HB_ARRAYS {arrays}\n#define HB_TYPE(part) {prefix}_##part\n"
    );
    let mut fill = String::new();
    // all other members are zero
    for v in inputs.iter().filter(|v| v.initial != 0.0) {
        let _ = writeln!(fill, "    n->u.{} = {:?};", v.name, v.initial);
    }
    let (one, show, period) = match block.period {
        None => (
            format!("    {prefix}_step(&n->c, &n->s, &n->u);"),
            format!("    {prefix}_see(&n->c, &n->s, &n->y);"),
            "n->u.step".to_string(),
        ),
        Some(ControlPeriod { length, steps }) => {
            let prepared = if parameters > 0 { "&n->c, " } else { "" };
            let mut one = format!("    {prefix}_update({prepared}&n->s, &n->u, &n->y);");
            if steps > 0 {
                one += &format!(
                    "\n    {{\n        int steps = {steps};\n        while (steps-- > 0) {{\n            \
                     {prefix}_step(&n->s);\n        }}\n    }}"
                );
            }
            (one, "    (void)n;".to_string(), format!("{length:?}"))
        }
    };
    let (describe, prepare) = match parameters {
        0 => (String::new(), "    (void)n;".to_string()),
        _ => (
            format!("    {prefix}_describe(&n->p);\n"),
            format!("    {prefix}_prepare(&n->p, &n->c);"),
        ),
    };
    let after = format!(
        "\n/* ---- the block ---- */\n\nstatic void hb_fill(hb_numbers *n)\n{{\n{describe}    {prefix}_start(&n->s);\n\
         {fill}}}\n\nstatic void hb_prepare(hb_numbers *n)\n{{\n{prepare}\n}}\n\n\
         static void hb_one(hb_numbers *n)\n{{\n{one}\n}}\n\nstatic void hb_show(hb_numbers *n)\n{{\n{show}\n}}\n\n\
         static double hb_period(const hb_numbers *n)\n{{\n    (void)n;\n    return {period};\n}}\n\n\
         static double hb_inner(const hb_numbers *n)\n{{\n    (void)n;\n    return 1.0;\n}}\n"
    );
    let seen = slopes.map_or(String::new(), |slopes| {
        let name = format!("hb_{}", slopes.name);
        format!(
            "\nstatic void hb_slopes(const double given[], double seen[])\n{{\n    {name}_input u;\n    {name}_output y;\n    \
             memcpy(&u, given, sizeof u);\n    {name}_see(&u, &y);\n    memcpy(seen, &y, sizeof y);\n}}\n"
        )
    });
    [before, after + &seen]
}
