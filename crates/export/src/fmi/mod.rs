//! FMI: a block as a functional mock-up unit for co-simulation that carries its source.

mod archive;

pub use archive::{ArchiveError, System, archive, binary};

use crate::block::{Block, Variable};
use crate::c::{Precision, files};
use crate::error::ExportError;
use crate::graph::Node;
use crate::plan::Plan;
use std::fmt::Write;

/// A version of the standard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0
    Two,
    /// FMI 3.0
    Three,
}

/// What an FMU is made of: the files of its archive, but for the binary.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Name of its files: the model identifier.
    pub identifier: String,
    /// Path in the archive and content, in the archive's order.
    pub files: Vec<(String, String)>,
    /// Version of the standard.
    pub version: Version,
}

/// A variable of an FMU; its place is its value reference.
struct Row<'a> {
    name: String,
    causality: &'static str,
    variability: &'static str,
    initial: Option<&'static str>,
    /// For the rate of a state: that state's reference.
    rate_of: Option<usize>,
    variable: &'a Variable,
}

impl Row<'_> {
    /// Attributes that both versions have, in the order of the standard.
    fn attributes(&self, reference: usize) -> String {
        let initial = self.initial.map_or(String::new(), |i| format!(" initial=\"{i}\""));
        format!(
            "name=\"{}\" valueReference=\"{reference}\" description=\"{}\" causality=\"{}\" variability=\"{}\"{initial}",
            escaped(&self.name),
            escaped(&self.variable.meaning),
            self.causality,
            self.variability
        )
    }

    /// Unit and start value.
    fn values(&self) -> String {
        let unit = match (self.variable.unit.as_str(), display(&self.variable.unit)) {
            ("" | "-" | "1", _) => String::new(),
            (unit, None) => format!(" unit=\"{}\"", escaped(unit)),
            (unit, Some((shown, _))) => {
                format!(" unit=\"{}\" displayUnit=\"{shown}\"", escaped(unit))
            }
        };
        match self.initial {
            Some("calculated") => unit,
            _ => format!("{unit} start=\"{:?}\"", self.variable.initial),
        }
    }
}

/// The unit that people think in, and how many of it one SI unit is.
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

/// Text as an attribute of an element.
fn escaped(text: &str) -> String {
    let mut safe = String::new();
    for c in text.chars() {
        match c {
            '&' => safe += "&amp;",
            '<' => safe += "&lt;",
            '>' => safe += "&gt;",
            '"' => safe += "&quot;",
            // what XML 1.0 has not at all
            c if (c as u32) < 32 || matches!(c, '\u{fffe}' | '\u{ffff}') => safe.push(' '),
            c => safe.push(c),
        }
    }
    safe
}

/// A block as an FMU. `title` is the crane's name. With its [`slopes`](crate::slopes) the FMU has the rates of its states and
/// gives directional derivatives.
///
/// # Errors
///
/// [`ExportError`] when the block depends on something that it does not have.
pub fn unit(
    block: &Block,
    slopes: Option<&Block>,
    title: &str,
    version: Version,
) -> Result<Unit, ExportError> {
    let plan = Plan::of(block)?;
    let parameters: Vec<&Variable> =
        plan.parameters.iter().map(|k| &block.parameters[*k].0).collect();
    let inputs: Vec<&Variable> = block.inputs.iter().map(|(v, _)| v).collect();
    let states: Vec<&Variable> = block.states.iter().map(|(v, _)| v).collect();
    let row = |causality, variability, initial, name: String, variable| Row {
        name,
        causality,
        variability,
        initial,
        rate_of: None,
        variable,
    };
    let mut rows: Vec<Row<'_>> = Vec::new();
    rows.extend(
        parameters.iter().map(|v| row("parameter", "tunable", Some("exact"), v.name.clone(), *v)),
    );
    rows.extend(inputs.iter().map(|v| match v.name == "step" {
        true => row("parameter", "tunable", Some("exact"), v.name.clone(), *v),
        false => row("input", "continuous", None, v.name.clone(), *v),
    }));
    // a state may have the name of an output
    rows.extend(
        states
            .iter()
            .map(|v| row("local", "continuous", Some("exact"), format!("state_{}", v.name), *v)),
    );
    rows.extend(
        block
            .outputs
            .iter()
            .map(|v| row("output", "continuous", Some("calculated"), v.name.clone(), v)),
    );
    let first_state = parameters.len() + inputs.len();
    // the first outputs of the slopes are the rates, one for each state
    rows.extend(slopes.iter().flat_map(|s| &s.outputs[..states.len()]).enumerate().map(
        |(k, v)| {
            let rate_of = Some(first_state + k);
            Row { rate_of, ..row("local", "continuous", Some("calculated"), v.name.clone(), v) }
        },
    ));

    let all: Vec<Block> = [Some(block), slopes].into_iter().flatten().cloned().collect();
    let code = files(&all, "hydroboom", Precision::Double)?;
    let identifier = format!("hydroboom_{}", block.name);
    let token = token(&identifier, &code.source);
    let counts = [parameters.len(), inputs.len(), states.len(), block.outputs.len()];
    let [before, after] = glue(block, slopes, counts, &inputs, &token);
    let functions = match version {
        Version::Two => include_str!("fmi2.c"),
        Version::Three => include_str!("fmi3.c"),
    };
    let layer = include_str!("layer.c");
    let source = functions.replace("HB_LAYER\n", &format!("{before}\n{layer}"));
    let source =
        source.replacen("#include <math.h>", "#include \"hydroboom.h\"\n#include <math.h>", 1)
            + &after;
    let about =
        About { identifier: &identifier, token: &token, title, step: communication_step(block) };
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
    Ok(Unit { identifier, files: all, version })
}

/// What TwinCAT's FMI target (TE1420) has to be told to compile the source of these FMUs: a file for its folder of settings.
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

/// What these FMUs say that they were made by.
fn tool() -> String {
    format!("Hydroboom {}", env!("CARGO_PKG_VERSION"))
}

/// What a description begins with.
struct About<'a> {
    identifier: &'a str,
    token: &'a str,
    title: &'a str,
    /// Communication step \[s\].
    step: f64,
}

impl About<'_> {
    fn description_2(&self, rows: &[Row<'_>]) -> String {
        let Self { identifier, token, title, step } = self;
        let mut text = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription fmiVersion=\"2.0\" modelName=\"{identifier}\" guid=\"{token}\" \
             description=\"{}\" generationTool=\"{}\" variableNamingConvention=\"flat\" numberOfEventIndicators=\"0\">\n  \
             <CoSimulation modelIdentifier=\"{identifier}\" canHandleVariableCommunicationStepSize=\"true\" \
             canBeInstantiatedOnlyOncePerProcess=\"false\" canNotUseMemoryManagementFunctions=\"true\" canGetAndSetFMUstate=\"true\" \
             canSerializeFMUstate=\"true\" providesDirectionalDerivative=\"{}\">\n    <SourceFiles>\n      <File name=\"hydroboom.c\"/>\n      \
             <File name=\"fmu.c\"/>\n    </SourceFiles>\n  </CoSimulation>\n{}  <DefaultExperiment startTime=\"0\" stepSize=\"{step:?}\"/>\n  \
             <ModelVariables>\n",
            escaped(title),
            tool(),
            rates(rows).next().is_some(),
            units_and_categories(rows)
        );
        for (reference, row) in rows.iter().enumerate() {
            // an index counts from one
            let rate = row.rate_of.map_or(String::new(), |k| format!(" derivative=\"{}\"", k + 1));
            let (attributes, values) = (row.attributes(reference), row.values());
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
        let Self { identifier, token, title, step } = self;
        let mut text = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription fmiVersion=\"3.0\" modelName=\"{identifier}\" \
             instantiationToken=\"{token}\" description=\"{}\" generationTool=\"{}\" variableNamingConvention=\"flat\">\n  <CoSimulation \
             modelIdentifier=\"{identifier}\" canHandleVariableCommunicationStepSize=\"true\" canGetAndSetFMUState=\"true\" \
             canSerializeFMUState=\"true\" providesDirectionalDerivatives=\"{}\"/>\n{}  <DefaultExperiment startTime=\"0\" stepSize=\"{step:?}\"/>\n  <ModelVariables>\n",
            escaped(title),
            tool(),
            rates(rows).next().is_some(),
            units_and_categories(rows)
        );
        for (reference, row) in rows.iter().enumerate() {
            let rate = row.rate_of.map_or(String::new(), |k| format!(" derivative=\"{k}\""));
            let (attributes, values) = (row.attributes(reference), row.values());
            let _ = writeln!(text, "    <Float64 {attributes}{rate}{values}/>");
        }
        let _ = writeln!(
            text,
            "    <Float64 name=\"time\" valueReference=\"{}\" description=\"Time\" causality=\"independent\" variability=\"continuous\" unit=\"s\"/>",
            rows.len()
        );
        text += "  </ModelVariables>\n  <ModelStructure>\n";
        let mut list = |kind: &str, reference: usize| {
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
    let of = |unit: &String| match display(unit) {
        None => format!("    <Unit name=\"{}\"/>\n", escaped(unit)),
        Some((shown, factor)) => format!(
            "    <Unit name=\"{}\"><DisplayUnit name=\"{shown}\" factor=\"{factor:?}\"/></Unit>\n",
            escaped(unit)
        ),
    };
    let units: String = units.iter().map(of).collect();
    format!(
        "  <UnitDefinitions>\n{units}  </UnitDefinitions>\n  <LogCategories>\n    <Category name=\"logStatusError\"/>\n  </LogCategories>\n"
    )
}

/// The control period \[s\], in C.
const CONTROL_PERIOD: &str = "1e-3 * n->p.controller_control_period_ms";

/// How a block goes on in time.
#[derive(Clone, Copy, PartialEq)]
enum Pace {
    /// By its own step, and shows its state.
    Step,
    /// By the control period.
    Period,
    /// By the control period, in each of which it simulates.
    PeriodOfSteps,
}

impl Pace {
    fn of(block: &Block) -> Self {
        let has = |name: &str| block.entries.iter().any(|entry| entry.name == name);
        match (has("update"), has("step")) {
            (false, _) => Self::Step,
            (true, false) => Self::Period,
            (true, true) => Self::PeriodOfSteps,
        }
    }
}

/// What a master is told to step by \[s\]: the control period, or a millisecond, which is a whole number of a model's steps as a rule.
fn communication_step(block: &Block) -> f64 {
    let of = |all: &[(Variable, Node)], name: &str| {
        all.iter().find(|(v, _)| v.name == name).map_or(1e-3, |(v, _)| v.initial)
    };
    match Pace::of(block) {
        Pace::Step => {
            let step = of(&block.inputs, "step");
            step * (1e-3 / step).round().max(1.0)
        }
        Pace::Period | Pace::PeriodOfSteps => {
            1e-3 * of(&block.parameters, "controller_control_period_ms")
        }
    }
}

/// Tells an FMU apart from one with another source.
fn token(identifier: &str, source: &str) -> String {
    let hash = |begin: u64| {
        let bytes = identifier.bytes().chain(source.bytes());
        bytes.fold(begin, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
    };
    format!("{{{:016x}{:016x}}}", hash(0xcbf2_9ce4_8422_2325), hash(0x8422_2325_cbf2_9ce4))
}

/// What ties the layer to a block: definitions before it, functions behind it.
fn glue(
    block: &Block,
    slopes: Option<&Block>,
    counts: [usize; 4],
    inputs: &[&Variable],
    token: &str,
) -> [String; 2] {
    let prefix = format!("hb_{}", block.name);
    let [parameters, given, states, outputs] = counts;
    let rates = if slopes.is_some() { states } else { 0 };
    let before = format!(
        "#define HB_TOKEN \"{token}\"\n#define HB_PARAMETERS {parameters}u\n#define HB_INPUTS {given}u\n#define HB_STATES {states}u\n\
         #define HB_OUTPUTS {outputs}u\n#define HB_RATES {rates}u\n#define HB_TYPE(part) {prefix}_##part\n"
    );
    let mut fill = String::new();
    for v in inputs {
        let _ = writeln!(fill, "    n->u.{} = {:?};", v.name, v.initial);
    }
    let (one, show, period) = match Pace::of(block) {
        Pace::Step => (
            format!("    {prefix}_step(&n->c, &n->s, &n->u);"),
            format!("    {prefix}_see(&n->c, &n->s, &n->y);"),
            "n->u.step",
        ),
        pace @ (Pace::Period | Pace::PeriodOfSteps) => {
            let begin = match pace {
                Pace::PeriodOfSteps => "&n->c, &n->s, &n->u",
                _ => "&n->s, &n->u",
            };
            let mut one = format!(
                "    if (n->has_begun == 0) {{\n        {prefix}_begin({begin});\n        n->has_begun = 1;\n    }}\n    \
                 {prefix}_update(&n->c, &n->s, &n->u, &n->y);"
            );
            if pace == Pace::PeriodOfSteps {
                one += &format!(
                    "\n    {{\n        long steps = (long)(hb_inner(n) + 0.5);\n        \
                     while (steps-- > 0) {{\n            {prefix}_step(&n->c, &n->s, &n->u);\n        }}\n    }}"
                );
            }
            (one, "    (void)n;".to_string(), CONTROL_PERIOD)
        }
    };
    let inner = match Pace::of(block) {
        Pace::PeriodOfSteps => format!("{CONTROL_PERIOD} / n->u.step"),
        Pace::Step | Pace::Period => "1.0".into(),
    };
    let after = format!(
        "\n/* ---- the block ---- */\n\nstatic void hb_fill(hb_numbers *n)\n{{\n    {prefix}_describe(&n->p);\n    {prefix}_start(&n->s);\n\
         {fill}}}\n\nstatic void hb_prepare(hb_numbers *n)\n{{\n    {prefix}_prepare(&n->p, &n->c);\n}}\n\n\
         static void hb_one(hb_numbers *n)\n{{\n{one}\n}}\n\nstatic void hb_show(hb_numbers *n)\n{{\n{show}\n}}\n\n\
         static double hb_period(const hb_numbers *n)\n{{\n    return {period};\n}}\n\n\
         static double hb_inner(const hb_numbers *n)\n{{\n    (void)n;\n    return {inner};\n}}\n"
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
