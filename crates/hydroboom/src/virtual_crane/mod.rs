//! `hydroboom virtual`

mod controller_keys;
mod summary_text;

use crate::controller_model::controller_model;
use crate::crane_file::CraneFile;
use crate::number;
use crate::output;
use crate::paths::{InputFile, OutputFile, OutputFolder};
use crate::strategy_argument::strategies;
use clap::Args;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::dataset::dataset;
use hydroboom_lab::simulate::Recording;
use hydroboom_lab::virtual_run::{Contents, LogOrder, Task, virtual_run};
use hydroboom_lab::virtual_survey::{SurveyOrder, virtual_survey};
use hydroboom_virtual_crane::Effect;
use indicatif::ProgressBar;
use miette::{IntoDiagnostic, Result};
use serde_json::json;
use std::path::Path;
use summary_text::summary_text;

/// Simulate the virtual crane, a substitute for a real one; log its sensor signals and the estimates of the state
/// estimator.
#[derive(Args)]
#[command(after_help = "Examples:\n  hydroboom virtual --log out.csv\n  \
    hydroboom virtual --strategy benchmark-closed-loop --speed-mm-s 25 --truth --log out.csv\n  \
    hydroboom virtual --without sensors,fieldbus --input drive.csv --log out.csv\n  \
    hydroboom virtual --dataset logs\n  hydroboom virtual --survey survey.csv")]
pub struct Virtual {
    #[command(flatten)]
    crane: CraneFile,
    /// Crane file of the controllers' model. Default: the file of --crane without --set, the paper's crane for its
    /// virtual crane.
    #[arg(long, value_name = "FILE")]
    model: Option<InputFile>,
    /// Override a key of that model, e.g. --model-set estimator.payload_drift_percent=2; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    model_set: Vec<String>,
    /// Effects to switch off: segments, payload-shape, base, friction, slip, torque-losses, ripple,
    /// drive, valve, air, temperature, sensors, fieldbus.
    #[arg(long, value_name = "EFFECTS", value_delimiter = ',')]
    without: Vec<String>,
    /// Speed of the motion; the model's fast one when not given: 0.1 to 10000 mm/s.
    #[arg(long, value_parser = number::within(number::SPEED, "mm/s"))]
    speed_mm_s: Option<f64>,
    /// Control strategy.
    #[arg(long, value_parser = strategies(), default_value = "velocity-feedforward")]
    strategy: Strategy,
    /// Run a scenario; `hydroboom scenarios` lists them.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["speed_mm_s", "input"])]
    scenario: Option<String>,
    /// Run a recorded input: CSV with time_s, motor_speed_rpm and optionally valve.
    #[arg(long, value_name = "FILE", conflicts_with = "speed_mm_s")]
    input: Option<InputFile>,
    /// Log to write: CSV, or MAT where the name ends so.
    #[arg(long, value_name = "FILE")]
    log: Option<OutputFile>,
    /// Interval of the log; never shorter than a control period: 0.001 to 3600000 ms.
    #[arg(long, default_value_t = 1.0, value_parser = number::within(number::LOG_INTERVAL, "ms"))]
    log_ms: f64,
    /// Add the hidden states to the log.
    #[arg(long, requires = "log")]
    truth: bool,
    /// Write a documented set of logs for identification and control into this new folder.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["input", "log", "scenario", "speed_mm_s"])]
    dataset: Option<OutputFolder>,
    /// Write a survey of the tip at rest into this file: five poses over the motion, empty and with the model's payload.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["input", "log", "scenario", "speed_mm_s", "dataset"])]
    survey: Option<OutputFile>,
    /// Standard deviation of each surveyed coordinate: 0.001 to 100 mm.
    #[arg(long, default_value_t = 1.0, requires = "survey", value_parser = number::within(number::SURVEY_NOISE, "mm"))]
    survey_noise_mm: f64,
    /// Seed of the survey's noise.
    #[arg(long, default_value_t = 1, requires = "survey")]
    survey_seed: u64,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Virtual {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, `--set` names a key that only the controller uses, or a simulation fails.
    pub fn run(self) -> Result<()> {
        let crane = self.machine()?;
        controller_keys::refuse(&self.crane)?;
        let model = self.controller_model()?;
        if let Some(path) = &self.survey {
            return self.write_survey(path, &model, &crane);
        }
        if let Some(folder) = &self.dataset {
            return self.write_dataset(folder, &model, &crane);
        }
        self.simulate(&model, &crane)
    }

    /// Virtual crane without the effects that are switched off.
    ///
    /// # Errors
    ///
    /// If its file is invalid, or there is no such effect.
    fn machine(&self) -> Result<Description> {
        let mut crane = self.crane.read_or(Description::uia_virtual)?;
        for name in &self.without {
            let effect = Effect::from_name(name).ok_or_else(|| {
                let names = Effect::ALL.map(Effect::name).join(", ");
                miette::miette!(help = format!("one of: {names}"), "no effect \"{name}\"")
            })?;
            effect.remove_from(&mut crane)?;
        }
        Ok(crane)
    }

    /// Model that the controllers use, with its overrides.
    ///
    /// # Errors
    ///
    /// If its file or an override is invalid.
    fn controller_model(&self) -> Result<Description> {
        let mut model = controller_model(&self.crane, self.model.as_deref())?;
        model.set_together_within_range(self.model_set.iter().map(String::as_str))?;
        Ok(model)
    }

    /// Writes a survey of the tip at rest, and prints the number of its poses.
    ///
    /// # Errors
    ///
    /// If the crane has no state of rest in a pose.
    fn write_survey(&self, path: &Path, model: &Description, crane: &Description) -> Result<()> {
        let order = SurveyOrder {
            loads: [0.0, model.numbers.payload],
            deviation: self.survey_noise_mm * 1e-3,
            seed: self.survey_seed,
        };
        let survey = virtual_survey(crane, &order).into_diagnostic()?;
        output::file(path, survey.text().as_bytes());
        match self.json {
            true => output::json(&json!({ "written": path, "poses": survey.points.len() })),
            false => output::text(&format!(
                "{} poses of \"{}\" in {}; hydroboom tip --survey {} fits base and bending to it",
                survey.points.len(),
                crane.name,
                path.display(),
                path.display()
            )),
        }
    }

    /// Writes a set of logs into a new folder, and prints the number of its files.
    ///
    /// # Errors
    ///
    /// If a simulation fails, or the set cannot be written.
    fn write_dataset(&self, folder: &Path, model: &Description, crane: &Description) -> Result<()> {
        let bar = ProgressBar::new(1000);
        let files = dataset(model, crane, folder, |share| {
            bar.set_position((share * 1000.0) as u64);
        });
        bar.finish_and_clear();
        let files = files.into_diagnostic()?;
        match self.json {
            true => output::json(&json!({ "written": folder, "files": files })),
            false => output::text(&format!(
                "{} files in {}; start with its README.md",
                files.len(),
                folder.display()
            )),
        }
    }

    /// Simulates the virtual crane, prints a summary, and writes a log.
    ///
    /// # Errors
    ///
    /// If the recorded input is invalid, there is no such scenario, or the simulation fails.
    fn simulate(&self, model: &Description, crane: &Description) -> Result<()> {
        let speed = match self.speed_mm_s {
            requested @ Some(_) => number::speed_of_motion(crane, requested)?,
            None => model.numbers.fast,
        };
        let choice = match &self.scenario {
            Some(name) => CourseChoice::Scenario(name.clone()),
            None => CourseChoice::Motion(speed),
        };
        let course = choice.of(crane).into_diagnostic()?;
        let task = match &self.input {
            Some(path) => Task::Recording(Recording::read(path).into_diagnostic()?),
            None => Task::Course(course.as_ref(), self.strategy),
        };
        let contents = if self.truth { Contents::Truth } else { Contents::Readings };
        let bar = ProgressBar::new(1000);
        let interval = self.log_ms * 1e-3;
        let log =
            self.log.as_deref().map(|path| LogOrder { path, contents, estimates: true, interval });
        let logs: Vec<_> = log.into_iter().collect();
        let result = virtual_run(model, crane, &task, &logs, |share| {
            bar.set_position((share * 1000.0) as u64);
        });
        bar.finish_and_clear();
        let (summary, lost) = result.into_diagnostic()?;
        if let Some(path) = &self.log {
            output::written(path, lost.into_iter().next().map_or(Ok(()), Err));
        }
        if self.json {
            let mut value = serde_json::to_value(summary).into_diagnostic()?;
            value["crane"] = json!(crane.name);
            value["log"] = json!(self.log);
            return output::json(&value);
        }
        let mut text = summary_text(&crane.name, &summary);
        if let Some(log) = &self.log {
            text += &output::named("log", log);
        }
        output::text(&text)
    }
}
