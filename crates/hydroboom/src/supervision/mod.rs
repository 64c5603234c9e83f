//! `hydroboom supervision`

mod report_text;

use crate::crane_file::CraneFile;
use crate::machine_choice::MachineChoice;
use crate::output;
use crate::paths::InputFile;
use clap::Args;
use hydroboom_control::supervision::flow_monitor::{
    LEAST_WINDOW as FLOW_LEAST_WINDOW, WINDOW_TIME as FLOW_WINDOW_TIME,
};
use hydroboom_control::supervision::limits::Limits;
use hydroboom_design::{LoadPressure, limits, load_pressure};
use hydroboom_realtime::flow_baseline::FlowBaseline;
use hydroboom_realtime::reactions::{ReactionEffect, ideal_second_line, reaction_effects};
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// Show the supervision of a crane file: limits, release of the load, detectable faults of the monitors, and the effect
/// of each reaction.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom supervision --crane my-crane.toml\n  hydroboom supervision --reactions"
)]
pub struct Supervision {
    #[command(flatten)]
    crane: CraneFile,
    /// Baseline of this machine's delivered flow, recorded by `hydroboom run --record-baseline`, for the detectable
    /// faults.
    #[arg(long, value_name = "FILE")]
    baseline: Option<InputFile>,
    /// Compute the effect of each reaction on the simulated machine at its slow and its fast speed, and that of a
    /// release without proof of balance; takes a minute.
    #[arg(long)]
    reactions: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Supervision of a crane.
struct SupervisionReport {
    /// Name of the crane.
    crane: String,
    limits: Limits,
    /// Pressures that carry the load, over the ranges of the crane file.
    load: LoadPressure,
    /// Baseline of the machine's delivered flow; none to use the crane file's ranges.
    baseline: Option<FlowBaseline>,
    /// Effects of the reactions on the simulated machine; empty if they were not asked for.
    effects: Vec<ReactionEffect>,
    /// Drop of the load at a release without proof of balance, before an ideal monitor behind it has shut the valve
    /// \[m\]; none if it was not asked for.
    second_line: Option<f64>,
}

impl Supervision {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, the crane has no limits of supervision, or a simulation of a reaction fails.
    pub fn run(self) -> Result<()> {
        let model = self.crane.read()?;
        let mut limits = limits(&model, model.numbers.fast).into_diagnostic()?;
        let load = load_pressure(&model).into_diagnostic()?;
        let baseline = match &self.baseline {
            Some(path) => Some(FlowBaseline::read(&model, path).into_diagnostic()?),
            None => None,
        };
        if let Some(baseline) = &baseline {
            limits.flow = baseline.narrowed(limits.flow);
        }
        let (mut effects, mut second_line) = (Vec::new(), None);
        if self.reactions {
            let machine = MachineChoice::of(model.clone(), &self.crane, None)?.machine;
            let speeds = [model.numbers.slow, model.numbers.fast];
            effects = reaction_effects(&model, &machine, &speeds).into_diagnostic()?;
            second_line = Some(ideal_second_line(&machine).into_diagnostic()?);
        }
        let crane = model.name.clone();
        let report = SupervisionReport { crane, limits, load, baseline, effects, second_line };
        match self.json {
            true => output::json(&report.in_json()),
            false => output::text(&report.text()),
        }
    }
}

impl SupervisionReport {
    fn in_json(&self) -> serde_json::Value {
        let (l, r) = (&self.limits, &self.limits.release);
        let pressures = [self.load.least, self.load.nominal, self.load.most].map(|p| p * 1e-5);
        json!({
            "crane": self.crane,
            "limits": {
                "pressure_bar": l.pressure * 1e-5, "stop_s": l.stop_time, "watchdog_ms": l.watchdog * 1e3,
                "valve_ms": l.valve_time * 1e3, "creep_mm": l.creep * 1e3,
                "end_margin_mm": l.margin * 1e3, "still_speed_mm_s": l.still.0 * 1e3,
                "still_s": l.still.1, "wait_s": l.wait_time,
                "pressure_agreement_bar": l.pressure_agreement.0 * 1e-5,
                "uncommanded_rpm": l.drive.uncommanded * 60.0,
            },
            "release": {
                "load_pressure_bar": pressures,
                "direction": self.load.direction, "proving_motion_mm": r.proving_motion * 1e3,
                "window_ms": r.window * 1e3, "fast_rpm": r.fast * 60.0, "slow_rpm": r.slow * 60.0,
                "largest_volume_l": r.largest_volume * 1e3, "largest_duration_s": r.largest_duration,
                "check_function": r.check_function == 1.0,
            },
            "position_and_flow": {
                "smallest_drift_mm_s": self.smallest_drift() * 1e3, "within_s": FLOW_WINDOW_TIME,
                "smallest_gain_error_percent": self.smallest_gain_error() * 100.0,
                "baseline": self.baseline.as_ref().map(|b| b.recorded_at),
            },
            "reactions": self.effects.iter().map(|e| json!({
                "speed_mm_s": e.speed * 1e3, "reaction": e.reaction.name(), "travel_mm": e.travel * 1e3,
                "time_ms": e.time * 1e3, "peak_pressure_bar": e.peak_pressure * 1e-5,
                "force_kn": e.force * 1e-3,
            })).collect::<Vec<_>>(),
            "ideal_second_line_mm": self.second_line.map(|drop| drop * 1e3),
        })
    }

    /// Smallest drift of the piston position at rest that the flow monitor finds \[m/s\].
    fn smallest_drift(&self) -> f64 {
        self.limits.flow.smallest_drift(FLOW_LEAST_WINDOW, self.load.nominal)
    }

    /// Smallest relative gain error of the position over 80 % of the stroke that the flow monitor finds \[-\].
    fn smallest_gain_error(&self) -> f64 {
        self.limits.flow.smallest_gain_error(0.8 * self.limits.stroke, self.load.nominal)
    }
}
