//! Execution time of a control period under each baseline and the scheduled LQR on this computer, as
//! Markdown: `period_times [RUNS]`.
//!
//! Two motions of 100 mm at the fast speed on the paper's virtual crane. With the crane file's ramps no
//! limit is active; with ramps of 50 ms the motor's limits are. Each period counts with its minimum over
//! RUNS runs, because other programs use the computer too.

use hydroboom_control::reference::profile::OutAndBack;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::LabError;
use hydroboom_lab::baselines::Baseline;
use hydroboom_lab::closed_loop::controller_choice::ControllerChoice;
use hydroboom_lab::closed_loop::period_time::period_times;

fn main() -> Result<(), LabError> {
    let runs = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(5);
    let (model, crane) = (Description::uia_single_boom()?, Description::uia_virtual()?);
    let mut controllers: Vec<ControllerChoice> =
        vec![Strategy::BenchmarkClosedLoop.into(), Strategy::ScheduledLqr.into()];
    controllers.extend(Baseline::all(&model)?.map(ControllerChoice::Baseline));
    let motion = model.motion(model.numbers.fast);
    let short = OutAndBack { end: motion.start + 0.1, dwell: 0.5, rest: 0.5, ..motion };
    println!("| controller | ramps | median, us | 99.9 %, us |\n|---|---|---|---|");
    for ramp in [motion.ramp, 0.05] {
        let course = OutAndBack { ramp, ..short };
        for time in period_times(&model, &crane, &controllers, &course, runs)? {
            println!(
                "| `{}` | {:.0} ms | {:.1} | {:.1} |",
                time.controller.name(),
                1e3 * ramp,
                time.median_us,
                time.percentile_99_9_us
            );
        }
    }
    Ok(())
}
