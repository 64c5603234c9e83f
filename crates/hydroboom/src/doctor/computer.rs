//! Whether this computer is suited for real time.

use crate::output;
use hydroboom_realtime::doctor;
use miette::Result;
use serde_json::json;

/// Prints what was found of this computer, with advice and reasons.
pub fn examine(is_json: bool) -> Result<()> {
    let findings = doctor::examine();
    if is_json {
        let list: Vec<_> = findings
            .iter()
            .map(|f| {
                json!({
                    "what": f.what, "found": f.found, "is_well": f.is_well,
                    "advice": (!f.is_well).then_some(f.advice),
                })
            })
            .collect();
        return output::json(&json!({ "findings": list }));
    }
    let rows: Vec<Vec<String>> = findings
        .iter()
        .map(|f| {
            let verdict = if f.is_well { "ok" } else { "not ok" };
            vec![f.what.into(), f.found.clone(), verdict.into()]
        })
        .collect();
    let mut said = output::table(&["what", "found", ""], &rows);
    for finding in findings.iter().filter(|f| !f.is_well) {
        said += &format!("\n\n{}: {}", finding.what, finding.advice);
    }
    output::text(&said)
}
