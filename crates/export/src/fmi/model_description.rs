//! Model description of an FMU in XML, for both versions of the standard.

use super::tool;
use super::unit_definition::base_unit;
use super::variable::{Row, display, escaped};
use std::fmt::Write;

/// Header of a model description.
pub(super) struct About<'a> {
    pub(super) identifier: &'a str,
    pub(super) token: &'a str,
    pub(super) title: &'a str,
    /// Communication step \[s\].
    pub(super) step: f64,
    /// The block's own step \[s\]; a communication step is a multiple of it.
    pub(super) own_step: f64,
}

impl About<'_> {
    pub(super) fn description_2(&self, rows: &[Row<'_>]) -> String {
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

    pub(super) fn description_3(&self, rows: &[Row<'_>]) -> String {
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
