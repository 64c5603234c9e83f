//! `hydroboom faults`

use crate::crane_file::CraneFile;
use crate::output;
use clap::Args;
use hydroboom_control::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::report::document;
use hydroboom_realtime::fault::Fault;
use hydroboom_realtime::faults::{Outcome, Underway, moments};
use indicatif::ProgressBar;
use maud::html;
use miette::{IntoDiagnostic, Result};
use rayon::prelude::*;
use serde_json::json;
use std::path::PathBuf;

/// Let everything go wrong that can, under every strategy and at three moments of the cycle, in
/// simulated time, and say what the supervisor made of it.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom faults\n  hydroboom faults --only p_A --report faults.html"
)]
pub struct Faults {
    #[command(flatten)]
    crane: CraneFile,
    /// Only faults whose name contains this.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// Report to write (HTML): every case.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Faults {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let model = self.crane.read()?;
        let machine = Description::uia_virtual()?;
        let motion = machine.motion(model.numbers.fast);
        let wanted = self.only.as_deref().unwrap_or("");
        let faults: Vec<Fault> =
            Fault::all().into_iter().filter(|fault| fault.name().contains(wanted)).collect();
        if faults.is_empty() {
            miette::bail!("no fault's name contains \"{wanted}\"");
        }
        let ways: Vec<_> = Strategy::ALL
            .into_iter()
            .flat_map(|strategy| moments(&motion).map(|moment| (strategy, moment)))
            .collect();
        let bar = ProgressBar::new((ways.len() * (1 + faults.len())) as u64);
        let ways = ways
            .into_par_iter()
            .map(|(strategy, moment)| {
                let way = Underway::until(&model, &machine, motion, strategy, moment);
                bar.inc(1);
                way
            })
            .collect::<Result<Vec<Underway>, _>>()
            .into_diagnostic()?;
        let cases: Vec<_> =
            faults.iter().flat_map(|fault| ways.iter().map(move |way| (way, *fault))).collect();
        let outcomes: Vec<Outcome> = cases
            .into_par_iter()
            .map(|(way, fault)| {
                let outcome = way.inject(fault);
                bar.inc(1);
                outcome
            })
            .collect();
        bar.finish_and_clear();
        if let Some(path) = &self.report {
            output::file(path, page(&faults, &outcomes).as_bytes())?;
        }
        if self.json {
            let list: Vec<_> = outcomes.iter().map(in_json).collect();
            return output::json(&json!({ "faults": faults.len(), "outcomes": list }));
        }
        let rows: Vec<Vec<String>> = faults.iter().map(|fault| row(*fault, &outcomes)).collect();
        let mut said = format!(
            "{} faults, {} cases: worst of all strategies and three moments\n{}",
            faults.len(),
            outcomes.len(),
            output::table(&HEADER, &rows)
        );
        if let Some(path) = &self.report {
            said += &format!("\nreport: {}", path.display());
        }
        output::text(&said)
    }
}

fn in_json(o: &Outcome) -> serde_json::Value {
    json!({
        "fault": o.fault.name(), "strategy": o.strategy.name(), "moment": o.moment,
        "cause": o.cause.map(|cause| cause.code()), "safe_after_ms": o.safe_after.map(|s| s * 1e3),
        "fallback": o.fallback, "strayed_mm": o.strayed * 1e3,
        "moved_after_mm": o.moved_after * 1e3, "broke": o.broke.map(|error| error.to_string()),
    })
}

const HEADER: [&str; 6] =
    ["fault", "found as", "finished", "safe after [ms]", "strayed [mm]", "moved when safe [mm]"];

/// All cases as a page.
fn page(faults: &[Fault], outcomes: &[Outcome]) -> String {
    let cause = |o: &Outcome| match (&o.broke, o.cause) {
        (Some(error), _) => format!("machine broken: {error}"),
        (None, Some(cause)) => cause.code().to_string(),
        (None, None) if o.fallback => "course finished, the benchmark took over".into(),
        (None, None) => "course finished".into(),
    };
    let body = html! {
        p.soft {
            "Every fault under all strategies at three moments of the 120 mm/s cycle, in simulated time, on the "
            "virtual crane. \"Safe\" is motor at zero and load-holding valves shut. \"Strayed\" is how far the "
            "tracking error, truly, went from where it was at the fault, until then or the course's end; \"moved when "
            "safe\" how far the piston moved in the two seconds after."
        }
        h2 { "Worst of each fault" }
        div.wide { table {
            thead { tr { @for name in HEADER { th { (name) } } } }
            tbody { @for fault in faults { tr {
                @for (k, cell) in row(*fault, outcomes).into_iter().enumerate() {
                    @if k == 1 { td.text { (cell) } } @else { td { (cell) } }
                }
            } } }
        } }
        h2 { "Every case" }
        div.wide { table {
            thead { tr {
                th { "fault" } th { "strategy" } th { "moment" } th { "found as" } th { "safe after [ms]" }
                th { "strayed [mm]" } th { "moved when safe [mm]" }
            } }
            tbody { @for o in outcomes { tr {
                td { (o.fault.name()) } td.text { (o.strategy.name()) } td.text { (o.moment) }
                td.text { (cause(o)) } td { (output::optional(o.safe_after.map(|s| s * 1e3), 0)) }
                td { (format!("{:.1}", o.strayed * 1e3)) } td { (format!("{:.2}", o.moved_after * 1e3)) }
            } } }
        } }
    };
    document(&format!("Hydroboom: {} faults, {} cases", faults.len(), outcomes.len()), &body)
}

/// The worst of a fault's cases.
fn row(fault: Fault, outcomes: &[Outcome]) -> Vec<String> {
    let cases: Vec<&Outcome> = outcomes.iter().filter(|o| o.fault == fault).collect();
    let most = |of: &dyn Fn(&Outcome) -> f64| cases.iter().map(|o| of(o)).fold(0.0, f64::max);
    let mut causes: Vec<&str> = cases.iter().filter_map(|o| o.cause).map(|c| c.code()).collect();
    if cases.iter().any(|o| o.fallback) {
        causes.push("(benchmark took over)");
    }
    if cases.iter().any(|o| o.broke.is_some()) {
        causes.push("MACHINE BROKEN");
    }
    causes.sort_unstable();
    causes.dedup();
    let finished = cases.iter().filter(|o| o.cause.is_none() && o.broke.is_none()).count();
    let safe = most(&|o| o.safe_after.unwrap_or(0.0) * 1e3);
    vec![
        fault.name(),
        causes.join(", "),
        format!("{finished} of {}", cases.len()),
        if safe > 0.0 { format!("{safe:.0}") } else { "-".into() },
        format!("{:.1}", most(&|o| o.strayed * 1e3)),
        format!("{:.2}", most(&|o| o.moved_after * 1e3)),
    ]
}
