//! `hydroboom virtual`

use crate::crane_file::{CraneFile, text};
use crate::number;
use crate::output;
use crate::paths::{InputFile, OutputFile, OutputFolder};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::dataset::dataset;
use hydroboom_lab::simulate::Recording;
use hydroboom_lab::virtual_estimates::Compared;
use hydroboom_lab::virtual_run::{Contents, LogOrder, Task, virtual_run};
use hydroboom_lab::virtual_survey::{SurveyOrder, virtual_survey};
use hydroboom_virtual_crane::Effect;
use indicatif::ProgressBar;
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// Parser of all strategies by their names.
pub fn strategies() -> impl TypedValueParser<Value = Strategy> {
    let offered = Strategy::ALL.map(|strategy| PossibleValue::new(strategy.name()));
    // refused with its own message
    let replaced = PossibleValue::new("model-following").hide(true);
    PossibleValuesParser::new(offered.into_iter().chain([replaced]))
        .try_map(|name| name.parse::<Strategy>())
}

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
    /// Crane file of the controllers' model. Default: the paper's crane.
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
    pub fn run(self) -> Result<()> {
        let mut crane = self.crane.read_or(Description::uia_virtual)?;
        for name in &self.without {
            let effect = Effect::from_name(name).ok_or_else(|| {
                let names = Effect::ALL.map(Effect::name).join(", ");
                miette::miette!(help = format!("one of: {names}"), "no effect \"{name}\"")
            })?;
            effect.remove_from(&mut crane)?;
        }
        if let Some(assignment) = self.crane.overrides().iter().find(|a| is_of_controller(a)) {
            miette::bail!(
                help = format!("--model-set {assignment}"),
                "--set {assignment}: --set changes the machine, and this is what its controller knows"
            );
        }
        if let (Some(path), None) = (self.crane.path(), &self.model)
            && let Some(key) = key_of_controller(&crane)
        {
            miette::bail!(
                help = format!("--model {} makes the controller know this file", path.display()),
                "{} has {key}, which is of the controller, and --crane is the machine: without --model the controller knows the paper's crane",
                path.display()
            );
        }
        let mut model = match &self.model {
            Some(path) => Description::parse(&path.display().to_string(), &text(path)?)?,
            None => Description::uia_single_boom()?,
        };
        model.set_together_within_range(self.model_set.iter().map(String::as_str))?;
        if let Some(path) = &self.survey {
            let order = SurveyOrder {
                loads: [0.0, model.numbers.payload],
                deviation: self.survey_noise_mm * 1e-3,
                seed: self.survey_seed,
            };
            let survey = virtual_survey(&crane, &order).into_diagnostic()?;
            output::file(path, survey.text().as_bytes());
            return match self.json {
                true => output::json(&json!({ "written": path, "poses": survey.points.len() })),
                false => output::text(&format!(
                    "{} poses of \"{}\" in {}; hydroboom tip --survey {} fits base and bending to it",
                    survey.points.len(),
                    crane.name,
                    path.display(),
                    path.display()
                )),
            };
        }
        if let Some(folder) = &self.dataset {
            let bar = ProgressBar::new(1000);
            let files = dataset(&model, &crane, folder, |share| {
                bar.set_position((share * 1000.0) as u64);
            });
            bar.finish_and_clear();
            let files = files.into_diagnostic()?;
            return match self.json {
                true => output::json(&json!({ "written": folder, "files": files })),
                false => output::text(&format!(
                    "{} files in {}; start with its README.md",
                    files.len(),
                    folder.display()
                )),
            };
        }
        let speed = match self.speed_mm_s {
            asked @ Some(_) => number::speed_of_motion(&crane, asked)?,
            None => model.numbers.fast,
        };
        let choice = match self.scenario {
            Some(name) => CourseChoice::Scenario(name),
            None => CourseChoice::Motion(speed),
        };
        let course = choice.of(&crane).into_diagnostic()?;
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
        let result = virtual_run(&model, &crane, &task, &logs, |share| {
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
        let mut said = format!("{}: {:.3} s", crane.name, summary.duration_s);
        let [rms, rms_measured, peak, peak_measured] = summary.error.cells();
        if let Some(oscillation) = summary.sustained_oscillation {
            said += &format!(", UNSTABLE, in sustained oscillation of {oscillation}");
        } else if rms.is_finite() {
            said += &format!(
                ", tracking error RMS true {rms:.3} mm, measured {rms_measured:.3} mm, peak true {peak:.3} mm, measured {peak_measured:.3} mm"
            );
        }
        said += &format!(
            "; at the end x_cyl {:.3} mm, p_A {:.2} bar, oil {:.2} C; largest motor torque {:.1} N m",
            summary.stroke_mm, summary.pressure_a_bar, summary.oil_c, summary.torque_nm
        );
        if let Some(estimates) = &summary.estimates {
            said += &format!(
                "\n\nstate estimator of scheduled-lqr beside the virtual crane, at the end:\n{}",
                output::table(&ESTIMATES, &estimates.iter().map(estimate).collect::<Vec<_>>())
            );
        }
        if let Some(log) = &self.log {
            said += &output::named("log", log);
        }
        output::text(&said)
    }
}

/// First key of the crane file that only a controller uses.
fn key_of_controller(crane: &Description) -> Option<String> {
    let mut entries = crane.entries();
    let found = entries.find(|(key, _, origin)| {
        CONTROLLER_SECTIONS.contains(&key.section) && origin.line.is_some()
    });
    found.map(|(key, ..)| key.path())
}

/// Sections of the crane file that only a controller uses.
const CONTROLLER_SECTIONS: [&str; 2] = ["estimator", "scheduled_lqr"];

/// Whether an override sets a key of estimator or control law.
fn is_of_controller(assignment: &str) -> bool {
    let section = assignment.trim().split('.').next();
    section.is_some_and(|section| CONTROLLER_SECTIONS.contains(&section))
}

const ESTIMATES: [&str; 5] =
    ["quantity", "estimated", "standard deviation", "true", "RMS error over the run"];

fn estimate((name, compared): (&str, &Compared)) -> Vec<String> {
    let Compared { estimated, deviation, true_value, rms_error } = compared;
    let shown = |value: Option<f64>| output::optional(value, 3);
    vec![
        name.into(),
        shown(Some(*estimated)),
        shown(*deviation),
        shown(*true_value),
        shown(*rms_error),
    ]
}
