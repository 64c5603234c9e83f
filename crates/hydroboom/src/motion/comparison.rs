//! Comparison of the control strategies along courses, on a plant that may differ from the model.

use super::key_effect::{self, KeyEffect};
use super::model_error::{self, ModelError, model_errors};
use super::run_log::write_run_log;
use super::tracking_table::tracking_table;
use crate::machine_choice::{MachineChoice, Source};
use crate::output;
use hydroboom_control::strategy::Strategy;
use hydroboom_design::benchmark_design::Gains;
use hydroboom_design::stability::{
    LoopStability, remark_on_expected_lags, stability_of, stable_with_expected_lags,
};
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::motion_test::{Row, Run, run, run_all};
use hydroboom_lab::report::{MotionTests, Page, motion_page};
use indicatif::ProgressBar;
use miette::{IntoDiagnostic, Result};
use serde_json::{Value, json};
use std::path::Path;

/// Comparison to be made.
pub struct Plan {
    /// Model and plant.
    pub choice: MachineChoice,
    /// Name of the plant in tables.
    pub plant_name: String,
    /// Courses along which all strategies run.
    pub courses: Vec<CourseChoice>,
    /// Whether the model is the paper's crane, whose values are shown for no other.
    pub is_papers_crane: bool,
    /// Remark on the gains of the benchmark controller; none if the crane file's are tuned.
    pub remark_on_gains: Option<String>,
}

/// Results of a comparison.
pub struct Comparison {
    plan: Plan,
    /// Effects of the most important differences of the plant, each by itself; none for a virtual crane, which differs
    /// in all its equipment.
    effects: Vec<KeyEffect>,
    /// Number of the other differences.
    other_differences: usize,
    /// Runs of all strategies along all courses.
    runs: Vec<Run>,
    rows: Vec<Row>,
    /// Stability of the strategies' linearised loops on the plant.
    loops: Vec<LoopStability>,
    /// Loops that are unstable on the plant with ideal equipment, and stable with the lags that controllers expect.
    stable_with_expected_lags: Vec<LoopStability>,
    /// The published model under velocity feedforward along the last course, beside a virtual crane.
    published: Option<Run>,
    /// Table 6; none except for the paper's virtual crane.
    model_errors: Option<Vec<ModelError>>,
}

impl Comparison {
    /// Runs all strategies along all courses, and analyses their loops.
    ///
    /// # Errors
    ///
    /// If a course is unknown, a simulation fails, or a loop cannot be analysed.
    pub fn new(plan: Plan) -> Result<Self> {
        let (model, plant) = (&plan.choice.model, &plan.choice.machine);
        // the virtual crane differs in all its equipment: `hydroboom show` lists that
        let (changes, other_differences) = match plan.choice.is_virtual() {
            true => (Vec::new(), 0),
            false => plan.choice.most_important(),
        };
        let bar = ProgressBar::new((plan.courses.len() + changes.len()) as u64);
        let effects = changes
            .iter()
            .map(|difference| {
                bar.inc(1);
                KeyEffect::new(model, difference).into_diagnostic()
            })
            .collect::<Result<Vec<_>>>()?;
        let mut runs = Vec::new();
        for course in &plan.courses {
            let course = course.of(plant).into_diagnostic()?;
            runs.extend(run_all(model, plant, course.as_ref()).into_diagnostic()?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        let loops = stability_of(&Strategy::ALL, model, plant).into_diagnostic()?;
        let stable_with_expected_lags =
            stable_with_expected_lags(model, &loops).into_diagnostic()?;
        let rows: Vec<Row> = runs
            .iter()
            .map(|run| Row::of(&plan.plant_name, run).with_loops(&loops))
            .map(|row| if plan.is_papers_crane { row } else { row.without_paper() })
            .collect();
        let published = plan.published_model()?;
        // the paper's differences apply to the paper's crane only
        let model_errors = published
            .as_ref()
            .zip(last_velocity_feedforward(&runs))
            .filter(|_| plan.choice.source == Source::Embedded)
            .map(|(simulated, crane)| model_errors(simulated, crane));
        Ok(Self {
            plan,
            effects,
            other_differences,
            runs,
            rows,
            loops,
            stable_with_expected_lags,
            published,
            model_errors,
        })
    }

    /// Page with the figures of every course.
    ///
    /// # Errors
    ///
    /// If a figure cannot be drawn.
    pub fn page(&self) -> Result<Page> {
        let Plan { choice, plant_name, is_papers_crane, remark_on_gains, .. } = &self.plan;
        let plant = match choice.source {
            Source::Embedded => "virtual crane".to_string(),
            Source::CraneFile => plant_name.clone(),
            Source::MachineFile | Source::Udp | Source::EtherCat | Source::Model => {
                format!("plant \"{plant_name}\"")
            }
        };
        let remarks: Vec<String> = choice
            .equality()
            .map(String::from)
            .into_iter()
            .chain(remark_on_gains.clone())
            .chain(self.unstable_loops().map(ToString::to_string))
            .chain(remark_on_expected_lags(&self.stable_with_expected_lags))
            .collect();
        let page = motion_page(&MotionTests {
            crane: &choice.model.name,
            plant: &plant,
            runs: &self.runs,
            alongside: self.published.as_ref(),
            is_papers_crane: *is_papers_crane,
            loops: &self.loops,
            remark: (!remarks.is_empty()).then(|| remarks.join(". ")).as_deref(),
        });
        page.into_diagnostic()
    }

    /// Writes the time series of every run into a folder, which is created.
    pub fn write_run_logs(&self, folder: &Path) {
        output::folder(folder);
        self.runs.iter().for_each(|run| write_run_log(folder, &self.plan.plant_name, run));
    }

    /// Results as JSON.
    pub fn in_json(&self) -> Value {
        let choice = &self.plan.choice;
        let is_stable =
            self.rows.iter().all(|row| row.stable) && self.loops.iter().all(|one| one.stable);
        json!({
            "motion": self.rows, "plant_changes": self.effects, "differences": self.model_errors,
            "plant": choice.json(), "stable": is_stable, "loops": self.loops,
            "stable_with_expected_lags": self.stable_with_expected_lags,
            "benchmark_gains": Gains::of(&choice.model), "remark_on_gains": self.plan.remark_on_gains,
        })
    }

    /// Results as text.
    pub fn text(&self) -> String {
        let choice = &self.plan.choice;
        let mut text = self.plant_text();
        if let Some(equality) = choice.equality() {
            text += &format!("{}: {equality}\n", choice.name());
        }
        if let Some(remark) = &self.plan.remark_on_gains {
            text += &format!("{remark}\n");
        }
        text + &tracking_table(&self.rows) + &self.instability_text()
    }

    /// Differences of the plant from the model: Table 6 for the paper's virtual crane, effects of single keys for
    /// another plant.
    fn plant_text(&self) -> String {
        let MachineChoice { model, machine, .. } = &self.plan.choice;
        let mut text = String::new();
        if let Some(errors) = &self.model_errors {
            let count = model.differences(machine).len();
            text = format!(
                "The plant is the virtual crane. It differs from the model in {count} keys \
                 (hydroboom show --crane cranes/uia-virtual.toml)\n\
                 Table 6: crane less published model as measured, both under velocity feedforward along {}; \
                 the paper measured a real crane\n{}\n\n",
                last_velocity_feedforward(&self.runs).map_or("", |run| &run.course),
                model_error::table(errors)
            );
        }
        if !self.effects.is_empty() {
            text = format!(
                "What each change does by itself, at the fast speed (model -> plant)\n{}\n\n",
                key_effect::table(&self.effects)
            );
        }
        if self.other_differences > 0 {
            text = format!(
                "{}\nand {} more differences: --json lists them\n\n",
                text.trim_end(),
                self.other_differences
            );
        }
        text
    }

    /// Unstable loops, and how they compare with the runs and with the lags that controllers expect.
    fn instability_text(&self) -> String {
        let mut text: String = self.unstable_loops().map(|of| format!("\n{of}")).collect();
        if let Some(remark) = remark_on_expected_lags(&self.stable_with_expected_lags) {
            text += &format!("\n{remark}");
        }
        if self.unstable_loops().next().is_some() && self.rows.iter().all(|row| row.stable) {
            text += "\nNo run above was in sustained oscillation while its reference rested, where friction may hold the piston: look at the motor's speed in motion (--log).";
        }
        text
    }

    fn unstable_loops(&self) -> impl Iterator<Item = &LoopStability> {
        self.loops.iter().filter(|of| !of.stable)
    }
}

impl Plan {
    /// Run of the published model along the last course, which is the fast motion or a scenario (Table 6); none unless
    /// the plant is a virtual crane.
    fn published_model(&self) -> Result<Option<Run>> {
        let MachineChoice { model, machine, .. } = &self.choice;
        let Some(course) = self.courses.last().filter(|_| self.choice.is_virtual()) else {
            return Ok(None);
        };
        let course = course.of(machine).into_diagnostic()?;
        let published = model.without_equipment();
        let run = run(model, &published, Strategy::VelocityFeedforward, course.as_ref());
        run.map(Some).into_diagnostic()
    }
}

/// Run under velocity feedforward along the last course.
fn last_velocity_feedforward(runs: &[Run]) -> Option<&Run> {
    runs.iter().rfind(|run| run.strategy == Strategy::VelocityFeedforward)
}
