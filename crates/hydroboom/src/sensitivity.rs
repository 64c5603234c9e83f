//! `hydroboom sensitivity`

use crate::crane_file::CraneFile;
use crate::interruptible::Interruptible;
use crate::number;
use crate::output;
use crate::paths::OutputFile;
use crate::scheduled_lqr_sensitivity as scheduled_lqr;
use clap::Args;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_description::schema::KEYS;
use hydroboom_identify::Free;
use hydroboom_lab::LabError;
use hydroboom_lab::report::{Bar, Bars, Page, document, figure};
use hydroboom_sensitivity::{
    Case, Index, Local, Output, Sobol, Study, at_ends, end_values, local, sobol,
};
use indicatif::{ProgressBar, ProgressStyle};
use maud::html;
use miette::{IntoDiagnostic, Result, miette};
use serde_json::json;

/// Rank a crane's parameters by their effect on tracking errors, pressures and the eigenfrequency, at both ends of each
/// parameter's range, by exact derivatives, and globally by Sobol indices.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom sensitivity\n  hydroboom sensitivity --outputs eigenfrequency,tracking-benchmark-closed-loop \
    --rows 256 --report sensitivity.html\n  hydroboom sensitivity --keys payload.mass_kg,pump.flow_gain --speed-mm-s 25\n  hydroboom sensitivity --strategy scheduled-lqr"
)]
pub struct Sensitivity {
    #[command(flatten)]
    crane: CraneFile,
    /// Outputs, with commas between them: eigenfrequency, tracking-STRATEGY, pressure-STRATEGY; all when not given.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    outputs: Vec<String>,
    /// Tracking error and p_A of these strategies, separated by commas, in place of --outputs. The scheduled LQR has no
    /// derivatives and indices.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', conflicts_with = "outputs")]
    strategy: Vec<Strategy>,
    /// Keys to vary, separated by commas. Default: those that logs usually determine.
    #[arg(long, value_name = "KEYS", value_delimiter = ',')]
    keys: Vec<String>,
    /// Speed of the motion; the crane's fast one when not given: 0.1 to 10000 mm/s.
    #[arg(long, value_name = "SPEED", value_parser = number::within(number::SPEED, "mm/s"))]
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

/// Results of the analysis.
struct Found {
    case: Case,
    /// Outputs of the case, then those that are only recomputed by simulation.
    outputs: Vec<Output>,
    /// Outputs of the described machine \[SI\].
    values: Vec<f64>,
    /// Local sensitivities; none for outputs that are only recomputed.
    local: Vec<Local>,
    /// Values of each key at both ends of its range, low and high \[SI\].
    ends: Vec<[f64; 2]>,
    /// All outputs at these values.
    at_ends: Vec<[Option<Vec<f64>>; 2]>,
    /// Sobol indices by output, and number of complete simulation rows.
    global: Option<(Vec<Sobol>, usize)>,
}

impl Sensitivity {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read()?;
        let speed = number::speed_of_motion(&crane, self.speed_mm_s)?;
        let (mut outputs, rerun): (Vec<Output>, Vec<Output>) =
            self.chosen()?.into_iter().partition(|output| output.has_slopes());
        let case = Case::new(&crane, speed, &outputs).into_diagnostic()?;
        let free = self.free(&crane)?;
        let bar = ProgressBar::new(free.len().div_ceil(4) as u64).with_style(
            ProgressStyle::with_template("{bar:40} {pos} of {len} slopes, {eta} left")
                .into_diagnostic()?,
        );
        let (mut values, slopes) = local(&case, &free, &|| bar.inc(1)).into_diagnostic()?;
        bar.finish_and_clear();
        let ends: Vec<(Free, [f64; 2])> =
            slopes.iter().map(|l| (l.key, end_values(&crane, l.key, l.known))).collect();
        let bar = ProgressBar::new(ends.len() as u64);
        let mut at_ends = at_ends(&case, &ends, &|| bar.inc(1));
        bar.finish_and_clear();
        if !rerun.is_empty() {
            let own = scheduled_lqr::rerun(&crane, &crane.numbers, speed).into_diagnostic()?;
            let others = scheduled_lqr::at_ends(&crane, &ends, speed);
            let of = |both: [f64; 2]| {
                rerun
                    .iter()
                    .map(move |output| both[usize::from(matches!(output, Output::Pressure(_)))])
            };
            values.extend(of(own));
            for (known, found) in at_ends.iter_mut().zip(others) {
                for (known, found) in known.iter_mut().zip(found) {
                    // a machine that one of them cannot control has no outputs at all
                    *known = known.take().zip(found).map(|(mut all, both)| {
                        all.extend(of(both));
                        all
                    });
                }
            }
            outputs.extend(rerun.iter().copied());
        }
        let ends = ends.into_iter().map(|(_, values)| values).collect();
        let global = match self.rows {
            0 => None,
            rows => Some(self.global(&case, &free, rows)?),
        };
        let found = Found { case, outputs, values, local: slopes, ends, at_ends, global };
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
            return Ok(match self.strategy.as_slice() {
                [] => Output::ALL.into_iter().chain(Output::OF_SCHEDULED_LQR).collect(),
                some => {
                    some.iter().flat_map(|s| [Output::Tracking(*s), Output::Pressure(*s)]).collect()
                }
            });
        }
        let named = self.outputs.iter().map(|name| {
            Output::from_name(name.trim()).ok_or_else(|| {
                let all = Output::ALL.into_iter().chain(Output::OF_SCHEDULED_LQR);
                let all: Vec<String> = all.map(Output::name).collect();
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

impl Found {
    /// Output with a key at one end of its range (0: low, 1: high) \[SI\].
    fn at(&self, key: usize, end: usize, output: usize) -> Option<f64> {
        self.at_ends[key][end].as_ref().map(|outputs| outputs[output])
    }

    /// Largest change of an output by a key within its range \[SI\].
    fn change(&self, key: usize, output: usize) -> f64 {
        let change =
            |end| self.at(key, end, output).map_or(0.0, |v| (v - self.values[output]).abs());
        change(0).max(change(1))
    }

    /// Relative sensitivity of an output to a key \[% per %\]; none for an output without derivatives.
    fn slope(&self, key: usize, output: usize) -> Option<f64> {
        self.local[key].slopes.get(output).map(|slope| slope / self.values[output])
    }

    /// Value of a key at one end of its range, in its unit.
    fn end(&self, key: usize, end: usize) -> f64 {
        KEYS[self.local[key].key.place].to_unit(self.ends[key][end])
    }

    /// The same with five significant digits as text.
    fn end_text(&self, key: usize, end: usize) -> String {
        let value = self.end(key, end);
        output::number(format!("{value:.4e}").parse().unwrap_or(value))
    }

    /// Keys ranked by their change of an output, the largest first.
    fn ranked(&self, output: usize) -> Vec<usize> {
        let mut list: Vec<usize> = (0..self.local.len()).collect();
        list.sort_by(|a, b| self.change(*b, output).total_cmp(&self.change(*a, output)));
        list
    }

    /// Sobol indices of an output, if any.
    fn indices(&self, output: usize) -> Option<&Sobol> {
        self.global.as_ref().and_then(|(indices, _)| indices.get(output))
    }
}

/// Explanation of the columns.
const ENDS: &str = "less, more: the ends of the key's prior range, by its provenance, and the output of the machine re-run there \
    (-: no such machine exists, or it cannot follow).\n% per %: exact slope at the described machine. The ten \
    keys of the largest change";

fn said(found: &Found) -> String {
    let mut said = String::new();
    for (k, output) in found.outputs.iter().enumerate() {
        let (unit, size) = output.unit();
        said += &format!("{}: {:.4} {unit}\n", output.title(), found.values[k] / size);
        let rows: Vec<Vec<String>> = found
            .ranked(k)
            .into_iter()
            .take(10)
            .map(|key| {
                let there = |end| output::optional(found.at(key, end, k).map(|v| v / size), 4);
                let mut row = vec![
                    found.local[key].key.path(),
                    found.end_text(key, 0),
                    there(0),
                    found.end_text(key, 1),
                    there(1),
                ];
                if output.has_slopes() {
                    row.push(
                        found.slope(key, k).map_or("-".into(), |slope| format!("{slope:+.3}")),
                    );
                }
                if let Some(indices) = found.indices(k) {
                    row.push(shown(&indices.first[key]));
                    row.push(shown(&indices.total[key]));
                }
                row
            })
            .collect();
        let there = format!("{unit} there");
        let mut header = vec!["key", "less", there.as_str(), "more", there.as_str()];
        if output.has_slopes() {
            header.push("% per %");
        }
        if found.indices(k).is_some() {
            header.extend(["Sobol first (95 %)", "total (95 %)"]);
        }
        said += &output::table(&header, &rows);
        said += "\n\n";
    }
    said += ENDS;
    if let Some((indices, rows)) = &found.global {
        said += &format!("\n{rows} rows of the global study were simulated whole; there");
        for (output, sobol) in found.outputs.iter().zip(indices) {
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
    let outputs = found.outputs.iter().enumerate().map(|(k, output)| {
        let (unit, size) = output.unit();
        let sobol = found.indices(k);
        let keys = found.local.iter().enumerate().map(|(place, l)| {
            let end = |end| {
                let output = found.at(place, end, k).map(|v| v / size);
                json!({ "value": found.end(place, end), "output": output })
            };
            json!({
                "key": l.key.path(), "unit": KEYS[l.key.place].unit,
                "value": KEYS[l.key.place].to_unit(l.key.value(crane)),
                "percent_per_percent": found.slope(place, k), "known_to_percent": l.known * 100.0,
                "less": end(0), "more": end(1),
                "sobol_first": sobol.map(|s| index(&s.first[place])),
                "sobol_total": sobol.map(|s| index(&s.total[place])),
            })
        });
        json!({
            "output": output.name(), "unit": unit, "value": found.values[k] / size,
            "keys": keys.collect::<Vec<_>>(),
            "mean": sobol.map(|s| s.mean / size), "deviation": sobol.map(|s| s.deviation / size),
        })
    });
    json!({
        "crane": crane.name, "outputs": outputs.collect::<Vec<_>>(),
        "rows": found.global.as_ref().map(|(_, rows)| rows),
    })
}

fn page(crane: &Description, found: &Found) -> Result<Page, LabError> {
    let mut figures = Vec::new();
    for (k, output) in found.outputs.iter().enumerate() {
        let (unit, size) = output.unit();
        // one bar per end: near a minimum both are on one side
        let mut changes = Vec::new();
        for key in found.ranked(k).into_iter().take(10) {
            let (path, key_unit) =
                (found.local[key].key.path(), KEYS[found.local[key].key.place].unit);
            for end in [0, 1] {
                if let Some(there) = found.at(key, end, k) {
                    let name = format!("{path} {} {key_unit}", found.end_text(key, end));
                    changes.push((name, (there - found.values[k]) / size, 1 - end));
                }
            }
        }
        let bars = changes.iter().map(|(name, change, colour)| Bar {
            name,
            from: 0.0,
            to: *change,
            colour: *colour,
            bounds: None,
        });
        let x = format!("change [{unit}]");
        let tornado = Bars { x: &x, bars: bars.collect() }.drawn()?;
        let sobol = match found.indices(k) {
            Some(indices) => {
                let mut order: Vec<usize> = (0..found.local.len()).collect();
                let total = |place: usize| indices.total[place].value;
                order.sort_by(|a, b| total(*b).total_cmp(&total(*a)));
                let names: Vec<String> =
                    order.iter().map(|place| found.local[*place].key.path()).collect();
                let bars = order.iter().zip(&names).take(12).map(|(place, name)| {
                    let i = indices.total[*place];
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
                "Change of the output with the machine re-run at both ends of a key's prior range, by its provenance. The ten keys of the \
                 largest change.",
                tornado,
            ))
            @if let Some(svg) = sobol {
                (figure(
                    "Total Sobol index: share of the output's variance that remains if all other keys are known, \
                     with its 95 % interval.",
                    svg,
                ))
            }
        }
        @if let Some((indices, rows)) = &found.global {
            h2 { "Sobol indices in numbers" }
            p.soft { (rows) " rows; the logarithm of every key is uniform, with the standard deviation of its provenance." }
            @for (output, sobol) in found.outputs.iter().zip(indices) {
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
