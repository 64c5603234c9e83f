//! `hydroboom supervision`

use crate::crane_file::CraneFile;
use crate::machine_choice::MachineChoice;
use crate::output;
use crate::paths::InputFile;
use clap::Args;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::fault::Cause;
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

/// Content of the output.
struct Shown {
    crane: String,
    limits: Limits,
    load: LoadPressure,
    baseline: Option<FlowBaseline>,
    effects: Vec<ReactionEffect>,
    second_line: Option<f64>,
}

impl Supervision {
    /// Runs the command.
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
        let shown =
            Shown { crane: model.name.clone(), limits, load, baseline, effects, second_line };
        match self.json {
            true => output::json(&shown.json()),
            false => output::text(&shown.text()),
        }
    }
}

impl Shown {
    fn json(&self) -> serde_json::Value {
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
                "smallest_drift_mm_s": self.drift() * 1e3, "within_s": FLOW_WINDOW_TIME,
                "smallest_gain_error_percent": self.gain_error() * 100.0,
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

    fn drift(&self) -> f64 {
        self.limits.flow.smallest_drift(FLOW_LEAST_WINDOW, self.load.nominal)
    }

    fn gain_error(&self) -> f64 {
        self.limits.flow.smallest_gain_error(0.8 * self.limits.stroke, self.load.nominal)
    }

    fn text(&self) -> String {
        let (l, r, load) = (&self.limits, &self.limits.release, &self.load);
        let bar = |pressure: f64| format!("{:.1} bar", pressure * 1e-5);
        let row = |name: &str, value: String, from: &str| vec![name.into(), value, from.into()];
        let proof = match r.check_function == 1.0 {
            true => "motion; at the upper end stop by pressure",
            false => "delivered volume and pressure",
        };
        let side = if load.direction > 0.0 { "piston side" } else { "rod side" };
        let rows = vec![
            row("largest pressure", bar(l.pressure), "supervision.pressure_bar"),
            row("controlled stop", format!("{:.2} s", l.stop_time), "supervision.stop_s"),
            row(
                "drive's watchdog",
                format!("{:.0} ms", l.watchdog * 1e3),
                "supervision.watchdog_ms",
            ),
            row(
                "valve has switched after",
                format!("{:.0} ms", l.valve_time * 1e3),
                "ranges of switching_valve, fieldbus",
            ),
            row(
                "distance from the end stops",
                format!("{:.0} mm, or the stopping distance", l.margin * 1e3),
                "supervision.end_margin_mm, stop_s",
            ),
            row("missed periods", format!("{} of 256 at most", l.missed), "a quarter"),
            row(
                "held load moves at most",
                format!("{:.1} mm", l.creep * 1e3),
                "supervision.creep_mm",
            ),
            row(
                "load is still below",
                format!("{:.1} mm/s for {:.2} s", l.still.0 * 1e3, l.still.1),
                "load mode, supervision.creep_mm",
            ),
            row("a state waits at most", format!("{:.0} s", l.wait_time), "supervision.wait_s"),
            row(
                "pump side and cylinder agree within",
                bar(l.pressure_agreement.0),
                "holding_valve, transducers",
            ),
            row(
                "uncommanded motor speed",
                format!(
                    "{:.0} rpm for {:.0} ms",
                    l.drive.uncommanded * 60.0,
                    l.drive.uncommanded_time * 1e3
                ),
                "motor.max_speed_rpm",
            ),
            row("load is carried by", side.into(), "statics"),
            row(
                "load pressure",
                format!(
                    "{:.1} to {:.1} bar, {:.1} nominal",
                    load.least * 1e-5,
                    load.most * 1e-5,
                    load.nominal * 1e-5
                ),
                "statics over the ranges of payload, friction, rod side",
            ),
            row("release proven by", proof.into(), "holding_valve.check_function"),
            row(
                "proving motion",
                format!(
                    "{:.2} mm, mean over {:.0} ms, 4 standard deviations at least",
                    r.proving_motion * 1e3,
                    r.window * 1e3
                ),
                "supervision.proving_motion_mm",
            ),
            row(
                "pump fills at",
                format!("{:.0} rpm, then {:.0} rpm", r.fast * 60.0, r.slow * 60.0),
                "proving motion, drive, leakage",
            ),
            row(
                "release is aborted after",
                format!("{:.2} L or {:.0} s", r.largest_volume * 1e3, r.largest_duration),
                "oil, volumes, leakage; supervision.release_s",
            ),
        ];
        let mut said =
            format!("{}\n{}", self.crane, output::table(&["limit", "value", "from"], &rows));
        if load.most > l.pressure {
            said += &format!(
                "\n\nwarning: the heaviest load of the file's range needs {:.0} bar, more than supervision.pressure_bar",
                load.most * 1e-5
            );
        }
        let against = match &self.baseline {
            Some(baseline) => format!(
                "this machine's baseline, {:.0} days old, residual {:.2} mm",
                baseline.age_days(),
                baseline.residual * 1e3
            ),
            None => "the crane file's ranges; a baseline narrows them".into(),
        };
        said += &format!(
            "\n\nposition against delivered flow, by {against}:\n  at rest a drift of {:.2} mm/s is found within {:.0} s; \
             over {:.0} mm a gain error of {:.1} %",
            self.drift() * 1e3,
            FLOW_WINDOW_TIME,
            800.0 * l.stroke,
            self.gain_error() * 100.0
        );
        if self.effects.is_empty() {
            return said
                + "\n\n--reactions computes what each reaction does to the simulated machine";
        }
        let rows: Vec<Vec<String>> = self
            .effects
            .iter()
            .map(|e| {
                vec![
                    format!("{:+.0}", e.speed * 1e3),
                    e.reaction.name().into(),
                    format!("{:.1}", e.travel * 1e3),
                    format!("{:.0}", e.time * 1e3),
                    format!("{:.0}", e.peak_pressure * 1e-5),
                    format!("{:.1}", e.force * 1e-3),
                ]
            })
            .collect();
        let header = [
            "speed [mm/s]",
            "reaction",
            "travel [mm]",
            "at rest after [ms]",
            "peak [bar]",
            "force [kN]",
        ];
        said +=
            &format!("\n\nreactions, simulated under {}:\n", Strategy::BenchmarkClosedLoop.name());
        said += &output::table(&header, &rows);
        let of = |reaction| {
            let causes = Cause::ALL.into_iter().filter(|cause| cause.reaction() == reaction);
            causes.map(Cause::code).collect::<Vec<_>>().join(", ")
        };
        for reaction in hydroboom_control::supervision::fault::Reaction::ALL {
            said += &format!("\n{}: {}", reaction.name(), of(reaction));
        }
        if let Some(drop) = self.second_line {
            said += &format!(
                "\n\na monitor behind an unproven release, ideal: the load drops by {:.1} mm before the valve has shut again",
                drop * 1e3
            );
        }
        said
    }
}
