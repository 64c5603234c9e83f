//! `hydroboom bounds`

use crate::benchmark_gains;
use crate::crane_file::CraneFile;
use crate::interruptible::Interruptible;
use crate::machine_choice::MachineChoice;
use crate::number::{SPEED, speed_of_motion, within};
use crate::output;
use crate::paths::{InputFile, OutputFolder};
use clap::Args;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::{Description, RangeSource};
use hydroboom_design::benchmark_design::payload_range;
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::performance_bounds::{
    BOUND_PARTS, Condition, PerformanceBounds, StrategyError, performance_bounds, strategy_errors,
};
use hydroboom_lab::report;
use miette::{IntoDiagnostic, Result, bail, miette};
use serde_json::json;

/// Compute lower bounds of the tracking error along a course, the cost of each limit, and the errors of the strategies.
///
/// Limits are motor speed, motor slew rate, delay (sensors, fieldbus, control period), sensor noise, and a payload
/// that is unknown when the motion begins. The bound is computed for each limit alone, and for all others without it.
/// All errors are true RMS errors of the piston over the whole motion, rests included.
/// docs/reference/performance-bounds.md has the equations, and states which results are bounds and which are estimates.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom bounds --out bounds\n  hydroboom bounds --crane my-crane.toml --speed-mm-s 60\n  \
    hydroboom bounds --payload-kg 300:340 --scenario start-stop\n\nThe virtual crane of the crane file is assessed: drive, sensors and fieldbus that its file leaves out are typical ones."
)]
pub struct Bounds {
    #[command(flatten)]
    crane: CraneFile,
    /// Crane file of the plant, or a file with a `[set]` table of overrides of the virtual crane. Default: the virtual
    /// crane of the crane file, without --crane the paper's.
    #[arg(long, value_name = "FILE")]
    plant: Option<InputFile>,
    /// Speed of the motion out and back. Default: the crane file's fast speed.
    #[arg(long, visible_alias = "mm-s", value_name = "MM/S", allow_negative_numbers = true, value_parser = within(SPEED, "mm/s"))]
    speed_mm_s: Option<f64>,
    /// Scenario in place of the motion, of up to 300 s: payload-change, start-stop, small-moves, reversal, saturation,
    /// load-in-motion.
    #[arg(long, value_name = "NAME", conflicts_with = "speed_mm_s")]
    scenario: Option<String>,
    /// Range of the payload that is unknown to the controller before the motion begins. Default: the plant's range of
    /// payload.mass_kg, which it must not exceed. A range of zero width is a known payload.
    #[arg(long, value_name = "LOW:HIGH", allow_hyphen_values = true, value_parser = benchmark_gains::payloads)]
    payload_kg: Option<[f64; 2]>,
    /// Use the benchmark gains of the crane file. By default, gains of `hydroboom design --benchmark` replace the
    /// placeholders of a new file, and the paper's gains on another crane for which they are not tuned.
    #[arg(long)]
    gains_as_given: bool,
    /// Folder for bounds.html, with its figure as SVG and CSV.
    #[arg(long, value_name = "DIR")]
    out: Option<OutputFolder>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Bounds {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, the payload range does not suit the plant, a bound cannot be computed, or the command was
    /// interrupted before.
    pub fn run(self) -> Result<()> {
        let choice = MachineChoice::read_plant(&self.crane, self.plant.as_deref())?;
        let along = match &self.scenario {
            Some(name) => CourseChoice::Scenario(name.clone()),
            None => CourseChoice::Motion(speed_of_motion(&choice.machine, self.speed_mm_s)?),
        };
        let own = choice.machine.numbers.payload;
        let payloads = self.payload_kg.unwrap_or_else(|| payload_range(&choice.machine));
        if let Some(reason) = beyond_range(&choice.machine, payloads) {
            return Err(miette!(
                help = "stay within, or widen `range` of payload.mass_kg in the plant's crane file",
                "{reason}"
            ));
        }
        if !(payloads[0] - 0.5..=payloads[1] + 0.5).contains(&own) {
            let change = match &self.plant {
                Some(path) => format!("another payload.mass_kg in {}", path.display()),
                None => "another payload by --crane FILE --set payload.mass_kg=KG".into(),
            };
            return Err(miette!(
                help = format!("take a range that has it, or {change}"),
                "the plant's payload is {own:.1} kg, and --payload-kg goes from {} to {} kg",
                payloads[0],
                payloads[1]
            ));
        }
        let (choice, gains) = match self.gains_as_given {
            true => (choice, None),
            false => benchmark_gains::for_comparison(choice, [own; 2])?,
        };
        gains.iter().for_each(|remark| output::warn(remark));
        let (model, machine) = (&choice.model, &choice.machine);
        let course = along.of(machine).into_diagnostic()?;
        let parts = BOUND_PARTS + Strategy::ALL.len();
        let work = Interruptible::new(parts as u64, "parts")?;
        let share = |done: usize| work.done(done as f64 / parts as f64);
        let bounds =
            performance_bounds(machine, course.as_ref(), payloads, &share).into_diagnostic()?;
        let Some(bounds) = bounds else {
            bail!("it was interrupted before the bounds were computed");
        };
        let go_on = |done: usize| share(BOUND_PARTS + done);
        let strategies = strategy_errors(model, machine, &along, bounds.all_mm, &go_on);
        let strategies = strategies.into_diagnostic()?;
        drop(work);
        if let Some(folder) = &self.out {
            let page = report::bounds_page(&choice.name(), &bounds, &strategies);
            output::page_in_folder(folder, "bounds", &page.into_diagnostic()?, None);
        }
        if self.json {
            return output::json(&json!({
                "bounds": bounds, "strategies": strategies, "plant": choice.json(),
                "remark_on_gains": gains,
            }));
        }
        output::text(&bounds_text(&choice, &bounds, &strategies))
    }
}

/// Reason to refuse payloads \[kg\] beyond the plant's range; none for payloads within it, or without a range.
fn beyond_range(machine: &Description, payloads: [f64; 2]) -> Option<String> {
    let range = machine.range("payload.mass_kg")?;
    let is_within = range.low <= payloads[0] && payloads[1] <= range.high;
    let source = match range.source {
        RangeSource::Value => return None,
        RangeSource::File => "of its crane file",
        RangeSource::Default => "by default, for its crane file states none",
    };
    (!is_within).then(|| {
        format!(
            "--payload-kg goes from {} to {} kg, beyond the plant's range of payload.mass_kg, {} to {} kg {source}",
            payloads[0],
            payloads[1],
            output::short(range.low),
            output::short(range.high)
        )
    })
}

/// Error \[mm\] with three digits; zero below a millionth of a millimetre.
fn millimetres(mm: f64) -> String {
    if mm < 1e-6 { "0".into() } else { output::three_digits(mm) }
}

/// Course as part of a sentence.
fn course_name(course: &str) -> String {
    match course.ends_with("mm/s") {
        true => format!("its motion out and back at {course}"),
        false => format!("the scenario {course}"),
    }
}

/// Rows of the least tracking errors \[mm\]: each limit alone, all others without it, and all of them.
fn limit_rows(bounds: &PerformanceBounds) -> Vec<Vec<String>> {
    let mut rows =
        vec![vec!["none".into(), millimetres(bounds.none_mm), String::new(), "exact".into()]];
    rows.extend(bounds.limits.iter().map(|cost| {
        vec![
            cost.limit.name().into(),
            millimetres(cost.alone_mm),
            millimetres(cost.all_others_mm),
            match cost.limit.is_of_motor() {
                true => "bound [1]".into(),
                false => "bound [2]".into(),
            },
        ]
    }));
    rows.extend(
        [
            ("all", bounds.all_mm, "bound [1] [2]"),
            ("all, not known ahead", bounds.not_known_ahead_mm, "estimate [4]"),
            ("feedforward alone", bounds.feedforward_mm, "estimate [3]"),
        ]
        .map(|(name, mm, kind)| vec![name.into(), millimetres(mm), String::new(), kind.into()]),
    );
    rows
}

/// Table of the strategies' errors \[mm\], with a column of remarks if there are any.
fn strategy_table(strategies: &[StrategyError]) -> String {
    let headings = ["strategy", "RMS true [mm]", "over the bound", "remark"];
    let has_remarks = strategies.iter().any(|s| s.remark.is_some());
    let columns = if has_remarks { headings.len() } else { headings.len() - 1 };
    let rows: Vec<Vec<String>> = strategies
        .iter()
        .map(|s| {
            let optional = |value: Option<f64>| value.map_or("-".into(), output::three_digits);
            let remark = s.remark.clone().unwrap_or_default();
            let mut row = vec![
                s.strategy.name().into(),
                optional(s.rms_true_mm),
                optional(s.over_bound),
                remark,
            ];
            row.truncate(columns);
            row
        })
        .collect();
    output::table(&headings[..columns], &rows)
}

/// Bounds by limit, the strategies' errors beside them, and the conditions.
fn bounds_text(
    choice: &MachineChoice,
    bounds: &PerformanceBounds,
    strategies: &[StrategyError],
) -> String {
    let [before, begun, ended] = bounds.payload_deviation_kg;
    let condition = |c: &Condition| {
        vec![c.name.into(), output::short(c.value), c.unit.into(), c.source.clone()]
    };
    let conditions: Vec<Vec<String>> = bounds.conditions.iter().map(condition).collect();
    let of_loads = match bounds.load_changes {
        0 => "",
        _ => {
            "; load changes are linearised about the new load: where oil stiffens with pressure, an estimate for small changes only, too high or too low for others"
        }
    };
    let interrupted = match Strategy::ALL.len() - strategies.len() {
        0 => String::new(),
        count => format!("\n{count} strategies had not been run when it was interrupted"),
    };
    format!(
        "Least possible tracking error of \"{}\" along {}: RMS true [mm], rests included\n{}\n\
         [1] for the crane linearised along the reference, model and reference known; duality gap {} %\n\
         [2] for any linear causal controller, if disturbances drift as below: that they do is an estimate\n\
         [3] no position feedback, the motor's limits not counted; payload estimated on the way: std {} kg before, {} kg when the motion begins, {} kg at the end\n\
         [4] reference and load changes not known ahead: the piston is on its reference whenever one changes, and what follows is known until the next{of_loads}\n\n\
         Strategies on it\n{}{interrupted}\n\n\
         Conditions\n{}",
        choice.name(),
        course_name(&bounds.course),
        output::table(&["limit", "this alone", "all but this", "kind"], &limit_rows(bounds)),
        output::three_digits(bounds.motor_gap_percent),
        output::three_digits(before),
        output::three_digits(begun),
        output::three_digits(ended),
        strategy_table(strategies),
        output::table(&["number", "value", "unit", "source"], &conditions),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{CommandFactory, Parser};
    use hydroboom_control::reference::trajectory::Trajectory;
    use hydroboom_lab::closed_loop::scenario::scenarios;
    use hydroboom_lab::performance_bounds::LONGEST_COURSE;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        _bounds: Bounds,
    }

    #[test]
    fn the_help_lists_the_scenarios_that_have_bounds() {
        let command = Command::command();
        let scenario = command.get_arguments().find(|argument| argument.get_id() == "scenario");
        let help = scenario.unwrap().get_help().unwrap().to_string();
        for scenario in scenarios(&Description::uia_virtual().unwrap()) {
            let has_bounds = scenario.duration() <= LONGEST_COURSE;
            assert_eq!(help.contains(scenario.name), has_bounds, "{}: {help}", scenario.name);
        }
    }

    #[test]
    fn payloads_beyond_the_plants_range_are_refused() {
        let mut crane = Description::uia_virtual().unwrap();
        assert_eq!(beyond_range(&crane, [0.0, 382.0]), None);
        assert_eq!(beyond_range(&crane, payload_range(&crane)), None);
        let message = beyond_range(&crane, [0.0, 99_999.0]).unwrap();
        assert!(
            message.contains("0 to 99999 kg") && message.contains("0 to 382 kg of its"),
            "{message}"
        );
        // a payload beyond the file's range extends it
        crane.set("payload.mass_kg=400").unwrap();
        assert_eq!(beyond_range(&crane, [0.0, 400.0]), None);
    }
}
