//! Page of the study: all experiments of the paper.

mod eigenfrequency;
mod energy;
mod tracking_errors;
mod work_precision;

use super::document::{Page, document};
use super::drawing;
use super::drawing_data::figure;
use super::figure::{Axes, Figure, Series};
use super::tracking::{self, over_time};
use super::validation;
use crate::LabError;
use crate::claims::{REMARK, REMARK_ON_PAPER};
use crate::closed_loop::metrics::{MOTOR_ENERGY, TrackingError};
use crate::closed_loop::sample::Sample;
use crate::motion_test::{Row, Run};
use crate::study::{NOMINAL, OFF, Study, VIRTUAL};
use eigenfrequency::eigenfrequencies;
use energy::energy;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_math::Real;
use maud::{Markup, html};
use tracking_errors::tracking;
use work_precision::precision;

/// Results of the study as one self-contained HTML page.
///
/// # Errors
///
/// [`LabError::Figure`] if a figure cannot be drawn; [`LabError::Plant`] if the crane has no state of rest at an end
/// of its motion.
pub fn page(description: &Description, study: &Study) -> Result<Page, LabError> {
    let body = html! {
                p.soft {
                    "Everything below is simulated. "
                    @if !study.is_papers_crane { "The paper's figures are of its own crane, and are left out beside this one. " }
                    @if study.is_papers_crane {
                        "\"Paper\" is Hagen et al., Actuators 2025, 14(2):80; "
                        "its tracking errors were measured on a real crane, of which no log is public. "
                    }
                    "\"Nominal\" is a plant equal to the model, which flatters every strategy that uses the "
                    "model; \"off-model\" is a plant that differs from it in a few parameters, by guesses"
                    @if study.virtual_eigenfrequency_hz.is_some() {
                        "; the \"virtual crane\" stands in for a real one, with what the model leaves out"
                    }
                    ". Neither is a measurement."
                }
                (figure("The crane to scale, at both ends of the motion. Dots are the joints between segments.",
                    &drawing::crane(description)?))
                (claims(study))
                (eigenfrequencies(study)?)
                (differences(study))
                (validation(study)?)
                (tracking(study)?)
                (damping(study))
                (test_4(study))
                (pressures(study)?)
                (energy(study)?)
                (precision(study)?)
                (oil(description)?)
                (parameters(description))
    };
    Ok(document(&format!("Hydroboom study: {}", study.crane), &body))
}

/// Main claims of the paper.
fn claims(study: &Study) -> Markup {
    let beside_paper = study.is_papers_crane;
    let beside_virtual = study.virtual_eigenfrequency_hz.is_some();
    html! {
        h2 { @if beside_paper { "The paper's headline claims" } @else { "What the paper's headline claims are of, on this crane" } }
        p.soft {
            "Each figure is computed from the runs below. Nominal and off-model plant have ideal sensors: measured and true is the same there. "
            (REMARK) @if beside_paper { " " (REMARK_ON_PAPER) }
        }
        div.wide { table {
            thead { tr {
                th { "compared" }
                @if beside_paper { th { "paper states" } th { "paper's tables" } }
                th { "nominal" } th { "off-model" }
                @if beside_virtual { th { "virtual crane, measured" } th { "virtual crane, true" } }
                @if beside_paper { th { "worse than the paper on" } }
            } }
            tbody { @for claim in &study.claims { tr {
                @let on = |plant| claim.on(plant);
                @let one = |value: Option<f64>| optional(value, claim.digits());
                td.text { (claim.compares) " [" (claim.unit) "]" }
                @if beside_paper { td { (one(claim.paper_stated)) } td { (one(claim.paper_tables)) } }
                td { (one(on(NOMINAL).map(|f| f.measured))) } td { (one(on(OFF).map(|f| f.measured))) }
                @if beside_virtual {
                    td { (one(on(VIRTUAL).map(|f| f.measured))) } td { (one(on(VIRTUAL).map(|f| f.truth))) }
                }
                @if beside_paper { td.text { (claim.worse_on().join(", ")) } }
            } } }
        } }
        @if let Some(percent) = study.eigenfrequency_accuracy_percent {
            p { "Against the eigenfrequencies that the paper measured, our model's mean accuracy is " (format!("{percent:.1}")) " %." }
        }
    }
}

fn differences(study: &Study) -> Markup {
    let three = |v: f64| format!("{v:.3}");
    let some = |v: Option<f64>| optional(v, 3);
    let (beside_paper, beside_virtual) =
        (study.is_papers_crane, study.virtual_eigenfrequency_hz.is_some());
    html! {
        h2 { @if beside_paper { "Table 6: p" } @else { "P" } "lant less model at the fast speed" }
        p.soft {
            @if beside_paper { "Paper: the real crane less its simulation. " }
            "Here: " @if beside_virtual { "virtual crane, and " } "off-model plant, less the "
            "model, all under velocity feedforward, as measured. "
            @if beside_paper && beside_virtual { "The embedded virtual crane was calibrated to the paper's RMS values and not to its peaks. " }
            "The off-model plant: " (study.off_model.join(", ")) "."
        }
        div.wide { table {
            thead { tr {
                th { "signal" } @if beside_paper { th { "RMS, paper" } }
                @if beside_virtual { th { "RMS, virtual crane" } } th { "RMS, off-model" }
                @if beside_paper { th { "peak, paper" } }
                @if beside_virtual { th { "peak, virtual crane" } } th { "peak, off-model" }
            } }
            tbody { @for row in &study.differences { tr {
                td { (row.signal) " [" (row.unit) "]" }
                @if beside_paper { td { (some(row.paper_rms)) } } @if beside_virtual { td { (some(row.virtual_rms)) } }
                td { (three(row.off_model_rms)) }
                @if beside_paper { td { (some(row.paper_peak)) } } @if beside_virtual { td { (some(row.virtual_peak)) } }
                td { (three(row.off_model_peak)) }
            } } }
        } }
        @if let Some(hz) = study.virtual_pressure_oscillation_hz {
            p {
                "The virtual crane's p_A oscillates at " strong { (format!("{hz:.3} Hz")) }
                @if let Some(paper) = study.paper_measured_pressure_oscillation_hz {
                    " (measured on the paper's crane: " (format!("{paper:.3}")) " Hz)"
                }
                "."
            }
        }
    }
}

fn validation(study: &Study) -> Result<Markup, LabError> {
    let Some(simulated) = &study.alongside else { return Ok(html! {}) };
    let same = |(plant, run): &&(String, Run)| {
        plant == VIRTUAL
            && run.strategy == Strategy::VelocityFeedforward
            && run.course == simulated.course
    };
    let Some((_, run)) = study.runs.iter().find(same) else { return Ok(html! {}) };
    let panels = validation::panels(simulated, run, "virtual crane")?;
    Ok(html! {
        h2 { "Figures 18 to 23: the published model beside the virtual crane" }
        (panels)
    })
}

fn damping(study: &Study) -> Markup {
    html! {
        h2 { "Double damping in the published closed loop of simulation feedforward" }
        p {
            "It adds the simulation's speed to an unchanged PI and pressure feedback. The simulation has its "
            "own pressure feedback already, and so the load pressure that a motion needs is damped twice. "
            "With plant G" sub { "x" } ", G" sub { "p" } ", PI C, pressure feedback F and L = C G" sub { "x" }
            " + F G" sub { "p" } ", and the model equal to the plant, the benchmark's error E becomes "
            "(E + F G" sub { "p" } ")/(1 + L). If the plant's pressure feedback acts on the difference from the "
            "simulation, p - p" sub { "sim" } ", it becomes E (1 + F G" sub { "p" } ")/(1 + L) instead."
        }
        div.wide { table {
            thead { tr {
                th { "plant" } th { "course" } th { "law" } @for head in TrackingError::HEADS { th { (head) } }
            } }
            tbody { @for row in &study.double_damping { @for (law, found) in row.laws() { tr {
                td { (row.plant) } td { (row.course) } td.text { (law) }
                @match found {
                    Ok(error) => @for mm in error.cells() { td { (format!("{mm:.3}")) } },
                    Err(word) => @for _ in TrackingError::HEADS { td.unstable { (word) } },
                }
            } } } }
        } }
    }
}

/// Own test in addition to the paper's.
fn test_4(study: &Study) -> Markup {
    let of = |row: &Row, strategy| {
        let same =
            |r: &&Row| r.plant == row.plant && r.course == row.course && r.strategy == strategy;
        study.motion.iter().find(same).cloned()
    };
    let ours = study.motion.iter().filter(|row| row.strategy == Strategy::ScheduledLqr);
    let pairs: Vec<(&Row, Row)> =
        ours.filter_map(|row| Some((row, of(row, Strategy::BenchmarkClosedLoop)?))).collect();
    html! {
        h2 { "Test 4: scheduled LQR" }
        p {
            "Ours, not the paper's. An extended Kalman filter estimates position, velocity and load pressure of the load, friction, unknown force and flow, payload "
            "and the oil's transition pressure; a linear-quadratic regulator, scheduled over these, feeds back \
             their difference from the inverse dynamics of "
            "the reference, which is smoothed over a preview of 0.4 s and limited by a governor to what the motor \
             can follow. The published strategies have "
            "no preview of the reference. The figures are with those of tests 1 to 3."
        }
        div.wide { table {
            thead { tr {
                th { "plant" } th { "course" } th { "strategy" } @for head in TrackingError::HEADS { th { (head) } }
                th { "RMS true below the benchmark's [%]" } th { "residual vibration of the tip [mm]" } th { "motor energy [kJ]" }
            } }
            tbody { @for (ours, benchmark) in &pairs { @for row in [*ours, benchmark] { tr {
                td { (row.plant) } td { (row.course) } td { (row.marked_name()) }
                @for mm in row.error.cells() { (tracking::here(row, mm)) }
                td {
                    @if row.strategy == benchmark.strategy || !benchmark.stable || !row.stable { "-" } @else {
                        (format!("{:.0}", 100.0 * (1.0 - row.error.rms_true_mm / benchmark.error.rms_true_mm)))
                    }
                }
                @for value in [row.effort.residual_vibration_mm, row.effort.energy_kj] {
                    td { (optional(value.is_finite().then_some(value), 3)) }
                }
            } } } }
        } }
        p.soft { (MOTOR_ENERGY) }
    }
}

fn pressures(study: &Study) -> Result<Markup, LabError> {
    let fast = study.motion.iter().map(|r| r.speed_mm_s).fold(0.0, f64::max);
    let Some(run) = study.run(NOMINAL, Strategy::VelocityFeedforward, fast) else {
        return Ok(html! {});
    };
    let bar = |pressure: fn(&Sample) -> f64| over_time(run, |s| pressure(s) * 1e-5);
    let high = Series::list([
        ("p_PA", bar(|s| s.signals.pressure_pump_a)),
        ("p_A", bar(|s| s.signals.pressure_a)),
    ]);
    let low = Series::list([
        ("p_B", bar(|s| s.signals.pressure_b)),
        ("p_PB", bar(|s| s.signals.pressure_pump_b)),
        ("p_acc", bar(|s| s.signals.pressure_accumulator)),
    ]);
    let high = Figure { x: "time [s]", y: "pressure [bar]", series: high, axes: Axes::Linear };
    let low = Figure { x: "time [s]", y: "pressure [bar]", series: low, axes: Axes::Linear };
    Ok(html! {
        h2 { "Pressures" }
        (figure("High-pressure side under velocity feedforward at the fast speed, nominal plant.", &high.drawn()?))
        (figure("Low-pressure side, likewise: rod side, pump port and accumulator.", &low.drawn()?))
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
    let svg = Figure { x: "pressure [bar]", y: "bulk modulus [MPa]", series, axes: Axes::Linear };
    Ok(
        html! { h2 { "Oil" } (figure("Figure 8: effective bulk modulus: soft where the oil is at low pressure and holds air.", &svg.drawn()?)) },
    )
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
            tbody { @for (key, value, origin) in description.entries().filter(|(.., origin)| origin.is_stated()) { tr {
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
