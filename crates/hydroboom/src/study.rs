//! `hydroboom study`

use crate::crane_file::{CraneFile, text};
use crate::machine_choice::MachineChoice;
use crate::motion::run_log::write_run_log;
use crate::motion::tracking_table::tracking_table;
use crate::paths::{InputFile, OutputFolder};
use crate::{benchmark_gains, eigen, energy, output};
use clap::Args;
use hydroboom_description::Description;
use hydroboom_lab::closed_loop::metrics::TrackingError;
use hydroboom_lab::study::{NOMINAL, OFF, VIRTUAL};
use hydroboom_lab::{claims, report, study};
use miette::{IntoDiagnostic, Result};
use std::time::Instant;

/// Run the paper's experiments, print "paper | here", write a report with figures.
#[derive(Args)]
#[command(after_help = "Example: hydroboom study --out study")]
pub struct Study {
    #[command(flatten)]
    crane: CraneFile,
    /// Crane file of a virtual crane as a further plant. Default: the embedded one for the paper's crane, otherwise
    /// none.
    #[arg(long, value_name = "FILE", visible_alias = "virtual-crane")]
    plant: Option<InputFile>,
    /// Use the benchmark gains of the crane file. By default, gains of `hydroboom design --benchmark` replace the
    /// placeholders of a new file, and the paper's gains on another crane for which they are not tuned.
    #[arg(long)]
    gains_as_given: bool,
    /// Folder for report.html, and for its figures as SVG and CSV.
    #[arg(long, value_name = "DIR", default_value = "study")]
    out: OutputFolder,
    /// Folder for the time series of every motion, as CSV.
    #[arg(long, value_name = "DIR")]
    log: Option<OutputFolder>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Study {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let clock = Instant::now();
        // the plant of the published experiments is the model: drive and sensors of the file belong to a
        // machine
        let mut description = self.crane.read()?.without_equipment();
        let said =
            |done: &str| output::note(&format!("{:5.1} s  {done}", clock.elapsed().as_secs_f64()));
        let is_papers_crane = self.crane.is_papers_crane()?;
        let stand_in = match &self.plant {
            Some(path) => Some(Description::parse(&path.display().to_string(), &text(path)?)?),
            None if self.crane.is_embedded() && is_papers_crane => {
                Some(Description::uia_virtual()?)
            }
            None => None,
        };
        if self.crane.is_embedded() && !is_papers_crane && stand_in.is_none() {
            output::note(
                "with these values it is another crane than the paper's: the paper's figures, and the virtual crane that stands in for its crane, are left out",
            );
        } else if self.crane.is_overridden() && stand_in.is_some() {
            output::note(
                "--set is of the model, the nominal and the off-model plant: the virtual crane keeps the values of its own file",
            );
        }
        let mut gains = None;
        if !self.gains_as_given {
            let payload = [description.numbers.payload; 2];
            let choice = MachineChoice::model_itself(&description);
            let (choice, remark) = benchmark_gains::for_comparison(choice, payload)?;
            (description, gains) = (choice.model, remark);
        }
        let mut result = study::study(&description, stand_in.as_ref(), is_papers_crane, &said)
            .into_diagnostic()?;
        result.remark_on_gains = gains;
        let page = report::page(&description, &result).into_diagnostic()?;
        let path = output::page_in_folder(&self.out, "report", &page, None);
        if let Some(folder) = &self.log {
            output::folder(folder);
            for (plant, run) in &result.runs {
                write_run_log(folder, plant, run);
            }
        }
        if self.json {
            return output::json(&serde_json::to_value(&result).into_diagnostic()?);
        }
        let three = |v: f64| format!("{v:.3}");
        let differences: Vec<Vec<String>> = result
            .differences
            .iter()
            .map(|d| {
                vec![
                    format!("{} [{}]", d.signal, d.unit),
                    output::optional(d.paper_rms, 3),
                    output::optional(d.virtual_rms, 3),
                    three(d.off_model_rms),
                    output::optional(d.paper_peak, 3),
                    output::optional(d.virtual_peak, 3),
                    three(d.off_model_peak),
                ]
            })
            .collect();
        let header = [
            "signal",
            "RMS paper",
            "RMS virtual",
            "RMS off-model",
            "peak paper",
            "peak virtual",
            "peak off-model",
        ];
        let (header, differences) = without_virtual(&result, &header, differences);
        let mut said =
            format!("{}\n\n{}", claims_table(&result), eigen::table(&result.eigenfrequency));
        if let Some(hz) = result.virtual_eigenfrequency_hz {
            let hz = hz.map(three).join(", ");
            let beside = if result.is_papers_crane { ", beside \"paper measured\"" } else { "" };
            said += &format!("\nvirtual crane{beside}: {hz}");
        }
        let beside = |paper: Option<f64>, which: &str| {
            paper.map_or_else(String::new, |hz| format!(" (paper {which} {hz:.3})"))
        };
        said += &format!(
            "\n\np_A oscillation, valve open [Hz]: nominal {}{}",
            output::optional(result.pressure_oscillation_hz, 3),
            beside(result.paper_pressure_oscillation_hz, "simulated")
        );
        if let Some(hz) = result.virtual_pressure_oscillation_hz {
            let paper = beside(result.paper_measured_pressure_oscillation_hz, "measured");
            said += &format!(", virtual crane {hz:.3}{paper}");
        }
        said += &format!(
            "\n\n{} less model as measured, at the fast speed under velocity feedforward{}\n{}",
            if result.is_papers_crane { "Table 6: plant" } else { "Plant" },
            if result.is_papers_crane { "; the paper's plant is its real crane" } else { "" },
            output::table_beside_paper(&header, &differences)
        );
        said += &format!("\n\n{}", tracking_table(&result.motion));
        for remark in result.unstable_loops().iter().chain(&result.remark_on_gains) {
            said += &format!("\n{remark}");
        }
        let damping: Vec<Vec<String>> = result
            .double_damping
            .iter()
            .flat_map(|d| {
                d.laws().map(|(law, found)| {
                    let names = [d.plant.clone(), d.course.clone(), law.to_string()];
                    let cells = match found {
                        Ok(error) => error.cells().map(three),
                        Err(word) => [(); 4].map(|()| word.into()),
                    };
                    names.into_iter().chain(cells).collect()
                })
            })
            .collect();
        let mut header = vec!["plant", "course", "law"];
        header.extend(TrackingError::HEADS);
        said += &format!(
            "\n\nSimulation feedforward in closed loop damps twice\n{}",
            output::table(&header, &damping)
        );
        output::text(&format!(
            "{said}\n\n{}\n{} ({:.1} s)",
            energy::table(&result.energy.audits),
            output::named("report", &path),
            clock.elapsed().as_secs_f64()
        ))
    }
}

/// Table without the virtual crane's columns if there is none.
fn without_virtual<'a>(
    study: &study::Study,
    header: &[&'a str],
    rows: Vec<Vec<String>>,
) -> (Vec<&'a str>, Vec<Vec<String>>) {
    let is_shown =
        |head: &str| study.virtual_eigenfrequency_hz.is_some() || !head.contains("virtual");
    let shown: Vec<usize> = (0..header.len()).filter(|k| is_shown(header[*k])).collect();
    let rows = rows.into_iter().map(|row| shown.iter().map(|k| row[*k].clone()).collect());
    (shown.iter().map(|k| header[*k]).collect(), rows.collect())
}

/// Main claims of the paper, "paper | here".
fn claims_table(study: &study::Study) -> String {
    let shown: Vec<[String; 8]> = study
        .claims
        .iter()
        .map(|claim| {
            let on = |plant| claim.on(plant);
            let one = |value: Option<f64>| output::optional(value, claim.digits());
            [
                format!("{} [{}]", claim.compares, claim.unit),
                one(claim.paper_stated),
                one(claim.paper_tables),
                one(on(NOMINAL).map(|figure| figure.measured)),
                one(on(OFF).map(|figure| figure.measured)),
                one(on(VIRTUAL).map(|figure| figure.measured)),
                one(on(VIRTUAL).map(|figure| figure.truth)),
                claim.worse_on().join(", "),
            ]
        })
        .collect();
    let header = [
        "compared",
        "paper states",
        "its tables",
        "nominal",
        "off-model",
        "virtual measured",
        "virtual true",
        "worse than the paper on",
    ];
    let is_shown = |column: &usize| match header[*column] {
        "paper states" | "its tables" | "worse than the paper on" => study.is_papers_crane,
        "virtual measured" | "virtual true" => study.virtual_eigenfrequency_hz.is_some(),
        _ => true,
    };
    let columns: Vec<usize> = (0..header.len()).filter(is_shown).collect();
    let header: Vec<&str> = columns.iter().map(|k| header[*k]).collect();
    let rows: Vec<Vec<String>> =
        shown.iter().map(|row| columns.iter().map(|k| row[*k].clone()).collect()).collect();
    let on_paper = match study.is_papers_crane {
        true => format!("\n{}", claims::REMARK_ON_PAPER),
        false => String::new(),
    };
    let against = study.eigenfrequency_accuracy_percent.map_or_else(String::new, |percent| {
        format!("\nAgainst the eigenfrequencies that the paper measured, our model's mean accuracy is {percent:.1} %.")
    });
    format!(
        "{}; nominal and off-model plant have ideal sensors, measured and true is the same there\n{}\n{}{against}",
        if study.is_papers_crane {
            "The paper's headline claims"
        } else {
            "What the paper's headline claims are of, on this crane"
        },
        output::table(&header, &rows),
        claims::REMARK.replace(". ", ".\n") + &on_paper,
    )
}
