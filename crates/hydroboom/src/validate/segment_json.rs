//! Comparison of a segment of a log with the model as JSON.

use super::segment::{Finding, SegmentComparison};
use crate::verdict_text;
use hydroboom_identify::{Aspect, Fault, Moved, Remedy, Ringing, SignalFault};
use hydroboom_measurement::Signal;
use serde_json::{Value, json};

/// Verdicts, differences, and changes of keys.
pub fn segment_in_json(segment: &SegmentComparison) -> Value {
    let SegmentComparison { experiment, verdict, corrected_verdict, faults, .. } = segment;
    json!({
        "begin_s": experiment.begin, "duration_s": experiment.duration(),
        "verdict": verdict_text::in_json(verdict),
        "verdict_mended": corrected_verdict.as_deref().map(verdict_text::in_json),
        "late_inputs": faults.iter().filter_map(delayed_input_in_json).collect::<Vec<_>>(),
        "signals": segment.findings.iter().map(finding_in_json).collect::<Vec<_>>(),
        "remedies": segment.remedies.iter().map(remedy_in_json).collect::<Vec<_>>(),
        "advice": segment.advice,
    })
}

/// Difference of a signal in its unit of display, with the fault of its sensor.
fn finding_in_json(finding: &Finding) -> Value {
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
        "judged": d.unresolved.is_none(), "said": finding.text,
        "sensor_error": finding.sensor.as_ref().map(|error| json!({
            "offset": match error.fault { Fault::Offset(off) => Some(off / size), _ => None },
            "scale": match error.fault { Fault::Scale(factor) => Some(factor), _ => None },
            "rms_left": error.left.map(|left| left / size), "against": error.against.map(Signal::key),
            "explains": error.explains.iter().map(|s| s.key()).collect::<Vec<_>>(),
        })),
    })
}

/// Delayed input; none for another fault.
fn delayed_input_in_json(of: &SignalFault) -> Option<Value> {
    let Fault::Delay(late) = of.fault else { return None };
    let explains: Vec<&str> = of.explains.iter().map(|s| s.key()).collect();
    Some(json!({ "signal": of.signal.key(), "delay_ms": late * 1e3, "explains": explains }))
}

/// Change of a key, with its effects on the judged quantities.
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
