//! `hydroboom export count`

use crate::crane_file::CraneFile;
use crate::output;
use clap::Args;
use hydroboom_export::{
    Plan, blocks, controller, crane_model, scheduled_lqr_controller, simulation_feedforward,
};
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// Count the operations of model and controllers by kind, for each part and each call.
#[derive(Args)]
#[command(after_help = "Example: hydroboom export count --set friction.law=lugre")]
pub struct Count {
    #[command(flatten)]
    crane: CraneFile,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Count {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If the crane file is invalid, or the crane cannot be exported.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read()?;
        let model = crane_model(&crane).into_diagnostic()?;
        let [hydraulics, boom] = blocks(&crane).into_diagnostic()?;
        let mut counts = Vec::new();
        let benchmark = controller(&crane).into_diagnostic()?;
        let feedforward = simulation_feedforward(&crane).into_diagnostic()?;
        let lqr = scheduled_lqr_controller(&crane).into_diagnostic()?;
        let mut memory = Vec::new();
        for block in [model, hydraulics, boom, benchmark, feedforward, lqr] {
            memory.push((block.name.clone(), block.states.len(), block.inputs.len()));
            let plan = Plan::of(&block).into_diagnostic()?;
            let prepares = ("prepare", &plan.preparing);
            let entries = block.entries.iter().map(|e| e.name.as_str()).zip(&plan.entries);
            for (name, order) in std::iter::once(prepares).chain(entries) {
                let count = hydroboom_export::Count::of(&block.graph, order);
                counts.push((block.name.clone(), name.to_string(), count));
            }
        }
        let of = |name: &str| memory.iter().find(|(block, ..)| block == name);
        let numbers =
            |name: &str| of(name).map_or((0, 0), |(_, states, inputs)| (*states, *inputs));
        if self.json {
            return output::json(&json!(counts.iter().map(|(block, call, c)| json!({
                "states": numbers(block).0, "inputs": numbers(block).1,
                "block": block, "call": call, "flops": c.flops(), "sums": c.sums, "products": c.products,
                "fused": c.fused, "quotients": c.quotients, "roots": c.roots, "functions": c.functions,
                "comparisons": c.comparisons, "choices": c.choices,
            })).collect::<Vec<_>>()));
        }
        let header = [
            "block",
            "call",
            "flops",
            "sums",
            "products",
            "fused",
            "quotients",
            "roots",
            "functions",
            "comparisons",
            "choices",
        ];
        let rows: Vec<Vec<String>> = counts
            .iter()
            .map(|(block, call, c)| {
                let numbers = [
                    c.flops(),
                    c.sums,
                    c.products,
                    c.fused,
                    c.quotients,
                    c.roots,
                    c.functions,
                    c.comparisons,
                    c.choices,
                ];
                let numbers = numbers.iter().map(usize::to_string);
                [block.clone(), call.clone()].into_iter().chain(numbers).collect()
            })
            .collect();
        let memory: Vec<String> = memory
            .iter()
            .map(|(name, states, inputs)| format!("{name} {states} and {inputs}"))
            .collect();
        output::text(&format!(
            "{}\n\nprepare is done once. A fused product and sum counts as two operations, a function as one.\n\
             Numbers of state and input, of 8 bytes each in double: {}.",
            output::table(&header, &rows),
            memory.join(", ")
        ))
    }
}
