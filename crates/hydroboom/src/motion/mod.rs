//! `hydroboom motion`

mod comparison;
mod family;
mod key_effect;
mod model_error;
pub mod run_log;
pub mod tracking_table;

use crate::crane_file::{CraneFile, text};
use crate::machine_choice::{MachineChoice, Source};
use crate::paths::{InputFile, OutputFolder};
use crate::{benchmark_gains, output, renamed_option};
use clap::Args;
use comparison::{Comparison, Plan};
use family::Family;
use hydroboom_description::Description;
use hydroboom_design::benchmark_design::payload_range;
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::study::NOMINAL;
use miette::{IntoDiagnostic, Result, miette};
use std::path::Path;

/// Argument for the virtual crane, and name of the embedded one.
const VIRTUAL: &str = "virtual";

/// Compare five control strategies (the paper's tests 1 to 3, and the scheduled LQR) at both speeds, on a plant that
/// may differ from the model.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom motion --plant-set payload.mass_kg=340 --out motion\n  \
    hydroboom motion --plant virtual\n  hydroboom motion --family 200 --out family\n  \
    hydroboom motion --family 24 --seed 1 --baselines\n  \
    hydroboom motion --plant virtual --scenario reversal --out motion"
)]
pub struct MotionTests {
    #[command(flatten)]
    crane: CraneFile,
    /// Crane file of the plant, a file with a `[set]` table of overrides, or `virtual`: the virtual crane
    /// of the crane file, without --crane the paper's. It has typical drive, valve, sensors and fieldbus
    /// where the file has none. Default: the model itself.
    #[arg(long, value_name = "FILE")]
    plant: Option<InputFile>,
    /// Number of virtual cranes, drawn at random around the plant, in place of one. Default plant: the virtual crane.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    family: Option<u64>,
    /// Seed of the family.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Also vary stiffness of beam and base, dead volumes, errors of the pressure transducers, lag of the sensors and
    /// delay of the fieldbus.
    #[arg(long, requires = "family")]
    widened: bool,
    /// In a family, add baselines: the benchmark with designed gains, without and with an input shaper,
    /// LQG, linear and nonlinear MPC. The computing time of each for a control period is added too
    /// (docs/reference/baselines.md).
    #[arg(long, requires = "family")]
    baselines: bool,
    /// Its name before.
    #[arg(long, hide = true)]
    rivals: bool,
    /// Run a scenario in place of the motion at both speeds; `hydroboom scenarios` lists them.
    #[arg(long, value_name = "NAME")]
    scenario: Option<String>,
    /// Use the benchmark gains of the crane file. By default, gains of `hydroboom design --benchmark` replace the
    /// placeholders of a new file, and the paper's gains on another crane for which they are not tuned.
    #[arg(long)]
    gains_as_given: bool,
    /// Override a key of the plant only; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    plant_set: Vec<String>,
    /// Folder for motion.html (figures 24 to 27, on the virtual crane also 18 to 23) or family.html.
    #[arg(long, value_name = "DIR")]
    out: Option<OutputFolder>,
    /// Folder for the time series of every run, as CSV.
    #[arg(long, value_name = "DIR", conflicts_with = "family")]
    log: Option<OutputFolder>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl MotionTests {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, a simulation fails, or no crane of a family was run.
    pub fn run(self) -> Result<()> {
        renamed_option::refuse(self.rivals, "--rivals", "--baselines")?;
        let (mut choice, plant_name) = self.plant()?;
        let is_papers_crane = self.crane.is_papers_crane()?;
        let courses = self.courses(&choice.model);
        let mut remark_on_gains = None;
        if !self.gains_as_given {
            let payloads = self.payloads(&choice, &courses)?;
            (choice, remark_on_gains) = benchmark_gains::for_comparison(choice, payloads)?;
        }
        if let Some(count) = self.family {
            remark_on_gains.iter().for_each(|remark| output::warn(remark));
            let family = Family {
                count,
                seed: self.seed,
                is_widened: self.widened,
                has_baselines: self.baselines,
            };
            return family::run(&choice, &family, &courses, self.out.as_deref(), self.json);
        }
        let plan = Plan { choice, plant_name, courses, is_papers_crane, remark_on_gains };
        let comparison = Comparison::new(plan)?;
        if let Some(folder) = &self.out {
            output::page_in_folder(folder, "motion", &comparison.page()?, None);
        }
        if let Some(folder) = &self.log {
            comparison.write_run_logs(folder);
        }
        match self.json {
            true => output::json(&comparison.in_json()),
            false => output::text(&comparison.text()),
        }
    }

    /// The scenario, otherwise the motion at the model's slow and fast speed.
    fn courses(&self, model: &Description) -> Vec<CourseChoice> {
        match &self.scenario {
            Some(name) => vec![CourseChoice::Scenario(name.clone())],
            None => [model.numbers.slow, model.numbers.fast].map(CourseChoice::Motion).to_vec(),
        }
    }

    /// Range of the payloads \[kg\] in the comparison: of the model, of the plant, and of load changes; for
    /// a family that of the crane file.
    ///
    /// # Errors
    ///
    /// If there is no such scenario.
    fn payloads(&self, choice: &MachineChoice, courses: &[CourseChoice]) -> Result<[f64; 2]> {
        let (model, plant) = (&choice.model, &choice.machine);
        let mut all = vec![model.numbers.payload, plant.numbers.payload];
        if self.family.is_some() {
            all.extend(payload_range(model));
        }
        for course in courses {
            let course = course.of(plant).into_diagnostic()?;
            all.extend(course.loads().iter().map(|load| load.mass));
        }
        let [least, most] = [f64::min, f64::max].map(|of| all.iter().copied().reduce(of));
        Ok([least.unwrap_or(0.0), most.unwrap_or(0.0)])
    }

    /// Model with its plant, and the plant's name in tables; with the overrides of the plant.
    ///
    /// # Errors
    ///
    /// If a crane file cannot be read, or an override is invalid.
    fn plant(&self) -> Result<(MachineChoice, String)> {
        let (choice, name) = self.plant_as_described()?;
        if self.plant_set.is_empty() {
            return Ok((choice, name));
        }
        let mut plant = choice.machine.clone();
        plant.set_together(self.plant_set.iter().map(String::as_str))?;
        let name = match choice.is_virtual() {
            true => format!("{name}, changed"),
            false => "changed".into(),
        };
        Ok((choice.with_machine(plant), name))
    }

    /// The same without the overrides.
    fn plant_as_described(&self) -> Result<(MachineChoice, String)> {
        let model = self.crane.read()?;
        let path = match &self.plant {
            None if self.family.is_none() => {
                return Ok((MachineChoice::model_itself(&model), NOMINAL.into()));
            }
            Some(path) if **path != *Path::new(VIRTUAL) => path,
            _ => {
                let choice = MachineChoice::of(model, &self.crane, None)?;
                let name = match choice.source {
                    Source::Embedded => VIRTUAL.into(),
                    _ => choice.name(),
                };
                return Ok((choice, name));
            }
        };
        let name = path.display().to_string();
        if !path.exists() {
            return Err(miette!(
                help = "`--plant virtual` is the virtual crane of the crane file; else it is a crane file, or a file \
                    with a [set] table of overrides",
                "--plant: there is no file {name}"
            ));
        }
        let content = text(path)?;
        let choice = match content.contains("[set]") {
            true => {
                let choice = MachineChoice::model_itself(&model);
                let plant = choice.model.overridden(&name, &content)?.0;
                choice.with_machine(plant)
            }
            false => MachineChoice::of(model, &self.crane, Some(path))?,
        };
        Ok((choice, name))
    }
}
