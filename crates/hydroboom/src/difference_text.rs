//! What a difference of log and model looks like, and what would move it, in words.

use hydroboom_identify::{Difference, Remedy, Ringing};

/// An offset, a drift or a scale is told where it alone explains this share of a difference's power.
const TOLD: f64 = 0.3;

/// What looks wrong with a signal, and what would move it.
pub fn said(d: &Difference, remedies: &[Remedy]) -> String {
    let (unit, size) = d.signal.shown();
    let mut parts: Vec<String> = Vec::new();
    if d.coloured < 0.1 || (d.rms < 1.2 * d.noise && d.coloured < 0.3) {
        return format!("{}: nothing is left but what its sensor scatters.", d.signal.symbol());
    }
    if let Some(found) = d.parts {
        if found.offset.share > TOLD {
            parts.push(format!(
                "reads {:+.2} {unit} off the model, {:.0} % of the difference's power",
                found.offset.value / size,
                found.offset.share * 100.0
            ));
        }
        if found.drift.share > TOLD {
            parts.push(format!(
                "drifts from the model by {:+.3} {unit} in a second, {:.0} % of the difference's power",
                found.drift.value / size,
                found.drift.share * 100.0
            ));
        }
        if found.scale.share > TOLD {
            parts.push(format!(
                "moves {:+.1} % more than the model, {:.0} % of the difference's power",
                found.scale.value * 100.0,
                found.scale.share * 100.0
            ));
        }
    }
    // more is explained by a delay that grows than by any that stays
    let drifts = d.rms_without_drift.zip(d.rms_without_delay);
    let drifts = drifts.is_some_and(|(drift, delay)| drift < 0.5 * d.rms.min(delay));
    if let (true, Some([first, second]), Some(drift)) = (drifts, d.delay_halves, d.drift) {
        parts.push(format!(
            "comes {:.1} ms late in the first half and {:.1} ms in the second, which is most of it: a clock that drifts \
             (drift_ppm = {:.0} in the mapping)",
            first * 1e3,
            second * 1e3,
            drift * 1e6
        ));
    }
    // a piston that follows late, out and back alike, is a late sensor; one that lags is the crane's
    if let (false, Some(delay), Some(without)) = (drifts, d.delay, d.rms_without_delay)
        && delay.abs() > 3e-3
        && without < 0.5 * d.rms
    {
        let way = if delay > 0.0 { "late" } else { "early" };
        parts.push(format!(
            "comes {:.1} ms {way}, which is most of it: a delay of sensor or fieldbus (delay_ms in the mapping)",
            delay.abs() * 1e3
        ));
    }
    // an oscillation whose fading cannot be told has no frequency that could be relied on either
    let rings = |r: Option<Ringing>| r.filter(|r| r.damping.is_some());
    if let (Some(log), Some(model)) = (rings(d.ringing), rings(d.model_ringing)) {
        let share = log.frequency / model.frequency - 1.0;
        // so far off it is not the same mode
        if !(-0.5..1.0).contains(&share) {
            parts.push(format!(
                "rings at {:.2} Hz, where the model's boom rings at {:.2} Hz: something else that vibrates, or a reading that ripples",
                log.frequency, model.frequency
            ));
        } else if share.abs() > 0.03 {
            let how = if share > 0.0 { "stiffer, or lighter," } else { "softer, or heavier," };
            parts.push(format!(
                "rings at {:.2} Hz, the model at {:.2} Hz: the crane is {how} than the model",
                log.frequency, model.frequency
            ));
        }
        if let (Some(a), Some(b)) = (log.damping, model.damping)
            && share.abs() < 0.5
            && (a - b).abs() > 0.3 * b.abs().max(0.01)
        {
            let how = if a > b { "more" } else { "less" };
            parts.push(format!("is damped {how} ({a:.3}) than the model ({b:.3})"));
        }
    }
    if parts.is_empty() {
        parts.push(format!("differs by {:.2} {unit} RMS", d.rms / size));
    }
    let mut said = format!("{}: {}.", d.signal.symbol(), parts.join("; "));
    let list: Vec<String> = remedies
        .iter()
        .map(|r| format!("{} {:+.1} % ({:.2} {unit})", r.path, r.change * 100.0, r.rms.1 / size))
        .collect();
    said += &match list.is_empty() {
        true => " No single key would take a twentieth of it away.".to_string(),
        false => {
            format!(" What would move it most, each on its own (RMS then): {}.", list.join(", "))
        }
    };
    said
}
