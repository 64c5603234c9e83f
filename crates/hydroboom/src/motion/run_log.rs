//! Time series of a run in a file.

use crate::output;
use hydroboom_lab::motion_test::Run;
use hydroboom_lab::run_log::write_run;
use std::path::Path;

/// Writes the time series of a run (CSV, a row every control period) into a folder. The file is named by plant, course
/// and strategy.
pub fn write_run_log(folder: &Path, plant: &str, run: &Run) {
    let plain = |text: &str| {
        let words = text.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty());
        words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("-")
    };
    let name = format!("{}-{}-{}.csv", plain(plant), plain(&run.course), run.strategy.name());
    let path = folder.join(name);
    output::written(&path, write_run(run, &path));
}
