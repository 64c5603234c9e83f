//! Gains of the benchmark controller: `hydroboom design --benchmark`, and the gains used in comparisons.

use crate::crane_file::CraneFile;
use crate::machine_choice::MachineChoice;
use crate::output;
use crate::paths::OutputFile;
use hydroboom_description::{Description, PLACEHOLDER, UIA_SINGLE_BOOM};
use hydroboom_design::DesignError;
use hydroboom_design::benchmark_design::{
    BenchmarkDesign, Gains, WorstMargins, benchmark_design, payload_range, worst_margins,
};
use hydroboom_lab::crane_file_text::{FoundValue, write_value};
use miette::{IntoDiagnostic, Result, miette};
use serde_json::json;
use toml_edit::DocumentMut;

/// Parses a range of payloads, `LOW:HIGH` \[kg\] from 0 to 1e6.
pub fn payloads(text: &str) -> Result<[f64; 2], String> {
    let read = || {
        let (low, high) = text.split_once(':')?;
        let pair = [low.trim().parse().ok()?, high.trim().parse().ok()?];
        (0.0 <= pair[0] && pair[0] <= pair[1] && pair[1] <= 1e6).then_some(pair)
    };
    read().ok_or_else(|| format!("payloads are LOW:HIGH in kg, such as 0:370, not {text}"))
}

/// Designs gains for a crane and a range of payloads \[kg\], by default the crane file's. Prints them with the present
/// ones, and writes them into a copy of its file.
///
/// # Errors
///
/// If there are overrides and a file to write, the design does not converge, or margins cannot be computed.
pub fn run(
    crane: &CraneFile,
    description: &Description,
    payload: Option<[f64; 2]>,
    out: Option<&OutputFile>,
    as_json: bool,
) -> Result<()> {
    if crane.is_overridden() && out.is_some() {
        return Err(miette!(
            help = "write the values into the crane file first",
            "--set is not written to --crane-out"
        ));
    }
    let payload = payload.unwrap_or_else(|| payload_range(description));
    let own = worst_margins(description, payload).into_diagnostic()?;
    let design = benchmark_design(description, payload).into_diagnostic()?;
    if let Some(path) = out {
        let mut document: DocumentMut = crane.text()?.parse().into_diagnostic()?;
        write_gains(&mut document, &design);
        output::file(path, document.to_string().as_bytes());
        if let Some(remark) = remark_on_wider_range(payload_range(description), payload) {
            output::warn(&remark);
        }
    }
    if as_json {
        return output::json(&json!({
            "crane": description.name, "design": design,
            "own": { "gains": Gains::of(description), "worst": own }, "written": out,
        }));
    }
    let mut text = format!(
        "{}: gains of the benchmark controller for payloads of {:.0} to {:.0} kg over the stroke\n{}",
        description.name,
        payload[0],
        payload[1],
        output::table(
            &[
                "",
                "K_p [1/s]",
                "K_i [1/s2]",
                "k_f [m3/(s Pa)]",
                "tau [s]",
                "M_s",
                "PM [deg]",
                "GM",
                "least at"
            ],
            &[
                row("crane file", &Gains::of(description), &own),
                row("designed", &design.gains, &design.worst)
            ],
        )
    );
    text += &format!(
        "\nThe largest K_i with a sensitivity of M_s <= {} and K_i <= K_p^2 (Astrom, Panagopoulos, Hagglund 1998). \
         It holds for all payloads of the range and positions from 5 to 95 % of the stroke.\n\
         M_s, PM and GM are each the worst of these; at the payload and position named M_s is largest, or the \
         loop unstable.",
        design.sensitivity_peak
    );
    if let Some(path) = out {
        text += &output::named("crane file", path);
    }
    output::text(&text)
}

/// Remark if the crane file's range of payloads \[kg\], which is not written, is wider than that of the design.
fn remark_on_wider_range([low, high]: [f64; 2], design: [f64; 2]) -> Option<String> {
    let is_wider = low < design[0] || high > design[1];
    let [low, high, least, most] = [low, high, design[0], design[1]].map(output::short);
    is_wider.then(|| {
        format!(
            "the gains are for payloads of {least} to {most} kg, and `range` of payload.mass_kg is still {low} to \
             {high} kg: narrow it too, or `motion --family` and `trials` go on with loads for which the gains are not \
             tuned"
        )
    })
}

/// Row of gains with their worst margins; dashes for an unstable loop and for infinite margins.
fn row(name: &str, gains: &Gains, worst: &WorstMargins) -> Vec<String> {
    let mut row = vec![name.to_string()];
    row.extend(gains.keys().map(|(_, value)| output::short(value)));
    row.extend(match worst.stable {
        true => [
            format!("{:.2}", worst.sensitivity_peak),
            if worst.phase_deg.is_finite() {
                format!("{:.0}", worst.phase_deg)
            } else {
                "-".into()
            },
            if worst.gain.is_finite() { format!("{:.1}", worst.gain) } else { "-".into() },
        ],
        false => ["unstable".into(), "-".into(), "-".into()],
    });
    row.push(format!("{:.0} kg, {:.0} mm", worst.payload_kg, worst.stroke_mm));
    row
}

/// Writes designed gains with their source into a crane file.
fn write_gains(document: &mut DocumentMut, design: &BenchmarkDesign) {
    for (path, value) in design.gains.keys() {
        let source = source(design);
        write_value(document, FoundValue { path, value, provenance: "designed", source });
    }
}

/// Text of the paper's crane file with gains designed for it. Its own gains are unstable with an empty
/// hook.
///
/// # Errors
///
/// If the design does not converge.
pub fn tuned_text(crane: &Description) -> Result<String> {
    let design = benchmark_design(crane, payload_range(crane)).into_diagnostic()?;
    let mut document: DocumentMut = UIA_SINGLE_BOOM.parse().into_diagnostic()?;
    write_gains(&mut document, &design);
    Ok(document.to_string())
}

/// Whether the gains are the unedited placeholders of a new file.
fn are_placeholders(model: &Description, gains: &Gains) -> bool {
    let is_placeholder = |path: &str| {
        let mut entries = model.entries();
        entries.any(|(key, _, origin)| key.path() == path && origin.provenance == PLACEHOLDER)
    };
    gains.keys().iter().all(|(path, _)| is_placeholder(path))
}

/// Whether a comparison may replace the gains by designed ones: placeholders, and the paper's gains.
fn are_replaceable(model: &Description) -> Result<bool> {
    let gains = Gains::of(model);
    Ok(are_placeholders(model, &gains) || gains == Gains::of(&Description::uia_single_boom()?))
}

/// Reason why the benchmark's gains are not tuned for payloads \[kg\], if any. They are placeholders, or a
/// crane other than the paper's has too small margins with them.
fn why_untuned(model: &Description, payload: [f64; 2]) -> Result<Option<String>> {
    if are_placeholders(model, &Gains::of(model)) {
        return Ok(Some("they are placeholders".into()));
    }
    let paper = Description::uia_single_boom()?;
    match paper.differences(model).iter().any(|difference| difference.is_of_machine()) {
        true => too_little_margin(model, payload),
        false => Ok(None),
    }
}

/// Description of the benchmark's margins with payloads \[kg\], if they are too small for tuned gains: a sensitivity
/// peak M_s above `benchmark_design.untuned_peak`, or an unstable loop.
///
/// # Errors
///
/// If the margins cannot be computed.
pub fn too_little_margin(model: &Description, payload: [f64; 2]) -> Result<Option<String>> {
    let own = worst_margins(model, payload).into_diagnostic()?;
    let peak = model.numbers.benchmark_untuned_peak;
    Ok(match own.stable {
        true if own.sensitivity_peak <= peak => None,
        true => Some(format!(
            "M_s = {:.1}, gain margin {:.1}, phase margin {:.0} deg, and gains count as tuned up to M_s = {peak}",
            own.sensitivity_peak, own.gain, own.phase_deg
        )),
        false => Some("the loop is UNSTABLE".into()),
    })
}

/// Remark if the crane file's gains are used with payloads \[kg\] although a comparison would replace them.
///
/// # Errors
///
/// If the margins cannot be computed.
pub fn remark_on_untuned_gains(model: &Description, payload: [f64; 2]) -> Result<Option<String>> {
    let reason = why_untuned(model, payload)?;
    Ok(reason.map(|reason| {
        format!(
            "the benchmark runs with the crane file's gains, which are not tuned for payloads of {:.0} to {:.0} kg ({reason}). \
             `hydroboom design --benchmark` designs some; `motion` uses those instead of placeholders and of the \
             paper's gains",
            payload[0], payload[1]
        )
    }))
}

/// Source of designed gains, for the comment in a crane file.
fn source(design: &BenchmarkDesign) -> String {
    format!(
        "hydroboom design --benchmark: largest K_i with M_s <= {} for payloads of {:.0} to {:.0} kg over the stroke",
        design.sensitivity_peak, design.payload_kg[0], design.payload_kg[1]
    )
}

/// Remark on gains that are not tuned for a reason, where the design of others failed.
fn remark_on_failed_design(reason: &str, error: &DesignError) -> String {
    format!("the benchmark is not tuned ({reason}), and cannot be: {error}")
}

/// Machine choice with the benchmark's gains for a comparison with payloads \[kg\], and a remark on a
/// replacement. Designed gains replace placeholders for all payloads. They also replace the paper's gains
/// on another crane with too small margins.
///
/// # Errors
///
/// If the margins cannot be computed. A design that does not converge is a remark.
pub fn for_comparison(
    choice: MachineChoice,
    payload: [f64; 2],
) -> Result<(MachineChoice, Option<String>)> {
    let model = &choice.model;
    let Some(reason) = why_untuned(model, payload)? else { return Ok((choice, None)) };
    if !are_replaceable(model)? {
        let remark = format!(
            "the benchmark's gains of the crane file are not tuned for payloads of {:.0} to {:.0} kg: {reason}; `hydroboom design --benchmark` finds some",
            payload[0], payload[1]
        );
        return Ok((choice, Some(remark)));
    }
    match benchmark_design(model, payload) {
        Ok(design) => {
            let g = design.gains;
            let remark = format!(
                "the file's gains are not tuned for this comparison ({reason}): the benchmark has K_p = {} 1/s, K_i = \
                 {} 1/s2, k_f = {} m3/(s Pa), tau = {} s, by `hydroboom design --benchmark --payload-kg {:.0}:{:.0}`; \
                 --gains-as-given keeps the file's",
                output::short(g.proportional_per_s),
                output::short(g.integral_per_s2),
                output::short(g.pressure_feedback_m3_per_spa),
                output::short(g.high_pass_s),
                payload[0],
                payload[1]
            );
            Ok((choice.with_benchmark_gains(&g), Some(remark)))
        }
        Err(error) => Ok((choice, Some(remark_on_failed_design(&reason, &error)))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_gain_design_is_reported_with_both_reasons() {
        let error = DesignError::NotConverged { exchanges: 12, low_kg: 0.0, high_kg: 370.0 };
        let remark = remark_on_failed_design("they are placeholders", &error);
        assert!(remark.contains("not tuned (they are placeholders)"), "{remark}");
        assert!(remark.contains("0 to 370 kg has not converged"), "{remark}");
        // `design --benchmark` fails with the same sentence
        let report = Err::<(), _>(error).into_diagnostic().unwrap_err();
        assert!(report.to_string().contains("has not converged: after 12 worst cases"), "{report}");
    }

    #[test]
    fn a_payload_range_wider_than_that_of_the_design_is_reported() {
        let remark = remark_on_wider_range([0.0, 600.0], [200.0, 600.0]).unwrap();
        assert!(remark.contains("payloads of 200 to 600 kg, and `range`"), "{remark}");
        assert!(remark.contains("is still 0 to 600 kg: narrow it too"), "{remark}");
        assert_eq!(remark_on_wider_range([200.0, 600.0], [200.0, 600.0]), None);
        assert_eq!(remark_on_wider_range([200.0, 600.0], [0.0, 700.0]), None);
    }

    #[test]
    fn an_infinite_margin_is_shown_as_a_dash() {
        let gains = Gains::of(&Description::uia_single_boom().unwrap());
        let worst = WorstMargins {
            stable: true,
            sensitivity_peak: 1.1,
            phase_deg: f64::INFINITY,
            gain: f64::INFINITY,
            payload_kg: 307.0,
            stroke_mm: 250.0,
        };
        assert_eq!(row("designed", &gains, &worst)[5..8], ["1.10", "-", "-"]);
    }
}
