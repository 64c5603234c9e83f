//! Table of a controller's errors and effort over the benchmark's on the same cranes of a family.
//!
//! Rows are read from CSV files of the example `true_errors`. Columns that an older file lacks are omitted.

use crate::LabError;
use crate::closed_loop::monte_carlo::Percentiles;
use hydroboom_control::strategy::Strategy;
use std::collections::{BTreeMap, HashMap};
use std::fmt::Write;

/// Name of the benchmark controller in older files.
const BENCHMARK_BEFORE: &str = "benchmark";
/// Ratio of motor speed or energy to the benchmark's above which it counts as higher.
const MORE: f64 = 1.05;

/// Result of one crane along one course under one controller; unknown numbers are none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Outcome {
    true_rms_mm: Option<f64>,
    measured_rms_mm: Option<f64>,
    sustained_oscillation: bool,
    motor_speed_rpm: Option<f64>,
    energy_kj: Option<f64>,
    motor_ripple_rpm: Option<f64>,
    motor_slew_rpm_per_s: Option<f64>,
}

/// Course, seed and number of a crane.
type Place = (String, String, String);

/// Errors and effort of controllers on the cranes of a family, from one or more files.
#[derive(Clone, Debug, Default)]
pub struct ErrorTable {
    /// Results by controller, in the order of reading.
    controllers: Vec<(String, HashMap<Place, Outcome>)>,
    /// Courses in the order of reading.
    courses: Vec<String>,
    benchmark: HashMap<Place, Outcome>,
}

/// Controller along a course, compared with the benchmark controller.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    course: String,
    controller: String,
    /// Cranes with results of both.
    cranes: usize,
    true_rms: Option<Percentiles>,
    true_rms_mm: Option<Percentiles>,
    /// Number of cranes with a larger true RMS error, or a run that only the controller did not finish.
    worse: usize,
    oscillating: usize,
    /// Of the oscillating cranes those on which the benchmark controller does not oscillate.
    oscillating_alone: usize,
    measured_rms: Option<Percentiles>,
    motor_speed: Option<(Percentiles, usize)>,
    energy: Option<(Percentiles, usize)>,
    ripple_rpm: Option<Percentiles>,
    measured_rms_mm: Option<Percentiles>,
    slew_rpm_per_s: Option<Percentiles>,
    unfinished: usize,
}

impl ErrorTable {
    /// Adds the rows of a CSV file; `file` is its name in messages.
    ///
    /// # Errors
    ///
    /// [`LabError::Input`] with file, line and column if a row cannot be read or repeats a crane.
    pub fn read(&mut self, file: &str, content: impl std::io::Read) -> Result<(), LabError> {
        let failed = |reason: String| LabError::Input { file: file.into(), reason };
        let mut reader = csv::Reader::from_reader(content);
        let headings = reader.headers().map_err(|e| failed(e.to_string()))?.clone();
        let place = |name: &str| headings.iter().position(|heading| heading.trim() == name);
        let needed = |name: &str| {
            place(name).ok_or_else(|| {
                let there: Vec<&str> = headings.iter().collect();
                failed(format!("line 1 has no column {name}, but {}", there.join(", ")))
            })
        };
        let [course, seed, crane, controller] = ["course", "seed", "crane", "controller"];
        let keys = [needed(course)?, needed(seed)?, needed(crane)?, needed(controller)?];
        let oscillation = needed("sustained_oscillation")?;
        needed("true_rms_mm")?;
        for record in reader.records() {
            let record = record.map_err(|e| failed(e.to_string()))?;
            let line = record.position().map_or(0, csv::Position::line);
            let text = |k: usize| record.get(k).unwrap_or_default().trim();
            let number = |name: &str| match place(name).map(text) {
                None | Some("" | "NaN") => Ok(None),
                Some(read) => match read.parse::<f64>() {
                    Ok(value) if value.is_finite() => Ok(Some(value)),
                    _ => Err(failed(format!(
                        "line {line}, {name}: \"{read}\" is no number; where there is none, leave it empty"
                    ))),
                },
            };
            let outcome = Outcome {
                true_rms_mm: number("true_rms_mm")?,
                measured_rms_mm: number("measured_rms_mm")?,
                sustained_oscillation: match text(oscillation) {
                    "true" => true,
                    "false" => false,
                    read => {
                        return Err(failed(format!(
                            "line {line}, sustained_oscillation: \"{read}\" is neither true nor false"
                        )));
                    }
                },
                motor_speed_rpm: number("motor_speed_rpm")?,
                energy_kj: number("energy_kj")?,
                motor_ripple_rpm: number("motor_ripple_rpm")?,
                motor_slew_rpm_per_s: number("motor_slew_rpm_per_s")?,
            };
            let [course, seed, crane, controller] = keys.map(|k| text(k).to_string());
            if !self.courses.contains(&course) {
                self.courses.push(course.clone());
            }
            let of = self.of(&controller);
            let place = (course, seed, crane);
            if of.contains_key(&place) {
                let (course, seed, crane) = place;
                return Err(failed(format!(
                    "line {line}: crane {crane} of seed {seed} along {course} under {controller} was read before; \
                     give each run once"
                )));
            }
            of.insert(place, outcome);
        }
        Ok(())
    }

    /// Results of a controller, added if missing.
    fn of(&mut self, controller: &str) -> &mut HashMap<Place, Outcome> {
        if controller == BENCHMARK_BEFORE || controller == Strategy::BenchmarkClosedLoop.name() {
            return &mut self.benchmark;
        }
        let known = self.controllers.iter().position(|(name, _)| name == controller);
        let k = known.unwrap_or_else(|| {
            self.controllers.push((controller.into(), HashMap::new()));
            self.controllers.len() - 1
        });
        &mut self.controllers[k].1
    }

    fn rows(&self) -> Vec<Row> {
        let mut rows = Vec::new();
        // the benchmark comes first, compared with itself
        let benchmark = (Strategy::BenchmarkClosedLoop.name().to_string(), self.benchmark.clone());
        for course in &self.courses {
            for (controller, outcomes) in [&benchmark].into_iter().chain(&self.controllers) {
                // sorted, for a reproducible order
                let pairs: BTreeMap<&Place, (&Outcome, &Outcome)> = outcomes
                    .iter()
                    .filter(|((along, ..), _)| along == course)
                    .filter_map(|(place, own)| Some((place, (own, self.benchmark.get(place)?))))
                    .collect();
                if !pairs.is_empty() {
                    let pairs: Vec<_> = pairs.into_values().collect();
                    rows.push(row(course, controller, &pairs));
                }
            }
        }
        rows
    }

    /// Markdown table with a row per course and controller, relative to the benchmark; columns without data are
    /// omitted.
    ///
    /// # Errors
    ///
    /// [`LabError::Input`] if no crane has results of both the benchmark and another controller.
    pub fn markdown(&self) -> Result<String, LabError> {
        let rows = self.rows();
        if rows.iter().all(|row| row.controller == Strategy::BenchmarkClosedLoop.name()) {
            let reason = format!(
                "no crane was run under both {} and another controller, along the same course and with the same seed",
                Strategy::BenchmarkClosedLoop.name()
            );
            return Err(LabError::Input { file: "all files".into(), reason });
        }
        let mut table = String::from(
            "Ratios are over the benchmark's on the same crane, seed and course: median / 95th percentile / largest.\n\
             Percentiles are median-unbiased (Hyndman and Fan 1996, type 8).\n\n",
        );
        let columns: Vec<&Column> =
            COLUMNS.iter().filter(|(_, cell)| rows.iter().any(|row| cell(row).is_some())).collect();
        let headings: Vec<&str> = columns.iter().map(|(heading, _)| *heading).collect();
        let _ = writeln!(table, "| {} |\n|{}", headings.join(" | "), "---|".repeat(headings.len()));
        for row in &rows {
            let cells: Vec<String> =
                columns.iter().map(|(_, cell)| cell(row).unwrap_or_else(|| "-".into())).collect();
            let _ = writeln!(table, "| {} |", cells.join(" | "));
        }
        table += &self.beside_scheduled_lqr();
        Ok(table)
    }

    /// Table of ratios to the scheduled LQR on the same crane for all controllers but the benchmark. Empty
    /// if the scheduled LQR is missing or is the only controller.
    fn beside_scheduled_lqr(&self) -> String {
        let is_lqr = |name: &str| name == Strategy::ScheduledLqr.name();
        let Some((_, lqr)) = self.controllers.iter().find(|(name, _)| is_lqr(name)) else {
            return String::new();
        };
        let mut rows = String::new();
        for course in &self.courses {
            for (name, outcomes) in self.controllers.iter().filter(|(name, _)| !is_lqr(name)) {
                let along = |place: &Place| place.0 == *course;
                let ratios = |of: fn(&Outcome) -> Option<f64>| -> Vec<f64> {
                    let ratio = |(place, own): (&Place, &Outcome)| {
                        Some(of(own)? / of(lqr.get(place).filter(|_| along(place))?)?)
                    };
                    outcomes.iter().filter_map(ratio).collect()
                };
                let truth = ratios(|o| o.true_rms_mm);
                let less = truth.iter().filter(|ratio| **ratio < 1.0).count();
                let text = |all: Vec<f64>| match all.is_empty() {
                    true => "-".into(),
                    false => Percentiles::of(all).range_text(2),
                };
                let count = truth.len();
                if count > 0 {
                    let [measured, slew] =
                        [ratios(|o| o.measured_rms_mm), ratios(|o| o.motor_slew_rpm_per_s)]
                            .map(text);
                    let _ = writeln!(
                        rows,
                        "| {course} | {name} | {count} | {} | {less} | {measured} | {slew} |",
                        text(truth)
                    );
                }
            }
        }
        match rows.is_empty() {
            true => rows,
            false => format!(
                "\nOver the scheduled LQR's on the same crane, seed and course: median (least .. largest).\n\n\
                 | course | controller | cranes | RMS true | less on | RMS measured | motor slew |\n|---|---|---|---|---|---|---|\n{rows}"
            ),
        }
    }
}

/// Heading of a column, and its text for a row.
type Column = (&'static str, fn(&Row) -> Option<String>);

const COLUMNS: [Column; 14] = [
    ("course", |r| Some(r.course.clone())),
    ("controller", |r| Some(r.controller.clone())),
    ("cranes", |r| Some(r.cranes.to_string())),
    ("RMS true, ratio", |r| Some(three(&r.true_rms?))),
    ("RMS true, mm: median / largest", |r| Some(millimetres(&r.true_rms_mm?))),
    ("RMS measured, mm: median / largest", |r| Some(millimetres(&r.measured_rms_mm?))),
    ("worse than the benchmark", |r| Some(r.worse.to_string())),
    ("sustained oscillation (of these, not the benchmark)", |r| {
        Some(format!("{} ({})", r.oscillating, r.oscillating_alone))
    }),
    ("RMS measured, ratio", |r| Some(three(&r.measured_rms?))),
    ("motor speed ratio: median (number over 1.05)", |r| Some(more(r.motor_speed?))),
    ("energy ratio: median (number over 1.05)", |r| Some(more(r.energy?))),
    ("motor ripple at rest, rpm: median / largest", |r| Some(two(&r.ripple_rpm?))),
    ("motor slew, RMS, rpm/s: median / largest", |r| {
        let slew = r.slew_rpm_per_s?;
        Some(format!("{:.0} / {:.0}", slew.median, slew.worst))
    }),
    ("not finished", |r| Some(r.unfinished.to_string())),
];

fn millimetres(s: &Percentiles) -> String {
    format!("{:.3} / {:.3}", s.median, s.worst)
}

fn three(s: &Percentiles) -> String {
    format!("{:.3} / {:.2} / {:.2}", s.median, s.p95, s.worst)
}

fn more((spread, count): (Percentiles, usize)) -> String {
    format!("{:.3} ({count})", spread.median)
}

fn two(s: &Percentiles) -> String {
    format!("{:.1} / {:.1}", s.median, s.worst)
}

/// Row of a controller compared with the benchmark on the same cranes.
fn row(course: &str, controller: &str, pairs: &[(&Outcome, &Outcome)]) -> Row {
    let spread = |values: Vec<f64>| {
        values.iter().any(|value| value.is_finite()).then(|| Percentiles::of(values))
    };
    let all = |of: fn(&(&Outcome, &Outcome)) -> Option<f64>| -> Vec<f64> {
        pairs.iter().filter_map(of).collect()
    };
    let with_more = |ratios: Vec<f64>| {
        let more = ratios.iter().filter(|ratio| **ratio > MORE).count();
        spread(ratios).map(|spread| (spread, more))
    };
    let count = |of: fn(&(&Outcome, &Outcome)) -> bool| pairs.iter().filter(|p| of(p)).count();
    Row {
        course: course.into(),
        controller: controller.into(),
        cranes: pairs.len(),
        true_rms: spread(all(|(own, other)| Some(own.true_rms_mm? / other.true_rms_mm?))),
        true_rms_mm: spread(all(|(own, _)| own.true_rms_mm)),
        worse: count(|(own, other)| match (own.true_rms_mm, other.true_rms_mm) {
            (Some(own), Some(other)) => own > other,
            (own, other) => own.is_none() && other.is_some(),
        }),
        oscillating: count(|(own, _)| own.sustained_oscillation),
        oscillating_alone: count(|(own, other)| {
            own.sustained_oscillation && !other.sustained_oscillation
        }),
        measured_rms: spread(all(|(own, other)| {
            Some(own.measured_rms_mm? / other.measured_rms_mm?)
        })),
        motor_speed: with_more(all(|(own, other)| {
            Some(own.motor_speed_rpm? / other.motor_speed_rpm?)
        })),
        energy: with_more(all(|(own, other)| Some(own.energy_kj? / other.energy_kj?))),
        ripple_rpm: spread(all(|(own, _)| own.motor_ripple_rpm)),
        measured_rms_mm: spread(all(|(own, _)| own.measured_rms_mm)),
        slew_rpm_per_s: spread(all(|(own, _)| own.motor_slew_rpm_per_s)),
        unfinished: count(|(own, _)| own.true_rms_mm.is_none()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BENCHMARK: &str = "\
course,seed,crane,controller,true_rms_mm,measured_rms_mm,true_peak_mm,lead_ms,sustained_oscillation,motor_speed_rpm,energy_kj
fast,1,0,benchmark,2.0,4.0,1,0,false,1000,10
fast,1,1,benchmark,4.0,4.0,1,0,true,1000,10
fast,1,2,benchmark,1.0,4.0,1,0,false,1000,10
fast,2,0,benchmark,8.0,4.0,1,0,false,1000,10
";
    const OURS: &str = "\
course,seed,crane,controller,true_rms_mm,measured_rms_mm,true_peak_mm,sustained_oscillation,motor_speed_rpm,energy_kj,motor_ripple_rpm
fast,1,0,scheduled-lqr,1.0,1.0,1,true,1060,11,3
fast,1,1,scheduled-lqr,1.0,2.0,1,true,1040,9,NaN
fast,1,2,scheduled-lqr,1.5,3.0,1,false,900,9,5
fast,1,3,scheduled-lqr,9.0,9.0,1,true,9000,90,99
fast,2,0,scheduled-lqr,,,,true,900,9,4
slow,1,0,scheduled-lqr,1.0,1.0,1,false,1060,11,3
";

    fn table(files: &[&str]) -> Result<ErrorTable, LabError> {
        let mut table = ErrorTable::default();
        files.iter().try_for_each(|content| table.read("a.csv", content.as_bytes()))?;
        Ok(table)
    }

    /// Computed by hand: true ratios 0.5, 0.25 and 1.5, the fourth run not finished. The fifth crane and
    /// the slow course have no benchmark.
    #[test]
    fn ratios_are_formed_for_the_same_crane_seed_and_course() {
        let rows = table(&[BENCHMARK, OURS]).unwrap().rows();
        let [benchmark, row] = &rows[..] else { panic!("{rows:?}") };
        assert_eq!((benchmark.cranes, benchmark.worse), (4, 0));
        assert_eq!(row.unfinished, 1);
        assert_eq!((row.course.as_str(), row.controller.as_str()), ("fast", "scheduled-lqr"));
        assert_eq!((row.cranes, row.worse), (4, 2));
        assert_eq!((row.oscillating, row.oscillating_alone), (3, 2));
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} for {b}");
        let (true_rms, measured) = (row.true_rms.unwrap(), row.measured_rms.unwrap());
        close(true_rms.median, 0.5);
        close(true_rms.worst, 1.5);
        close(measured.median, 0.5);
        close(measured.worst, 0.75);
        let ((speed, faster), (energy, costlier)) = (row.motor_speed.unwrap(), row.energy.unwrap());
        close(speed.median, 0.97);
        close(energy.median, 0.9);
        assert_eq!((faster, costlier), (1, 1));
        let ripple = row.ripple_rpm.unwrap();
        close(ripple.median, 4.0);
        close(ripple.worst, 5.0);
    }

    /// Computed by hand: half of the scheduled LQR's error on crane 0, twice on crane 1.
    #[test]
    fn controllers_are_compared_with_the_scheduled_lqr_on_the_same_crane() {
        let other = "\
course,seed,crane,controller,true_rms_mm,measured_rms_mm,sustained_oscillation
fast,1,0,linear-mpc,0.5,1.5,false
fast,1,1,linear-mpc,2.0,2.0,false
fast,1,7,linear-mpc,9.0,9.0,false
";
        let text = table(&[BENCHMARK, OURS, other]).unwrap().markdown().unwrap();
        let row = "| fast | linear-mpc | 2 | 1.25 (0.50 .. 2.00) | 1 | 1.25 (1.00 .. 1.50) | - |";
        assert!(text.contains(row), "{text}");
        let alone = table(&[BENCHMARK, OURS]).unwrap().markdown().unwrap();
        assert!(!alone.contains("Over the scheduled LQR's"), "{alone}");
    }

    #[test]
    fn columns_that_no_file_has_are_left_out() {
        let both = table(&[BENCHMARK, OURS]).unwrap().markdown().unwrap();
        assert!(both.contains("motor ripple at rest") && !both.contains("motor slew"));
        let before = OURS.lines().map(|line| &line[..line.rfind(',').unwrap()]);
        let before: Vec<&str> = before.collect();
        let older = table(&[BENCHMARK, &before.join("\n")]).unwrap().markdown().unwrap();
        assert!(!older.contains("ripple"), "{older}");
        let columns: Vec<usize> =
            older.lines().filter(|l| l.starts_with('|')).map(|l| l.matches('|').count()).collect();
        assert_eq!(columns, [13; 4]);
    }

    #[test]
    fn an_unreadable_file_is_refused_with_its_line() {
        let says = |files: &[&str], what: &str| {
            let error = table(files).unwrap_err().to_string();
            assert!(error.contains("a.csv") && error.contains(what), "{error}");
        };
        says(&[BENCHMARK, BENCHMARK], "line 2: crane 0 of seed 1");
        says(&[&BENCHMARK.replace("8.0", "eight")], "line 5, true_rms_mm: \"eight\"");
        says(&[&BENCHMARK.replace("true,1000", "yes,1000")], "line 3, sustained_oscillation");
        says(&[&BENCHMARK.replace("crane,", "number,")], "no column crane");
        assert!(table(&[OURS]).unwrap().markdown().is_err());
    }
}
