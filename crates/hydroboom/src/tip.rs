//! `hydroboom tip`

use crate::crane_file::{CraneFile, text_of};
use crate::interruptible::{Interruptible, of_requested};
use crate::machine_choice::MachineChoice;
use crate::number;
use crate::output;
use crate::paths::InputFile;
use crate::strategy_argument::strategies;
use clap::Args;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_description::schema::KEYS;
use hydroboom_design::tip_survey::{SurveyFit, TipSurvey};
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::closed_loop::tip_accuracy::{NoiseFloor, TipAccuracy, TipFamily, tip_accuracy};
use hydroboom_lab::crane_file_text::{FoundValue, write_value};
use hydroboom_lab::report;
use miette::{IntoDiagnostic, Result, bail, miette};
use serde_json::json;
use std::path::{Path, PathBuf};
use toml_edit::DocumentMut;

/// Residual in standard deviations above which a pose is an outlier.
const OUTLIER_DEVIATIONS: f64 = 3.5;
/// Half width of a 95 % interval in standard deviations.
const INTERVAL: f64 = 1.96;

/// Fit the parameters of the tip estimator (base, bending, zero of the stroke) to a survey, or test the estimated tip
/// on virtual cranes with a survey of each.
#[derive(Args)]
#[command(after_help = "Examples:\n  hydroboom virtual --survey survey.csv\n  \
    hydroboom tip --survey survey.csv --out surveyed.toml\n  \
    hydroboom tip --family 40 --seed 7 --widened --out tip")]
pub struct Tip {
    #[command(flatten)]
    crane: CraneFile,
    /// Survey: a CSV file with stroke_mm, payload_kg, tip_x_mm, tip_y_mm, deviation_mm
    /// (docs/reference/estimation.md).
    #[arg(
        long,
        value_name = "FILE",
        required_unless_present = "family",
        conflicts_with = "family"
    )]
    survey: Option<InputFile>,
    /// Crane file to write with the fitted keys of section tip. With --family: folder for the page with table and
    /// figure.
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
    /// Number of virtual cranes, drawn at random around the machine.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    family: Option<u64>,
    /// Number of the first crane.
    #[arg(long, value_name = "NUMBER", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=1_000_000_000))]
    from: u64,
    /// Seed of the family, and of the noise of the surveys.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Also vary stiffness of beam and base, dead volumes, sensors and fieldbus.
    #[arg(long, requires = "family")]
    widened: bool,
    /// Standard deviation of each surveyed coordinate of the family's cranes: 0.001 to 100 mm.
    #[arg(long, default_value_t = 1.0, requires = "family", value_parser = number::within(number::SURVEY_NOISE, "mm"))]
    survey_noise_mm: f64,
    /// Scenario in place of the fast motion; `hydroboom scenarios` lists them.
    #[arg(long, value_name = "NAME", requires = "family")]
    scenario: Option<String>,
    /// Strategy that controls the cranes while the estimator runs.
    #[arg(long, value_parser = strategies(), default_value = Strategy::ScheduledLqr.name())]
    strategy: Strategy,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Tip {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, the survey has an outlier or does not determine the keys, or no crane completed its
    /// course.
    pub fn run(self) -> Result<()> {
        match (&self.survey, self.family) {
            (Some(survey), _) => self.fit(survey),
            (None, count) => self.test(count.unwrap_or(1)),
        }
    }

    /// Fits the keys of section tip to a survey, prints them, and writes them into a copy of the crane file.
    fn fit(&self, path: &Path) -> Result<()> {
        let crane = self.crane.read()?;
        if self.crane.is_overridden() && self.out.is_some() {
            return Err(miette!(
                help = "write the values into the crane file first",
                "--set is not written to --out"
            ));
        }
        let name = path.display().to_string();
        let survey =
            TipSurvey::parse(&name, &text_of(path, "survey")?, &crane).into_diagnostic()?;
        let fit = survey.fit(&crane).into_diagnostic()?;
        let noise_floor = NoiseFloor::of_survey(&fit, &crane, self.seed);
        let (line, worst) = fit.worst;
        if worst > OUTLIER_DEVIATIONS {
            return Err(miette!(
                help =
                    "correct or survey it again, delete the line, or state a larger deviation_mm",
                "{name}, line {line}: the pose is {worst:.1} standard deviations off the fit, where {OUTLIER_DEVIATIONS} are allowed; nothing is written"
            ));
        }
        if let Some(out) = &self.out {
            let written = self.with_keys(&fit, path)?;
            output::file(out, written.as_bytes());
        }
        if self.json {
            let keys: serde_json::Map<String, serde_json::Value> = fit
                .keys()
                .iter()
                .map(|(path, si)| ((*path).into(), json!(in_unit(path, *si))))
                .collect();
            return output::json(&json!({
                "survey": path, "poses": survey.points.len(), "keys": keys,
                "residual_mm": fit.residual * 1e3, "worst_line": line, "worst_deviations": worst,
                "survey_noise": noise_floor, "written": self.out,
            }));
        }
        let written = self.out.as_ref().map_or_else(String::new, |out| {
            format!("\nwritten to {}, with covariance", out.display())
        });
        output::text(&format!(
            "{} poses of {name} on \"{}\"; left at them {:.2} mm RMS, most at line {line}: {worst:.1} standard deviations\n{}\n\n\
             Bending and base lower the tip nearly alike: the survey determines their sum, and each alone only by \
             its stated spread (correlation {:.2}).\n\
             The survey's noise leaves of the tip's height at {:.0} mm/s, median (5 .. 95 %), worst of 200 surveys: bias {} mm, RMS about it {} mm{written}",
            survey.points.len(),
            crane.name,
            fit.residual * 1e3,
            intervals(&crane, &fit),
            fit.keys()[6].1,
            crane.numbers.fast * 1e3,
            noise_floor.bias_mm.text(2),
            noise_floor.rms_about_mm.text(2),
        ))
    }

    /// Text of the crane file with the fitted keys; their source is the survey.
    fn with_keys(&self, fit: &SurveyFit, path: &Path) -> Result<String> {
        let mut document: DocumentMut = self.crane.text()?.parse().into_diagnostic()?;
        let file = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into());
        for (path, value) in fit.keys() {
            let value = in_unit(path, value);
            let source = format!("survey {file}");
            write_value(&mut document, FoundValue { path, value, provenance: "tuned", source });
        }
        Ok(document.to_string())
    }

    /// Tests the estimated tip on virtual cranes with a survey of each, and prints the errors of its height.
    fn test(&self, count: u64) -> Result<()> {
        let choice = MachineChoice::read(&self.crane, None)?;
        let (model, nominal) = (&choice.model, &choice.machine);
        let course = match &self.scenario {
            Some(name) => CourseChoice::Scenario(name.clone()),
            None => CourseChoice::Motion(nominal.numbers.fast),
        };
        let along = course.of(nominal).into_diagnostic()?.name();
        let family = TipFamily {
            cranes: self.from..self.from + count,
            seed: self.seed,
            is_widened: self.widened,
            survey_deviation: self.survey_noise_mm * 1e-3,
        };
        let work = Interruptible::new(count, "cranes")?;
        let go_on = |share: f64| work.done(share);
        let accuracy = tip_accuracy(model, nominal, self.strategy.into(), &course, &family, &go_on);
        drop(work);
        let accuracy = accuracy.into_diagnostic()?;
        if accuracy.cranes.is_empty() {
            bail!("none of {count} cranes completed its course: {}", accuracy.failed.join("; "));
        }
        let title = format!(
            "{} virtual cranes {}around \"{}\", seed {}, first {}, {along} under {}",
            of_requested(accuracy.cranes.len(), count as usize),
            if self.widened { "of a widened family " } else { "" },
            choice.name(),
            self.seed,
            self.from,
            self.strategy.name(),
        );
        if let Some(folder) = &self.out {
            let page = report::tip_page(&format!("Estimated tip: {title}"), &accuracy)
                .into_diagnostic()?;
            output::page_in_folder(folder, "tip", &page, Some(self.seed));
        }
        if self.json {
            return output::json(&json!({
                "asked": count, "seed": self.seed, "from": self.from, "widened": self.widened,
                "survey_noise_mm": self.survey_noise_mm, "course": along,
                "strategy": self.strategy.name(), "tip": accuracy, "plant": choice.json(),
            }));
        }
        output::text(&format!(
            "{title}\nErrors of the tip's height [mm]: median (5 .. 95 %), worst. Each crane is surveyed by itself: five poses, two loads, {} mm of noise. \
             Truth is the virtual crane's.\n{}",
            self.survey_noise_mm,
            table(&accuracy)
        ))
    }
}

/// Errors of the tip's height \[mm\] by method, beside those that the survey's noise alone leaves.
fn table(accuracy: &TipAccuracy) -> String {
    let mut cells: Vec<Vec<String>> = accuracy
        .methods
        .iter()
        .map(|row| {
            vec![
                row.method.into(),
                row.bias_mm.text(2),
                row.rms_about_mm.text(2),
                row.rms_mm.text(2),
                output::optional(row.deviation_mm, 2),
                output::optional(row.coverage_percent, 0),
            ]
        })
        .collect();
    let noise_floor = &accuracy.survey_noise;
    let none = || output::optional(None, 0);
    cells.push(vec![
        "left by the survey's noise alone".into(),
        noise_floor.bias_mm.text(2),
        noise_floor.rms_about_mm.text(2),
        none(),
        none(),
        none(),
    ]);
    let header = ["", "bias", "RMS about it", "RMS", "mean sigma", "within 2 sigma [%]"];
    let failed = match accuracy.failed.is_empty() {
        true => String::new(),
        false => format!("\n\nnot finished, and not counted:\n  {}", accuracy.failed.join("\n  ")),
    };
    output::table(&header, &cells) + &failed
}

/// Value of a key in its unit with six significant digits.
fn in_unit(path: &str, si: f64) -> f64 {
    let value = KEYS.iter().find(|key| key.path() == path).map_or(si, |key| key.to_unit(si));
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// Fitted keys with their 95 % intervals, beside those of the crane file.
fn intervals(crane: &Description, fit: &SurveyFit) -> String {
    let before: Vec<(String, f64)> =
        crane.entries().map(|(key, value, _)| (key.path(), value)).collect();
    let stated = |path: &str| before.iter().find(|(of, _)| of == path).map_or(f64::NAN, |b| b.1);
    let keys = fit.keys();
    let cells: Vec<Vec<String>> = keys[..6]
        .chunks(2)
        .map(|pair| {
            let [(path, value), (of_deviation, deviation)] = [pair[0], pair[1]];
            let (value, deviation) = (in_unit(path, value), in_unit(of_deviation, deviation));
            let range = |value: f64, deviation: f64| {
                let half = INTERVAL * deviation;
                format!("{:.3} to {:.3}", value - half, value + half)
            };
            vec![
                path.into(),
                format!("{value:.3}"),
                range(value, deviation),
                range(stated(path), stated(of_deviation)),
            ]
        })
        .collect();
    output::table(&["key", "fitted", "95 %", "95 % as stated before"], &cells)
}
