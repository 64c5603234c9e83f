//! Supervision of a crane as text.

use super::SupervisionReport;
use crate::output;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::fault::{Cause, Reaction};
use hydroboom_control::supervision::flow_monitor::WINDOW_TIME as FLOW_WINDOW_TIME;

/// Row of the table of limits: name, value, and what it follows from.
fn row(name: &str, value: String, from: &str) -> Vec<String> {
    vec![name.into(), value, from.into()]
}

fn bar(pressure: f64) -> String {
    format!("{:.1} bar", pressure * 1e-5)
}

impl SupervisionReport {
    /// Limits, release, detectable faults and reactions.
    pub(super) fn text(&self) -> String {
        let rows = [self.limit_rows(), self.release_rows()].concat();
        let mut text =
            format!("{}\n{}", self.crane, output::table(&["limit", "value", "from"], &rows));
        if self.load.most > self.limits.pressure {
            text += &format!(
                "\n\nwarning: the heaviest load of the file's range needs {:.0} bar, more than supervision.pressure_bar",
                self.load.most * 1e-5
            );
        }
        text + &self.flow_monitor_text() + &self.reactions_text()
    }

    /// Limits of pressure, motion, times and drive.
    fn limit_rows(&self) -> Vec<Vec<String>> {
        let l = &self.limits;
        vec![
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
        ]
    }

    /// Load, and its release.
    fn release_rows(&self) -> Vec<Vec<String>> {
        let (r, load) = (&self.limits.release, &self.load);
        let proof = match r.check_function == 1.0 {
            true => "motion; at the upper end stop by pressure",
            false => "delivered volume and pressure",
        };
        let side = if load.direction > 0.0 { "piston side" } else { "rod side" };
        vec![
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
        ]
    }

    /// Smallest faults that the flow monitor finds.
    fn flow_monitor_text(&self) -> String {
        let reference = match &self.baseline {
            Some(baseline) => format!(
                "this machine's baseline, {:.0} days old, residual {:.2} mm",
                baseline.age_days(),
                baseline.residual * 1e3
            ),
            None => "the crane file's ranges; a baseline narrows them".into(),
        };
        format!(
            "\n\nposition against delivered flow, by {reference}:\n  at rest a drift of {:.2} mm/s is found within {:.0} s; \
             over {:.0} mm a gain error of {:.1} %",
            self.smallest_drift() * 1e3,
            FLOW_WINDOW_TIME,
            800.0 * self.limits.stroke,
            self.smallest_gain_error() * 100.0
        )
    }

    /// Effect of each reaction on the simulated machine, and the causes of each; a hint if they were not computed.
    fn reactions_text(&self) -> String {
        if self.effects.is_empty() {
            return "\n\n--reactions computes what each reaction does to the simulated machine"
                .into();
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
        let mut text =
            format!("\n\nreactions, simulated under {}:\n", Strategy::BenchmarkClosedLoop.name());
        text += &output::table(&header, &rows);
        for reaction in Reaction::ALL {
            let causes = Cause::ALL.into_iter().filter(|cause| cause.reaction() == reaction);
            let codes = causes.map(Cause::code).collect::<Vec<_>>().join(", ");
            text += &format!("\n{}: {codes}", reaction.name());
        }
        if let Some(drop) = self.second_line {
            text += &format!(
                "\n\na monitor behind an unproven release, ideal: the load drops by {:.1} mm before the valve has shut again",
                drop * 1e3
            );
        }
        text
    }
}
