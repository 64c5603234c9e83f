//! The page.

use super::drawing;
use super::figure::{Figure, Series};
use crate::LabError;
use crate::motion_test::{Run, Sample, Strategy};
use crate::study::{NOMINAL, OFF, Study};
use hydroboom_description::Description;
use hydroboom_math::Real;
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = "
:root{--ink:#1c1f24;--paper:#fff;--grid:#d9dce1;--soft:#5c6470;--band:#f4f6f8}
@media(prefers-color-scheme:dark){:root{--ink:#e6e8eb;--paper:#15181c;--grid:#3a4048;--soft:#a2a9b3;--band:#1e2329}}
*{box-sizing:border-box}
body{margin:0 auto;max-width:60rem;padding:2rem 1rem 4rem;background:var(--paper);color:var(--ink);
font:16px/1.5 system-ui,sans-serif}
h1{font-size:1.7rem;margin:.2em 0}h2{margin:2.2em 0 .4em;font-size:1.25rem;border-bottom:1px solid var(--grid)}
h3{font-size:1.02rem;margin:1.4em 0 .2em}
table{border-collapse:collapse;margin:.6em 0;font-variant-numeric:tabular-nums;font-size:.92rem}
th,td{padding:.18em .7em;text-align:right;border-bottom:1px solid var(--grid)}
th:first-child,td:first-child{text-align:left}thead th{border-bottom:2px solid var(--soft)}
tr:nth-child(even) td{background:var(--band)}
td.text{text-align:left}figure{margin:.8em 0}figcaption{color:var(--soft);font-size:.92rem}
.wide{overflow-x:auto}small,.soft{color:var(--soft)}code{font-size:.92em}
details{margin:.6em 0}summary{cursor:pointer}";

/// The study as one self-contained HTML page.
///
/// # Errors
///
/// [`LabError`] when a figure cannot be drawn.
pub fn page(description: &Description, study: &Study) -> Result<String, LabError> {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "Hydroboom study: " (study.crane) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { "Hydroboom study: " (study.crane) }
                p.soft {
                    "Everything below is simulated. \"Paper\" is Hagen et al., Actuators 2025, 14(2):80; "
                    "its tracking errors were measured on a real crane, of which no log is public. "
                    "\"Nominal\" is a plant equal to the model, which flatters every strategy that uses the "
                    "model; \"off-model\" is a plant that differs from it as a real crane might, by guesses "
                    "and not by measurements."
                }
                (figure("The crane to scale, at both ends of the motion. Dots are the joints between segments.",
                    &drawing::crane(description)?))
                (eigenfrequencies(study)?)
                (differences(study))
                (tracking(study)?)
                (pressures(study)?)
                (energy(study)?)
                (precision(study)?)
                (oil(description)?)
                (parameters(description))
            }
        }
    };
    Ok(page.into_string())
}

fn figure(caption: &str, svg: &str) -> Markup {
    html! { figure { (PreEscaped(svg)) figcaption { (caption) } } }
}

fn eigenfrequencies(study: &Study) -> Result<Markup, LabError> {
    let ringing = match &study.oscillation {
        Some(seen) => {
            let shown = seen.time.iter().zip(&seen.pressure_a).map(|(t, p)| (*t, p * 1e-5));
            let series = Series::list([("p_A", shown.collect())]);
            figure(
                "Figure 17: the boom dropped onto its locked cylinder at 200 mm, with friction.",
                &Figure { x: "time [s]", y: "p_A [bar]", series, logarithmic: false }.svg()?,
            )
        }
        None => html! {},
    };
    Ok(html! {
        h2 { "Table 5: eigenfrequencies, load-holding valve closed" }
        div.wide { table {
            thead { tr {
                th { "x_cyl [mm]" } th { "paper, simulated [Hz]" } th { "here, linearised [Hz]" }
                th { "difference" } th { "here, oscillation without friction [Hz]" }
                th { "here, with friction [Hz]" } th { "paper, measured [Hz]" }
            } }
            tbody { @for row in &study.eigenfrequency { tr {
                td { (format!("{:.0}", row.stroke_mm)) }
                td { (optional(row.paper_simulated_hz, 2)) }
                td { (format!("{:.3}", row.linearised_hz)) }
                td { (row.paper_simulated_hz.map_or(String::new(), |p| percent(row.linearised_hz / p - 1.0))) }
                td { (format!("{:.3}", row.frictionless_hz)) }
                td { (format!("{:.3}", row.oscillation_hz)) }
                td { (optional(row.paper_measured_hz, 2)) }
            } } }
        } }
        p.soft {
            "Compared without friction, at a drop of 0.2 mm at the tip, with the trapped rod-side pressure of "
            "the crane file. The boom's stiffness is calibrated to the paper's simulated values. With friction "
            "the drop is the crane file's; the frequency then differs, because friction dissipates within a few "
            "periods while the oil's stiffness changes with the large pressure swing, and near rest the smoothed friction "
            "is a stiff damper that all but locks the piston."
        }
        (ringing)
        p {
            "With the valve open, during the fast motion, p_A oscillates at "
            strong { (format!("{:.3} Hz", study.pressure_oscillation_hz)) }
            " (paper's simulation: " (format!("{:.3}", study.paper_pressure_oscillation_hz)) " Hz, "
            (percent(study.pressure_oscillation_hz / study.paper_pressure_oscillation_hz - 1.0))
            "; nothing was fitted to it)."
        }
    })
}

fn differences(study: &Study) -> Markup {
    html! {
        h2 { "Table 6: model against plant at the fast speed" }
        p.soft {
            "Paper: its simulation against the real crane. Here: the model against the off-model plant, under "
            "the same motor speed. The plants are different, so only the sizes can be compared. "
            "The off-model plant: " (study.off_model.join(", ")) "."
        }
        div.wide { table {
            thead { tr { th { "signal" } th { "RMS, paper" } th { "RMS, here" } th { "peak, paper" } th { "peak, here" } } }
            tbody { @for row in &study.differences { tr {
                td { (row.signal) " [" (row.unit) "]" }
                td { (format!("{:.3}", row.paper_rms)) } td { (format!("{:.3}", row.rms)) }
                td { (format!("{:.3}", row.paper_peak)) } td { (format!("{:.3}", row.peak)) }
            } } }
        } }
    }
}

fn tracking(study: &Study) -> Result<Markup, LabError> {
    let speeds: Vec<f64> = {
        let mut speeds: Vec<f64> = study.motion.iter().map(|row| row.speed_mm_s).collect();
        speeds.sort_by(f64::total_cmp);
        speeds.dedup();
        speeds
    };
    let find = |plant: &str, strategy: Strategy, speed: f64| {
        study
            .motion
            .iter()
            .find(|r| r.plant == plant && r.strategy == strategy && r.speed_mm_s == speed)
    };
    let fast = speeds.last().copied().unwrap_or_default();
    let compared = [
        (
            "Figure 25, test 1: open loop",
            [Strategy::VelocityFeedforward, Strategy::SimulationFeedforwardOpenLoop],
        ),
        (
            "Figure 26, test 2: open-loop simulation feedforward against the benchmark",
            [Strategy::SimulationFeedforwardOpenLoop, Strategy::BenchmarkClosedLoop],
        ),
        (
            "Figure 27, test 3: closed loop",
            [Strategy::BenchmarkClosedLoop, Strategy::SimulationFeedforwardClosedLoop],
        ),
    ];
    let reference = match study.run(NOMINAL, Strategy::VelocityFeedforward, fast) {
        Some(run) => {
            let series = Series::list([("x_ref", over_time(run, |s| s.reference.position * 1e3))]);
            figure(
                &format!("Figure 24: reference at {fast:.0} mm/s."),
                &Figure { x: "time [s]", y: "x_ref [mm]", series, logarithmic: false }.svg()?,
            )
        }
        None => html! {},
    };
    let mut panels = Vec::new();
    for (title, strategies) in compared {
        let runs: Vec<&Run> = strategies.iter().filter_map(|s| study.run(OFF, *s, fast)).collect();
        let mut positions = Vec::new();
        let mut errors = Vec::new();
        if let Some(run) = runs.first() {
            let points = over_time(run, |s| s.reference.position * 1e3);
            positions.push(Series { name: "reference", points, colour: 0 });
        }
        for (index, run) in runs.into_iter().enumerate() {
            let (name, colour) = (run.strategy.name(), index + 1);
            let points = over_time(run, |s| s.plant.stroke * 1e3);
            positions.push(Series { name, points, colour });
            let points = over_time(run, |s| s.error() * 1e3);
            errors.push(Series { name, points, colour });
        }
        let a = Figure { x: "time [s]", y: "x_cyl [mm]", series: positions, logarithmic: false }
            .svg()?;
        let b = Figure { x: "time [s]", y: "x - x_ref [mm]", series: errors, logarithmic: false }
            .svg()?;
        panels.push((title, a, b));
    }
    Ok(html! {
        h2 { "Tables 7 to 9: tracking errors" }
        p.soft {
            "RMS over the whole motion, 2 s of rest before and after included (the paper does not state its "
            "window), and the error of largest magnitude, x - x_ref. The paper's values were measured on the real crane."
        }
        @for speed in &speeds {
            h3 { (format!("{speed:.0} mm/s")) }
            div.wide { table {
                thead { tr {
                    th { "strategy" } th { "RMS, paper [mm]" } th { "nominal" } th { "off-model" }
                    th { "peak, paper [mm]" } th { "nominal" } th { "off-model" }
                } }
                tbody { @for strategy in Strategy::ALL {
                    @if let (Some(n), Some(o)) = (find(NOMINAL, strategy, *speed), find(OFF, strategy, *speed)) { tr {
                        td { (strategy.name()) }
                        td { (optional(n.paper_rms_mm, 2)) }
                        td { (format!("{:.3}", n.rms_mm)) } td { (format!("{:.3}", o.rms_mm)) }
                        td { (optional(n.paper_peak_mm, 2)) }
                        td { (format!("{:.3}", n.peak_mm)) } td { (format!("{:.3}", o.peak_mm)) }
                    } }
                } }
            } }
        }
        p {
            "On the nominal plant the open-loop simulation feedforward repeats the benchmark's closed loop "
            "exactly, because plant and simulation are the same: that column says nothing about the real crane. "
            "Off the model its error grows to what pump flow and leakage make it. In closed loop the published "
            "structure damps twice, once inside the simulation and once on the real load pressure."
        }
        (reference)
        @for (title, a, b) in &panels {
            h3 { (title) ", off-model plant, " (format!("{fast:.0} mm/s")) }
            (figure("(a) Piston position.", a))
            (figure("(b) Tracking error.", b))
        }
    })
}

fn over_time(run: &Run, value: impl Fn(&Sample) -> f64) -> Vec<(f64, f64)> {
    run.samples.iter().map(|s| (s.time, value(s))).collect()
}

fn pressures(study: &Study) -> Result<Markup, LabError> {
    let fast = study.motion.iter().map(|r| r.speed_mm_s).fold(0.0, f64::max);
    let Some(run) = study.run(NOMINAL, Strategy::VelocityFeedforward, fast) else {
        return Ok(html! {});
    };
    let bar = |pressure: fn(&Sample) -> f64| over_time(run, |s| pressure(s) * 1e-5);
    let high = Series::list([
        ("p_PA", bar(|s| s.plant.pressure_pump_a)),
        ("p_A", bar(|s| s.plant.pressure_a)),
    ]);
    let low = Series::list([
        ("p_B", bar(|s| s.plant.pressure_b)),
        ("p_PB", bar(|s| s.plant.pressure_pump_b)),
        ("p_acc", bar(|s| s.plant.pressure_accumulator)),
    ]);
    let high = Figure { x: "time [s]", y: "pressure [bar]", series: high, logarithmic: false };
    let low = Figure { x: "time [s]", y: "pressure [bar]", series: low, logarithmic: false };
    Ok(html! {
        h2 { "Pressures" }
        (figure("High-pressure side under velocity feedforward at the fast speed, nominal plant.", &high.svg()?))
        (figure("Low-pressure side.", &low.svg()?))
    })
}

fn energy(study: &Study) -> Result<Markup, LabError> {
    Ok(html! {
        h2 { "Energy" }
        p.soft {
            "One fast cycle under velocity feedforward: change of stored energy against the pump's work, all "
            "losses, and the mass defects of equations that conserve volume and not mass. "
            "The residual is the implicit scheme's own error and shrinks with its step."
        }
        div.wide { table {
            thead { tr {
                th { "step [us]" } th { "change [J]" } th { "work [J]" } th { "losses [J]" }
                th { "defects [J]" } th { "exchanged [J]" } th { "residual / exchanged" }
            } }
            tbody { @for a in &study.energy.audits { tr {
                td { (format!("{:.0}", a.step_us)) } td { (format!("{:.2}", a.change_j)) }
                td { (format!("{:.2}", a.work_j)) } td { (format!("{:.2}", a.losses_j)) }
                td { (format!("{:.2}", a.defects_j)) } td { (format!("{:.1}", a.exchanged_j)) }
                td { (format!("{:.1e}", a.relative_residual)) }
            } } }
        } }
        p.soft {
            "What the time step itself adds to the lowest mode, on the same crane without any loss and "
            "with its load held: from the eigenvalues of one step's derivative."
        }
        div.wide { table {
            thead { tr { th { "scheme" } th { "step [us]" } th { "damping ratio" } th { "frequency error" } th { "order" } } }
            tbody { @for s in &study.energy.numerical_damping { tr {
                td { (s.scheme) } td { (format!("{:.0}", s.step_us)) }
                td { (format!("{:.1e}", s.damping_ratio)) }
                td { (format!("{:.1e}", s.frequency_error)) } td { (optional(s.order, 2)) }
            } } }
        } }
        @if let Some(a) = study.energy.audits.last() {
            details { summary { "Each power's share" }
                table { tbody { @for (name, energy) in &a.by_name_j {
                    tr { td { (name.replace('_', " ")) } td { (format!("{energy:.3} J")) } }
                } } }
            }
        }
    })
}

fn precision(study: &Study) -> Result<Markup, LabError> {
    let series = |x: fn(&crate::work_precision::Point) -> f64| -> Vec<Series<'_>> {
        let of = |name: &str| {
            let points = study.work_precision.iter().filter(|p| p.scheme == name);
            points.map(|p| (x(p), p.pressure_error_bar)).collect()
        };
        Series::list(["published", "implicit", "runge-kutta-4"].map(|name| (name, of(name))))
    };
    let y = "largest error of p_A [bar]";
    let steps = Figure { x: "step [us]", y, series: series(|p| p.step_us), logarithmic: true };
    let times = Figure {
        x: "computing time per simulated second [ms]",
        y,
        series: series(|p| p.time_ms_per_s),
        logarithmic: true,
    };
    Ok(html! {
        h2 { "Work and precision" }
        p.soft {
            "The first two seconds of the fast motion against Runge-Kutta steps of 1 us, without substeps. "
            "Points that diverged are left out."
        }
        (figure("Error over step size.", &steps.svg()?))
        (figure("Error over computing time.", &times.svg()?))
    })
}

fn oil(description: &Description) -> Result<Markup, LabError> {
    let n = &description.numbers;
    let beta = |p: f64| {
        let z: f64 = (p - n.transition) / n.transition_width;
        0.5 * (n.bulk_modulus_max + n.bulk_modulus_min)
            + 0.5 * (n.bulk_modulus_max - n.bulk_modulus_min) * Real::tanh(z)
    };
    let points = (0..=300).map(|i| f64::from(i) * 0.4).map(|p| (p, beta(p * 1e5) * 1e-6));
    let series = Series::list([("beta", points.collect())]);
    let svg = Figure { x: "pressure [bar]", y: "bulk modulus [MPa]", series, logarithmic: false };
    Ok(html! { h2 { "Oil" } (figure("Figure 8: effective bulk modulus.", &svg.svg()?)) })
}

fn parameters(description: &Description) -> Markup {
    html! {
        h2 { "Parameters" }
        p.soft {
            "Choices: friction " (description.choices.friction.name()) ", pump delivery "
            (description.choices.delivery.name()) ", relief valves " (description.choices.relief.name())
            ", " (description.segment_shares.len()) " segments."
        }
        div.wide { table {
            thead { tr { th { "key" } th { "value" } th { "unit" } th { "provenance" } th { "source" } } }
            tbody { @for (key, value, origin) in description.entries() { tr {
                td { code { (key.path()) } } td { (value) } td.text { (key.unit) }
                td.text { (origin.provenance) } td.text { (origin.source) }
            } } }
        } }
    }
}

fn optional(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".into(), |v| format!("{v:.digits$}"))
}

fn percent(ratio: f64) -> String {
    format!("{:+.1} %", ratio * 100.0)
}
