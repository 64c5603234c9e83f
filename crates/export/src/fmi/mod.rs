//! FMI: a block as a functional mock-up unit for co-simulation that contains its source.

mod archive;
mod block_connection;
mod bounds;
mod model_description;
mod parameter_check;
mod unit_definition;
mod variable;

pub use archive::{ArchiveError, System, archive, binary};

use crate::block::{Block, Variable};
use crate::c::{Precision, files};
use crate::error::ExportError;
use crate::plan::Plan;
use crate::step_limit::longest_step;
use block_connection::{balanced, connection};
use hydroboom_description::Description;
use model_description::About;
use parameter_check::impossible;
use variable::{arrays_of, bounds_of, shown, variables};

/// Version of the FMI standard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0
    Two,
    /// FMI 3.0
    Three,
}

/// Content of an FMU (functional mock-up unit): the files of its archive without the compiled libraries.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Model identifier of the FMI standard, which is the name of its files.
    pub identifier: String,
    /// Path in the archive and text of each file, in the archive's order.
    pub files: Vec<(String, String)>,
    /// Version of the FMI standard.
    pub version: Version,
    /// Names of the functions that `sources/hydroboom.c` defines for `sources/fmu.c`.
    functions: Vec<String>,
}

/// A block of a crane as an FMU. With its [`slopes`](crate::slopes) the FMU provides the rates of its states and
/// directional derivatives.
///
/// # Errors
///
/// [`ExportError::Foreign`] if the block depends on a quantity that it does not contain, [`ExportError::Step`] if the
/// crane file's step is above the stability limit of the scheme.
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
    let (rows, settable) =
        variables(block, slopes, [&parameters, &inputs, &states], longest_step, version);

    let all: Vec<Block> = [Some(block), slopes].into_iter().flatten().cloned().collect();
    let code = files(&all, "hydroboom", Precision::Double)?;
    let identifier = format!("hydroboom_{}", block.name);
    let token = token(&identifier, &code.source);
    let counts = [parameters.len(), inputs.len(), shown(&states).len(), block.outputs.len()];
    let arrays = rows.iter().filter(|row| row.count > 1).count();
    let [before, after] = connection(block, slopes, counts, arrays, &inputs, &token);
    let after = after + &impossible(&parameters) + &balanced(block, &parameters);
    let functions = match version {
        Version::Two => include_str!("fmi2.c"),
        Version::Three => include_str!("fmi3.c"),
    };
    let layer = include_str!("layer.c")
        .replace("HB_BOUNDS_OF_KNOWN\n", &bounds_of(&rows[..settable]))
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
