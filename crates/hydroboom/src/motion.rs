//! `hydroboom motion`

use crate::crane_file::{CraneFile, text};
use crate::machine_choice::{MachineChoice, Source};
use crate::paths::{InputFile, OutputFolder};
use crate::{benchmark_gains, family, output, renamed_option};
use clap::Args;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::{Description, Difference};
use hydroboom_design::benchmark_design::{Gains, payload_range};
use hydroboom_design::stability::{
    remark_on_expected_lags, stability_of, stable_with_expected_lags,
};
use hydroboom_lab::calibrate::differences;
use hydroboom_lab::closed_loop::metrics::{MOTOR_ENERGY, TrackingError};
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::eigenfrequency::{locked_mode, without_friction};
use hydroboom_lab::motion_test::{Row, instability_remarks, remark_on_mark, run, run_all};
use hydroboom_lab::report::IDEAL_SENSORS;
use hydroboom_lab::study::NOMINAL;
use hydroboom_lab::{LabError, paper, report};
use indicatif::ProgressBar;
use miette::{IntoDiagnostic, Result};
use serde::Serialize;
use serde_json::json;
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
    pub fn run(self) -> Result<()> {
        renamed_option::refuse(self.rivals, "--rivals", "--baselines")?;
        let (mut choice, mut name) = self.choice()?;
        if !self.plant_set.is_empty() {
            let mut plant = choice.machine.clone();
            plant.set_together(self.plant_set.iter().map(String::as_str))?;
            name = if choice.is_virtual() { format!("{name}, changed") } else { "changed".into() };
            choice = choice.with_machine(plant);
        }
        let is_papers_crane = self.crane.is_papers_crane()?;
        let courses = match &self.scenario {
            Some(name) => vec![CourseChoice::Scenario(name.clone())],
            None => {
                let n = &choice.model.numbers;
                [n.slow, n.fast].map(CourseChoice::Motion).to_vec()
            }
        };
        let mut gains = None;
        if !self.gains_as_given {
            let payloads = self.payloads(&choice, &courses)?;
            (choice, gains) = benchmark_gains::for_comparison(choice, payloads)?;
        }
        let (model, plant) = (&choice.model, &choice.machine);
        if self.family.is_some() {
            gains.iter().for_each(|remark| output::warn(remark));
        }
        if let Some(count) = self.family {
            let out = self.out.as_deref();
            let family = family::Family {
                count,
                seed: self.seed,
                is_widened: self.widened,
                has_baselines: self.baselines,
            };
            return family::run(&choice, &family, &courses, out, self.json);
        }
        // the virtual crane differs in all its equipment: `hydroboom show` lists that
        let (changes, more) = match choice.is_virtual() {
            true => (Vec::new(), 0),
            false => choice.most_important(),
        };
        let bar = ProgressBar::new((courses.len() + changes.len()) as u64);
        let effects = changes
            .iter()
            .map(|difference| {
                bar.inc(1);
                effect(model, difference).into_diagnostic()
            })
            .collect::<Result<Vec<_>>>()?;
        let mut runs = Vec::new();
        for course in &courses {
            let course = course.of(plant).into_diagnostic()?;
            runs.extend(run_all(model, plant, course.as_ref()).into_diagnostic()?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        let loops = stability_of(&Strategy::ALL, model, plant).into_diagnostic()?;
        let expected = stable_with_expected_lags(model, &loops).into_diagnostic()?;
        let rows: Vec<Row> = runs
            .iter()
            .map(|run| Row::of(&name, run).with_loops(&loops))
            .map(|row| if is_papers_crane { row } else { row.without_paper() })
            .collect();
        // Table 6: the published model along the last course, which is the fast motion or a scenario
        let velocity_feedforward =
            runs.iter().rfind(|run| run.strategy == Strategy::VelocityFeedforward);
        let mut alongside = None;
        if choice.is_virtual()
            && let Some(course) = courses.last()
        {
            let course = course.of(plant).into_diagnostic()?;
            let published = model.without_equipment();
            let simulated = run(model, &published, Strategy::VelocityFeedforward, course.as_ref());
            alongside = Some(simulated.into_diagnostic()?);
        }
        // the paper's differences apply to the paper's crane only
        let table_6 = alongside
            .as_ref()
            .zip(velocity_feedforward)
            .filter(|_| choice.source == Source::Embedded)
            .map(|(simulated, crane)| signals(&differences(simulated, crane)));
        if let Some(folder) = &self.out {
            let plant = match choice.source {
                Source::Embedded => "virtual crane".to_string(),
                Source::CraneFile => name.clone(),
                Source::MachineFile | Source::Udp | Source::EtherCat | Source::Model => {
                    format!("plant \"{name}\"")
                }
            };
            let unstable = loops.iter().filter(|of| !of.stable).map(ToString::to_string);
            let remarks: Vec<String> = choice
                .equality()
                .map(String::from)
                .into_iter()
                .chain(gains.clone())
                .chain(unstable)
                .chain(remark_on_expected_lags(&expected))
                .collect();
            let page = report::motion_page(&report::MotionTests {
                crane: &model.name,
                plant: &plant,
                runs: &runs,
                alongside: alongside.as_ref(),
                is_papers_crane,
                loops: &loops,
                remark: (!remarks.is_empty()).then(|| remarks.join(". ")).as_deref(),
            });
            output::page_in_folder(folder, "motion", &page.into_diagnostic()?, None);
        }
        if let Some(folder) = &self.log {
            output::folder(folder);
            runs.iter().for_each(|run| write_log(folder, &name, run));
        }
        if self.json {
            return output::json(&json!({
                "motion": rows, "plant_changes": effects, "differences": table_6, "plant": choice.json(),
                "stable": rows.iter().all(|row| row.stable) && loops.iter().all(|one| one.stable),
                "loops": loops, "stable_with_expected_lags": expected, "benchmark_gains": Gains::of(model), "remark_on_gains": gains,
            }));
        }
        let mut said = String::new();
        if let Some(signals) = &table_6 {
            let count = model.differences(plant).len();
            let cells: Vec<Vec<String>> = signals.iter().map(Signal::cells).collect();
            let header = ["signal", "unit", "RMS paper", "RMS here", "peak paper", "peak here"];
            said = format!(
                "The plant is the virtual crane. It differs from the model in {count} keys \
                 (hydroboom show --crane cranes/uia-virtual.toml)\n\
                 Table 6: crane less published model as measured, both under velocity feedforward along {}; \
                 the paper measured a real crane\n{}\n\n",
                velocity_feedforward.map_or("", |run| &run.course),
                output::table(&header, &cells)
            );
        }
        if !effects.is_empty() {
            let cells: Vec<Vec<String>> = effects.iter().map(Effect::cells).collect();
            let header = [
                "changed key",
                "model",
                "plant",
                "unit",
                "velocity-FF RMS true [mm]",
                "p_A RMS [bar]",
                "eigenfrequency [Hz]",
            ];
            said = format!(
                "What each change does by itself, at the fast speed (model -> plant)\n{}\n\n",
                output::table(&header, &cells)
            );
        }
        if more > 0 {
            said =
                format!("{}\nand {more} more differences: --json lists them\n\n", said.trim_end());
        }
        if let Some(equality) = choice.equality() {
            said += &format!("{}: {equality}\n", choice.name());
        }
        if let Some(remark) = &gains {
            said += &format!("{remark}\n");
        }
        let mut unstable: String =
            loops.iter().filter(|of| !of.stable).map(|of| format!("\n{of}")).collect();
        if let Some(remark) = remark_on_expected_lags(&expected) {
            unstable += &format!("\n{remark}");
        }
        if loops.iter().any(|of| !of.stable) && rows.iter().all(|row| row.stable) {
            unstable += "\nNo run above was in sustained oscillation while its reference rested, where friction may hold the piston: look at the motor's speed in motion (--log).";
        }
        output::text(&format!("{said}{}{unstable}", table(&rows)))
    }

    /// Range of the payloads \[kg\] in the comparison: of the model, of the plant, and of load changes; for
    /// a family that of the crane file.
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

    /// Machine choice and its name in tables.
    fn choice(&self) -> Result<(MachineChoice, String)> {
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
        let (name, content) = (path.display().to_string(), text(path)?);
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

/// Row of Table 6.
#[derive(Serialize)]
struct Signal {
    signal: &'static str,
    unit: &'static str,
    paper_rms: f64,
    rms: f64,
    paper_peak: f64,
    peak: f64,
}

impl Signal {
    fn cells(&self) -> Vec<String> {
        let number = |v: f64| format!("{v:.3}");
        let [a, b, c, d] = [self.paper_rms, self.rms, self.paper_peak, self.peak].map(number);
        vec![self.signal.into(), self.unit.into(), a, b, c, d]
    }
}

fn signals(seen: &[(f64, f64); 6]) -> Vec<Signal> {
    paper::TABLE_6
        .iter()
        .zip(seen)
        .map(|((signal, unit, paper_peak, paper_rms), (rms, peak))| Signal {
            signal,
            unit,
            paper_rms: *paper_rms,
            rms: *rms,
            paper_peak: *paper_peak,
            peak: *peak,
        })
        .collect()
}

/// Effect of one changed key.
#[derive(Serialize)]
struct Effect {
    key: String,
    model: String,
    plant: String,
    unit: String,
    /// RMS true error under velocity feedforward, of the model and of the changed plant.
    velocity_feedforward_rms_true_mm: [f64; 2],
    /// RMS difference of p_A between both.
    pressure_a_rms_bar: f64,
    /// Locked-valve eigenfrequency without friction at mid-stroke of both.
    eigenfrequency_hz: [f64; 2],
}

impl Effect {
    fn cells(&self) -> Vec<String> {
        let [rms, changed_rms] = self.velocity_feedforward_rms_true_mm;
        let [f, changed_f] = self.eigenfrequency_hz;
        vec![
            self.key.clone(),
            self.model.clone(),
            self.plant.clone(),
            self.unit.clone(),
            format!("{rms:.3} -> {changed_rms:.3}"),
            format!("{:.3}", self.pressure_a_rms_bar),
            format!("{f:.3} -> {changed_f:.3}"),
        ]
    }
}

/// Changes one key of the plant and computes the effect.
fn effect(model: &Description, difference: &Difference) -> Result<Effect, LabError> {
    let mut plant = model.clone();
    plant.set(&difference.assignment())?;
    let course = model.motion(model.numbers.fast);
    let drive = |plant| run(model, plant, Strategy::VelocityFeedforward, &course);
    let (before, after) = (drive(model)?, drive(&plant)?);
    let pairs = before.samples.iter().zip(&after.samples);
    let square: f64 =
        pairs.map(|(a, b)| (a.truth.outputs.pressure_a - b.truth.outputs.pressure_a).powi(2)).sum();
    let frequency = |description: &Description| -> Result<f64, LabError> {
        let frictionless = without_friction(description)?;
        Ok(locked_mode(&frictionless, 0.5 * description.numbers.stroke)?.frequency_hz)
    };
    Ok(Effect {
        key: difference.key.clone(),
        model: difference.here.clone(),
        plant: difference.there.clone(),
        unit: difference.unit.into(),
        velocity_feedforward_rms_true_mm: [&before, &after]
            .map(|run| run.metrics().true_rms() * 1e3),
        pressure_a_rms_bar: (square / before.samples.len().max(1) as f64).sqrt() * 1e-5,
        eigenfrequency_hz: [frequency(model)?, frequency(&plant)?],
    })
}

/// Writes a run into a folder, named by plant, course and strategy.
pub fn write_log(folder: &Path, plant: &str, run: &hydroboom_lab::motion_test::Run) {
    let plain = |text: &str| {
        let words = text.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty());
        words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("-")
    };
    let name = format!("{}-{}-{}.csv", plain(plant), plain(&run.course), run.strategy.name());
    let path = folder.join(name);
    output::written(&path, hydroboom_lab::run_log::write_run(run, &path));
}

/// Error of a run; a note instead if the run oscillates or stopped.
fn here(row: &Row, mm: f64) -> String {
    match (&row.stopped, row.stable) {
        (Some(_), _) => "stopped".into(),
        (None, true) => format!("{mm:.3}"),
        (None, false) => "unstable".into(),
    }
}

/// Effort of a run; a dash if it stopped.
fn spent(value: f64, digits: usize) -> String {
    output::optional(value.is_finite().then_some(value), digits)
}

/// Row without the omitted columns.
fn kept<T: Clone>(row: &[T], left_out: &[usize]) -> Vec<T> {
    let kept = row.iter().enumerate().filter(|(column, _)| !left_out.contains(column));
    kept.map(|(_, cell)| cell.clone()).collect()
}

/// Tables 7 to 9, "paper | here", with remarks on oscillating runs.
pub fn table(rows: &[Row]) -> String {
    let is_ideal = |row: &Row| row.stopped.is_some() || row.error.is_measured_truly();
    let (ideal, mixed) = (rows.iter().all(is_ideal), rows.iter().any(is_ideal));
    let beside_paper = rows.iter().any(|row| row.paper_rms_mm.is_some());
    // columns without information are omitted
    let left_out: &[usize] = match (ideal, beside_paper) {
        (true, true) => &[5, 8],
        (true, false) => &[3, 5, 6, 8],
        (false, true) => &[],
        (false, false) => &[3, 6],
    };
    let sensors = match (ideal, mixed) {
        (true, _) => format!("\n{IDEAL_SENSORS}"),
        (false, true) => "\n=: sensors are ideal there, the measured error is the true one.".into(),
        (false, false) => String::new(),
    };
    let measured = |row: &Row, mm: f64| {
        if row.stopped.is_none() && is_ideal(row) { "=".into() } else { here(row, mm) }
    };
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|r| {
            kept(
                &[
                    r.marked_name(),
                    r.plant.clone(),
                    r.course.clone(),
                    output::optional(r.paper_rms_mm, 2),
                    here(r, r.error.rms_true_mm),
                    measured(r, r.error.rms_measured_mm),
                    output::optional(r.paper_peak_mm, 2),
                    here(r, r.error.peak_true_mm),
                    measured(r, r.error.peak_measured_mm),
                    spent(r.effort.residual_vibration_mm, 3),
                    spent(r.effort.energy_kj, 2),
                    spent(r.effort.motor_speed_rpm, 0),
                ],
                left_out,
            )
        })
        .collect();
    let [rms_true, rms_measured, peak_true, peak_measured] = TrackingError::HEADS;
    let header = [
        "strategy",
        "plant",
        "course",
        "RMS paper [mm]",
        rms_true,
        rms_measured,
        "peak paper [mm]",
        peak_true,
        peak_measured,
        "tip rings [mm]",
        "motor energy [kJ]",
        "motor [rpm]",
    ];
    let mark = remark_on_mark(rows).map(str::to_string);
    let remarks: String =
        mark.iter().chain(&instability_remarks(rows)).map(|remark| format!("\n{remark}")).collect();
    let title = match beside_paper {
        true => "Tables 7 to 9: tracking error x - x_ref [mm]; the paper measured a real crane.",
        false => "Tracking error x - x_ref [mm].",
    };
    format!(
        "{title} The scheduled LQR is ours, and looks\n\
         0.4 s along the path.\n\
         Beside it the RMS of the tip's vibration at rest, the motor energy and the largest motor speed.\n{MOTOR_ENERGY}\n{}{sensors}{remarks}",
        output::table(&kept(&header, left_out), &cells)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_lab::closed_loop::metrics::Effort;

    fn row(rms_measured_mm: f64, paper_rms_mm: Option<f64>) -> Row {
        let error = TrackingError {
            rms_true_mm: 0.5,
            rms_measured_mm,
            peak_true_mm: 1.5,
            peak_measured_mm: 1.5,
        };
        Row {
            plant: NOMINAL.into(),
            strategy: Strategy::BenchmarkClosedLoop,
            course: "120 mm/s".into(),
            speed_mm_s: 120.0,
            stable: true,
            has_stable_loops: true,
            stopped: None,
            sustained_oscillation: None,
            error,
            effort: Effort::default(),
            paper_rms_mm,
            paper_peak_mm: paper_rms_mm,
        }
    }

    #[test]
    fn equal_true_and_measured_errors_are_printed_once() {
        let ideal = table(&[row(0.5, Some(0.42))]);
        assert!(ideal.contains("RMS true [mm]") && !ideal.contains("measured [mm]"), "{ideal}");
        assert!(ideal.contains(IDEAL_SENSORS), "{ideal}");
        let mixed = table(&[row(0.5, Some(0.42)), row(0.625, Some(0.42))]);
        assert!(mixed.contains("RMS measured [mm]") && mixed.contains("0.625"), "{mixed}");
        assert_eq!(
            (mixed.matches("0.500").count(), mixed.matches("=:").count()),
            (2, 1),
            "{mixed}"
        );
    }

    /// The row itself is marked, besides the remark below the table.
    #[test]
    fn a_row_of_an_unstable_loop_is_marked() {
        let swings = Row { has_stable_loops: false, ..row(0.5, None) };
        let text = table(&[row(0.5, None), swings]);
        let marked = |line: &str| line.starts_with("benchmark-closed-loop (!)");
        assert_eq!(text.lines().filter(|line| marked(line)).count(), 1, "{text}");
        assert!(text.contains("(!): its closed loop is unstable"), "{text}");
        assert!(!table(&[row(0.5, None)]).contains("(!)"));
    }

    /// The head of each error column says whether the error is true or measured.
    #[test]
    fn heads_of_error_columns_say_true_or_measured() {
        let text = table(&[row(0.625, None)]);
        let header = text.lines().find(|line| line.starts_with("strategy")).unwrap();
        for head in TrackingError::HEADS {
            assert!(header.contains(head), "{head}: {header}");
        }
        let of = |head: &str| header.find(head).unwrap();
        let line = text.lines().find(|line| line.starts_with("benchmark-closed-loop")).unwrap();
        let ends = |head: &str| line[..of(head) + head.len()].trim_end().to_string();
        assert!(ends("RMS true [mm]").ends_with("0.500"), "{text}");
        assert!(ends("RMS measured [mm]").ends_with("0.625"), "{text}");
    }

    #[test]
    fn columns_of_the_paper_without_numbers_are_left_out() {
        let other = table(&[row(0.5, None)]);
        assert!(!other.contains("RMS paper") && !other.contains("peak paper"), "{other}");
        let header = other.lines().find(|line| line.starts_with("strategy")).unwrap();
        assert!(header.contains("peak true [mm]"), "{header}");
    }
}
