//! PLCopen XML (TC6 2.01): all units in one file, which most tools can import.

use super::unit::{CONFIGURATION, Declared, Form, Kind, RESOURCE, Section, Unit};

/// Project in PLCopen XML (TC6, version 2.01) as text, with all these units.
pub fn project(units: &[Unit]) -> String {
    let mut text = String::from(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<project xmlns=\"http://www.plcopen.org/xml/tc6_0200\">\n  <fileHeader \
         companyName=\"Hydroboom\" productName=\"Hydroboom\" productVersion=\"",
    );
    text += env!("CARGO_PKG_VERSION");
    // no date: the same crane gives the same file
    text += "\" creationDateTime=\"2000-01-01T00:00:00\"/>\n  <contentHeader name=\"hydroboom\">\n    <coordinateInfo>\n      <fbd><scaling x=\"1\" y=\"1\"/></fbd>\n      \
             <ld><scaling x=\"1\" y=\"1\"/></ld>\n      <sfc><scaling x=\"1\" y=\"1\"/></sfc>\n    </coordinateInfo>\n  </contentHeader>\n  <types>\n    <dataTypes/>\n    <pous>\n";
    for unit in units.iter().filter(|u| u.kind != Kind::Globals) {
        let kind = match unit.kind {
            Kind::Function => "function",
            Kind::Program => "program",
            Kind::FunctionBlock | Kind::Globals => "functionBlock",
        };
        text += &format!(
            "      <pou name=\"{}\" pouType=\"{kind}\">\n        <interface>\n",
            unit.name
        );
        for result in unit.variables.iter().filter(|v| v.section == Section::Result) {
            text += &format!("          <returnType><{}/></returnType>\n", result.kind);
        }
        for (section, tag) in [
            (Section::Input, "inputVars"),
            (Section::InOut, "inOutVars"),
            (Section::Output, "outputVars"),
            (Section::Local, "localVars"),
            (Section::External, "externalVars"),
        ] {
            text += &variables(unit, section, tag, 10);
        }
        text += &format!(
            "        </interface>\n        <body>\n          <ST>\n            <xhtml xmlns=\"http://www.w3.org/1999/xhtml\">{}</xhtml>\n          \
             </ST>\n        </body>\n      </pou>\n",
            escaped(&unit.statements(Form::Standard))
        );
    }
    text += "    </pous>\n  </types>\n  <instances>\n    <configurations>\n";
    text += &format!("      <configuration name=\"{CONFIGURATION}\">\n");
    text += &format!("        <resource name=\"{RESOURCE}\">\n");
    for task in units.iter().flat_map(|unit| &unit.tasks) {
        text += &format!(
            "          <task name=\"{}\" priority=\"{}\" interval=\"{}\">\n            <pouInstance name=\"{}\" typeName=\"{}\"/>\n          \
             </task>\n",
            task.name,
            task.priority,
            task.interval_literal(),
            task.instance(),
            task.program
        );
    }
    text += "        </resource>\n";
    for unit in units.iter().filter(|u| u.kind == Kind::Globals) {
        let all = variables(unit, Section::Global, "globalVars", 8);
        text += &all.replacen("<globalVars>", &format!("<globalVars name=\"{}\">", unit.name), 1);
    }
    text += "      </configuration>\n    </configurations>\n  </instances>\n</project>\n";
    text
}

fn variables(unit: &Unit, section: Section, tag: &str, indent: usize) -> String {
    let all: Vec<&Declared> = unit.variables.iter().filter(|v| v.section == section).collect();
    if all.is_empty() {
        return String::new();
    }
    let space = " ".repeat(indent);
    let mut text = format!("{space}<{tag}>\n");
    for v in all {
        let bounds = v.kind.strip_prefix("ARRAY[").and_then(|rest| rest.split_once("] OF "));
        let bounds = bounds.and_then(|(bounds, kind)| Some((bounds.split_once("..")?, kind)));
        let kind = match (v.kind.as_str(), bounds) {
            ("LREAL" | "REAL" | "BOOL" | "DINT", _) => format!("<{}/>", v.kind),
            (_, Some(((low, high), kind))) => format!(
                "<array><dimension lower=\"{low}\" upper=\"{high}\"/><baseType><{kind}/></baseType></array>"
            ),
            (derived, None) => format!("<derived name=\"{derived}\"/>"),
        };
        let initial = v.initial.as_ref().map_or(String::new(), |value| {
            format!("<initialValue><simpleValue value=\"{}\"/></initialValue>", escaped(value))
        });
        let said = match v.comment.is_empty() {
            true => String::new(),
            false => format!(
                "<documentation><xhtml xmlns=\"http://www.w3.org/1999/xhtml\">{}</xhtml></documentation>",
                escaped(&v.comment)
            ),
        };
        text += &format!(
            "{space}  <variable name=\"{}\"><type>{kind}</type>{initial}{said}</variable>\n",
            v.name
        );
    }
    text + &format!("{space}</{tag}>\n")
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
