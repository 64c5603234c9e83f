//! Open data set: logs of virtual cranes for identification and control, with the true values in separate
//! files.

use crate::LabError;
use crate::closed_loop::monte_carlo::worn;
use crate::closed_loop::scenario::{Course, scenarios};
use crate::paper;
use crate::virtual_run::{Contents, LogOrder, Task, virtual_run};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_control::reference::trajectory::Trajectory as _;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_files::Folder;
use hydroboom_model::Outputs;
use hydroboom_virtual_crane::Truth;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// Sampling interval of the logs \[s\].
const INTERVAL: f64 = 5e-3;

/// Writes the data set into a folder that must not exist yet: measured signals in `readings`, true values in `truth`,
/// every 5 ms. Returns the files; `progress` receives the share done.
///
/// # Errors
///
/// - [`LabError::File`] if the folder exists already or cannot be created;
/// - [`LabError::Files`] if a file cannot be written;
/// - [`LabError::Description`] if the worn crane cannot exist;
/// - the errors of [`virtual_run`] if a crane cannot be simulated.
///
/// No partial data set is left in the folder.
pub fn dataset(
    model: &Description,
    crane: &Description,
    folder: &Path,
    mut progress: impl FnMut(f64),
) -> Result<Vec<PathBuf>, LabError> {
    // written to a temporary folder first, so that the data set is complete or absent
    let failed = |path: &Path| {
        let path = path.display().to_string();
        move |error| LabError::File { path, error }
    };
    if folder.exists() {
        let error = std::io::Error::from(std::io::ErrorKind::AlreadyExists);
        return Err(failed(folder)(error));
    }
    let beside = Folder::begin(folder)?;
    let partial = beside.path();
    for kind in ["readings", "truth"] {
        let path = partial.join(kind);
        fs::create_dir_all(&path).map_err(failed(&path))?;
    }

    let cranes = [("healthy", crane.clone()), ("worn", worn(crane)?)];
    let mut done = Vec::new();
    let count = (cranes.len() * tests(crane).len()) as f64;
    for (condition, crane) in &cranes {
        for test in tests(crane) {
            let name = format!("{condition}-{}", test.name);
            let paths: Vec<PathBuf> = ["readings", "truth"]
                .into_iter()
                .flat_map(|kind| ["csv", "mat"].map(|e| format!("{kind}/{name}.{e}").into()))
                .collect();
            let whole: Vec<PathBuf> = paths.iter().map(|path| partial.join(path)).collect();
            let orders: Vec<LogOrder<'_>> = whole
                .iter()
                .enumerate()
                .map(|(k, path)| LogOrder {
                    path,
                    contents: if k < 2 { Contents::Readings } else { Contents::TruthAlone },
                    estimates: false,
                    interval: INTERVAL,
                })
                .collect();
            let (_, lost) = virtual_run(model, crane, &test.task(), &orders, |_| {})?;
            if let Some(error) = lost.into_iter().next() {
                return Err(error.into());
            }
            done.extend(paths);
            progress(done.len() as f64 / 4.0 / count);
        }
    }
    let readme = partial.join("README.md");
    hydroboom_files::write(&readme, read_me(crane).as_bytes())?;
    done.push("README.md".into());
    beside.finish()?;
    Ok(done)
}

/// One run of the data set.
struct Test {
    name: String,
    meaning: String,
    kind: Kind,
}

enum Kind {
    Course(Box<dyn Course>, Strategy),
    Oscillation(f64, f64),
}

impl Test {
    fn task(&self) -> Task<'_> {
        match &self.kind {
            Kind::Course(course, strategy) => Task::Course(course.as_ref(), *strategy),
            Kind::Oscillation(stroke, drop) => Task::Oscillation { stroke: *stroke, drop: *drop },
        }
    }
}

fn tests(crane: &Description) -> Vec<Test> {
    let n = &crane.numbers;
    let mut tests = Vec::new();
    for speed in [n.slow, n.fast] {
        for strategy in [Strategy::VelocityFeedforward, Strategy::BenchmarkClosedLoop] {
            tests.push(Test {
                name: format!("motion-{:.0}-{}", speed * 1e3, strategy.name()),
                meaning: format!(
                    "out, dwell and back at {:.0} mm/s under {}",
                    speed * 1e3,
                    strategy.name()
                ),
                kind: Kind::Course(Box::new(crane.motion(speed)), strategy),
            });
        }
    }
    for stroke in paper::EIGEN_STROKE_MM {
        tests.push(Test {
            name: format!("oscillation-{stroke:.0}"),
            meaning: format!("load held, the boom dropped onto its cylinder at {stroke:.0} mm"),
            kind: Kind::Oscillation(stroke * 1e-3, n.oscillation_drop),
        });
    }
    // the scenario of a whole shift is a hundred times as long as all others together
    for scenario in scenarios(crane).into_iter().filter(|s| s.duration() < 600.0) {
        tests.push(Test {
            name: format!("scenario-{}", scenario.name),
            meaning: format!("{}, under the benchmark controller", scenario.meaning),
            kind: Kind::Course(Box::new(scenario), Strategy::BenchmarkClosedLoop),
        });
    }
    tests
}

fn read_me(crane: &Description) -> String {
    let mut text = format!(
        "# Logs of a virtual crane\n\n\
         Simulated with Hydroboom on \"{}\"; nothing here is a measurement. `readings/` holds what a \
         data acquisition would see, with noise, resolution and delay of sensors and fieldbus, \
         `truth/` the same runs without them and the hidden states. Each run is there as CSV and as \
         MAT (level 4, a variable for each column), a row every {:.0} ms. The worn crane leaks three \
         times as much, with a third more friction and more air in its oil.\n\n\
         | run (healthy- and worn-) | what happens |\n|---|---|\n",
        crane.name,
        INTERVAL * 1e3
    );
    for test in tests(crane) {
        let _ = writeln!(text, "| {} | {} |", test.name, test.meaning);
    }
    text += "\nColumns of the readings: time_s; where there is a reference, reference_position_mm and \
             reference_velocity_mm_s; then\n\n";
    text += &meanings(&AxisCommand::NAMES, &AxisCommand::MEANINGS, "command_");
    text += &meanings(&AxisSignals::NAMES, &AxisSignals::MEANINGS, "");
    text += "\nColumns of the truth, beside time_s:\n\n";
    text += &meanings(&Outputs::NAMES, &Outputs::MEANINGS, "true_");
    text += &meanings(&Truth::NAMES, &Truth::MEANINGS, "true_");
    text += "\nThe ending of a column is its unit: mm, mm_s (mm/s), bar, rpm, l, n (N), nm (N m), \
             c (degrees Celsius), w (W).\n";
    text
}

fn meanings(names: &[&str], meanings: &[&str], prefix: &str) -> String {
    names.iter().zip(meanings).fold(String::new(), |mut text, (name, meaning)| {
        let _ = writeln!(text, "- `{prefix}{name}...`: {}", meaning.trim());
        text
    })
}
