//! `hydroboom validate`

use crate::crane_file::CraneFile;
use crate::difference_text::{self, Context};
use crate::log_mapping::{LogMapping, LogWindow, suspicions};
use crate::output;
use crate::paths::{InputFile, OutputFile};
use crate::verdict_text;
use clap::Args;
use hydroboom_description::Description;
use hydroboom_description::schema::CircuitChoice;
use hydroboom_identify::{
    Aspect, COMPARED, Difference, Experiment, Fault, Isolated, Judgement, LIMITS, Moved,
    Prediction, Remedy, Ringing, SignalFault, complaints, isolate, remedies, verdict,
};
use hydroboom_lab::LabError;
use hydroboom_lab::paper;
use hydroboom_lab::report::{Axes, Figure, Page, Series, document, figure};
use hydroboom_measurement::{Signal, Signals, Suspicion};
use maud::html;
use miette::{IntoDiagnostic, Result};
use serde_json::{Value, json};

/// Drive the model by a log's motor speed and valve; report the differences of position and pressures, faulty signals,
/// and keys that would reduce the differences.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom validate --log lift.csv\n  hydroboom validate --crane my-crane.toml \
    --log lift.csv --mapping lift.toml --report lift.html\n  hydroboom log inspect lift.csv shows what a log has"
)]
pub struct Validate {
    #[command(flatten)]
    crane: CraneFile,
    /// The log: CSV, TwinCAT Scope, Simulink, MAT, MDF, MCAP.
    #[arg(long, value_name = "FILE")]
    log: InputFile,
    #[command(flatten)]
    mapping: LogMapping,
    #[command(flatten)]
    window: LogWindow,
    /// Report to write (HTML).
    #[arg(long, value_name = "FILE")]
    report: Option<OutputFile>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Difference of one signal with its description.
struct Finding {
    difference: Difference,
    sensor: Option<SignalFault>,
    said: String,
}

/// Comparison of a segment of a log with the model.
struct Part {
    experiment: Experiment,
    prediction: Prediction,
    findings: Vec<Finding>,
    /// Faults of signals, with a text for those of inputs.
    faults: Vec<SignalFault>,
    inputs: Vec<String>,
    /// Verdict after correction of the isolated faults, if there are any.
    mended: Option<Vec<Judgement>>,
    /// Proposed changes of keys, and their text.
    remedies: Vec<Remedy>,
    advice: Option<String>,
    verdict: Vec<Judgement>,
}

impl Validate {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read_any()?;
        let (log, mapping) = self.mapping.read(&self.log, &crane)?;
        let suspicions = suspicions(&log, &mapping, &crane);
        let signals = Signals::of(&log, &mapping).into_diagnostic()?;
        let each = Experiment::each(&crane, &log, &signals, self.window.of()).into_diagnostic()?;
        let parts = each.into_iter().map(|experiment| part(&crane, experiment));
        let parts = parts.collect::<Result<Vec<Part>>>()?;
        let mut notes = log.remarks.clone();
        notes.extend(parts.iter().flat_map(|part| part.experiment.remarks.clone()));
        notes.extend(suspicions.iter().map(|Suspicion { text, .. }| format!("suspicious: {text}")));
        if let Some(path) = &self.report {
            let page = page(&self, &crane, &parts, &notes);
            output::page(path, &page.into_diagnostic()?, None);
        }
        if self.json {
            return output::json(&self.in_json(&crane, &parts, &notes));
        }
        let mut said = String::new();
        for part in &parts {
            let rows: Vec<Vec<String>> = part.findings.iter().map(row).collect();
            said += &format!(
                "{}\n\n{}: {:.1} s beside \"{}\", log less model\n{}\n",
                verdict_text::sentence(&part.verdict),
                part.experiment.name,
                part.experiment.duration(),
                crane.name,
                output::table(&HEADER, &rows)
            );
            if rows.iter().any(|row| row[RINGS].contains('(')) {
                said += &format!("{SPECTRUM}\n");
            }
            for finding in &part.findings {
                said += &format!("\n{}", finding.said);
            }
            for input in &part.inputs {
                said += &format!("\n{input}");
            }
            if let Some(mended) = &part.mended {
                said += &format!("\n{AFTER_CORRECTION} {}", verdict_text::sentence(mended));
            }
            if let Some(advice) = &part.advice {
                said += &format!("\n{advice}");
            }
            said += if parts.len() > 1 { "\n" } else { "" };
        }
        for note in &notes {
            said += &format!("\nnote: {note}");
        }
        if let Some(path) = &self.report {
            said += &output::named("report", path);
        }
        output::text(&said)
    }

    /// JSON. For a log of several segments: the signals of the longest one, then each segment.
    fn in_json(&self, crane: &Description, parts: &[Part], notes: &[String]) -> Value {
        let of = |part: &Part| {
            json!({
                "begin_s": part.experiment.begin, "duration_s": part.experiment.duration(),
                "verdict": verdict_text::in_json(&part.verdict),
                "verdict_mended": part.mended.as_deref().map(verdict_text::in_json),
                "late_inputs": part.faults.iter().filter_map(late_input_in_json).collect::<Vec<_>>(),
                "signals": part.findings.iter().map(in_json).collect::<Vec<_>>(),
                "remedies": part.remedies.iter().map(remedy_in_json).collect::<Vec<_>>(), "advice": part.advice,
            })
        };
        let duration = |part: &&Part| part.experiment.duration();
        let longest = parts.iter().max_by(|a, b| duration(a).total_cmp(&duration(b)));
        let mut value = longest.map_or_else(|| json!({}), of);
        value["log"] = json!(self.log);
        value["crane"] = json!(crane.name);
        value["notes"] = json!(notes);
        if parts.len() > 1 {
            value["segments"] = parts.iter().map(of).collect();
        }
        value
    }
}

/// Compares a segment of a log with the model.
fn part(crane: &Description, mut experiment: Experiment) -> Result<Part> {
    let Isolated { prediction, found, faults, corrected, left } =
        isolate(crane, &experiment).into_diagnostic()?;
    let (_, would) = remedies(crane, &corrected).into_diagnostic()?;
    let pressures = prediction.iter().flat_map(|row| row.iter().skip(1).copied());
    experiment.remarks.extend(difference_text::beyond(pressures.fold(0.0, f64::max)));
    experiment.remarks.extend(charge(crane, &experiment));
    let all = complaints(&found);
    let context = Context { found: &found, complaints: &all, faults: &faults, left: &left };
    let findings = found.iter().map(|d| Finding {
        difference: d.clone(),
        sensor: faults.iter().find(|fault| fault.signal == d.signal).cloned(),
        said: difference_text::said(d, &context),
    });
    let findings = findings.collect();
    let advice =
        difference_text::advice(&complaints(&left), &would, difference_text::asks_for_keys(&left));
    let is_mended = faults.iter().any(SignalFault::is_isolable);
    Ok(Part {
        experiment,
        findings,
        inputs: faults.iter().filter_map(difference_text::of_input).collect(),
        mended: is_mended.then(|| verdict(&left)),
        remedies: would,
        advice,
        verdict: verdict(&found),
        prediction,
        faults,
    })
}

/// Text before the verdict on the corrected log, in which keys are searched.
const AFTER_CORRECTION: &str = "After this correction:";

/// Remark on an initial accumulator pressure that differs from the crane file's, unless another low-side
/// pressure explains it.
fn charge(crane: &Description, experiment: &Experiment) -> Option<String> {
    let others = [Signal::PressureB, Signal::PressurePumpB];
    let begun = experiment.begun(Signal::PressureAccumulator)?;
    let off = begun - crane.numbers.working_pressure;
    let is_alone = others.iter().all(|signal| !experiment.is_measured(*signal));
    (is_alone && off.abs() > LIMITS.least_pressure).then(|| {
        format!(
            "p_acc begins {:+.2} bar off accumulator.working_bar. Without p_B or p_PB an offset of its sensor cannot be distinguished from another \
             precharge or filling. The model begins with the measured pressure",
            off * 1e-5
        )
    })
}

const HEADER: [&str; 10] = [
    "signal",
    "RMS",
    "peak",
    "bias",
    "fit [%]",
    "correlation",
    "delay [ms]",
    "rings [Hz], model",
    "damping, model",
    "coloured",
];

/// Index of the frequencies among the columns.
const RINGS: usize = 7;
/// Note on frequencies in brackets.
const SPECTRUM: &str = "(...): this frequency is not judged. It is a peak of the spectrum without a fitted \
    decaying oscillation, or the oscillation decays within fewer than four periods.";

fn row(finding: &Finding) -> Vec<String> {
    let d = &finding.difference;
    let (unit, size) = d.signal.shown();
    let frequency = |r: Option<Ringing>| {
        let text = output::optional(r.map(|r| r.frequency), 3);
        if r.is_some_and(|r| !r.has_reliable_frequency()) { format!("({text})") } else { text }
    };
    let damping = |r: Option<Ringing>| output::optional(r.and_then(|r| r.damping), 3);
    vec![
        format!("{} [{unit}]", d.signal.symbol()),
        format!("{:.3}", d.rms / size),
        format!("{:.3}", d.peak / size),
        format!("{:.3}", d.bias / size),
        output::optional(d.fit, 1),
        output::optional(d.correlation, 4),
        output::optional(d.delay.map(|s| s * 1e3), 1),
        format!("{}, {}", frequency(d.ringing), frequency(d.model_ringing)),
        format!("{}, {}", damping(d.ringing), damping(d.model_ringing)),
        format!("{:.2}{}", d.coloured, if d.is_white { ", white" } else { "" }),
    ]
}

fn in_json(finding: &Finding) -> Value {
    let d = &finding.difference;
    let (unit, size) = d.signal.shown();
    let rings = |r: Option<Ringing>| {
        r.map(|r| json!({ "frequency_hz": r.frequency, "damping": r.damping, "frequency_judged": r.has_reliable_frequency() }))
    };
    json!({
        "signal": d.signal.key(), "unit": unit, "samples": d.count, "rms": d.rms / size,
        "peak": d.peak / size, "bias": d.bias / size, "fit_percent": d.fit,
        "correlation": d.correlation, "delay_ms": d.delay.map(|s| s * 1e3),
        "delay_halves_ms": d.delay_halves.map(|h| h.map(|s| s * 1e3)),
        "drift_ppm": d.drift.map(|drift| drift * 1e6), "noise": d.noise / size,
        "parts": d.parts.map(|p| json!({
            "offset": { "value": p.offset.value / size, "share": p.offset.share },
            "drift_per_s": { "value": p.drift.value / size, "share": p.drift.share },
            "scale_percent": { "value": p.scale.value * 100.0, "share": p.scale.share },
            "delay_ms": { "value": p.delay.value * 1e3, "share": p.delay.share },
        })),
        "ringing": rings(d.ringing), "model_ringing": rings(d.model_ringing), "coloured": d.coloured, "white": d.is_white,
        "judged": d.unresolved.is_none(), "said": finding.said,
        "sensor_error": finding.sensor.as_ref().map(|error| json!({
            "offset": match error.fault { Fault::Offset(off) => Some(off / size), _ => None },
            "scale": match error.fault { Fault::Scale(factor) => Some(factor), _ => None },
            "rms_left": error.left.map(|left| left / size), "against": error.against.map(Signal::key),
            "explains": error.explains.iter().map(|s| s.key()).collect::<Vec<_>>(),
        })),
    })
}

fn late_input_in_json(of: &SignalFault) -> Option<Value> {
    let Fault::Delay(late) = of.fault else { return None };
    let explains: Vec<&str> = of.explains.iter().map(|s| s.key()).collect();
    Some(json!({ "signal": of.signal.key(), "delay_ms": late * 1e3, "explains": explains }))
}

fn remedy_in_json(r: &Remedy) -> Value {
    // frequencies and damping ratios have no unit to convert
    let in_unit = |moved: &Moved| match moved.aspect {
        Aspect::Position | Aspect::Pressures => moved.signal.shown().1,
        Aspect::Frequency | Aspect::Damping => 1.0,
    };
    json!({
        "key": r.path, "change_percent": r.change * 100.0, "at_limit": r.at_limit,
        "misfit_before": r.misfit.0, "misfit_after": r.misfit.1,
        "moved": r.moved.iter().map(|m| json!({
            "of": verdict_text::name(m.aspect), "signal": m.signal.key(),
            "before": m.found.0 / in_unit(m), "after": m.found.1 / in_unit(m),
        })).collect::<Vec<_>>(),
    })
}

/// Number of the paper's figure of a signal.
fn paper_figure(signal: Signal) -> u32 {
    const FIGURES: [Signal; 6] = [
        Signal::Stroke,
        Signal::PressureA,
        Signal::PressurePumpA,
        Signal::PressurePumpB,
        Signal::PressureB,
        Signal::PressureAccumulator,
    ];
    18 + FIGURES.iter().position(|s| *s == signal).unwrap_or(0) as u32
}

/// Name of the segment of an experiment, if the log has several.
fn of_segment(parts: &[Part], experiment: &Experiment) -> String {
    match parts.len() {
        0 | 1 => String::new(),
        _ => format!(" (from {:.3} s)", experiment.begin),
    }
}

fn page(
    asked: &Validate,
    crane: &Description,
    parts: &[Part],
    notes: &[String],
) -> Result<Page, LabError> {
    let mut figures = Vec::new();
    let findings = || parts.iter().flat_map(|part| part.findings.iter().map(move |f| (part, f)));
    for (Part { experiment, prediction, .. }, finding) in findings() {
        let signal = finding.difference.signal;
        let k = COMPARED.iter().position(|s| *s == signal).unwrap_or(0);
        let (unit, size) = signal.shown();
        let samples = || experiment.samples.iter().zip(prediction);
        let log: Vec<(f64, f64)> =
            samples().filter_map(|(s, _)| Some((s.time, s.values[k]? / size))).collect();
        let model: Vec<(f64, f64)> = samples().map(|(s, p)| (s.time, p[k] / size)).collect();
        let less: Vec<(f64, f64)> =
            samples().filter_map(|(s, p)| Some((s.time, (s.values[k]? - p[k]) / size))).collect();
        let x = "time since the experiment began [s]";
        let y = format!("{} [{unit}]", signal.symbol());
        let series = Series::list([("log", log), ("model", model)]);
        let both = Figure { x, y: &y, series, axes: Axes::Linear }.drawn()?;
        let y = format!("log less model [{unit}]");
        let series = vec![Series { name: "difference", points: less, colour: 2 }];
        let difference = Figure { x, y: &y, series, axes: Axes::Linear }.drawn()?;
        figures.push((signal, of_segment(parts, experiment), both, difference));
    }
    // the paper's values are shown for its own crane only
    let is_published = paper::is_its_crane(crane);
    let paper_row = |signal: Signal| paper::TABLE_6.iter().find(|row| row.0 == signal.symbol());
    let driven_by = match crane.choices.circuit {
        CircuitChoice::SelfContained => {
            "the log's motor speed and valve. It starts at rest at the log's piston position with the log's pressures, except for the one \
                 that carries the load"
        }
        CircuitChoice::ValveControlled => {
            "the log's valve command, supply and tank pressure. It starts at rest at the log's piston position with the log's pressures, \
                  as far as friction carries the remaining load"
        }
    };
    let body = html! {
        @for part in parts { p { b { (verdict_text::sentence(&part.verdict)) } (of_segment(parts, &part.experiment)) } }
        p.soft {
            "The log " code { (asked.log.display()) } " beside \"" (crane.name) "\""
            @for Part { experiment, .. } in parts { ", from " (format!("{:.3}", experiment.begin)) " s on for " (format!("{:.1}", experiment.duration())) " s" } ". The model is driven by " (driven_by) ". All differences are log less model."
        }
        @for note in notes { p.soft { "Note: " (note) } }
        h2 { "Findings" }
        @for (part, finding) in findings() { p { (finding.said) (of_segment(parts, &part.experiment)) } }
        @for part in parts { @for input in &part.inputs { p { (input) (of_segment(parts, &part.experiment)) } } }
        @for part in parts { @if let Some(mended) = &part.mended { p { (AFTER_CORRECTION) " " (verdict_text::sentence(mended)) (of_segment(parts, &part.experiment)) } } }
        @for part in parts { @if let Some(advice) = &part.advice { p { (advice) (of_segment(parts, &part.experiment)) } } }
        p.soft {
            "Candidate keys follow from exact derivatives and are tested by running the model with that key changed: "
            "a hint where to look, no result. " code { "hydroboom show" } " lists where each value comes from."
        }
        h2 { "In numbers" @if is_published { ", beside Table 6" } }
        div.wide { table {
            thead { tr { @for name in HEADER { th { (name) } } @if is_published { th { "paper's RMS" } th { "paper's peak" } } } }
            tbody { @for (part, finding) in findings() { tr {
                @for (k, cell) in row(finding).into_iter().enumerate() {
                    td { (cell) @if k == 0 { (of_segment(parts, &part.experiment)) } }
                }
                @if is_published { @match paper_row(finding.difference.signal) {
                    Some((_, _, peak, rms)) => { td { (format!("{rms:.3}")) } td { (format!("{peak:.3}")) } }
                    None => { td { "-" } td { "-" } }
                } }
            } } }
        } }
        p.soft {
            "Fit: 100 % less the share of the log's own standard deviation that the model misses. Coloured: share \
             of the difference's autocorrelations, up to a "
            "second, outside the 95 % band of white noise; 0.05 for white noise."
            @if findings().any(|(_, finding)| row(finding)[RINGS].contains('(')) { " " (SPECTRUM) }
            @if is_published { " The paper's numbers are of its own crane at 120 mm/s." }
        }
        @for (signal, segment, both, difference) in &figures {
            @let paper = if is_published { format!(", as the paper's figure {}", paper_figure(*signal)) } else { String::new() };
            (figure(&format!("{}{segment}{paper}: log and model, over the time since the log's first sample that is compared.", signal.symbol()), both))
            (figure(&format!("{}{segment}, log less model. For a correct model this is sensor noise about zero.", signal.symbol()), difference))
        }
    };
    Ok(document("Hydroboom: log and model", &body))
}
