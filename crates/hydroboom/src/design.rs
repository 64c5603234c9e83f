//! `hydroboom design`

use crate::benchmark_gains;
use crate::crane_file::CraneFile;
use crate::machine_choice::MachineChoice;
use crate::output;
use crate::paths::{OutputFile, OutputFolder};
use clap::Args;
use hydroboom_control::estimation::reduced_model::MachineState;
use hydroboom_description::Description;
use hydroboom_design::observability::observability;
use hydroboom_design::stability::{
    FINDS_GAINS, LOWERS_GAINS, POSITIONS, benchmark_stability, remark_on_ideal_equipment,
    scheduled_lqr_stability, unstable_on_ideal_equipment,
};
use hydroboom_design::{DesignReport, Margins, design_report};
use hydroboom_lab::closed_loop::family_margins::{FamilyMargins, family_margins};
use hydroboom_lab::report;
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// Smallest and largest payload \[kg\].
type Payloads = [f64; 2];

/// Analyse the loops of the benchmark and of the scheduled LQR: natural frequency of the load, stability margins, Bode
/// diagrams; observability of the estimator's states; gains of the benchmark.
#[derive(Args)]
#[command(after_help = "Examples:
  hydroboom design --out design
  hydroboom design --set controller.proportional_per_s=6
  hydroboom design --observability
  hydroboom design --benchmark --crane my-crane.toml --crane-out tuned.toml
  \
    hydroboom design --family 50")]
pub struct Design {
    #[command(flatten)]
    crane: CraneFile,
    /// Number of virtual cranes for the distribution of the margins; the worst is named. They are drawn around the
    /// virtual crane of the crane file, without --crane the paper's.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    family: Option<u64>,
    /// Seed of the family.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Show the reduction of each state's standard deviation in the Kalman filter by each phase of the motion alone.
    #[arg(long, conflicts_with_all = ["family", "out"])]
    observability: bool,
    /// Design gains K_p, K_i, k_f and tau of the benchmark controller for this crane. The sensitivity's peak is at most
    /// benchmark_design.sensitivity_peak, over the crane file's payload range and the stroke.
    #[arg(long, conflicts_with_all = ["family", "observability", "out"])]
    benchmark: bool,
    /// With --benchmark: range of payloads in the design. Default: the crane file's range.
    #[arg(long, value_name = "LOW:HIGH", requires = "benchmark", allow_hyphen_values = true, value_parser = benchmark_gains::payloads)]
    payload_kg: Option<Payloads>,
    /// With --benchmark: crane file to write with these gains and their source.
    #[arg(long, value_name = "FILE", requires = "benchmark")]
    crane_out: Option<OutputFile>,
    /// Folder for design.html.
    #[arg(long, value_name = "DIR")]
    out: Option<OutputFolder>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Design {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, or a loop cannot be linearised.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read()?;
        if self.benchmark {
            let (payload, out) = (self.payload_kg, self.crane_out.as_ref());
            return benchmark_gains::run(&self.crane, &crane, payload, out, self.json);
        }
        if self.observability {
            return self.observability_of(&crane);
        }
        let at = |share: &f64| design_report(&crane, share * crane.numbers.stroke);
        let reports =
            POSITIONS.iter().map(at).collect::<Result<Vec<DesignReport>, _>>().into_diagnostic()?;
        let family = self.family.map(|count| self.family_of(&crane, count)).transpose()?;
        let loops = [
            benchmark_stability(&crane, None).into_diagnostic()?,
            scheduled_lqr_stability(&crane, None).into_diagnostic()?,
        ];
        if let Some(folder) = &self.out {
            let page = report::design_page(&crane, &reports, &loops).into_diagnostic()?;
            let seed = self.family.map(|_| self.seed);
            output::page_in_folder(folder, "design", &page, seed);
        }
        let on_ideal = unstable_on_ideal_equipment(&crane, &loops).into_diagnostic()?;
        if self.json {
            return output::json(&json!({
                "crane": crane.name, "positions": reports, "stable": loops.iter().all(|of| of.stable),
                "loops": loops, "unstable_on_ideal_equipment": on_ideal,
                "family": family.as_ref().map(|(_, margins)| margins),
                "plant": family.as_ref().map(|(choice, _)| choice.json()),
            }));
        }
        let mut text = format!(
            "{}: loops of the benchmark and of the scheduled LQR\n\n{}",
            crane.name,
            table(&reports)
        );
        text += "\n\
            PM phase margin, GM gain margin, d modulus margin (smallest distance from -1). \
            Frequencies are those of the highest gain crossover and of d. The machine equals the model, with the lags \
            of drive and fieldbus that the controllers expect before identification.";
        text += &format!(
            "\nPayload {:.0} kg, load-holding valve open, sliding friction, {:.0} bar at the rod side; `eigen` has the load held.",
            crane.numbers.payload,
            crane.numbers.rod_side * 1e-5
        );
        for unstable in loops.iter().filter(|of| !of.stable) {
            let remedy = match unstable.controller {
                "benchmark" => FINDS_GAINS,
                _ => LOWERS_GAINS,
            };
            text += &format!("\n{unstable}; it has no margins there; {remedy}");
        }
        if let Some(remark) = remark_on_ideal_equipment(&on_ideal) {
            text += &format!("\n{remark}");
        }
        if let Some((choice, family)) = &family {
            text += &format!("\n\n{}", over_family(&choice.name(), family));
        }
        output::text(&text)
    }

    /// The crane that the family is drawn around, and the margins over the family.
    ///
    /// # Errors
    ///
    /// If a crane of the family cannot be built or linearised.
    fn family_of(
        &self,
        crane: &Description,
        count: u64,
    ) -> Result<(MachineChoice, Vec<FamilyMargins>)> {
        let choice = MachineChoice::of(crane.clone(), &self.crane, None)?;
        let margins = family_margins(&choice.model, &choice.machine, (count, self.seed));
        let margins = margins.into_diagnostic()?;
        Ok((choice, margins))
    }

    /// Prints the observability of the estimator's states: reduction of each standard deviation by each phase.
    fn observability_of(&self, crane: &Description) -> Result<()> {
        let phases = observability(crane, crane.numbers.fast).into_diagnostic()?;
        if self.json {
            return output::json(&json!({
                "crane": crane.name, "states": MachineState::NAMES, "phases": phases,
            }));
        }
        let states = MachineState::NAMES.map(|name| name.replace('_', " "));
        let mut header = vec!["phase", "from [s]", "to [s]"];
        header.extend(states.iter().map(String::as_str));
        let rows: Vec<Vec<String>> = phases
            .iter()
            .map(|phase| {
                let mut row = vec![
                    phase.name.into(),
                    format!("{:.2}", phase.begin_s),
                    format!("{:.2}", phase.end_s),
                ];
                row.extend(phase.reduction.iter().map(|q| match *q < 9.95 {
                    true => format!("{q:.1}"),
                    false => format!("{q:.0}"),
                }));
                row
            })
            .collect();
        output::text(&format!(
            "{}: factor by which a phase of the motion at {:.0} mm/s alone reduces the standard deviation of a \
             state, without process noise; 1.0: not excited\n{}",
            crane.name,
            crane.numbers.fast * 1e3,
            output::table(&header, &rows)
        ))
    }
}

/// A phase margin \[deg\], or a dash where the loop's gain is nowhere one.
fn phase(degrees: f64) -> String {
    if degrees.is_finite() { format!("{degrees:.0}") } else { "-".into() }
}

/// A gain margin \[-\], or a dash where no gain makes the loop unstable.
fn gain(factor: f64) -> String {
    if factor.is_finite() { format!("{factor:.1}") } else { "-".into() }
}

/// A modulus margin \[-\], or a dash where no loop of a family has one.
fn modulus(distance: f64) -> String {
    output::optional(Some(distance).filter(|d| d.is_finite()), 2)
}

/// Table of the margins over a family that is drawn around the named crane, with its conditions.
fn over_family(nominal: &str, family: &[FamilyMargins]) -> String {
    let header = [
        "over the family",
        "unstable",
        "PM [deg]: median, 5th percentile",
        "GM",
        "d",
        "worst: crane, stroke [mm]",
        "d",
        "GM",
        "PM [deg]",
    ];
    format!(
        "{}\nEvery crane of the family, drawn around \"{nominal}\", at three piston positions, linearised at rest as \
         its pump begins to lift, friction left out, with its own drive, fieldbus and sensors. The controllers know \
         the model file and the weighed payload. PM, GM and d are those of the stable loops. Cranes are numbered from \
         0.",
        output::table(&header, &family.iter().map(over_family_row).collect::<Vec<_>>())
    )
}

/// Row of a controller: unstable loops, margins over the family, and the worst crane.
fn over_family_row(of: &FamilyMargins) -> Vec<String> {
    let m = &of.worst.margins;
    let margins = match m.is_stable() {
        true => [format!("{:.2}", m.modulus_margin), gain(m.gain), phase(m.phase_deg)],
        false => ["unstable".into(), "-".into(), "-".into()],
    };
    let mut row = vec![
        of.controller.into(),
        format!("{} of {}", of.unstable, of.count),
        format!("{}, {}", phase(of.phase_median_deg), phase(of.phase_p5_deg)),
        format!("{}, {}", gain(of.gain_median), gain(of.gain_p5)),
        format!("{}, {}", modulus(of.modulus_margin_median), modulus(of.modulus_margin_p5)),
        format!("{}, {:.0}", of.worst.crane, of.worst.stroke_mm),
    ];
    row.extend(margins);
    row
}

/// Table of load mode and margins, a row for each piston position.
fn table(reports: &[DesignReport]) -> String {
    let rows: Vec<Vec<String>> = reports
        .iter()
        .map(|l| {
            let mut row = vec![
                format!("{:.0}", l.stroke_mm),
                l.load_mode.map_or_else(
                    || "overdamped".into(),
                    |mode| format!("{:.2} Hz, {:.3}", mode.frequency_hz, mode.damping_ratio),
                ),
            ];
            row.extend(margin_cells(&l.benchmark));
            row.extend(margin_cells(&l.scheduled_lqr));
            row
        })
        .collect();
    let header = [
        "stroke [mm]",
        "load mode, damping ratio",
        "benchmark: PM [deg] / GM / d",
        "crossover / d at [Hz]",
        "scheduled LQR: PM [deg] / GM / d",
        "crossover / d at [Hz]",
    ];
    output::table(&header, &rows)
}

/// Cells of a loop: its margins, and the frequencies of gain crossover and modulus margin.
fn margin_cells(m: &Margins) -> [String; 2] {
    if !m.is_stable() {
        return ["unstable".into(), "-".into()];
    }
    let [crossover, at] = [m.crossover_hz, m.at_hz].map(output::three_digits);
    [
        format!("{} / {} / {:.2}", phase(m.phase_deg), gain(m.gain), m.modulus_margin),
        format!("{crossover} / {at}"),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Margins of a loop whose gain is below one at all frequencies.
    const WITHOUT_CROSSOVER: Margins = Margins {
        gain: f64::INFINITY,
        phase_deg: f64::INFINITY,
        modulus_margin: 0.9,
        at_hz: 5.0,
        crossover_hz: f64::NAN,
        unstable_poles: 0,
    };

    #[test]
    fn an_infinite_margin_is_a_dash_in_the_table_and_null_in_json() {
        assert_eq!([phase(60.4), gain(2.44), modulus(0.5)], ["60", "2.4", "0.50"]);
        assert_eq!([phase(f64::INFINITY), gain(f64::INFINITY), modulus(f64::NAN)], ["-"; 3]);
        let benchmark = WITHOUT_CROSSOVER;
        let scheduled_lqr = Margins { unstable_poles: 1, ..WITHOUT_CROSSOVER };
        let report = DesignReport { stroke_mm: 250.0, load_mode: None, benchmark, scheduled_lqr };
        let json = serde_json::to_value(&report).unwrap();
        assert!(json["benchmark"]["phase_deg"].is_null(), "{json}");
        assert!(json["benchmark"]["crossover_hz"].is_null(), "{json}");
        let text = table(&[report]);
        assert!(text.contains("- / - / 0.90") && text.contains("unstable"), "{text}");
        assert!(text.contains("- / 5.00"), "{text}");
    }

    /// A small modulus margin is that of a resonance if its frequency is that of the resonance.
    #[test]
    fn the_table_names_the_frequencies_of_crossover_and_modulus_margin() {
        let lqr = Margins { gain: 3.0, phase_deg: 36.0, crossover_hz: 33.21, ..WITHOUT_CROSSOVER };
        assert_eq!(margin_cells(&lqr), ["36 / 3.0 / 0.90", "33.2 / 5.00"]);
        let unstable = Margins { unstable_poles: 2, ..lqr };
        assert_eq!(margin_cells(&unstable), ["unstable", "-"]);
    }
}
