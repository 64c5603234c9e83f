//! `hydroboom sensitivity`

use crate::crane_file::CraneFile;
use crate::interruptible::Interruptible;
use crate::number;
use crate::output;
use crate::paths::OutputFile;
use clap::Args;
use hydroboom_description::Description;
use hydroboom_description::schema::KEYS;
use hydroboom_identify::Free;
use hydroboom_lab::LabError;
use hydroboom_lab::report::{Bar, Bars, Page, document, figure};
use hydroboom_sensitivity::{Case, Index, Local, Output, Sobol, Study, local, sobol};
use indicatif::{ProgressBar, ProgressStyle};
use maud::html;
use miette::{IntoDiagnostic, Result, miette};
use serde_json::json;

/// Rank a crane's parameters by their effect on tracking errors, pressures and the eigenfrequency: locally by exact
/// slopes, and globally by Sobol indices.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom sensitivity\n  hydroboom sensitivity --outputs eigenfrequency,tracking-benchmark-closed-loop \
    --rows 256 --report sensitivity.html\n  hydroboom sensitivity --keys payload.mass_kg,pump.flow_gain --speed-mm-s 25"
)]
pub struct Sensitivity {
    #[command(flatten)]
    crane: CraneFile,
    /// Outputs, with commas between them: eigenfrequency, tracking-STRATEGY, pressure-STRATEGY; all when not given.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    outputs: Vec<String>,
    /// Keys that vary, with commas between them; those that logs usually tell something of when not given.
    #[arg(long, value_name = "KEYS", value_delimiter = ',')]
    keys: Vec<String>,
    /// Speed of the motion; the crane's fast one when not given: 0.1 to 10000 mm/s.
    #[arg(long, value_name = "SPEED", allow_negative_numbers = true, value_parser = number::within(number::SPEED, "mm/s"))]
    speed_mm_s: Option<f64>,
    /// Rows of the global study, each of as many runs as there are keys, and two more; 0 leaves it out.
    #[arg(long, value_name = "COUNT", default_value_t = 0)]
    rows: usize,
    /// Seed of the global study.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Report to write (HTML).
    #[arg(long, value_name = "FILE")]
    report: Option<OutputFile>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// What came of it.
struct Found {
    case: Case,
    values: Vec<f64>,
    local: Vec<Local>,
    /// Indices by output, and rows that were simulated whole.
    global: Option<(Vec<Sobol>, usize)>,
}

impl Sensitivity {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read()?;
        let case =
            Case::new(&crane, number::speed_of_motion(&crane, self.speed_mm_s)?, &self.chosen()?)
                .into_diagnostic()?;
        let free = self.free(&crane)?;
        let bar = ProgressBar::new(free.len().div_ceil(4) as u64).with_style(
            ProgressStyle::with_template("{bar:40} {pos} of {len} slopes, {eta} left")
                .into_diagnostic()?,
        );
        let (values, slopes) = local(&case, &free, &|| bar.inc(1)).into_diagnostic()?;
        bar.finish_and_clear();
        let global = match self.rows {
            0 => None,
            rows => Some(self.global(&case, &free, rows)?),
        };
        let found = Found { case, values, local: slopes, global };
        if let Some(path) = &self.report {
            let seed = (self.rows > 0).then_some(self.seed);
            output::page(path, &page(&crane, &found).into_diagnostic()?, seed);
        }
        match self.json {
            true => output::json(&in_json(&crane, &found)),
            false => {
                let mut text = said(&found);
                if let Some(path) = &self.report {
                    text += &format!("\nreport: {}", path.display());
                }
                output::text(&text)
            }
        }
    }

    fn chosen(&self) -> Result<Vec<Output>> {
        if self.outputs.is_empty() {
            return Ok(Output::ALL.to_vec());
        }
        let named = self.outputs.iter().map(|name| {
            Output::from_name(name.trim()).ok_or_else(|| {
                let all: Vec<String> = Output::ALL.iter().map(|o| o.name()).collect();
                miette!(help = format!("one of: {}", all.join(", ")), "no output \"{name}\"")
            })
        });
        named.collect()
    }

    fn free(&self, crane: &Description) -> Result<Vec<Free>> {
        let named: Vec<Free> = match self.keys.as_slice() {
            [] => Free::usual(crane),
            keys => keys
                .iter()
                .map(|path| Free::from_path(path.trim()).into_diagnostic())
                .collect::<Result<_>>()?,
        };
        match named.iter().find(|key| key.value(crane) <= 0.0) {
            Some(zero) => {
                Err(miette!("{} is zero: keys vary by shares of their value", zero.path()))
            }
            None => Ok(named),
        }
    }

    fn global(&self, case: &Case, free: &[Free], rows: usize) -> Result<(Vec<Sobol>, usize)> {
        let work = Interruptible::new(rows as u64, "rows")?;
        let study = Study { rows, seed: self.seed };
        sobol(case, free, study, &|| work.one_more()).into_diagnostic()
    }
}

/// Keys in the order of their effect on an output, the largest first.
fn ranked(found: &Found, output: usize) -> Vec<&Local> {
    let mut list: Vec<&Local> = found.local.iter().collect();
    list.sort_by(|a, b| b.effect(output).abs().total_cmp(&a.effect(output).abs()));
    list
}

fn said(found: &Found) -> String {
    let mut said = String::new();
    for (k, output) in found.case.outputs.iter().enumerate() {
        let (unit, size) = output.unit();
        said += &format!("{}: {:.4} {unit}\n", output.title(), found.values[k] / size);
        let rows: Vec<Vec<String>> = ranked(found, k)
            .into_iter()
            .take(10)
            .map(|l| {
                let mut row = vec![
                    l.key.path(),
                    format!("{:+.3}", l.slopes[k] / found.values[k]),
                    format!("{:.0}", l.known * 100.0),
                    format!("{:+.4}", l.effect(k) / size),
                ];
                if let Some((indices, _)) = &found.global {
                    let place = found.local.iter().position(|other| other == l).unwrap_or(0);
                    row.push(shown(&indices[k].first[place]));
                    row.push(shown(&indices[k].total[place]));
                }
                row
            })
            .collect();
        let effect = format!("effect [{unit}]");
        let mut header = vec!["key", "% per %", "known to [%]", effect.as_str()];
        if found.global.is_some() {
            header.extend(["Sobol first (95 %)", "total (95 %)"]);
        }
        said += &output::table(&header, &rows);
        said += "\n\n";
    }
    said +=
        "effect: of an error as large as what is known of the key, to first order; the ten largest";
    if let Some((indices, rows)) = &found.global {
        said += &format!("\n{rows} rows of the global study were simulated whole; there");
        for (output, sobol) in found.case.outputs.iter().zip(indices) {
            let (unit, size) = output.unit();
            said += &format!(
                "\n  {}: {:.3} {unit}, scattering by {:.3}",
                output.title(),
                sobol.mean / size,
                sobol.deviation / size
            );
        }
    }
    said
}

fn shown(index: &Index) -> String {
    format!("{:.2} ({:.2} .. {:.2})", index.value, index.low, index.high)
}

fn in_json(crane: &Description, found: &Found) -> serde_json::Value {
    let index = |i: &Index| json!({ "value": i.value, "low": i.low, "high": i.high });
    let outputs = found.case.outputs.iter().enumerate().map(|(k, output)| {
        let (unit, size) = output.unit();
        let keys = found.local.iter().enumerate().map(|(place, l)| {
            let sobol = found.global.as_ref().map(|(indices, _)| &indices[k]);
            json!({
                "key": l.key.path(), "unit": KEYS[l.key.place].unit,
                "value": KEYS[l.key.place].to_unit(l.key.value(crane)),
                "percent_per_percent": l.slopes[k] / found.values[k], "known_to_percent": l.known * 100.0,
                "effect": l.effect(k) / size,
                "sobol_first": sobol.map(|s| index(&s.first[place])),
                "sobol_total": sobol.map(|s| index(&s.total[place])),
            })
        });
        json!({
            "output": output.name(), "unit": unit, "value": found.values[k] / size,
            "keys": keys.collect::<Vec<_>>(),
            "mean": found.global.as_ref().map(|(s, _)| s[k].mean / size),
            "deviation": found.global.as_ref().map(|(s, _)| s[k].deviation / size),
        })
    });
    json!({
        "crane": crane.name, "outputs": outputs.collect::<Vec<_>>(),
        "rows": found.global.as_ref().map(|(_, rows)| rows),
    })
}

fn page(crane: &Description, found: &Found) -> Result<Page, LabError> {
    let mut figures = Vec::new();
    for (k, output) in found.case.outputs.iter().enumerate() {
        let (unit, size) = output.unit();
        let ranked = ranked(found, k);
        let names: Vec<String> = ranked.iter().map(|l| l.key.path()).collect();
        let bars = ranked.iter().zip(&names).take(12).map(|(l, name)| {
            let effect = l.effect(k) / size;
            Bar { name, from: -effect, to: effect, colour: 0, bounds: None }
        });
        let x = format!("effect on the {} [{unit}]", output.title());
        let tornado = Bars { x: &x, bars: bars.collect() }.drawn()?;
        let sobol = match &found.global {
            Some((indices, _)) => {
                let mut order: Vec<usize> = (0..found.local.len()).collect();
                let total = |place: usize| indices[k].total[place].value;
                order.sort_by(|a, b| total(*b).total_cmp(&total(*a)));
                let names: Vec<String> =
                    order.iter().map(|place| found.local[*place].key.path()).collect();
                let bars = order.iter().zip(&names).take(12).map(|(place, name)| {
                    let i = indices[k].total[*place];
                    Bar { name, from: 0.0, to: i.value, colour: 0, bounds: Some((i.low, i.high)) }
                });
                let x = "total Sobol index, share of the variance [-]";
                Some(Bars { x, bars: bars.collect() }.drawn()?)
            }
            None => None,
        };
        figures.push((k, *output, tornado, sobol));
    }
    let body = html! {
        p.soft {
            "\"" (crane.name) "\" along its motion at " (format!("{:.0}", found.case.motion.speed * 1e3)) " mm/s. What varies is the machine; its "
            "controllers and the simulation beside it keep the described parameters. Sensors and motor are ideal."
        }
        @for (k, output, tornado, sobol) in &figures {
            h2 { (output.title()) ": " (format!("{:.3} {}", found.values[*k] / output.unit().1, output.unit().0)) }
            (figure(
                "By how much the output changes, to first order, when the key is more (the end with the dot) or less by what its provenance \
                 leaves open. Exact slopes.",
                tornado,
            ))
            @if let Some(svg) = sobol {
                (figure(
                    "Share of the output's variance that would be left if all other keys were known, with the interval that holds it in nineteen \
                     cases of twenty.",
                    svg,
                ))
            }
        }
        @if let Some((indices, rows)) = &found.global {
            h2 { "Sobol indices in numbers" }
            p.soft { (rows) " rows; every key even in its logarithm, with the deviation its provenance stands for." }
            @for (output, sobol) in found.case.outputs.iter().zip(indices) {
                h3 {
                    (output.title()) ": " (format!("{:.3} {}", sobol.mean / output.unit().1, output.unit().0)) " in the mean, deviation "
                    (format!("{:.3}", sobol.deviation / output.unit().1))
                }
                div.wide { table {
                    thead { tr { th { "key" } th { "first order" } th { "95 %" } th { "total" } th { "95 %" } } }
                    tbody { @for (place, l) in found.local.iter().enumerate() {
                        @let (first, total) = (sobol.first[place], sobol.total[place]);
                        tr {
                            td { (l.key.path()) }
                            td { (format!("{:.3}", first.value)) } td { (format!("{:.2} .. {:.2}", first.low, first.high)) }
                            td { (format!("{:.3}", total.value)) } td { (format!("{:.2} .. {:.2}", total.low, total.high)) }
                        }
                    } }
                } }
            }
        }
    };
    Ok(document("Hydroboom: sensitivity", &body))
}
