//! `hydroboom doctor`

use crate::output;
use clap::Args;
use hydroboom_realtime::doctor::examine;
use miette::Result;
use serde_json::json;

/// Check whether this computer is suited for real time, with advice and reasons.
#[derive(Args)]
#[command(after_help = "Example: hydroboom doctor")]
pub struct Doctor {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Doctor {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let findings = examine();
        if self.json {
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
                let verdict = if f.is_well { "well" } else { "not well" };
                vec![f.what.into(), f.found.clone(), verdict.into()]
            })
            .collect();
        let mut said = output::table(&["what", "found", ""], &rows);
        for finding in findings.iter().filter(|f| !f.is_well) {
            said += &format!("\n\n{}: {}", finding.what, finding.advice);
        }
        output::text(&said)
    }
}
