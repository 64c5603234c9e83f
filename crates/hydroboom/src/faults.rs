//! `hydroboom faults`

use crate::crane_file::CraneFile;
use crate::machine_choice::MachineChoice;
use crate::paths::OutputFile;
use crate::strategy_argument::strategies;
use crate::{healthy, output};
use clap::Args;
use hydroboom_control::strategy::Strategy;
use hydroboom_lab::report::{Page, document};
use hydroboom_realtime::campaign_cranes::{CampaignCrane, at_valve_end, campaign_cranes};
use hydroboom_realtime::fault::Fault;
use hydroboom_realtime::faults::{Moment, Outcome, Underway};
use indicatif::ProgressBar;
use maud::html;
use miette::{IntoDiagnostic, Result};
use rayon::prelude::*;
use serde_json::json;

/// Run the fault-injection campaign: every fault, under every strategy or those named, and at five moments
/// of the cycle, in simulated time, judged on the simulated machine.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom faults\n  hydroboom faults --only p_A --report faults.html\n  \
    hydroboom faults --all --report faults.html\n  \
    hydroboom faults --strategy scheduled-lqr --strategy benchmark-closed-loop"
)]
pub struct Faults {
    #[command(flatten)]
    crane: CraneFile,
    /// Only faults whose name contains this, in the same case, as "p_A stuck"; a text that none has lists the names.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// All cranes, with their valve at both ends of its range of time, and pairs of faults; half an
    /// hour on two cores.
    #[arg(long)]
    all: bool,
    /// Pairs of faults too: every fault with operator loss, emergency stop and missed periods 20 ms later.
    #[arg(long)]
    pairs: bool,
    /// Number of healthy virtual cranes to run along every course in place of faults; every stop is a false alarm.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..=100_000), conflicts_with_all = ["only", "all", "pairs", "report"])]
    healthy: Option<u64>,
    /// Seed of the family.
    #[arg(long, default_value_t = 1, requires = "healthy")]
    seed: u64,
    /// Only under this strategy; can be repeated. Default: all strategies for faults, benchmark and simulation
    /// feedforward in closed loop for healthy cranes.
    #[arg(long, value_parser = strategies())]
    strategy: Vec<Strategy>,
    /// Report to write (HTML): every case.
    #[arg(long, value_name = "FILE")]
    report: Option<OutputFile>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Longest line of listed names \[letters\].
const LONGEST_LINE: usize = 100;

/// Names in lines that fit a screen.
fn in_lines(names: &[String]) -> String {
    let mut lines: Vec<String> = Vec::new();
    for name in names {
        match lines.last_mut() {
            Some(line) if line.len() + name.len() + 2 <= LONGEST_LINE => {
                line.push_str(", ");
                line.push_str(name);
            }
            _ => lines.push(name.clone()),
        }
    }
    lines.join("\n")
}

/// Largest number of cases beyond their bounds that are printed.
const MOST_CASES: usize = 40;

/// Crane and outcome of a case.
struct Case {
    crane: String,
    outcome: Outcome,
}

impl Faults {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, no fault has such a name, or a crane cannot be built.
    pub fn run(self) -> Result<()> {
        if let Some(count) = self.healthy {
            let choice = MachineChoice::read(&self.crane, None)?;
            let family = (count, self.seed);
            return healthy::run(&choice.model, &choice.machine, family, &self.strategy, self.json);
        }
        let part = self.only.as_deref().unwrap_or("");
        let faults: Vec<Fault> =
            Fault::all().into_iter().filter(|fault| fault.name().contains(part)).collect();
        if faults.is_empty() {
            let names: Vec<String> = Fault::all().into_iter().map(Fault::name).collect();
            miette::bail!(
                help = format!(
                    "--only takes every fault whose name contains its text, in the same case:\n{}",
                    in_lines(&names)
                ),
                "no fault's name contains \"{part}\""
            );
        }
        let cranes = self.cranes()?;
        let mut cases = Vec::new();
        let pairs = faults.len() * (1 + 3 * usize::from(self.pairs || self.all));
        let strategies = self.strategies();
        let ways = strategies.len() * Moment::ALL.len();
        let total = ways * (cranes.len() * faults.len() + pairs - faults.len());
        let bar = ProgressBar::new(total as u64);
        for (k, (name, crane)) in cranes.iter().enumerate() {
            // pairs of faults on the first crane only
            let seconds = match k == 0 && (self.pairs || self.all) {
                true => [None].into_iter().chain(Fault::seconds().map(Some)).collect(),
                false => vec![None],
            };
            cases.extend(campaign(name, crane, &strategies, &faults, &seconds, &bar)?);
        }
        bar.finish_and_clear();
        if let Some(path) = &self.report {
            output::page(path, &page(&strategies, &faults, &cases), None);
        }
        let beyond: Vec<&Case> = cases.iter().filter(|c| !c.outcome.is_within_bounds()).collect();
        if self.json {
            let list: Vec<_> = cases.iter().map(in_json).collect();
            return output::json(&json!({
                "faults": faults.len(), "strategies": names(&strategies), "beyond_bounds": beyond.len(), "outcomes": list
            }));
        }
        let rows: Vec<Vec<String>> = faults.iter().map(|fault| row(*fault, &cases)).collect();
        let mut text = format!(
            "{} faults, {} cases under {}: the worst of each over cranes, strategies and moments. Moved: off the course until the\n\
             stop, and from there; safe: pilots without pressure, motor at rest (a machine that is not enabled yet waits\n\
             supervision.wait_s before it gives up); dropped: below where the load was held\n{}\n",
            faults.len(),
            cases.len(),
            names(&strategies).join(", "),
            output::table(&HEADER, &rows)
        );
        text += &match beyond.is_empty() {
            true => "every case keeps to its computed bounds: of movement, and of time where the fault has one".to_string(),
            false => {
                let rows: Vec<Vec<String>> = beyond.iter().take(MOST_CASES).map(|c| case_row(c)).collect();
                format!(
                    "{} cases beyond their computed bounds{}:\n{}",
                    beyond.len(),
                    match beyond.len() > MOST_CASES {
                        true => format!(", of which {MOST_CASES}"),
                        false => String::new(),
                    },
                    output::table(&CASE_HEADER, &rows)
                )
            }
        };
        if let Some(path) = &self.report {
            text += &output::named("report", path);
        }
        output::text(&text)
    }

    /// Selected strategies, each once and in their order; all by default.
    fn strategies(&self) -> Vec<Strategy> {
        let is_wanted = |s: &Strategy| self.strategy.is_empty() || self.strategy.contains(s);
        Strategy::ALL.into_iter().filter(is_wanted).collect()
    }

    /// Names and cranes of the campaign: that of the options, otherwise the first or all of the campaign's own.
    fn cranes(&self) -> Result<Vec<(String, CampaignCrane)>> {
        if !self.crane.is_embedded() || self.crane.is_overridden() {
            let MachineChoice { model, machine, .. } = MachineChoice::read(&self.crane, None)?;
            let name = model.name.clone();
            return Ok(vec![(name, CampaignCrane { name: "given", model, machine })]);
        }
        let all = campaign_cranes()?;
        if !self.all {
            return Ok(all.into_iter().take(1).map(|c| (c.name.to_string(), c)).collect());
        }
        let mut cranes = Vec::new();
        // the first crane with its described valve, for pairs
        cranes.extend(all.first().map(|crane| (crane.name.to_string(), crane.clone())));
        for crane in &all {
            for (slowest, end) in [(false, "fast valve"), (true, "slow valve")] {
                cranes.push((format!("{}, {end}", crane.name), at_valve_end(crane, slowest)));
            }
        }
        Ok(cranes)
    }
}

/// All cases of one crane: every fault, with each of the second ones, under every strategy at every moment.
///
/// # Errors
///
/// If the crane cannot be simulated up to a moment.
fn campaign(
    name: &str,
    crane: &CampaignCrane,
    strategies: &[Strategy],
    faults: &[Fault],
    seconds: &[Option<Fault>],
    bar: &ProgressBar,
) -> Result<Vec<Case>> {
    let CampaignCrane { model, machine, .. } = crane;
    let motion = machine.motion(model.numbers.fast);
    let ways: Vec<_> = strategies
        .iter()
        .flat_map(|strategy| Moment::ALL.map(|moment| (*strategy, moment)))
        .collect();
    let ways = ways
        .into_par_iter()
        .map(|(strategy, moment)| Underway::until(model, machine, motion, strategy, moment))
        .collect::<Result<Vec<Underway>, _>>()
        .into_diagnostic()?;
    let mut cases = Vec::new();
    for way in &ways {
        for fault in faults {
            for second in seconds {
                cases.push((way, *fault, *second));
            }
        }
    }
    Ok(cases
        .into_par_iter()
        .map(|(way, fault, second)| {
            let outcome = way.inject(fault, second);
            bar.inc(1);
            Case { crane: name.to_string(), outcome }
        })
        .collect())
}

/// Names of strategies.
fn names(strategies: &[Strategy]) -> Vec<&'static str> {
    strategies.iter().map(|strategy| strategy.name()).collect()
}

/// A case with its outcome and bounds.
fn in_json(case: &Case) -> serde_json::Value {
    let o = &case.outcome;
    json!({
        "crane": case.crane, "fault": o.fault.name(), "second": o.second.map(Fault::name),
        "strategy": o.strategy.name(), "moment": o.moment.name(),
        "cause": o.cause.map(|cause| cause.code()), "safe_after_ms": o.safe_after.map(|s| s * 1e3),
        "fallback": o.fallback, "moved_mm": o.moved * 1e3, "dropped_mm": o.dropped * 1e3,
        "stop_force_kn": o.stop_force * 1e-3, "peak_pressure_bar": o.peak_pressure * 1e-5,
        "movement_bound_mm": o.movement_bound * 1e3, "time_bound_ms": o.time_bound.map(|s| s * 1e3),
        "pressure_bound_bar": o.pressure_bound * 1e-5, "must_be_found": o.must_be_found,
        "within_bounds": o.is_within_bounds(), "broke": o.broke.map(|error| error.to_string()),
    })
}

/// Column headings of the table of faults.
const HEADER: [&str; 9] = [
    "fault",
    "found as",
    "finished",
    "safe after [ms]",
    "moved [mm]",
    "bound [mm]",
    "dropped [mm]",
    "end stop [kN]",
    "peak [bar]",
];

/// Column headings of the table of cases.
const CASE_HEADER: [&str; 9] = [
    "fault",
    "then",
    "crane",
    "strategy",
    "moment",
    "found as",
    "safe after, bound [ms]",
    "moved, bound [mm]",
    "dropped [mm]",
];

/// Code of the cause that the supervisor found, or how the course ended without one.
fn cause(o: &Outcome) -> String {
    match (&o.broke, o.cause) {
        (Some(error), _) => format!("simulation failed: {error}"),
        (None, Some(cause)) => cause.code().to_string(),
        (None, None) if o.fallback => "course finished, the benchmark took over".into(),
        (None, None) => "course finished".into(),
    }
}

/// Row of a case.
fn case_row(case: &Case) -> Vec<String> {
    let o = &case.outcome;
    let ms = |time: Option<f64>| output::optional(time.map(|s| s * 1e3), 0);
    vec![
        o.fault.name(),
        o.second.map_or_else(|| "-".into(), Fault::name),
        case.crane.clone(),
        o.strategy.name().into(),
        o.moment.name().into(),
        cause(o),
        format!("{}, {}", ms(o.safe_after), ms(o.time_bound)),
        format!("{:.1}, {:.1}", o.moved * 1e3, o.movement_bound * 1e3),
        format!("{:.1}", o.dropped * 1e3),
    ]
}

/// All cases as a page.
fn page(strategies: &[Strategy], faults: &[Fault], cases: &[Case]) -> Page {
    let body = html! {
        p.soft {
            "Every fault under " (names(strategies).join(", ")) " at five moments of the fast cycle, in simulated "
            "time, on virtual cranes: nothing here was measured on a real machine. \"Safe\" is the machine, not its command: pilots "
            "without pressure, motor at rest. \"Moved\" is how far the piston went off its course until the stop "
            "began, and from there; its bound follows from detection time, reaction and tracking limit. \"Dropped\" "
            "is how far a held load sank. Pressures and forces are the machine's largest after the fault."
        }
        h2 { "Worst of each fault" }
        div.wide { table {
            thead { tr { @for name in HEADER { th { (name) } } } }
            tbody { @for fault in faults { tr {
                @for (k, cell) in row(*fault, cases).into_iter().enumerate() {
                    @if k == 1 { td.text { (cell) } } @else { td { (cell) } }
                }
            } } }
        } }
        @let beyond: Vec<&Case> = cases.iter().filter(|c| !c.outcome.is_within_bounds()).collect();
        h2 { "Beyond their bounds: " (beyond.len()) }
        @if !beyond.is_empty() { (table(&beyond)) }
        h2 { "Every case" }
        (table(&cases.iter().collect::<Vec<_>>()))
    };
    document(&format!("Hydroboom: {} faults, {} cases", faults.len(), cases.len()), &body)
}

/// Table of cases for the page.
fn table(cases: &[&Case]) -> maud::Markup {
    html! {
        div.wide { table {
            thead { tr { @for name in CASE_HEADER { th { (name) } } } }
            tbody { @for case in cases { tr {
                @for cell in case_row(case) { td.text { (cell) } }
            } } }
        } }
    }
}

/// Row of a fault: causes found, and the worst values over its cases.
fn row(fault: Fault, cases: &[Case]) -> Vec<String> {
    let cases: Vec<&Outcome> =
        cases.iter().map(|c| &c.outcome).filter(|o| o.fault == fault).collect();
    let most = |of: &dyn Fn(&Outcome) -> f64| cases.iter().map(|o| of(o)).fold(0.0, f64::max);
    let mut causes: Vec<&str> = cases.iter().filter_map(|o| o.cause).map(|c| c.code()).collect();
    if cases.iter().any(|o| o.fallback) {
        causes.push("(benchmark took over)");
    }
    if cases.iter().any(|o| o.broke.is_some()) {
        causes.push("SIMULATION FAILED");
    }
    causes.sort_unstable();
    causes.dedup();
    let finished = cases.iter().filter(|o| o.cause.is_none() && o.broke.is_none()).count();
    let safe = most(&|o| o.safe_after.unwrap_or(0.0) * 1e3);
    let worst = cases.iter().max_by(|a, b| a.moved.total_cmp(&b.moved));
    vec![
        fault.name(),
        causes.join(", "),
        format!("{finished} of {}", cases.len()),
        if safe > 0.0 { format!("{safe:.0}") } else { "-".into() },
        format!("{:.1}", most(&|o| o.moved * 1e3)),
        worst.map_or_else(String::new, |o| format!("{:.1}", o.movement_bound * 1e3)),
        format!("{:.2}", most(&|o| o.dropped * 1e3)),
        format!("{:.1}", most(&|o| o.stop_force * 1e-3)),
        format!("{:.0}", most(&|o| o.peak_pressure * 1e-5)),
    ]
}
