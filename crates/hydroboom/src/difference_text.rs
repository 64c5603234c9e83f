//! What a difference of log and model looks like, and what would move it, in words.

use crate::output::three_digits;
use hydroboom_identify::{Aspect, Difference, Judgement, LIMITS, Remedy, Ringing};

/// An offset, a drift or a scale is told where it alone explains this share of a difference's power.
const TOLD: f64 = 0.3;
/// A model whose pressures go further is no machine's: it has a piston at its stop, and no relief valve \[Pa\].
const HIGHEST: f64 = 1e8;

/// What looks wrong with a signal, and what would move it; `complaints` are those of all signals.
pub fn said(d: &Difference, complaints: &[Judgement], remedies: &[Remedy]) -> String {
    let (unit, size) = d.signal.shown();
    let symbol = d.signal.symbol();
    if let Some(far) = d.unresolved {
        return format!(
            "{symbol}: not judged. The log's samples are {:.0} ms apart, and the model oscillates at {:.2} Hz: what happens between samples is not known.",
            far.interval * 1e3,
            far.frequency
        );
    }
    let own: Vec<&Judgement> = complaints.iter().filter(|j| j.signal == d.signal).collect();
    let is_noise = d.coloured < 0.1 || (d.rms < 1.2 * d.noise && d.coloured < 0.3);
    // an offset is no noise, whatever is left about it
    if own.is_empty() && is_noise && d.bias.abs() < d.noise.max(0.1 * size) {
        return format!("{symbol}: nothing is left but what its sensor scatters.");
    }
    let mut parts = [explained(d), of_time(d), rings(d)].concat();
    if parts.is_empty() {
        parts.push(format!("differs by {} {unit} RMS", three_digits(d.rms / size)));
    }
    let mut said = format!("{symbol}: {}.", parts.join("; "));
    if own.is_empty() {
        return said + " That is within its limit.";
    }
    for complaint in own {
        let list: Vec<String> = remedies
            .iter()
            .filter(|r| r.aspect == complaint.aspect)
            .map(|r| {
                let change = r.change * 100.0;
                let sign = if change > 0.0 { "+" } else { "" };
                let then = match r.aspect {
                    Aspect::Frequency => format!("{:.2} Hz", r.found.1),
                    Aspect::Damping => format!("{:.3}", r.found.1),
                    _ => format!("{} {unit}", three_digits(r.found.1 / size)),
                };
                let end = if r.at_limit { ", the end of what is tried" } else { "" };
                format!("{} {sign}{} %{end} ({then})", r.path, three_digits(change))
            })
            .collect();
        let what = match complaint.aspect {
            Aspect::Frequency => "the model's frequency",
            Aspect::Damping => "the model's damping ratio",
            _ => "it",
        };
        said += &match (list.is_empty(), is_of_time(d, complaint)) {
            (true, true) => String::new(),
            (true, false) if what == "it" => {
                " No key that was tried takes a twentieth of it away on its own.".into()
            }
            (true, false) => {
                format!(" No key that was tried brings {what} a twentieth nearer on its own.")
            }
            (false, _) => {
                let then = if what == "it" { "RMS then" } else { "what it is then" };
                format!(
                    " What would move {what} most, each on its own ({then}): {}.",
                    list.join(", ")
                )
            }
        };
    }
    said
}

/// Whether a complaint is one that a late sensor or a clock explains: it asks for no key.
fn is_of_time(d: &Difference, complaint: &Judgement) -> bool {
    matches!(complaint.aspect, Aspect::Position | Aspect::Pressures)
        && (d.is_late() || d.is_of_clock())
}

/// What is to be said of a model that leaves what it holds for; `highest` is its highest pressure \[Pa\].
pub fn beyond(highest: f64) -> Option<String> {
    (highest > HIGHEST).then(|| {
        format!(
            "the model comes to {:.0} bar, where its piston is at its stop and no relief valve opens: it is driven further than its cylinder goes",
            highest * 1e-5
        )
    })
}

/// Offset, drift and scale.
fn explained(d: &Difference) -> Vec<String> {
    let (unit, size) = d.signal.shown();
    let Some(found) = d.parts else { return Vec::new() };
    let signed = |value: f64| {
        let sign = if value > 0.0 { "+" } else { "" };
        format!("{sign}{}", three_digits(value))
    };
    let mut parts = Vec::new();
    let mut tell = |share: f64, what: String| {
        if share > TOLD {
            parts.push(format!("{what}, {:.0} % of the difference's power", share * 100.0));
        }
    };
    let offset = signed(found.offset.value / size);
    tell(found.offset.share, format!("reads {offset} {unit} off the model"));
    let drift = signed(found.drift.value / size);
    tell(found.drift.share, format!("drifts from the model by {drift} {unit} in a second"));
    let way = if found.scale.value > 0.0 { "more" } else { "less" };
    let scale = three_digits(found.scale.value.abs() * 100.0);
    let scale = match found.scale.value < -1.0 {
        true => "moves against the model".into(),
        false => format!("moves {scale} % {way} than the model"),
    };
    tell(found.scale.share, scale);
    parts
}

/// A delay, or a clock that drifts.
fn of_time(d: &Difference) -> Vec<String> {
    if let (true, Some([first, second]), Some(drift)) = (d.is_of_clock(), d.delay_halves, d.drift) {
        return vec![format!(
            "comes {:.1} ms late in the first half and {:.1} ms in the second, which is most of it: a clock that drifts \
             (drift_ppm = {:.0} in the mapping)",
            first * 1e3,
            second * 1e3,
            drift * 1e6
        )];
    }
    match d.delay.filter(|_| d.is_late()) {
        Some(delay) => {
            let way = if delay > 0.0 { "late" } else { "early" };
            vec![format!(
                "comes {:.1} ms {way}, which is most of it: a delay of sensor or fieldbus (delay_ms in the mapping)",
                delay.abs() * 1e3
            )]
        }
        None => Vec::new(),
    }
}

/// How log and model ring.
fn rings(d: &Difference) -> Vec<String> {
    // an oscillation whose fading cannot be told has no frequency that could be relied on either
    let told = |r: Option<Ringing>| r.filter(|r| r.damping.is_some());
    let (Some(log), Some(model)) = (told(d.ringing), told(d.model_ringing)) else {
        return Vec::new();
    };
    let mut parts = Vec::new();
    let share = log.frequency / model.frequency - 1.0;
    // so far off it need not be the same mode
    if !(-0.5..1.0).contains(&share) {
        parts.push(format!(
            "rings at {:.2} Hz, the model at {:.2} Hz: a load, a lever or a stiffness that is far from the crane file's, or something else that vibrates",
            log.frequency, model.frequency
        ));
    } else if share.abs() > LIMITS.frequency {
        let how = if share > 0.0 { "stiffer, or lighter," } else { "softer, or heavier," };
        parts.push(format!(
            "rings at {:.2} Hz, the model at {:.2} Hz: the crane is {how} than the model",
            log.frequency, model.frequency
        ));
    }
    if let (Some(a), Some(b)) = (log.damping, model.damping)
        && share.abs() < 0.5
        && (a - b).abs() > (LIMITS.damping * a.abs()).max(LIMITS.least_damping)
    {
        let how = if a > b { "more" } else { "less" };
        parts.push(format!("is damped {how} ({a:.3}) than the model ({b:.3})"));
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_identify::{Explained, Part, complaints};
    use hydroboom_measurement::Signal;

    fn part(value: f64, share: f64) -> Part {
        Part { value, share }
    }

    /// A load pressure that is 5 bar off, which is beyond its limit.
    fn difference() -> Difference {
        Difference {
            signal: Signal::PressureA,
            count: 1000,
            rms: 5e5,
            peak: 8e5,
            bias: 0.0,
            correlation: None,
            fit: None,
            delay: None,
            rms_without_delay: None,
            delay_halves: None,
            drift: None,
            rms_without_drift: None,
            ringing: None,
            model_ringing: None,
            coloured: 1.0,
            parts: None,
            span: 10e5,
            largest: 80e5,
            noise: 1e3,
            unresolved: None,
        }
    }

    fn rings(frequency: f64) -> Option<Ringing> {
        Some(Ringing { frequency, damping: Some(0.05), amplitude: 1e5 })
    }

    fn read(d: &Difference, remedies: &[Remedy]) -> String {
        said(d, &complaints(&vec![d.clone()]), remedies)
    }

    #[test]
    fn a_log_that_moves_less_is_told_so_and_one_that_moves_against_too() {
        let of = |scale: f64| {
            let (scale, none) = (part(scale, 0.9), part(0.0, 0.0));
            let parts = Explained { offset: none, drift: none, scale, delay: none };
            read(&Difference { parts: Some(parts), ..difference() }, &[])
        };
        assert!(of(-0.498).contains("moves 49.8 % less than the model"), "{}", of(-0.498));
        assert!(of(0.05).contains("moves 5.00 % more than the model"), "{}", of(0.05));
        assert!(of(-1.4).contains("moves against the model"), "{}", of(-1.4));
    }

    /// White about an offset: the offset is no scatter.
    #[test]
    fn an_offset_is_not_taken_for_noise() {
        let white = Difference { coloured: 0.02, noise: 1e3, rms: 1.1e3, ..difference() };
        assert!(read(&white, &[]).contains("nothing is left but"), "{}", read(&white, &[]));
        let off = Difference { bias: 5e5, rms: 5e5, ..white };
        assert!(!read(&off, &[]).contains("nothing is left but"), "{}", read(&off, &[]));
        assert!(read(&off, &[]).contains("5.00 bar"), "{}", read(&off, &[]));
    }

    /// A payload at 9 m rings at 0.82 Hz where the model rings at 2.25 Hz: that need be nothing else that vibrates.
    #[test]
    fn a_frequency_that_is_far_off_may_be_the_load_s() {
        let far = Difference { ringing: rings(0.82), model_ringing: rings(2.25), ..difference() };
        let text = read(&far, &[]);
        assert!(text.contains("a load, a lever or a stiffness that is far from"), "{text}");
        assert!(!text.contains("heavier"), "{text}");
        let near = Difference { ringing: rings(2.1), ..far };
        assert!(read(&near, &[]).contains("softer, or heavier, than"), "{}", read(&near, &[]));
    }

    #[test]
    fn hints_stand_beside_what_they_are_of() {
        let off = Difference { ringing: rings(2.0), model_ringing: rings(2.25), ..difference() };
        let remedy = |aspect, found, at_limit| Remedy {
            aspect,
            path: "payload.mass_kg".into(),
            change: -0.0003,
            at_limit,
            found,
        };
        let list = [
            remedy(Aspect::Pressures, (5e5, 1e5), true),
            remedy(Aspect::Frequency, (2.25, 2.0), false),
        ];
        let text = read(&off, &list);
        assert!(text.contains("What would move it most, each on its own (RMS then): payload.mass_kg -0.0300 %, the end of what is tried (1.00 bar)"), "{text}");
        assert!(text.contains("What would move the model's frequency most, each on its own (what it is then): payload.mass_kg -0.0300 % (2.00 Hz)"), "{text}");
        let within = Difference { rms: 1e5, ..difference() };
        assert!(read(&within, &list).ends_with("That is within its limit."));
        let late = Difference { delay: Some(0.02), rms_without_delay: Some(0.4e5), ..difference() };
        let text = read(&late, &[]);
        assert!(text.contains("comes 20.0 ms late") && !text.contains("key"), "{text}");
        assert!(beyond(3.5e8).unwrap().contains("3500 bar") && beyond(3e7).is_none());
    }
}
