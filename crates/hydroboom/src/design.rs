//! `hydroboom design`

use crate::crane_file::CraneFile;
use crate::output;
use clap::Args;
use hydroboom_design::{Look, look, model_following, step_response};
use hydroboom_lab::closed_loop::family_margins::{FamilyMargins, family_margins};
use hydroboom_lab::report;
use miette::{IntoDiagnostic, Result};
use serde_json::json;
use std::path::PathBuf;

/// Piston positions that are looked at, as shares of the stroke.
const AT: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];
/// Height of the step that is shown \[m\], and for how long \[s\].
const STEP: f64 = 1e-3;
const DURATION: f64 = 4.0;

/// Model following, designed and looked at before anything moves: poles, margins, Bode and step figures.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom design --out design\n  hydroboom design --set following.bandwidth_hz=1 --set following.damping_ratio=0.9\n  \
    hydroboom design --family 50\n  docs/model-following.md says what is done, and why"
)]
pub struct Design {
    #[command(flatten)]
    crane: CraneFile,
    /// Margins over so many virtual cranes too, the worst named.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    family: Option<u64>,
    /// Seed of the family.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Write design.html into this folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Design {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read()?;
        let law = model_following(&crane).into_diagnostic()?;
        let at = |share: &f64| look(&law, &crane, share * crane.numbers.stroke);
        let looks = AT.iter().map(at).collect::<Result<Vec<Look>, _>>().into_diagnostic()?;
        let family = self.family.map(|count| family_margins(&crane, count, self.seed));
        let family = family.transpose().into_diagnostic()?;
        if let Some(folder) = &self.out {
            let middle = 0.5 * crane.numbers.stroke;
            let step = step_response(&law, &crane, middle, STEP, DURATION).into_diagnostic()?;
            let page = report::design_page(&crane, &law, &looks, &step).into_diagnostic()?;
            std::fs::create_dir_all(folder).into_diagnostic()?;
            output::file(&folder.join("design.html"), page.as_bytes())?;
        }
        if self.json {
            return output::json(&json!({
                "crane": crane.name, "bandwidth_hz": crane.numbers.following_bandwidth,
                "damping_ratio": crane.numbers.following_damping, "lead_ms": crane.numbers.following_lead * 1e3,
                "observer_hz": crane.numbers.following_observer, "effort_percent": crane.numbers.following_effort * 100.0,
                "positions": looks, "family": family,
            }));
        }
        let n = &crane.numbers;
        let mut text = format!(
            "{}: model following, bandwidth {} Hz, damping ratio {}, lead {} ms, observer {} Hz, effort {} %\n\n{}",
            crane.name,
            n.following_bandwidth,
            n.following_damping,
            n.following_lead * 1e3,
            n.following_observer,
            n.following_effort * 100.0,
            table(&looks)
        );
        text += "\nPM phase margin, GM gain margin, d distance from -1. State feedback is the simulated crane's own loop; the others \
                 are around a machine that is like the model, with the lead as delay.";
        if let Some(family) = &family {
            text += &format!("\n\n{}", over_family(family));
        }
        output::text(&text)
    }
}

fn gain(factor: f64) -> String {
    if factor.is_finite() { format!("{factor:.1}") } else { "-".into() }
}

fn over_family(family: &[FamilyMargins]) -> String {
    let header = [
        "over the family",
        "ring on",
        "d median",
        "d 5th percentile",
        "worst: crane, stroke [mm]",
        "d",
        "GM",
        "PM [deg]",
    ];
    let rows: Vec<Vec<String>> = family
        .iter()
        .map(|of| {
            let m = &of.worst.margins;
            let margins = match m.growing {
                0 => [format!("{:.2}", m.distance), gain(m.gain), format!("{:.0}", m.phase_deg)],
                _ => ["rings on".into(), "-".into(), "-".into()],
            };
            let mut row = vec![
                of.controller.into(),
                format!("{} of {}", of.ringing_on, of.count),
                format!("{:.2}", of.distance_median),
                format!("{:.2}", of.distance_p5),
                format!("{}, {:.0}", of.worst.crane, of.worst.stroke_mm),
            ];
            row.extend(margins);
            row
        })
        .collect();
    format!(
        "{}\nEvery crane of the family at three piston positions, linearised at rest as its pump begins to lift, friction left out. \
         d is negative where a loop rings on. Cranes are numbered from 0.",
        output::table(&header, &rows)
    )
}

fn table(looks: &[Look]) -> String {
    let rows: Vec<Vec<String>> = looks
        .iter()
        .map(|l| {
            let placed: Vec<String> = l
                .poles
                .iter()
                .take(3)
                .map(|p| match p.imaginary > 0.0 {
                    true => format!("{:.1}+{:.1}i", p.real, p.imaginary),
                    false => format!("{:.1}", p.real),
                })
                .collect();
            let margins = |m: &hydroboom_design::Margins| {
                format!("{:.0} / {} / {:.2}", m.phase_deg, gain(m.gain), m.distance)
            };
            vec![
                format!("{:.0}", l.stroke_mm),
                format!("{:.2} Hz, {:.3}", l.rings.frequency_hz, l.rings.damping_ratio),
                placed.join("  "),
                margins(&l.state_feedback),
                margins(&l.machine),
                margins(&l.benchmark),
            ]
        })
        .collect();
    let header = [
        "stroke [mm]",
        "rings at, damping",
        "slowest poles with state feedback [1/s]",
        "state feedback PM [deg] / GM / d",
        "machine",
        "benchmark",
    ];
    output::table(&header, &rows)
}
